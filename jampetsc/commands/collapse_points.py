"""The data of a collapse, points of an observable against φ and rate or size from results; its outcome in words."""

import math

import numpy as np

from jampetsc.analysis.collapse_fit import degrees_above, parameter_ranges
from jampetsc.analysis.correlated_series import Average, mean_of_averages, mean_of_runs
from jampetsc.analysis.jammed_samples import runs_of, share_of
from jampetsc.analysis.scaling_collapse import PARAMETERS, Points, words_of
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.options.values import input_name

FORMATS = {False: ("jampetsc-flow",), True: ("jampetsc-jam", "jampetsc-shear")}  # by rate, by size
COMMON_ATTRIBUTES = (
    "dimension", "model", "mass", "sizes", "potential", "exponent", "stiffness", "protocol", "cooling_rate",
    "separated", "units", "k", "tau1",
)  # fmt: skip
LENGTH = {2: np.sqrt, 3: np.cbrt}  # L = N^(1/D) of D dimensions
PHI_DECIMALS = 6  # of packing fractions that count as equal
# of χ²; below, the form or the errors are wrong, above 1 − this the errors are too large
MIN_PROBABILITY = 0.01


def read_points(results, observable: str, finite_size: bool) -> Points:
    """The observable of all files, averaged over files of one φ and rate or size.

    Raises InputError for files of several kinds, or of a kind that is not scaled so, and for a file given twice.
    """
    groups, seen = {}, {}
    for result in results:
        _check(result, results[0], finite_size)
        for phi, scale, origin, values in _rows(result, observable, finite_size):
            key = round(phi, PHI_DECIMALS), scale
            if (*key, origin) in seen:
                raise InputError(
                    f"{result.path}: phi = {phi:g} from {origin} is in {seen[*key, origin]} as well. Give each run "
                    "once."
                )
            seen[*key, origin] = result.path.name
            groups.setdefault((*key, int(result.attributes["particle_count"])), []).append(values)
    rows = [
        (*key, *_mean(runs, observable), len(runs))
        for key, runs in sorted(groups.items())
        if observable == "jammed" or np.any(np.concatenate([np.atleast_1d(run) for run in runs]))
    ]  # where nothing is jammed a stress is 0 without an error, which cannot be weighted
    phi, scale, size, value, error, count = np.array(rows, float).reshape(-1, 6).T
    if not finite_size and len(set(size)) > 1:
        raise InputError(
            f"{results[0].path}: N = {min(size):g}, other files up to {max(size):g}. Give files of one N to scale "
            "with rates."
        )
    return Points(phi, scale, value, error, size, count)


def _setting(result, name):
    return recorded_dimension(result.attributes) if name == "dimension" else result.attributes.get(name)


def _check(result, first, finite_size):
    """Raise InputError unless a file is of a kind that is scaled, and has the same settings as the first."""
    if getattr(result, "format", "") not in FORMATS[finite_size]:
        supported = (
            "jam and shear files"
            if finite_size
            else f"flow files, or add {named('finite_size')} for jam and shear files"
        )
        raise InputError(f"{input_name(result)}: not supported. Give {supported}.")
    for name in COMMON_ATTRIBUTES:
        value, expected = (_setting(item, name) for item in (result, first))
        if value != expected and not (name == "protocol" and result.format != first.format):
            raise InputError(
                f"{result.path}: {name} {value}, but {first.path.name} has {expected}. Give files of one kind."
            )


def _rows(result, observable, finite_size):
    """[(φ, scale, origin, values)] of a file; values: (mean, error, samples), or the series of one run.

    The stress of a state that is not jammed, which the minimiser leaves near zero, is set to 0.
    """
    a = result.attributes
    n = int(a["particle_count"])
    scale = 1.0 / float(LENGTH[recorded_dimension(a)](n)) if finite_size else float(a["rate"])
    origin = f"seed {a['seed']}" if "seed" in a else str(a.get("packing", "a packing"))
    if finite_size:
        if observable not in result:
            raise InputError(f"{result.path}: no dataset {observable}. Choose pressure or jammed.")
        values, has_seeds = result[observable].astype(float), "seed" in result
        values[result["jammed"] == 0] = 0.0
        finite_runs = ((*run, rows[np.isfinite(values[rows])]) for *run, rows in runs_of(result))
        return [
            (phi, scale, f"seed {seed:g}" if has_seeds else origin, values[rows])
            for phi, seed, rows in finite_runs
            if len(rows)
        ]
    if observable == "jammed":
        raise InputError(
            f"{result.path}: {named('observable')} jammed without {named('finite_size')}. Add {named('finite_size')}."
        )
    mean = tuple(a[f"{observable}_{part}"] for part in ("mean", "error", "samples"))
    return [(float(a["phi"]), scale, origin, mean)]


def _mean(runs, observable):
    """(value, error) of what `_rows` gives for one φ and scale."""
    if isinstance(runs[0], tuple):
        return mean_of_runs(*np.array(runs, float).T)
    if observable == "jammed":
        share = share_of(runs)
        return share.value, share.error
    return mean_of_averages([Average.of(run) for run in runs])


def text_of(parameters, estimates, finite_size) -> str:
    """phi_J = 0.8433 ± 0.0002, znu > 2.7, … of {parameter: value}, and {parameter: Estimate} of those fitted."""
    symbols = words_of(finite_size)
    names = [name for name in PARAMETERS if name in parameters]
    return ", ".join(
        f"{symbols[name]} {_with_error(parameters[name], estimates.get(name))}" for name in names
    )


def _with_error(value, estimate):
    if estimate is None:
        return f"= {value:.6g} fixed"
    if estimate.decided and estimate.uneven:
        return f"= {value:.5g} (2 sigma: {estimate.low:.5g} to {estimate.high:.5g})"
    if estimate.decided:
        return f"= {value:.5g} ± {estimate.error:.2g}"
    if math.isfinite(estimate.low):
        return f"> {estimate.low:.5g}"
    return f"< {estimate.high:.5g}" if math.isfinite(estimate.high) else "undecided"


def notes_of(points: Points, fit, estimates, finite_size) -> list[str]:
    """Warnings about the numbers of a fit."""
    symbols = words_of(finite_size)
    lowest, highest = points.phi.min(), points.phi.max()
    degrees = degrees_above(points, fit.form)
    notes = []
    if fit.probability < MIN_PROBABILITY:
        notes.append(
            "the form does not describe the data within their errors: cut the data, or fit corrections"
        )
    if fit.common:
        variable = "size" if finite_size else "rate"
        notes.append(
            f"points of one {variable} scatter about their mean by {math.sqrt(1.0 - fit.common):.0%} of their "
            f"errors: they are too large, or common to a {variable}; {fit.common:.0%} of their squares are fitted as "
            "common"
        )
    if fit.probability > 1.0 - MIN_PROBABILITY:
        notes.append("chi2 is far too small: the errors of the data are too large, and so are these")
    if "phi_J" in estimates and not lowest < fit.parameters["phi_J"] < highest:
        notes.append(f"phi_J = {fit.parameters['phi_J']:.5g} is outside the data, {lowest:g} to {highest:g}")
    for name, estimate in estimates.items():
        symbol = symbols[name]
        if not estimate.decided:
            low, high = parameter_ranges(points)[name]
            notes.append(
                f"the data do not determine {symbol}: its 2 sigma interval reaches an end of its range, {low:.5g} "
                f"to {high:.5g}"
            )
        elif estimate.uneven:
            notes.append(
                f"{symbol} has uneven errors: use its 2 sigma interval, {estimate.low:.5g} to {estimate.high:.5g}"
            )
        if estimate.left_to_degree:
            notes.append(
                f"{symbol} changes by {estimate.shift:.2g} with the degree, which is in its error: try a higher one"
            )
    if not degrees:
        notes.append("too few points for a higher degree: what it would change is not in the errors")
    return notes

"""What the claims share: how one is entered, and estimates over the rows of a study."""

import math
from dataclasses import dataclass

import numpy as np

import jampetsc
from claims.verdicts import Estimate, Target
from jampetsc.analysis.averages import mean_of_runs
from jampetsc.analysis.statistics import log_median

WITHIN = 2.0  # standard errors
NEAR, LARGE = 1e-3, 1e3  # p up to which, pN² from which, a packing counts as near jamming and large
ENOUGH = 0.1  # error, as a share of the number claimed, above which agreement is no yes
POINT = ("n", "pressure", "law", "beta", "eta_f", "prestress")  # what packings of one point have in common
CLAIMS = []  # (figure, function)


GROUPS = (
    "Moduli at β = 1",
    "Moduli at β ≠ 1",
    "Floppiness",
    "Stokes drag",
    "Correlations",
    "Finite size",
    "Power-law damping",
    "Statics",
    "Steady flow",
    "Criticality",
)  # of the page, in its order


@dataclass(frozen=True)
class Row:
    """One claim of the works with our estimate, or a measured number beside them, of which only claims.csv tells.

    group   of the page; "" for a number without a verdict
    theirs  what the work says, in words or digits
    target  the same as numbers; None for a number without a verdict
    reason  one line; every number in it is computed
    size    N, packings or strain behind the number
    """

    claim: str
    theirs: str
    ours: Estimate
    target: Target | None = None
    group: str = ""
    reason: str = ""
    size: str = ""


def check(claim, value, error=None, note="", size="", theirs="") -> Row:
    """A measured number without a verdict: a cross-check of another estimator, or one of which the works say nothing."""
    return Row(claim, theirs, Estimate(float(value), math.nan if error is None else float(error)), None, "", note, size)


def claim(figure):
    """Decorator: the function yields a `Row` for each claim, from the table of a study."""

    def enter(function):
        CLAIMS.append((figure, function))
        return function

    return enter


def size_of(rows):
    """N with seeds and strain behind flows, or with the number of packings a point, in words."""
    n = ", ".join(f"{one:.0f}" for one in np.unique(rows["n"]))
    if "rate" in rows:
        strains, seeds = np.unique(rows["strain"]), len(np.unique(rows["seed"])) if "seed" in rows else 1
        strain = f"{strains[0]:g}" + (f" to {strains[-1]:g}" if len(strains) > 1 else "")
        return f"N = {n}, {seeds} seed{'s' if seeds > 1 else ''}, strain {strain}"
    counts = sorted({part.rows for _, part in rows.groups([name for name in POINT if name in rows])})
    few = f"{counts[0]}" if counts[0] == counts[-1] else f"{counts[0]} to {counts[-1]}"
    return f"N = {n}; {few} packings"


def near_jamming(rows, column):
    """(exponent of the median of a column in p, its error) at p ≤ 1e-3 and pN² > 1e3, weighted; None without two such.

    The error is the larger of that of the medians, from resampling the packings, and the scatter about a straight line.
    """
    found = []
    for key, part in rows.groups(["n", "pressure"]):
        if key["pressure"] <= NEAR and key["pressure"] * key["n"] ** 2 > LARGE and part.rows > 2:
            found.append((np.log(key["pressure"]), *log_median(part[column])))
    if len(found) < 2 or not np.isfinite(found).all():
        return None
    return line_through(*np.transpose(found))


def line_through(x, y, error):
    """(slope, its error) of a straight line, from the errors of the points or, if that is more, from their scatter."""
    coefficients, covariance = np.polyfit(x, y, 1, w=1 / error, cov="unscaled")
    scatter = np.sum(((y - np.polyval(coefficients, x)) / error) ** 2) / max(len(x) - 2, 1)
    return coefficients[0], np.sqrt(covariance[0, 0] * max(1.0, scatter))


def by_decades(rows, column):
    """Exponents of the median between neighbouring pressures, from the highest, in words: how a limit is approached."""
    groups = rows.groups(["pressure"])
    p = np.array([key["pressure"] for key, _ in groups])
    with np.errstate(invalid="ignore"):
        medians = np.log([np.median(part[column]) for _, part in groups])
    slopes = np.diff(medians) / np.diff(np.log(p))
    told = ", ".join(f"{slope:.2f}" for slope in slopes[::-1])
    return f"between pressures from {p[-1]:g} to {p[0]:g}: {told}"


def verdict(theirs, ours, error):
    """ "open" where the two agree, but only by an error of more than ENOUGH of theirs; else "": the errors decide."""
    return "open" if abs(ours - theirs) <= WITHIN * error and error > ENOUGH * abs(theirs) else ""


def rates_of(rows, name):
    """(rates, means, errors) of σ or p of flows, over seeds."""
    groups = rows.groups(["rate"])
    rates = np.array([key["rate"] for key, _ in groups])
    return rates, *np.array([mean_over_seeds(part, name) for _, part in groups]).T


def mean_over_seeds(rows, name):
    """(mean, error) of σ or p of flows of one kind."""
    samples = rows[f"{name}_samples"] if f"{name}_samples" in rows else np.full(rows.rows, np.inf)
    return mean_of_runs(rows[f"{name}_mean"], rows[f"{name}_error"], samples)


def slope_with_error(rates, values, errors):
    """Exponent through all points, weighted, and its error from theirs."""
    (slope, _), covariance = np.polyfit(np.log(rates), np.log(values), 1, w=values / errors, cov="unscaled")
    return slope, np.sqrt(covariance[0, 0])


def fitted(table, name, wanted, of):
    """Claims about the parameters that `jampetsc collapse` has put into a file of the study's folder."""
    path = table.path / f"{name}.h5"
    if not path.exists():  # a fit that did not converge, or that is under way
        return
    result = jampetsc.load(path).attributes
    for parameter, theirs, note in wanted:
        symbol = {"phi_J": "φ_J", "znu": "zν", "nu": "ν"}.get(parameter, parameter)
        what = f"{of}: {symbol} (χ²/dof {result['chi2'] / result['dof']:.2f})"
        error = result[f"{parameter}_error"]
        if np.isfinite(error):
            yield Row(what, theirs, result[parameter], error, note)
        else:
            yield Row(what, theirs, result[parameter], None, "the data do not tell it", decided="open")

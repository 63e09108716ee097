"""Yield stress by fits of flow curves."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.analysis.flow_laws import (
    CONSISTENCY,
    FLOW_INDEX,
    FORMS,
    PARAMETERS,
    YIELD_STRESS,
    fits_below,
)
from jampetsc.commands.collapse_points import MIN_PROBABILITY
from jampetsc.commands.flow_points import COLUMNS, FORMATS, read_groups
from jampetsc.commands.sources import WHERE, FitJob, write_derived
from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines
from jampetsc.options.parameters import FILES, ValueType, optional_parameter, parameter
from jampetsc.options.values import RESULT, load_source, split_list

SYMBOLS = {YIELD_STRESS: "sigma_y", CONSISTENCY: "A", FLOW_INDEX: "n"}
COMMON_ATTRIBUTES = (
    "dimension", "model", "mass", "sizes", "potential", "exponent", "stiffness", "units", "tau1",
)  # fmt: skip
NORMAL_95 = 1.96  # half of a 95 % interval over half of a 68 % one


@dataclass(frozen=True, eq=False)
class Scaling(FitJob):
    """Yield stress by a Herschel–Bulkley, Bingham or power-law fit of flow curves.

    Fit the mean shear stress of flows at several rates of one model, phi and N by

      sigma = sigma_y + A rate^n     (Herschel & Bulkley, Kolloid-Z. 39, 291 (1926))

    bingham has n = 1, power-law has sigma_y = 0. The fit is weighted least squares. 95 % intervals are from the
    scatter of seeds (jackknife, Student's t) where three or more have all rates, else from the profile of chi^2. The
    fit is repeated with the largest rates left out one by one: the law holds for slow flow alone. Quasistatic shear
    of the same particles, if given, is compared with the yield stress.
    """

    scalar: ClassVar = None
    EPILOG: ClassVar = """examples:
  jampetsc scaling r-*.h5 --form herschel-bulkley --out hb.h5
  jampetsc scaling r-*.h5 qs.h5 --form herschel-bulkley --cut 1e-2 --out compared.h5  # with quasistatic shear
  jampetsc scaling flows --form herschel-bulkley --by phi --out by-phi.h5                # the folder of a study
  jampetsc plot hb.h5 --out hb.png"""

    results: Sequence = parameter(
        help="flows at several rates, quasistatic shear to compare with, or the folder of a study",
        value_type=RESULT,
        place=FILES,
    )
    form: str = parameter("herschel-bulkley", "law to fit", choices=tuple(FORMS))
    by: tuple | None = optional_parameter(
        f"settings in which groups of flows differ, each with its own fit: {', '.join(COLUMNS)}",
        value_type=ValueType(split_list, ",".join, metavar="NAME,…"),
    )
    where: str | None = WHERE
    cut: float | None = optional_parameter(
        "largest rate in the fit (default: all)", above=0.0, high=1e300, metavar="R"
    )

    def check(self):
        """Refuse unknown and repeated names in `by`."""
        by = self.by or ()
        for name in by:
            if name not in COLUMNS:
                raise InputError(
                    f"{named('by')} {name}: not supported. Choose one or several of {', '.join(COLUMNS)}."
                )
        if len(set(by)) < len(by):
            raise InputError(f"{named('by')} {','.join(by)}: a name twice. Leave one out.")

    @property
    def formats(self):
        """See `FitJob`."""
        return FORMATS

    def work(self, to):
        start_time = time.perf_counter()
        results = [load_source(source) for source in self.sources]
        cut, by = math.inf if self.cut is None else self.cut, self.by or ()
        groups = [group.below(cut) for group in read_groups(results, by)]
        fits = [_fits_of(group, FORMS[self.form]) for group in groups]
        notes = [
            note for group, own in zip(groups, fits, strict=True) for note in _notes_of(group, own[0][1])
        ]
        first = groups[0].first
        facts = {
            **{name: first.attributes.get(name) for name in COMMON_ATTRIBUTES if name not in by},
            "form": self.form,
            "groups": "; ".join(group.label for group in groups),
        }
        write_derived(to, self.FORMAT, results, start_time, _arrays(groups, fits), notes, **facts)
        lines = [
            f"{to}: {self.form} fit of {sum(len(group.runs) for group in groups)} points, 95 % intervals"
        ]
        for group, own in zip(groups, fits, strict=True):
            lines += _group_lines(group, own)
        return "\n".join(lines + note_lines(notes))


def _fits_of(group, form):
    """`fits_below` of a group. Raises InputError, with its file and label, for too few rates."""
    with about(f"{group.first.path}{f', {group.label}' if group.label else ''}"):
        return fits_below(group.curve, form)


def _difference(group, fit):
    """(σ_y − σ, low, high) of the yield stress and quasistatic σ, 95 % interval; nan without one of them."""
    if group.quasistatic is None or YIELD_STRESS not in fit.intervals:
        return (math.nan,) * 3
    (stress, error), _ = group.quasistatic
    value, (low, high) = fit.law.yield_stress, fit.intervals[YIELD_STRESS]
    sides = (math.hypot(end - value, NORMAL_95 * error) for end in (low, high))
    down, up = sides
    return value - stress, value - stress - down, value - stress + up


def _arrays(groups, fits) -> dict:
    """{name: array} of the points, the groups, and the fits with largest rates left out."""
    import numpy as np

    best = [own[0][1] for own in fits]
    sizes = [len(group.runs) for group in groups]
    drift = [(place, cut, fit) for place, own in enumerate(fits) for cut, fit in own]
    no_shear = ((math.nan, math.nan),) * 2
    curves, sheared = [group.curve for group in groups], [group.quasistatic or no_shear for group in groups]
    residuals = [
        (curve.stress - fit.law.stress(curve.rate)) / curve.error
        for curve, fit in zip(curves, best, strict=True)
    ]
    pressure = np.concatenate([group.pressure for group in groups])
    arrays = {
        "group": np.repeat(np.arange(len(groups)), sizes),
        "rate": np.concatenate([curve.rate for curve in curves]),
        "shear_stress": np.concatenate([curve.stress for curve in curves]),
        "shear_stress_error": np.concatenate([curve.error for curve in curves]),
        "pressure": pressure[:, 0],
        "pressure_error": pressure[:, 1],
        "runs": np.concatenate([group.runs for group in groups]),
        "residual": np.concatenate(residuals),
        "groups/phi": np.array([float(group.first.attributes["phi"]) for group in groups]),
        "groups/N": np.array([int(group.first.attributes["particle_count"]) for group in groups]),
        "groups/seeds": np.array([group.seed_count for group in groups]),
        "groups/jackknifed": np.array([curve.is_jackknifed for curve in curves]),
        "groups/chi2": np.array([fit.chi2 for fit in best]),
        "groups/dof": np.array([fit.dof for fit in best]),
        "groups/probability": np.array([fit.probability for fit in best]),
        **{
            f"groups/quasistatic_{name}": np.array([own[part][column] for own in sheared])
            for part, quantity in enumerate(("shear_stress", "pressure"))
            for column, name in enumerate((quantity, f"{quantity}_error"))
        },
        **dict(
            zip(
                ("groups/difference", "groups/difference_low", "groups/difference_high"),
                np.array([_difference(group, fit) for group, fit in zip(groups, best, strict=True)]).T,
                strict=True,
            )
        ),
        "drift/group": np.array([place for place, _, _ in drift]),
        "drift/cut": np.array([cut for _, cut, _ in drift]),
        "drift/probability": np.array([fit.probability for _, _, fit in drift]),
    }
    for folder, some in (("groups", best), ("drift", [fit for _, _, fit in drift])):
        for name in PARAMETERS:
            ends = np.array([fit.intervals.get(name, (math.nan, math.nan)) for fit in some])
            arrays |= {
                f"{folder}/{name}": np.array([getattr(fit.law, name) for fit in some]),
                f"{folder}/{name}_low": ends[:, 0],
                f"{folder}/{name}_high": ends[:, 1],
            }
    return arrays


def _group_lines(group, fits) -> list[str]:
    """Lines of a summary about a group: its fit, quasistatic shear, and fits with largest rates left out."""
    (_, best), *further = fits
    way = f"jackknife over {group.seed_count} seeds" if group.curve.is_jackknifed else "profile of chi2"
    start = f"{group.label}: " if group.label else ""
    lines = [
        f"  {start}{_law_text(best)} ({way}), chi2/dof = {best.chi2 / best.dof:.3g}, probability "
        f"{best.probability:.2g}"
    ]
    if group.quasistatic is not None:
        (stress, error), _ = group.quasistatic
        difference, low, high = _difference(group, best)
        compared = (
            f"; sigma_y is {difference:+.2g} from it ({low:+.2g} to {high:+.2g})"
            if math.isfinite(difference)
            else ""
        )
        lines.append(f"    quasistatic sigma = {stress:.5g} ± {error:.2g}{compared}")
    lines += [f"    rates <= {cut:.4g}: {_law_text(fit)}" for cut, fit in further]
    return lines


def _law_text(fit) -> str:
    """sigma_y = 1.02e-3 (9.8e-4 to 1.06e-3), A = …, n = 1 fixed."""
    words = []
    for name in PARAMETERS:
        value = getattr(fit.law, name)
        if name not in fit.intervals:
            words.append(f"{SYMBOLS[name]} = {value:g} fixed")
            continue
        low, high = fit.intervals[name]
        words.append(f"{SYMBOLS[name]} = {value:.4g} ({low:.3g} to {high:.3g})")
    return ", ".join(words)


def _notes_of(group, fit) -> list[str]:
    """Warnings about the numbers of a fit, see `io.results`."""
    notes, whose = [], f" ({group.label})" if group.label else ""
    if YIELD_STRESS in fit.intervals and not fit.resolves_yield_stress:
        low = fit.intervals[YIELD_STRESS][0]
        notes.append(
            f"the yield stress is not resolved: its 95 % interval, from {low:.2g}, includes 0{whose}. Give lower "
            "rates, longer flows, or denser packings"
        )
    if fit.probability < MIN_PROBABILITY:
        notes.append(
            f"the law does not describe the stresses within their errors: probability {fit.probability:.1g}{whose}. "
            f"Leave out high rates by {named('cut')}"
        )
    if fit.probability > 1.0 - MIN_PROBABILITY:
        notes.append(f"chi2 is far too small: the errors of the flows are too large, and so are these{whose}")
    if not all(map(math.isfinite, fit.intervals.get(FLOW_INDEX, (0.0, 0.0)))):
        notes.append(f"n is not determined: its interval reaches an end of its range{whose}. Give more rates")
    if fit.law.consistency <= 0.0:
        notes.append(
            f"the stress does not rise with the rate: A = {fit.law.consistency:.3g}{whose}. Give more rates"
        )
    return notes

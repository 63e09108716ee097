"""Laws of flow curves near a yield stress, fitted to mean stresses: σ(γ̇) = σ_y + A γ̇^n.

Herschel & Bulkley, Kolloid-Z. 39, 291 (1926); Bingham's law has n = 1, the power law σ_y = 0. At fixed n the law is
linear in σ_y and A, so the search is over n alone and finds the least χ² of all.

95 % intervals: where one seed stands for all, from the profile of χ² (the least χ² at a fixed value is 3.84 above the
least of all; James, Statistical Methods in Experimental Physics, ch. 9). With several seeds at all rates, from the
scatter of fits without one seed (jackknife; Tukey, Ann. Math. Stat. 29, 614 (1958)) by Student's t: it also has what
rates of one seed have in common, as where each rate starts from the last state of another.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from jampetsc import interrupts
from jampetsc.analysis.statistics import chi2_probability, jackknife_error
from jampetsc.errors import InputError, named

INTERVAL_LEVEL = 0.95  # of the intervals of parameters
CHI2_RISE = 3.841459  # of the profile of χ² at the ends of such an interval
MIN_JACKKNIFE_SEEDS = 3  # two seeds have one degree of freedom: t = 12.7
MIN_FLOW_INDEX, MAX_FLOW_INDEX = 0.05, 4.0  # of a search; Bagnold's law has 2
_GRID, _ZOOM_COUNT, _ZOOMS = np.geomspace(MIN_FLOW_INDEX, MAX_FLOW_INDEX, 61), 21, 5
_MAX_STRESS_RATIO = 100.0  # of an end of σ_y to the largest stress
_MAX_LOG_CONSISTENCY = 100.0  # of an end of ln A to the best one
PARAMETERS = YIELD_STRESS, CONSISTENCY, FLOW_INDEX = "yield_stress", "consistency", "flow_index"


@dataclass(frozen=True)
class LawForm:
    """A form of the law: whether σ_y is fitted, else 0, and n, None where it is fitted."""

    name: str
    has_yield_stress: bool
    flow_index: float | None

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        fixed = {YIELD_STRESS: not self.has_yield_stress, FLOW_INDEX: self.flow_index is not None}
        return tuple(name for name in PARAMETERS if not fixed.get(name))

    @property
    def min_rates(self) -> int:
        """Fewest rates: one more than parameters."""
        return len(self.free) + 1


FORMS = {
    form.name: form
    for form in (
        LawForm("herschel-bulkley", True, None),
        LawForm("bingham", True, 1.0),
        LawForm("power-law", False, None),
    )
}


@dataclass(frozen=True)
class FlowLaw:
    """σ = σ_y + A γ̇^n; A is in units of stress times timeⁿ."""

    yield_stress: float  # σ_y
    consistency: float  # A
    flow_index: float  # n

    def stress(self, rate):
        """σ at rates (M,)."""
        return self.yield_stress + self.consistency * np.asarray(rate, float) ** self.flow_index


@dataclass(frozen=True, eq=False)
class FlowCurve:
    """Mean stresses at M rates.

    Weights of the fit are 1/`own_error`². The scatter of few seeds, which `error` has as well, would pull the fit
    towards rates where they agree by chance: 95 % intervals of four seeds then held 90 %.
    """

    rate: np.ndarray  # (M,)
    stress: np.ndarray  # (M,)
    error: np.ndarray  # (M,) halves of 68 % intervals
    own_error: np.ndarray  # (M,) the same from the series of the runs alone
    seeds: np.ndarray | None = None  # (S, M) stresses of each seed, where every seed has all rates

    def below(self, cut: float) -> "FlowCurve":
        """The rates up to `cut`."""
        kept = self.rate <= cut
        seeds = None if self.seeds is None else self.seeds[:, kept]
        return FlowCurve(self.rate[kept], self.stress[kept], self.error[kept], self.own_error[kept], seeds)

    def without_seeds(self) -> "list[FlowCurve]":
        """The curves without one of the seeds each, with the weights of all."""
        means = (self.seeds.sum(axis=0) - self.seeds) / (len(self.seeds) - 1)
        return [replace(self, stress=mean, seeds=None) for mean in means]

    @property
    def is_jackknifed(self) -> bool:
        """Whether intervals come from the scatter of seeds, else from the profile of χ²."""
        return self.seeds is not None and len(self.seeds) >= MIN_JACKKNIFE_SEEDS


@dataclass(frozen=True)
class FlowLawFit:
    """The law with the least χ², and the 95 % intervals {name: (low, high)} of its free parameters."""

    form: LawForm
    law: FlowLaw
    chi2: float
    dof: int
    intervals: dict

    @property
    def probability(self) -> float:
        """Probability of a χ² at least as large."""
        return chi2_probability(self.chi2, self.dof)

    @property
    def resolves_yield_stress(self) -> bool:
        """Whether the interval of σ_y is above 0."""
        return YIELD_STRESS in self.intervals and self.intervals[YIELD_STRESS][0] > 0.0


def fit_flow_law(curve: FlowCurve, form: LawForm) -> FlowLawFit:
    """The fit of a form with its intervals. Raises InputError for too few rates."""
    interrupts.check()
    count = len(curve.rate)
    if count < form.min_rates:
        rates = f"{count} rate{'s' * (count != 1)}"
        raise InputError(
            f"{rates}: too few for {named('form')} {form.name} (at least {form.min_rates}). Give flows at more rates."
        )
    law, least = least_squares_law(curve, form)
    if not math.isfinite(least):
        raise InputError("stresses and errors: out of range, squares overflow. Give them in other units.")
    intervals = (
        _jackknife_intervals(curve, form, law)
        if curve.is_jackknifed
        else _profile_intervals(curve, form, law, least)
    )
    chi2 = float(np.sum(((curve.stress - law.stress(curve.rate)) / curve.error) ** 2))
    return FlowLawFit(form, law, chi2, count - len(form.free), intervals)


def fits_below(curve: FlowCurve, form: LawForm) -> list[tuple[float, FlowLawFit]]:
    """[(cut, fit of the rates ≤ cut)], from all rates to as few as can be fitted.

    A law holds for slow flow, so σ_y can be trusted once it no longer changes with the cut. Raises as `fit_flow_law`.
    """
    count = max(1, len(curve.rate) - form.min_rates + 1)
    cuts = [*np.sort(curve.rate)[::-1][:count].tolist(), math.inf][:count]
    return [(cut, fit_flow_law(curve.below(cut), form)) for cut in cuts]


def least_squares_law(curve: FlowCurve, form: LawForm, **fixed) -> tuple[FlowLaw, float]:
    """(law, its weighted sum of squares) where that is least; fixed: values of parameters that are not searched."""
    if not form.has_yield_stress:
        fixed.setdefault(YIELD_STRESS, 0.0)
    index = fixed.get(FLOW_INDEX, form.flow_index)
    if index is not None:
        return _best_of(curve, fixed, np.array([index]))[0]
    grid = _GRID
    for _ in range(_ZOOMS + 1):
        best, place = _best_of(curve, fixed, grid)
        low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
        grid = np.linspace(low, high, _ZOOM_COUNT)
    return best


def _best_of(curve, fixed, index):
    """((law, sum of squares), its place) of the best n of index (K,): linear least squares of σ_y and A at each."""
    weight, unit = curve.own_error**-2.0, np.exp(np.mean(np.log(curve.rate)))
    x = (curve.rate / unit) ** index[:, None]  # (K, M)
    total = weight.sum()
    if CONSISTENCY in fixed:
        slope = fixed[CONSISTENCY] * unit**index
        constant = (
            np.full(len(index), fixed[YIELD_STRESS])
            if YIELD_STRESS in fixed
            else ((curve.stress - slope[:, None] * x) @ weight) / total
        )
    elif YIELD_STRESS in fixed:
        constant = np.full(len(index), fixed[YIELD_STRESS])
        slope = (x @ (weight * (curve.stress - fixed[YIELD_STRESS]))) / (x**2 @ weight)
    else:
        centred = x - (x @ weight)[:, None] / total
        slope = (centred @ (weight * curve.stress)) / (centred**2 @ weight)
        constant = (curve.stress @ weight - slope * (x @ weight)) / total
    squares = (constant[:, None] + slope[:, None] * x - curve.stress) ** 2 @ weight
    place = int(np.argmin(squares))
    consistency = slope[place] / unit ** index[place]
    return (
        FlowLaw(float(constant[place]), float(consistency), float(index[place])),
        float(squares[place]),
    ), place


def _profile_intervals(curve, form, law, least):
    """{name: (low, high)} from the profile of χ², `least` at the law; infinite where χ² stays low."""
    largest = float(np.abs(curve.stress).max())
    ranges = {  # name -> (best, first step, farthest low, farthest high) of what is varied
        YIELD_STRESS: (
            law.yield_stress,
            0.01 * largest,
            *(sign * _MAX_STRESS_RATIO * largest for sign in (-1, 1)),
        ),
        FLOW_INDEX: (law.flow_index, 0.01, MIN_FLOW_INDEX, MAX_FLOW_INDEX),
    }
    if law.consistency > 0.0:
        best = math.log(law.consistency)
        ranges[CONSISTENCY] = best, 0.05, best - _MAX_LOG_CONSISTENCY, best + _MAX_LOG_CONSISTENCY
    intervals = {}
    for name in form.free:
        if name not in ranges:
            intervals[name] = -math.inf, math.inf
            continue

        def excess(value, name=name):
            fixed = math.exp(value) if name == CONSISTENCY else value
            return least_squares_law(curve, form, **{name: fixed})[1] - least - CHI2_RISE

        best, step, *limits = ranges[name]
        ends = [
            _find_end(excess, best, sign * step, limit) for sign, limit in zip((-1, 1), limits, strict=True)
        ]
        intervals[name] = tuple(map(_exponential, ends)) if name == CONSISTENCY else tuple(ends)
    return intervals


def _find_end(excess, best, step, limit):
    """Where `excess`, negative at `best`, becomes positive in the direction of `step`; infinite beyond `limit`."""
    from scipy.optimize import brentq

    inner = best
    while inner != limit:
        interrupts.check()
        outer = best + step
        outer = limit if (outer - limit) * step > 0.0 else outer
        if excess(outer) > 0.0:
            return float(brentq(excess, inner, outer, xtol=1e-6 * abs(outer - best), rtol=1e-12))
        inner, step = outer, 2.0 * step
    return math.copysign(math.inf, step)


def _exponential(value):
    return math.exp(value) if value < math.inf else math.inf


def _jackknife_intervals(curve, form, law):
    """{name: (low, high)} from the fits without one seed, of A by way of ln A."""
    laws = [least_squares_law(other, form)[0] for other in curve.without_seeds()]
    intervals = {}
    for name in form.free:
        values, best = np.array([getattr(other, name) for other in laws]), getattr(law, name)
        if name == CONSISTENCY:
            if min(values.min(), best) <= 0.0:
                intervals[name] = -math.inf, math.inf
                continue
            values, best = np.log(values), math.log(best)
        width = jackknife_error(values, INTERVAL_LEVEL)
        ends = best - width, best + width
        intervals[name] = tuple(map(_exponential, ends)) if name == CONSISTENCY else ends
    return intervals

"""One rule for every verdict: what an estimate says about a number, or a range, that a work claims.

An estimate has a statistical and a systematic error, both as one standard deviation, and the χ² of the form that gave
it. Its interval is

    value ± 2 √(statistical² · max(1, χ²/dof) + systematic²) .

- A form with P(χ²) < 0.01 decides nothing: undecided, the form does not fit.
- A number c is claimed with a margin, 10 % of |c| (2 % where the claim is exact, or the claim's own). The estimate
  agrees where its interval contains c and reaches no farther than the margin to either side of its value; it differs
  where the whole interval is farther from c than the margin; else it is undecided.
- A range is claimed by its ends: the estimate agrees where its interval is inside, differs where all of it is outside
  by more than the margin, else it is undecided.
- An identity holds for any packing: it agrees, and is not evidence.
"""

import math
from dataclasses import dataclass

from jampetsc.analysis.statistics import chi2_probability

SIGMAS = 2.0
MARGIN, EXACT_MARGIN = 0.10, 0.02  # of the number claimed
MIN_PROBABILITY = 0.01  # of χ², below which a form does not fit
AGREES, DIFFERS, UNDECIDED = "agrees", "differs", "undecided"
IDENTITY = "identity"  # for "agrees" where no packing could differ


@dataclass(frozen=True)
class Estimate:
    """A measured number: errors of one standard deviation; chi2, dof: of the form fitted, dof 0 where there is none."""

    value: float
    statistical: float = 0.0
    systematic: float = 0.0
    chi2: float = 0.0
    dof: int = 0

    def __str__(self):
        """value(statistical)(systematic), errors in units of the last digit: two digits of the larger one."""
        errors = [self.inflated, self.systematic]
        largest = max((error for error in errors if math.isfinite(error)), default=0.0)
        if not largest > 0.0:
            return f"{self.value:.4g}"
        digits = min(max(0, 1 - math.floor(math.log10(largest))), 8)
        parts = [error for error, shown in zip(errors, (True, self.systematic > 0), strict=True) if shown]
        return f"{self.value:.{digits}f}" + "".join(f"({error * 10**digits:.0f})" for error in parts)

    @property
    def fits(self) -> bool:
        """Whether the form describes the data, P(χ²) ≥ MIN_PROBABILITY."""
        return self.dof == 0 or chi2_probability(self.chi2, self.dof) >= MIN_PROBABILITY

    @property
    def inflated(self) -> float:
        """Statistical error times √(χ²/dof) where that is above 1."""
        return self.statistical * math.sqrt(max(1.0, self.chi2 / self.dof if self.dof else 0.0))

    @property
    def half_width(self) -> float:
        """Half of the interval that verdicts use."""
        return SIGMAS * math.hypot(self.inflated, self.systematic)


@dataclass(frozen=True)
class Target:
    """What a work claims: low = high for a number; ±inf for an end that is open; margin in units of the number."""

    low: float
    high: float
    margin: float


def number(value: float, margin: float = MARGIN, absolute: float | None = None) -> Target:
    """A number with a relative margin, or an absolute one."""
    return Target(value, value, margin * abs(value) if absolute is None else absolute)


def exact(value: float) -> Target:
    """A number that a theory gives exactly."""
    return number(value, EXACT_MARGIN)


def between(low: float = -math.inf, high: float = math.inf, margin: float = 0.0) -> Target:
    """A range."""
    return Target(low, high, margin)


def distance_from(estimate: Estimate, target: Target) -> float:
    """How far a value is from its claim, in half-widths of its interval; below 0 inside the range claimed."""
    beyond = max(target.low - estimate.value, estimate.value - target.high)
    return beyond / max(estimate.half_width, 1e-300) if math.isfinite(estimate.half_width) else 0.0


def difference(one: Estimate, other: Estimate) -> Estimate:
    """The difference of two independent estimates."""
    return Estimate(
        one.value - other.value,
        math.hypot(one.inflated, other.inflated),
        math.hypot(one.systematic, other.systematic),
    )


def mean_estimate(estimates) -> Estimate:
    """Mean of independent estimates of one number, with the χ² of their being one; systematic errors add up."""
    weights = [max(estimate.inflated, 1e-150) ** -2.0 for estimate in estimates]
    total = math.fsum(weights)

    def averaged(values):
        return math.fsum(w * value for w, value in zip(weights, values, strict=True)) / total

    mean = averaged([estimate.value for estimate in estimates])
    chi2 = math.fsum(w * (e.value - mean) ** 2 for w, e in zip(weights, estimates, strict=True))
    return Estimate(mean, total**-0.5, averaged([e.systematic for e in estimates]), chi2, len(weights) - 1)


def verdict(estimate: Estimate, target: Target) -> tuple[str, str]:
    """(verdict, why an undecided one is, else "")."""
    value, half = estimate.value, estimate.half_width
    if not math.isfinite(value) or not math.isfinite(half):
        return UNDECIDED, "no error is known" if math.isfinite(value) else "no value"
    if not estimate.fits:
        return (
            UNDECIDED,
            f"the form does not fit: χ² = {estimate.chi2:.0f} for {estimate.dof} degrees of freedom",
        )
    low, high = value - half, value + half
    distance = max(target.low - high, low - target.high, 0.0)  # between the interval and the claim
    if distance > target.margin:
        return DIFFERS, ""
    if target.low == target.high:
        if distance == 0.0 and half <= target.margin:
            return AGREES, ""
        why = f"the interval, ± {half:.2g}, is wider than the margin, ± {target.margin:.2g}"
        return UNDECIDED, why if half > target.margin else "it misses the claim by less than the margin"
    if target.low <= low and high <= target.high:
        return AGREES, ""
    return UNDECIDED, "the interval crosses the end of the range claimed"

"""Means and medians of independent samples, such as packings, with errors that hold for few of them.

An error is half of the interval that holds the true value in 68 % of cases: of many samples, one standard error.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from jampetsc.packing.neighbours import lengths

CONFIDENCE_LEVEL = 0.6827  # of an interval: one standard deviation to either side of a normal distribution


@functools.lru_cache
def half_width(degrees: float, level: float = CONFIDENCE_LEVEL) -> float:
    """Student's t at a confidence level for `degrees` of freedom, > 0: by how much a standard error widens."""
    from scipy.special import stdtrit  # takes a while to import

    return float(stdtrit(degrees, 0.5 * (1.0 + level)))


def chi2_probability(chi2: float, dof: int) -> float:
    """Probability of a χ² at least as large, `dof` > 0 degrees of freedom."""
    from scipy.special import gammaincc

    return float(gammaincc(0.5 * dof, 0.5 * chi2))


def small_sample_factor(count: int) -> float:
    """Factor on the scatter of statistics resampled from `count` = n samples: √(n/(n−1)) times Student's t of n − 1."""
    return math.sqrt(count / (count - 1)) * half_width(count - 1) if count > 1 else math.nan


def jackknife_error(values, level: float = CONFIDENCE_LEVEL) -> float:
    """Half of the Student interval of an estimate, from its values (n,) without one of n samples each.

    The standard error is √((n − 1) var), Tukey, Ann. Math. Stat. 29, 614 (1958).
    """
    degrees = len(values) - 1
    return half_width(degrees, level) * math.sqrt(degrees * np.var(values))


def mean_with_error(values) -> tuple:
    """(mean, error) of independent samples (n, …) along the first axis: (…), error nan for n = 1.

    Student's interval, the standard error √(Σ(x − mean)²/(n(n − 1))) times t of n − 1 degrees of freedom: 1.84, 1.32,
    1.20, 1.14 for n = 2, 3, 4, 5.
    """
    values = np.asarray(values, float)
    mean, n = values.mean(axis=0), len(values)
    if n < 2:
        return mean, np.full_like(mean, np.nan)
    return mean, values.std(axis=0) / math.sqrt(n) * small_sample_factor(n)


def draws_of(count: int, samples: int, seed: int = 0):
    """Indices of bootstrap samples, (samples, count): each row draws `count` of `count` with replacement."""
    return np.random.default_rng(seed).integers(count, size=(samples, count))


def median_interval(values) -> tuple:
    """(low, high) that hold the true median of samples (n, …) in 68 % of cases: (…), nan for n < 3.

    Between order statistics, which hold it by chances that need no distribution (Hettmansperger & Sheather, Stat.
    Probab. Lett. 4, 75 (1986)): from six samples on long tails do not matter.
    """
    ordered = np.sort(np.asarray(values, float), axis=0)
    n = len(ordered)
    if n < 3:
        return np.full(ordered.shape[1:], np.nan), np.full(ordered.shape[1:], np.nan)
    from scipy.special import bdtr

    # that the median is between the d-th from either end, d = 1, 2, …: not fewer than d are on either side of it
    chance = np.append(1.0 - 2.0 * bdtr(np.arange(n // 2), n, 0.5), 0.0)
    d = int(np.count_nonzero(chance >= CONFIDENCE_LEVEL))
    part = (chance[d - 1] - CONFIDENCE_LEVEL) / (chance[d - 1] - chance[d])
    inner = (n - d) * part / (d + (n - 2 * d) * part)
    return tuple((1.0 - inner) * ordered[a] + inner * ordered[b] for a, b in ((d - 1, d), (n - d, n - d - 1)))


def median_with_error(values) -> tuple:
    """(median, error), half of `median_interval`; for n = 2 the median is the mean."""
    values = np.asarray(values, float)
    if len(values) < 3:
        return mean_with_error(values)
    low, high = median_interval(values)
    return np.median(values, axis=0), 0.5 * (high - low)


STATISTICS = {"mean": mean_with_error, "median": median_with_error}


def complex_statistic(values, statistic: str) -> tuple:
    """(value, error) of samples (n, …), one of STATISTICS; of complex ones real and imaginary part by themselves."""
    values, function = np.asarray(values), STATISTICS[statistic]
    if not np.iscomplexobj(values):
        return function(values)
    (storage, storage_error), (loss, loss_error) = function(values.real), function(values.imag)
    return storage + 1j * loss, storage_error + 1j * loss_error


def log_median(values) -> tuple[float, float]:
    """(ln of the median, its error) of values (n,), which may have a long tail.

    Half of the logarithm of `median_interval`; where that reaches below zero, and for n < 3, error over median, as of
    `median_with_error`; nan for a median ≤ 0.
    """
    median, error = median_with_error(values)
    if not median > 0:
        return np.nan, np.nan
    low, high = median_interval(values)
    return float(np.log(median)), float(0.5 * np.log(high / low) if low > 0 else error / median)


BINS_PER_DECADE = 10
HISTOGRAM_DECADES = 10  # below the decade of the largest value; smaller values fall into the first bin


@dataclass(frozen=True, eq=False)
class Distribution:
    """Magnitudes of one quantity: moments and a histogram. Bins b hold edges[b] ≤ |x| < edges[b + 1]."""

    median: float
    mean: float
    rms: float
    edges: np.ndarray  # (b + 1,) zero, then powers of 10^(1/BINS_PER_DECADE), the same for every packing
    counts: np.ndarray  # (b,)

    @classmethod
    def of(cls, values) -> "Distribution":
        """Distribution of |values| (M,), or of the lengths of vectors (M, D)."""
        size = np.abs(values) if values.ndim == 1 else lengths(values)
        # by the C library, whose log10 is exact at powers of ten; numpy's own for some processors need not be
        top = math.floor(math.log10(size.max())) + 1 if size.any() else 0
        exponents = (
            np.arange(BINS_PER_DECADE * (top - HISTOGRAM_DECADES), BINS_PER_DECADE * top + 1)
            / BINS_PER_DECADE
        )
        edges = np.append(0.0, 10.0**exponents)
        counts = np.bincount(np.searchsorted(edges, size, side="right") - 1, minlength=len(edges) - 1)
        return cls(
            float(np.median(size)), float(np.mean(size)), float(np.sqrt(np.mean(size**2))), edges, counts
        )

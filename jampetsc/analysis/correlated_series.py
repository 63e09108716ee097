"""Means of correlated series, with errors that allow for the correlation and for how badly a short series shows it.

The Γ-method of Wolff (Comput. Phys. Commun. 156, 143 (2004); erratum 176, 383 (2007)): the mean of T values has the
variance C/T, where C = Γ(0) + 2 Σ_1^W Γ(t) is 2τ Γ(0), τ the integrated autocorrelation time. The window W is where
what is left out, e^(−W/(Sτ)), falls below the noise of the sum; C is freed of the bias of deviations from the series'
own mean by the factor 1/(1 − (2W + 1)/T). C averages over T/(2W + 1) independent squares, W about 4τ and chosen on the
same series: SAMPLES_PER_DEGREE samples make one degree of freedom, and Student's factor for these widens the error.

The number of independent samples is the lower of two estimates that err for different reasons: T/(2τ), and
T (1 − a)/(1 + a) of the exponential a^t through the last ρ(t) ≥ 1/e (Bayley & Hammersley, J. R. Stat. Soc. Suppl. 8,
184 (1946)), freed of its bias (Marriott & Pope, Biometrika 41, 390 (1954)). τ alone would let pass the series in which
it is underestimated.

Both assume a single correlation time. Stress and pressure of massive disks have a fast part, of collisions, and a slow
one, perhaps of density fluctuations, which the window leaves out: the same estimate from the means of blocks of 4τ
contains it, and the larger error counts. Slower changes, or a drift, show in the means of the ten tenths of the series,
if they scatter by more than the error allows.

pyerrors has this estimator, but brings autograd, matplotlib and seconds of start-up for the thirty lines here;
emcee and pymbar correct no bias.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import half_width, mean_with_error

DECAY_FACTOR = 2.0  # S: correlations are taken to decay over Sτ
MIN_EFFECTIVE_SAMPLES = 20.0  # independent samples below which an error is rough
SAMPLES_PER_DEGREE = 6.0  # independent samples per degree of freedom of the variance: benchmarks/coverage.py
BLOCK_TIMES = 4.0  # τ in a block whose mean forgets the fast part of a series
MIN_BLOCKS = 20  # fewest blocks from which an error is taken
BLOCK_COUNT = 10  # parts of a series whose means are compared
MAX_SCATTER_RATIO = 2.4  # of their variance to what the error allows; 1 % of long series exceed it by chance


@dataclass(frozen=True)
class Average:
    """Mean of a correlated series, and its error."""

    mean: float
    error: float  # half of the 68 % interval; nan for a single value
    time: float  # integrated autocorrelation time τ, in values, at least ½
    samples: float  # number of independent values with the same error
    drifts: bool  # the means of its tenths scatter by more than the error allows; `error` is then from that scatter

    def __str__(self):
        return f"{self.mean:.5g} ± {self.error:.2g}"

    @property
    def enough(self) -> bool:
        """Whether there are enough samples to trust the error; it is widened for their number in any case."""
        return self.samples >= MIN_EFFECTIVE_SAMPLES

    @classmethod
    def of(cls, values) -> "Average":
        """Average of a series (T,), T ≥ 1. A constant one has no error and counts as one sample."""
        x = np.asarray(values, float)
        count = len(x)
        if count < 2 or np.ptp(x) == 0.0:
            return cls(float(x.mean()), 0.0 if count > 1 else math.nan, 0.5, 1.0, False)
        time, plain, samples = _mean_error(x)
        scatter = 0.0
        if count >= 2 * BLOCK_COUNT:
            scatter = float(
                mean_with_error(x[: count - count % BLOCK_COUNT].reshape(BLOCK_COUNT, -1).mean(1))[1]
            )
        drifts = (scatter / half_width(BLOCK_COUNT - 1)) ** 2 > MAX_SCATTER_RATIO * plain**2
        excess = max(1.0, _error_of_blocks(x, math.ceil(BLOCK_TIMES * time)) / plain) ** 2
        time, samples = time * excess, max(1.0, samples / excess)
        error = plain * math.sqrt(excess) * _widening(samples)
        return cls(float(x.mean()), max(error, scatter) if drifts else error, time, samples, bool(drifts))


def _mean_error(x):
    """(τ, standard error of the mean, number of independent samples) of a series (T,), T ≥ 2, for one memory."""
    count = len(x)
    gamma = _covariance(x)
    time, variance = _correlation(gamma, count)
    samples = max(1.0, min(0.5 * count / time, _independent(gamma / gamma[0], count)))
    return time, math.sqrt(2.0 * time * variance / count), samples


def _error_of_blocks(x, block):
    """Standard error of the mean of a series (T,) from the means of its blocks; 0 where these are too few."""
    means = x[: len(x) - len(x) % block].reshape(-1, block).mean(1)
    return _mean_error(means)[1] if len(means) >= MIN_BLOCKS and np.ptp(means) > 0.0 else 0.0


def _covariance(x):
    """Γ(t) of a series (T,) for t < T/2, two values at least."""
    count = len(x)
    most = max(2, count // 2)
    transform = np.fft.rfft(x - x.mean(), 2 * count)
    return np.fft.irfft(np.abs(transform) ** 2)[:most] / (count - np.arange(most))


def _correlation(gamma, count):
    """(τ, variance of the values), both free of the bias of a mean from the same `count` values."""
    times = np.cumsum(gamma / gamma[0])[1:] - 0.5
    t = np.arange(1, len(gamma))
    above = np.maximum(times, 0.5 + 1e-9)
    decay = DECAY_FACTOR / np.log((2.0 * above + 1.0) / (2.0 * above - 1.0))
    closed = np.exp(-t / decay) < decay / np.sqrt(t * count)
    window = int(t[np.argmax(closed)] if closed.any() else t[-1])
    if times[window - 1] <= 0.5:  # no memory, or one that makes means better, which is not relied on
        return 0.5, float(gamma[0]) * count / (count - 1)
    total = 2.0 * gamma[0] * times[window - 1] / (1.0 - min((2 * window + 1) / count, 0.9))
    variance = gamma[0] + total / count
    return max(0.5, float(0.5 * total / variance)), float(variance)


def _independent(rho, count):
    """Number of independent samples in `count` values of autocorrelation ρ (T/2,), if ρ were an exponential."""
    below = rho < 1.0 / math.e
    lag = max(1, (int(np.argmax(below)) if below.any() else len(rho)) - 1)
    if rho[lag] <= 0.0:
        return float(count)
    correlation = min(float(rho[lag]), 1.0 - 1.0 / count)
    times = (1.0 + correlation ** (1.0 / lag)) / (1.0 - correlation ** (1.0 / lag))
    correlation = min(correlation + (times * (1.0 - correlation) + 2.0 * lag * correlation) / count, 1.0)
    return count * (1.0 - correlation ** (1.0 / lag)) / (1.0 + correlation ** (1.0 / lag))


def _widening(samples):
    """Student's factor for a variance that was estimated from this number of independent samples."""
    return half_width(max(1.0, samples / SAMPLES_PER_DEGREE))


def mean_of_runs(means, errors, samples) -> tuple[float, float]:
    """(mean, error) over runs (R,); the error is the larger of that from the scatter of their means and that from their
    own errors.

    means, errors, samples   of each run as in `Average`; samples inf: not known, taken for many

    Both are widened by Student's factor: for R − 1 degrees of freedom, and for all degrees of freedom of the runs. nan
    for one run without an error.
    """
    mean, scatter = mean_with_error(means)
    return float(mean), float(np.fmax(own_error_of_runs(errors, samples), scatter))


def own_error_of_runs(errors, samples) -> float:
    """The error of the mean of runs (R,) from their own errors alone, parameters as `mean_of_runs`."""
    errors, samples = (np.asarray(values, float) for values in (errors, samples))
    finite = np.isfinite(errors)
    if not finite.any():
        return math.nan
    plain = errors[finite] / [_widening(count) for count in samples[finite]]
    return float(np.sqrt(np.mean(plain**2) / len(errors)) * _widening(samples[finite].sum()))


def facts_of(runs, name: str) -> list:
    """[means, errors, samples] of a quantity in the attributes of runs: NAME_mean, NAME_error, NAME_samples."""
    return [[float(run[f"{name}_{part}"]) for run in runs] for part in ("mean", "error", "samples")]


def mean_of_facts(runs, name: str) -> tuple[float, float]:
    """`mean_of_runs` of a quantity in the attributes of runs, see `facts_of`."""
    return mean_of_runs(*facts_of(runs, name))


def mean_of_averages(averages) -> tuple[float, float]:
    """`mean_of_runs` of a list of Average."""
    return mean_of_runs(
        *zip(*((average.mean, average.error, average.samples) for average in averages), strict=True)
    )


def layer_heights(layers: int) -> np.ndarray:
    """y/H − ½ of the middles of layers of equal height between walls at −½ and ½, (layers,); the linear profile."""
    return (np.arange(layers) + 0.5) / layers - 0.5


def mean_profile(profiles):
    """(mean (B,), its error (B,)) of the velocity profiles v_x/(γ̇H) of runs, (rows, B) each, nan for empty layers.

    Errors are from the scatter of runs, of a single run from its own autocorrelation.
    """
    means, errors = [], []
    for rows in profiles:
        columns = [column[np.isfinite(column)] for column in rows.T]
        averages = [Average.of(column) if len(column) else None for column in columns]
        means.append([average.mean if average else np.nan for average in averages])
        errors.append([average.error if average else np.nan for average in averages])
    if len(means) == 1:
        return np.array(means[0]), np.array(errors[0])
    return mean_with_error(means)

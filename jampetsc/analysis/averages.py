"""Means of correlated series with errors that know the correlation.

The variance of a mean of T values x_t is 2 τ var(x)/T with the integrated autocorrelation time
τ = ½ + Σ_t ρ(t). The sum is cut at the first window W ≥ WINDOW τ(W) (Sokal 1997; Madras & Sokal, J. Stat. Phys. 50,
109 (1988)): later terms are noise. A series much shorter than that cannot say what its correlation is.
"""

import math
from dataclasses import dataclass

import numpy as np

WINDOW = 6.0
ENOUGH = 25.0  # correlation times that a series must be long
DRIFT = 4.0  # standard errors by which the halves of a series may differ


@dataclass(frozen=True)
class Average:
    """Mean of a series and what is known of its error."""

    mean: float
    error: float  # one standard error
    time: float  # integrated autocorrelation time τ, in values
    enough: bool  # the series is ENOUGH of them long
    drifts: bool  # its halves differ by more than their errors allow

    @classmethod
    def of(cls, values) -> "Average":
        """Average of a series (T,), T ≥ 1; a constant or a single value has no error."""
        x = np.asarray(values, float)
        count = len(x)
        if count < 2 or np.ptp(x) == 0.0:
            return cls(float(x.mean()), 0.0, 0.5, False, False)
        time = correlation_time(x)
        variance = float(np.var(x)) / (1.0 - min(2.0 * time / count, 0.9))  # the mean was taken from the data
        halves = x[: count // 2].mean() - x[(count + 1) // 2 :].mean()
        apart = abs(halves) > DRIFT * math.sqrt(8.0 * time * variance / count)
        return cls(
            float(x.mean()),
            math.sqrt(2.0 * time * variance / count),
            time,
            count >= ENOUGH * time,
            bool(apart),
        )


def correlation_time(values) -> float:
    """τ = ½ + Σ ρ(t) of a series (T,) that is not constant, in units of its spacing, at least ½."""
    x = np.asarray(values, float) - np.mean(values)
    count = len(x)
    transform = np.fft.rfft(x, 2 * count)
    rho = np.fft.irfft(np.abs(transform) ** 2)[:count]
    times = np.cumsum(rho / rho[0]) - 0.5
    # the last window closes whatever the series, as deviations from the mean add up to nothing: τ(T − 1) = 0
    cut = int(np.argmax(np.arange(count) >= WINDOW * times))
    return max(0.5, float(times[cut]))


def mean_of_runs(means, errors) -> tuple[float, float]:
    """(mean, error) over runs (R,): the larger of the scatter of their means and what they say of their errors."""
    means, errors = np.asarray(means, float), np.asarray(errors, float)
    own = np.sqrt(np.mean(errors**2) / len(means))
    scatter = np.std(means, ddof=1) / np.sqrt(len(means)) if len(means) > 1 else 0.0
    return float(means.mean()), float(max(own, scatter))

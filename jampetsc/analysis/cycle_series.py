"""Values of successive cycles: whether they repeat, fluctuate about a mean, or still approach one.

Cycles repeat once later ones will change the value by little: the last changes, continued as a geometric series. Above
yielding orbits never return, and the values of cycles fluctuate. Their mean, with the standard error of a
correlated series, is then the result, after a transient. It ends where the mean of the cycles after it has the least
standard error (White, Simulation 69, 323 (1997)). Trends of few values differ by von Neumann's ratio
Σ(x_{n+1} − x_n)² / Σ(x_n − x̄)², 2 for independent values and 0 for a slow trend (Ann. Math. Stat. 12, 367 (1941)).
Trends of many differ by the means of their tenths, and as few of them are independent.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.correlated_series import BLOCK_COUNT, Average

ROUNDING_TOLERANCE = 1e-7  # of a value: a change this small is rounding
MIN_AVERAGED_CYCLES = 12  # means of 4 that agreed to 2 % were off by 30 % while orbits were still settling
MAX_TRANSIENT_RATIO = 0.5  # of all cycles
MIN_NEUMANN_RATIO = 1.0  # of few values: as where successive ones have a correlation of 1/2
MIN_INDEPENDENT_CYCLES = 3.0  # of many


def remaining_change(values) -> float:
    """Estimate of how much later cycles would change the last of `values` (cycles,): inf if changes grow."""
    change, previous = abs(np.diff(values[-3:]))[::-1] if len(values) > 2 else (np.inf, np.inf)
    if len(values) > 1 and abs(values[-1] - values[-2]) <= ROUNDING_TOLERANCE * abs(values[-1]):
        return float(abs(values[-1] - values[-2]))
    return float(change * max(1.0, change / (previous - change))) if change < previous else np.inf


@dataclass(frozen=True)
class CycleMean:
    """Mean of complex values that fluctuate, over the cycles after a transient."""

    transient: int  # number of cycles left out
    real: Average
    imag: Average

    @property
    def value(self) -> complex:
        return complex(self.real.mean, self.imag.mean)

    @property
    def errors(self) -> complex:
        """Errors of the real and of the imaginary part, as parts of a complex number."""
        return complex(self.real.error, self.imag.error)


def fluctuation_mean(values) -> CycleMean | None:
    """The mean of complex values (cycles,) after their transient; None if they are too few, or have a trend."""
    values = np.asarray(values, complex)
    count = len(values)
    most = min(int(MAX_TRANSIENT_RATIO * count), count - MIN_AVERAGED_CYCLES)
    if most < 0:
        return None
    rests = [values[left_out:] for left_out in range(most + 1)]
    transient = int(np.argmin([np.sum(abs(rest - rest.mean()) ** 2) / len(rest) ** 2 for rest in rests]))
    rest = rests[transient]
    mean = CycleMean(transient, Average.of(rest.real), Average.of(rest.imag))
    parts = (rest.real, mean.real), (rest.imag, mean.imag)
    return None if any(_has_trend(values, average) for values, average in parts) else mean


def _has_trend(values, average) -> bool:
    if np.ptp(values) == 0.0:
        return False
    if len(values) < 2 * BLOCK_COUNT:
        return _neumann_ratio(values) < MIN_NEUMANN_RATIO
    return average.drifts or average.samples < MIN_INDEPENDENT_CYCLES


def fluctuation_error(values) -> complex:
    """Errors of the real and of the imaginary part of the mean of complex values (cycles,) without a transient."""
    return CycleMean(0, Average.of(np.real(values)), Average.of(np.imag(values))).errors


def _neumann_ratio(values) -> float:
    """Squared differences of successive values over squared deviations from the mean."""
    return float(np.sum(np.diff(values) ** 2) / np.sum((values - values.mean()) ** 2))

"""The overshoot of the stress at the start of a flow: height and strain of the peak of σ(γ), with honest errors.

The largest value of a mean over seeds is too high, as it also picks the highest noise, and its scatter among seeds is
too small. So every seed is fitted, by least squares, with a polynomial in one window about the peak, the same for all.
Heights and slopes are then linear in the data, independent between seeds, and Student's intervals hold for them:

- height: of the mean polynomial where it is largest, and the scatter of the seeds at this strain: to first order the
  place of a maximum does not change its height;
- strain: all strains about it at which the mean slope differs from 0 by less than its error (Fieller, J. R. Stat. Soc.
  B 16, 175 (1954)), as the quotient of two slopes is not normal.

The window reaches down to a share of the overshoot, of the smoothed mean. What a higher polynomial in a wider window
would change is added to the errors, in quadrature. On synthetic starts 68 % intervals hold the height in 64 to 72 % and
the strain in 52 to 70 % of cases, for overshoots of 12 to 70 % with 3 to 10 % of noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import half_width, mean_with_error

SMOOTHING_STRAIN = 0.02  # standard deviation of the Gaussian that smooths the mean, to find the window
DEGREE, WINDOW_SHARE = 3, 0.7  # of the polynomial; of the overshoot, down to which its window reaches
CHECK_DEGREE, CHECK_SHARE = 4, 0.5  # of the wider one, whose change counts as an error
MIN_WINDOW_ROWS = 8
PLACES = 401  # strains of a window at which slopes are compared
RESOLVED_LEVEL = 0.99  # of an overshoot that is told from noise, which has some 10 chances to be highest


@dataclass(frozen=True)
class StressPeak:
    """The peak of a mean start; errors are halves of 68 % intervals, nan for one seed."""

    strain: float
    strain_low: float
    strain_high: float
    stress: float
    stress_error: float
    overshoot: float  # of the peak above the steady stress
    overshoot_error: float
    is_resolved: bool  # whether the overshoot is told from noise


def find_peak(strain, stress, steady) -> StressPeak:
    """The peak of the mean over seeds.

    strain   (T,) evenly spaced, increasing
    stress   (S, T) of each seed there
    steady   (S,) mean stress of each seed when the flow is steady
    """
    smooth, level = _smoothed(strain, stress.mean(axis=0)), float(np.mean(steady))
    (place, low, high), heights = _fitted_peak(strain, stress, smooth, level, DEGREE, WINDOW_SHARE)
    (other_place, *_), other_heights = _fitted_peak(strain, stress, smooth, level, CHECK_DEGREE, CHECK_SHARE)
    shift, rise = other_place - place, float(np.mean(other_heights - heights))
    height, error = mean_with_error(heights)
    overshoot, overshoot_error = map(float, mean_with_error(heights - steady))
    overshoot_error, seeds = math.hypot(overshoot_error, rise), len(stress)
    ratio = half_width(seeds - 1, RESOLVED_LEVEL) / half_width(seeds - 1) if seeds > 1 else math.nan
    return StressPeak(
        place,
        place - math.hypot(place - low, shift),
        place + math.hypot(high - place, shift),
        float(height),
        math.hypot(error, rise),
        overshoot,
        overshoot_error,
        overshoot > ratio * overshoot_error,
    )


def _smoothed(strain, mean):
    """The mean (T,) smoothed by a Gaussian of SMOOTHING_STRAIN."""
    weights = np.exp(-0.5 * ((strain[:, None] - strain) / SMOOTHING_STRAIN) ** 2)
    return weights @ mean / weights.sum(axis=1)


def _window(smooth, steady, share):
    """(first, last + 1) row about the highest of `smooth` (T,) down to a share of its excess over the steady stress."""
    top = int(np.argmax(smooth))
    below = np.flatnonzero(smooth <= steady + share * (smooth[top] - steady))
    below = below[below != top]
    first = int(below[below < top].max(initial=-1)) + 1
    last = int(below[below > top].min(initial=len(smooth)))
    missing = max(0, MIN_WINDOW_ROWS - (last - first))
    first = max(0, min(first - missing // 2, len(smooth) - MIN_WINDOW_ROWS))
    return first, min(len(smooth), max(last, first + MIN_WINDOW_ROWS))


def _fitted_peak(strain, stress, smooth, steady, degree, share):
    """((strain of the peak, low, high), heights (S,) of the seeds there) of polynomials in one window."""
    first, last = _window(smooth, steady, share)
    middle, half = 0.5 * (strain[first] + strain[last - 1]), 0.5 * (strain[last - 1] - strain[first])
    x = np.linspace(-1.0, 1.0, PLACES)
    rows = np.polynomial.legendre.legvander((strain[first:last] - middle) / half, degree)
    series = np.linalg.lstsq(rows, stress[:, first:last].T, rcond=None)[0]  # (degree + 1, S)
    heights = np.polynomial.legendre.legval(x, series)  # (S, PLACES)
    slopes, errors = mean_with_error(np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(series)))
    top = int(np.argmax(heights.mean(axis=0)))
    apart = np.flatnonzero(np.abs(slopes) > errors)
    low = apart[apart < top].max(initial=-1) + 1
    high = apart[apart > top].min(initial=PLACES) - 1
    ends = (middle + half * x[place] for place in (top, low, high))
    peak = tuple(map(float, ends)) if len(stress) > 1 else (float(middle + half * x[top]), math.nan, math.nan)
    return peak, heights[:, top]

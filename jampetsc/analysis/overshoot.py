"""The overshoot of the stress at the start of a flow: height and strain of the peak of σ(γ), with honest errors.

The largest value of a mean over seeds is too high, as it also picks the highest noise, and its scatter among seeds is
too small. So every seed is fitted, by least squares, with a polynomial in one window about the peak, the same for all:

- height: of the mean polynomial where it is largest. Its error is the scatter of the seeds at this strain, by Student's
  t: to first order the place of a maximum does not change its height.
- strain: where the mean polynomial is largest. Its error is from the means without one seed, each in a window of its
  own (jackknife), as the window is a part of the estimate.

The window reaches down to a share of the overshoot, of the smoothed mean. What a higher polynomial in a wider window
would change is added to the errors, in quadrature. How often they hold a planted peak: docs/theory/statistics.md.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import half_width, jackknife_error, mean_with_error

SMOOTHING_STRAIN = 0.02  # standard deviation of the Gaussian that smooths the mean, to find the window
DEGREE, WINDOW_SHARE = 3, 0.7  # of the polynomial; of the overshoot, down to which its window reaches
CHECK_DEGREE, CHECK_SHARE = 4, 0.5  # of the wider one, whose change counts as an error
MIN_WINDOW_ROWS = 8
PLACES = 401  # strains of a window, of which one is the peak
RESOLVED_LEVEL = 0.99  # of an overshoot that exceeds noise, which has some 10 chances to be highest


@dataclass(frozen=True)
class StressPeak:
    """The peak of a mean start; errors are halves of 68 % intervals, nan for one seed."""

    strain: float
    strain_error: float
    stress: float
    stress_error: float
    overshoot: float  # of the peak above the steady stress
    overshoot_error: float
    is_resolved: bool  # whether the overshoot exceeds noise


def find_peak(strain, stress, steady) -> StressPeak:
    """The peak of the mean over seeds.

    strain   (T,) evenly spaced, increasing
    stress   (S, T) of each seed there
    steady   (S,) mean stress of each seed when the flow is steady
    """
    steady, seeds = np.asarray(steady, float), len(stress)
    place, heights = _fitted_peak(strain, stress, steady, DEGREE, WINDOW_SHARE)
    other_place, other_heights = _fitted_peak(strain, stress, steady, CHECK_DEGREE, CHECK_SHARE)
    shift, rise = other_place - place, float(np.mean(other_heights - heights))
    height, error = map(float, mean_with_error(heights))
    overshoot, overshoot_error = map(float, mean_with_error(heights - steady))
    strain_error, ratio = math.nan, math.nan
    if seeds > 1:
        kept = ~np.eye(seeds, dtype=bool)
        places = [_fitted_peak(strain, stress[own], steady[own], DEGREE, WINDOW_SHARE)[0] for own in kept]
        strain_error = jackknife_error(places)
        ratio = half_width(seeds - 1, RESOLVED_LEVEL) / half_width(seeds - 1)
    overshoot_error = math.hypot(overshoot_error, rise)
    return StressPeak(
        place,
        math.hypot(strain_error, shift),
        height,
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


def _fitted_peak(strain, stress, steady, degree, share):
    """(strain of the peak, heights (S,) of the seeds there) of polynomials in one window."""
    first, last = _window(_smoothed(strain, stress.mean(axis=0)), float(steady.mean()), share)
    middle, half = 0.5 * (strain[first] + strain[last - 1]), 0.5 * (strain[last - 1] - strain[first])
    x = np.linspace(-1.0, 1.0, PLACES)
    rows = np.polynomial.legendre.legvander((strain[first:last] - middle) / half, degree)
    series = np.linalg.lstsq(rows, stress[:, first:last].T, rcond=None)[0]  # (degree + 1, S)
    heights = np.polynomial.legendre.legval(x, series)  # (S, PLACES)
    top = int(np.argmax(heights.mean(axis=0)))
    return float(middle + half * x[top]), heights[:, top]

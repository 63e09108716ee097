"""Power laws over part of the data: where a slope holds, exponents between neighbouring medians, quotients."""

import numpy as np

from jampetsc.analysis.power_laws import local_exponents, local_slope
from jampetsc.analysis.statistics import log_median

SLOPE_TOLERANCE = 0.12  # between the slope of the data and the exponent of a window
MIN_DECADES, MAX_DECADES = 0.6, 2.5  # of x in a window


def power_law_window(x, y, exponent, max_decades=MAX_DECADES) -> tuple[float, float] | None:
    """(first, last) log₁₀ x of the longest stretch where d ln y/d ln x is near `exponent`; x increasing, (M,) each.

    A stretch of more than `max_decades` is cut to its middle; None for one of less than MIN_DECADES. Values y ≤ 0 are
    left out.
    """
    x, y = x[y > 0], y[y > 0]
    if len(x) < 3:
        return None
    u = np.log10(x)
    near = np.abs(local_slope(x, y) - exponent) <= SLOPE_TOLERANCE
    edges = np.flatnonzero(np.diff(np.r_[0, near.astype(int), 0]))
    stretches = [(u[a], u[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    first, last = max(stretches, key=lambda ends: ends[1] - ends[0], default=(0.0, 0.0))
    if last - first < MIN_DECADES:
        return None
    excess = max(0.0, (last - first) - max_decades) / 2
    return first + excess, last - excess


def median_exponents(x, samples):
    """(middles, d ln X/d ln x, errors), (m − 1,) each, between neighbouring x (m,); X: medians of m samples.

    Errors are those of the medians, nan for fewer than three values; nan where a median is not positive.
    """
    pairs = [
        log_median(sample) if len(sample) > 2 else (np.log(max(np.median(sample), 0.0) or np.nan), np.nan)
        for sample in samples
    ]
    logs, errors = np.transpose(pairs)
    return local_exponents(x, np.exp(logs), np.exp(logs) * errors)


def quotient(numerator, denominator):
    """(value, error) of the quotient of two independent (value, error)."""
    value = numerator[0] / denominator[0]
    return value, np.abs(value) * np.hypot(numerator[1] / numerator[0], denominator[1] / denominator[0])


def fit_logarithm(x, y, errors):
    """(a, b) of y = a + b ln x, weighted by errors (m,) > 0."""
    slope, constant = np.polyfit(np.log(x), y, 1, w=1.0 / errors)
    return constant, slope

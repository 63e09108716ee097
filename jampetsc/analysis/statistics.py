"""Averages over an ensemble of packings, with errors from resampling the packings."""

import numpy as np

RESAMPLES = 2000
LEVEL = 0.6827  # of an interval: one standard deviation to either side
STATISTICS = {"mean": np.mean, "median": np.median}


def bootstrap(values, statistic: str = "mean") -> tuple:
    """(value, standard error) of a statistic of independent samples.

    values      (n, …), samples along the first axis, all finite
    statistic   "mean" or "median"

    The error is the standard deviation of the statistic over samples drawn anew with replacement (Efron 1979), times
    √(n/(n−1)), which makes that of a mean unbiased: (…), nan for n = 1. The same samples give the same error.
    """
    values = np.asarray(values, float)
    value, n = STATISTICS[statistic](values, axis=0), len(values)
    if n < 2:
        return value, np.full_like(value, np.nan)
    return value, np.asarray(_resampled(values, statistic).standard_error) * np.sqrt(n / (n - 1))


def interval(values, statistic: str = "median") -> tuple:
    """(low, high) between which 68 % of the statistics of samples drawn anew lie, for values (n, …) with n > 1.

    What one standard error is for a normal distribution; it keeps its meaning where the tail is long.
    """
    return tuple(_resampled(np.asarray(values, float), statistic).confidence_interval)


def log_median(values) -> tuple[float, float]:
    """(ln of the median, half of its 68 % interval) of values (n,) with n > 1, which may have a long tail.

    Where the interval reaches below zero its half width over the median is the error; nan for a median ≤ 0.
    """
    median, (low, high) = np.median(values), interval(values)
    if not median > 0:
        return np.nan, np.nan
    error = 0.5 * np.log(high / low) if low > 0 else 0.5 * (high - low) / median
    return float(np.log(median)), float(error)


def _resampled(values, statistic):
    from scipy.stats import bootstrap as resample  # takes half a second to import

    settings = {"axis": 0, "vectorized": True, "method": "percentile", "random_state": 0}
    settings |= {"n_resamples": RESAMPLES, "batch": 200, "confidence_level": LEVEL}
    return resample((values,), STATISTICS[statistic], **settings)

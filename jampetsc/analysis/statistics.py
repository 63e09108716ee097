"""Averages over an ensemble of packings, with errors from resampling the packings."""

import numpy as np

RESAMPLES = 2000
STATISTICS = {"mean": np.mean, "median": np.median}


def bootstrap(values, statistic: str = "mean") -> tuple:
    """(value, standard error) of a statistic of independent samples.

    values      (n, …), samples along the first axis, all finite
    statistic   "mean" or "median"

    The error is the standard deviation of the statistic over samples drawn anew with replacement (Efron 1979), times
    √(n/(n−1)), which makes that of a mean unbiased: (…), nan for n = 1. The same samples give the same error.
    """
    from scipy.stats import bootstrap as resample  # takes half a second to import

    values = np.asarray(values, float)
    function, n = STATISTICS[statistic], len(values)
    value = function(values, axis=0)
    if n < 2:
        return value, np.full_like(value, np.nan)
    settings = {"axis": 0, "vectorized": True, "method": "percentile", "random_state": 0}
    found = resample((values,), function, n_resamples=RESAMPLES, batch=200, **settings)
    return value, np.asarray(found.standard_error) * np.sqrt(n / (n - 1))

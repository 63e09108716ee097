"""Errors of means of correlated series, against series whose correlation is known."""

import numpy as np
import pytest

from jampetsc.analysis.averages import Average, correlation_time


def autoregressive(memory, count, seed):
    """x_t = memory x_{t−1} + noise, started in its steady state: variance 1/(1 − memory²), ρ(t) = memory^t."""
    rng = np.random.default_rng(seed)
    x = np.empty(count)
    x[0] = rng.normal() / np.sqrt(1 - memory**2)
    for t, noise in enumerate(rng.normal(size=count - 1), 1):
        x[t] = memory * x[t - 1] + noise
    return x


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_correlation_time_of_a_known_process(memory):
    exact = 0.5 * (1 + memory) / (1 - memory)
    found = [correlation_time(autoregressive(memory, 4000, seed)) for seed in range(10)]
    assert np.mean(found) == pytest.approx(exact, rel=0.15)


@pytest.mark.parametrize("memory, count", [(0.0, 200), (0.8, 1000), (0.95, 3000)])
def test_the_error_covers_what_it_says(memory, count):
    """Means lie within one error in about 68 % of all runs: the true mean is zero."""
    averages = [Average.of(autoregressive(memory, count, seed)) for seed in range(300)]
    share = np.mean([abs(a.mean) < a.error for a in averages])
    assert 0.58 < share < 0.76
    assert all(a.enough for a in averages) or memory > 0.9


def test_short_and_drifting_series_are_told():
    assert not Average.of(autoregressive(0.98, 200, 1)).enough
    steady = autoregressive(0.5, 2000, 2)
    assert not Average.of(steady).drifts
    assert (
        Average.of(steady + np.linspace(0, 3, 2000)).drifts
        or not Average.of(steady + np.linspace(0, 3, 2000)).enough
    )


def test_a_long_series_that_drifts_by_one_standard_deviation_is_told():
    drifting = Average.of(autoregressive(0.5, 2000, 2) + np.linspace(0, 1, 2000))
    assert drifting.enough and drifting.drifts


def test_nothing_to_average():
    assert Average.of([3.0]) == Average(3.0, 0.0, 0.5, False, False)
    assert Average.of(np.full(100, 2.0)).error == 0.0

"""Errors of means of correlated series, against series whose correlation is known."""

import numpy as np
import pytest

from jampetsc.analysis.averages import Average, correlation_time, mean_of_runs


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


def test_a_series_without_memory_has_the_error_of_independent_values():
    """Alternating values have τ = ½, the least; the variance is that about a mean that was not known."""
    for count in (8, 12, 13, 40):
        x = (-1.0) ** np.arange(count)
        found = Average.of(x)
        assert found.time == 0.5 and found.error == pytest.approx(np.std(x, ddof=1) / np.sqrt(count))
        assert found.enough == (count >= 12.5)


def test_a_series_of_one_memory_has_an_error_for_all_that():
    """Half of it up, half down: what is taken for independent cannot be less than the tenth that the error allows."""
    x = np.repeat([0.0, 1.0], 40)
    found = Average.of(x)
    share = 1 - min(2 * found.time / 80, 0.9)
    assert found.time > 5 and found.error == pytest.approx(np.sqrt(2 * found.time * 0.25 / share / 80))
    assert not found.enough


@pytest.mark.parametrize(("shift", "told"), [(1.1, False), (1.25, True)])
def test_how_far_halves_may_be_apart(shift, told):
    """±1 in turn, T = 64 and τ = ½: halves s apart, by four errors of √(4 (1 + s²/4)/(1 − 1/T)/T) where s > 1.17."""
    found = Average.of(np.tile([1.0, -1.0], 32) + np.repeat([0.0, shift], 32))
    assert found.time == 0.5 and found.drifts == told


def test_means_of_runs():
    assert mean_of_runs([2.0], [0.5]) == (2.0, 0.5)
    assert mean_of_runs([1.0, 3.0], [0.1, 0.1]) == (2.0, pytest.approx(1.0))  # their scatter, √2/√2
    assert mean_of_runs([1.0, 1.0], [0.3, 0.4]) == (1.0, pytest.approx(np.sqrt(0.125 / 2)))


def test_the_middle_of_an_odd_series_is_in_neither_half():
    """±1 in turn about halves 1.3 apart: over four errors, but less where the −3 in the middle is in one of them."""
    x = np.insert(np.tile([1.0, -1.0], 32), 32, -3.0) + np.repeat([0.0, 1.3], [33, 32])
    assert Average.of(x).drifts and not Average.of(np.insert(x, 33, -3.0)).drifts
    assert x[33:].mean() - x[:32].mean() == pytest.approx(1.3)


@pytest.mark.parametrize("count", [2, 3, 7, 16, 17])
def test_a_step_of_few_values_is_no_drift(count):
    """Two levels alone: what they differ by is the scatter, too."""
    assert not Average.of(np.arange(count) >= count // 2).drifts


@pytest.mark.parametrize("count", [2, 3, 6, 50])
def test_a_series_that_does_not_forget_is_summed_to_where_its_window_closes(count):
    """x_t = t: τ(W) = ½ + Σ_1^W ρ(t) by hand, at the first W ≥ 6 τ(W), which there always is, as τ(T − 1) = 0."""
    x = np.arange(count) - np.mean(np.arange(count))
    rho = [np.sum(x[: count - t] * x[t:]) / np.sum(x * x) for t in range(count)]
    tau = np.cumsum(rho) - 0.5
    assert tau[-1] == pytest.approx(0.0, abs=1e-12)
    first = next(t for t in range(count) if t >= 6 * tau[t])
    assert correlation_time(3.0 + 2.0 * np.arange(count)) == pytest.approx(max(0.5, tau[first]))

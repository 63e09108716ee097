"""Errors of means of correlated series, against series whose correlation is known."""

import numpy as np
import pytest

from jampetsc.analysis.correlated_series import (
    MAX_SCATTER_RATIO,
    MIN_EFFECTIVE_SAMPLES,
    Average,
    mean_of_runs,
)
from jampetsc.analysis.statistics import half_width


def autoregressive(memory, count, runs, seed=1):
    """(runs, T) series x_t = memory x_{t−1} + noise in their steady state: ρ(t) = memory^t, mean 0."""
    rng = np.random.default_rng(seed)
    x = np.empty((runs, count))
    x[:, 0] = rng.normal(size=runs) / np.sqrt(1 - memory**2)
    for t in range(1, count):
        x[:, t] = memory * x[:, t - 1] + rng.normal(size=runs)
    return x


def covered(series):
    """Of series of mean 0: shares of means within one error and two, share that is long enough, of these within one."""
    averages = [Average.of(x) for x in series]
    off = np.array([abs(a.mean) / a.error for a in averages])
    enough = np.array([a.enough for a in averages])
    of_these = np.mean(off[enough] < 1) if enough.any() else np.nan
    return np.mean(off < 1), np.mean(off < 2), np.mean(enough), of_these


@pytest.mark.parametrize("count, tau", [(1000, 10), (1000, 50), (100, 10), (200, 3), (100, 0.5), (1000, 1)])
def test_the_error_covers_what_it_says(count, tau):
    """68 and 95 % of means, by three standard errors of 400 series; what is long enough is not chosen by luck."""
    one, two, enough, of_these = covered(autoregressive((2 * tau - 1) / (2 * tau + 1), count, 400))
    assert 0.63 < one < 0.84 and two > 0.9
    independent = 0.5 * count / tau
    assert (
        enough > 0.85 and 0.63 < of_these < 0.79
        if independent > 1.5 * MIN_EFFECTIVE_SAMPLES
        else enough < 0.08
    )


def test_series_that_tell_little():
    """Two levels alone are one memory: what they differ by is the scatter, too, and no drift."""
    alone = Average.of([3.0])
    assert alone.mean == 3.0 and np.isnan(alone.error) and alone.samples == 1 and not alone.enough
    same = Average.of(np.full(100, 2.0))
    assert same.error == 0.0 and same.samples == 1 and not same.enough
    halves = Average.of(np.repeat([0.0, 1.0], 40))
    assert halves.samples < 5 and halves.error > 0.3 and not halves.enough
    assert not any(Average.of(np.arange(count) >= count // 2).drifts for count in (2, 3, 7, 16, 17))


@pytest.mark.parametrize("count", [2, 3, 8, 13, 40])
def test_a_series_without_memory_has_the_error_of_independent_values(count):
    """Alternating values have τ = ½, the least."""
    x = (-1.0) ** np.arange(count)
    found = Average.of(x)
    assert found.time == 0.5 and found.samples == count and found.enough == (count >= MIN_EFFECTIVE_SAMPLES)
    assert found.error == pytest.approx(np.std(x, ddof=1) / np.sqrt(count) * half_width(max(1, count / 6)))


def test_window_and_bias_by_hand():
    """ρ of eight values, Wolff's window and his factor, written out anew."""
    x = np.array([1.0, 2.0, 2.5, 2.0, 0.5, 0.0, 0.5, 1.5])
    d, n = x - x.mean(), 8
    gamma = [np.sum(d[: n - t] * d[t:]) / (n - t) for t in range(4)]
    for window in (1, 2, 3):
        tau = 0.5 + sum(gamma[1 : window + 1]) / gamma[0]
        decay = 2.0 / np.log((2 * tau + 1) / (2 * tau - 1)) if tau > 0.5 else 1e-9
        if np.exp(-window / decay) < decay / np.sqrt(window * n) or window == 3:
            break
    total = gamma[0] * max(1, 2 * tau) / (1 - min(0.9, (2 * window + 1) / n))
    found = Average.of(x)
    assert found.error == pytest.approx(np.sqrt(total / n) * half_width(max(1, found.samples / 6)))
    assert found.time == pytest.approx(0.5 * total / (gamma[0] + total / n))


@pytest.mark.parametrize(("step", "told"), [(0.6, False), (0.9, True)])
def test_how_far_tenths_may_be_apart(step, told):
    """±1 in turn about two levels, T = 200: the means of tenths have the scatter of the step."""
    x = np.tile([1.0, -1.0], 100) + np.repeat([0.0, step], 100)
    found = Average.of(x)
    variance = np.var(np.repeat([0.0, step], 5), ddof=1) / 10
    plain = np.sqrt(np.var(x, ddof=1) / 200)  # values in turn have no memory
    assert found.drifts == told == (variance > MAX_SCATTER_RATIO * plain**2)
    if told:
        assert found.error >= np.sqrt(variance) * half_width(9)


def test_a_slow_part_beside_a_fast_one_is_covered():
    """A tenth of the variance remembers forty values: 1 of 3 means would be within an error that does not see it, and
    half of them are if the window alone decides."""
    slow = autoregressive(79 / 81, 1000, 300, 1) * np.sqrt(1 - (79 / 81) ** 2)
    one, two, _, _ = covered(np.sqrt(0.9) * autoregressive(0.0, 1000, 300, 2) + np.sqrt(0.1) * slow)
    assert one > 0.57 and two > 0.83


def test_stress_of_colliding_disks_is_covered():
    """Three memories as the pressure of 1024 disks of CDn has: ρ = .55, .28, .1, .04 after 1, 5, 20 and 100 values."""
    parts = ((0.6, 1), (0.3, 10), (0.1, 60))
    x = sum(
        np.sqrt(share * (1 - memory**2)) * autoregressive(memory, 800, 300, seed)
        for seed, (share, memory) in enumerate(
            ((share, (2 * tau - 1) / (2 * tau + 1)) for share, tau in parts), 1
        )
    )
    one, two, _, _ = covered(x)
    assert one > 0.63 and two > 0.86


def test_means_of_runs():
    many = [np.inf, np.inf]
    assert mean_of_runs([2.0], [0.5], [30.0]) == (2.0, pytest.approx(0.5))
    scatter = pytest.approx(half_width(1))  # √2/√2
    assert mean_of_runs([1.0, 3.0], [0.1, 0.1], many) == (2.0, scatter)
    assert mean_of_runs([1.0, 1.0], [0.3, 0.4], many) == (1.0, pytest.approx(np.sqrt(0.125 / 2)))
    widened = [0.3 * half_width(2), 0.4 * half_width(3)]
    error = np.sqrt(0.125 / 2) * half_width(5)
    assert mean_of_runs([1.0, 1.0], widened, [12.0, 18.0])[1] == pytest.approx(error)
    assert mean_of_runs([1.0, 1.0], [0.3, np.nan], [np.inf, 1.0])[1] == pytest.approx(0.3 / np.sqrt(2))
    assert np.isnan(mean_of_runs([1.0], [np.nan], [1.0])[1])
    assert [half_width(n) for n in (1, 2, 4, 1e9)] == pytest.approx([1.837, 1.321, 1.142, 1.0], abs=1e-3)


@pytest.mark.parametrize(("scatter", "runs"), [(0.0, 3), (1.0, 2), (3.0, 2), (3.0, 3), (3.0, 10)])
def test_runs_that_remember_their_start_are_covered(scatter, runs):
    """Means with errors of 1, from 15 degrees of freedom, and a scatter of runs beside them that the errors miss."""
    rng = np.random.default_rng(3)
    errors = np.sqrt(rng.chisquare(15, (2000, runs)) / 15)
    means = rng.normal(size=(2000, runs)) * np.hypot(1.0, scatter)
    found = np.array([mean_of_runs(*pair, [np.inf] * runs) for pair in zip(means, errors, strict=True)])
    assert 0.65 < np.mean(abs(found[:, 0]) < found[:, 1]) < 0.83

"""Values of cycles: transients, fluctuations and repetition are told apart, and the error of a mean holds."""

from itertools import product

import numpy as np
import pytest

from jampetsc.analysis.cycle_series import MIN_AVERAGED_CYCLES, fluctuation_mean, remaining_change


def fluctuations(count, seed, correlation=0.0):
    """Complex values about 3 + i, with a standard deviation of 0.2 in each part."""
    noise, values = np.random.default_rng(seed).normal(size=(count, 2)), np.zeros((count, 2))
    values[0] = noise[0]
    for n in range(1, count):
        values[n] = correlation * values[n - 1] + np.sqrt(1.0 - correlation**2) * noise[n]
    return 3.0 + 1.0j + 0.2 * (values[:, 0] + 1j * values[:, 1])


@pytest.mark.parametrize(
    ("ratio", "count"), [*product((0.5, 0.8, 0.95, 1.05), (4, 8, 30)), (0.9, 60), (0.95, 60), (1.05, 60)]
)
def test_a_series_that_approaches_a_limit_has_no_mean(ratio, count):
    """Its limit is known by the geometric series; where it grows by none."""
    values = 2.0 + 1.0j + (1.0 - 0.5j) * ratio ** np.arange(count)
    assert fluctuation_mean(values) is None
    left = abs(values[-1] - (2.0 + 1.0j)) if ratio < 1.0 else np.inf
    assert remaining_change(values) == pytest.approx(left)


@pytest.mark.parametrize(("count", "correlation"), [(13, 0.0), (16, 0.3), (60, 0.8)])
def test_the_error_of_a_mean_holds_in_two_thirds_of_series(count, correlation):
    inside, without = [], 0
    for seed in range(200):
        mean = fluctuation_mean(fluctuations(count, seed, correlation))
        if mean is None:
            without += 1
            continue
        inside += [
            abs(mean.real.mean - 3.0) <= mean.errors.real,
            abs(mean.imag.mean - 1.0) <= mean.errors.imag,
        ]
    assert without < 70 and 0.58 < np.mean(inside) < 0.9


def test_the_transient_is_left_out():
    """Half of the cycles at most."""
    for seed in range(20):
        values = fluctuations(24, seed)
        values += 20.0 * 0.4 ** np.arange(24)
        mean = fluctuation_mean(values)
        assert mean is None or 3 <= mean.transient <= 12
        if mean is not None:
            assert abs(mean.value - (3.0 + 1.0j)) < 4.0 * abs(mean.errors)


def test_a_few_cycles_have_no_mean_and_those_that_alternate_have():
    assert fluctuation_mean(fluctuations(MIN_AVERAGED_CYCLES - 1, 1)) is None
    mean = fluctuation_mean([1.0, 2.0] * 6)
    assert mean.value == pytest.approx(1.5) and 0.05 < mean.errors.real < 0.5 and mean.errors.imag == 0.0

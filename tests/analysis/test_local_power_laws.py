"""Windows of power laws, exponents of medians, quotients with errors."""

import numpy as np
import pytest

from jampetsc.analysis.power_laws import fit_logarithm, median_exponents, power_law_window, quotient


def test_a_window_is_the_middle_of_the_longest_stretch():
    x = np.geomspace(1.0, 1e8, 81)
    y = np.where(x < 10**1.05, x**0.5, np.where(x < 10**3.05, x**2, x**0.5 * 10 ** (1.5 * 3.05)))
    first, last = power_law_window(x, y, 0.5)
    assert last - first == pytest.approx(2.5) and first + last == pytest.approx(3.2 + 8.0, abs=0.2)
    assert power_law_window(x[:2], x[:2], 1.0) is None
    for slope, close in ((0.61, True), (0.63, False), (0.39, True), (0.37, False)):
        assert (power_law_window(x, x**slope, 0.5) is not None) == close


def test_exponents_of_medians_ignore_outliers_and_are_nan_where_a_median_is_not_positive():
    x = np.array([1.0, 10.0, 100.0])
    samples = [np.array([1.0, 1.0, 50.0]), np.array([10.0, 10.0, 10.0]), np.array([-1.0, -2.0, 3.0])]
    middles, exponents, errors = median_exponents(x, samples)
    assert middles == pytest.approx([10**0.5, 10**1.5])
    assert exponents[0] == pytest.approx(1.0) and errors[0] > 0
    assert np.isnan(exponents[1]) and np.isnan(errors[1])
    assert np.isnan(median_exponents(x[:2], [np.array([1.0, 2.0])] * 2)[2]).all()  # two values have no error


def test_the_error_of_a_quotient_is_relative():
    value, error = quotient((np.array([6.0]), np.array([0.6])), (np.array([-2.0]), np.array([0.2])))
    assert value == pytest.approx([-3.0]) and error == pytest.approx([3.0 * np.hypot(0.1, 0.1)])


def test_a_logarithm_is_fitted_by_the_weights_of_errors():
    x = np.array([1.0, 10.0, 100.0, 1000.0])
    y = 2.0 + 3.0 * np.log(x) + np.array([0.0, 0.0, 0.0, 5.0])
    assert fit_logarithm(x, y, np.array([1.0, 1.0, 1.0, 1e9])) == pytest.approx((2.0, 3.0))

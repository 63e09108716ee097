"""exp, log and a cosine of additions, multiplications and divisions: against their own identities and the C library."""

import math

import numpy as np
import pytest

from jampetsc.packing import bond, elementary, strain
from jampetsc.packing.compiled import compiled

SMALL = [sign * 10.0**-digits for digits in range(1, 17) for sign in (1, -1)]
LARGE = [*np.linspace(-30.0, 30.0, 61), 699.0, -699.0, math.log(2.0) / 2, -math.log(2.0) / 2]


def ulps(value, expected):
    return abs(value - expected) / math.ulp(expected)


@pytest.mark.parametrize("x", [*SMALL, *LARGE])
def test_exponentials_to_the_last_digits(x):
    assert ulps(elementary.exp(x), math.exp(x)) <= 2
    assert ulps(elementary.expm1(x), math.expm1(x)) <= 3
    assert elementary.log(elementary.exp(x)) == pytest.approx(x, rel=1e-15, abs=3e-16)


def test_ends():
    assert elementary.exp(0.0) == 1.0 and elementary.expm1(0.0) == elementary.log(1.0) == 0.0
    assert elementary.exp(math.inf) == elementary.expm1(800.0) == math.inf
    assert elementary.exp(-math.inf) == 0.0 and elementary.expm1(-800.0) == -1.0
    assert math.isnan(elementary.exp(math.nan)) and math.isnan(elementary.expm1(math.nan))


@pytest.mark.parametrize("x", [5e-324, 1e-300, 0.3, math.nextafter(1.0, 0.0), 1.0 + 2**-52, 1.5, 3.0, 1e300])
def test_logarithms_to_the_last_digits(x):
    assert ulps(elementary.log(x), math.log(x)) <= 3


def test_a_third_of_an_angle():
    angles = np.r_[np.linspace(0.0, np.pi, 50), np.pi - 1e-7]
    for angle in angles:
        assert elementary.cosine_of_third(math.cos(angle)) == pytest.approx(math.cos(angle / 3.0), abs=1e-8)
    assert elementary.cosine_of_third(1.0) == 1.0 and elementary.cosine_of_third(-1.0) == pytest.approx(
        0.5, abs=1e-15
    )


@compiled(False)
def _compiled_values(x):
    return elementary.exp(x), elementary.expm1(x), elementary.cosine_of_third(min(max(x, -1.0), 1.0))


@compiled(False)
def _compiled_strain(growth):
    return bond.growth_and_shear(growth, 0.5)


@pytest.mark.parametrize("x", [1e-9, -0.0123456789, 0.7, -3.2, 1000.0, -1000.0])
def test_compiled_functions_have_the_same_digits(x):
    assert _compiled_strain(0.01 * x)[:2] == pytest.approx(
        strain.growth_and_shear(0.01 * x, 0.5)[:2], rel=1e-14
    )
    expected = elementary.exp(x), elementary.expm1(x), elementary.cosine_of_third(min(max(x, -1.0), 1.0))
    assert _compiled_values(x) == expected

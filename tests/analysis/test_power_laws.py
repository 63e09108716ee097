"""Limits, collapse and power laws, on moduli whose answers are known."""

import numpy as np
import pytest

from jampetsc.analysis.power_laws import (
    collapse,
    collapse_spread,
    critical_exponents,
    fit_power_law,
    local_slope,
    low_frequency_limit,
)
from jampetsc.errors import InputError
from jampetsc.laws.equivalent_damping import EquivalentDamping
from papers.claims.moduli import upper_border

G_LOW, ETA_HIGH = 0.03, 0.4

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

RATES = np.geomspace(1e-4, 1.0, 30)
WEIGHTS = 0.02 * np.sqrt(RATES)


def maxwell(omega):
    """A spring, a dashpot and 30 relaxing elements: G₀, and from their sum η₀."""
    s = 1j * np.asarray(omega)[:, None]
    return G_LOW + s[:, 0] * ETA_HIGH + np.sum(WEIGHTS * s / (s + RATES), axis=1)


def critical(omega, pressure, mu=0.5, lam=1.0):
    """G* = p^μ √(1 + iω/p^λ): it scales exactly."""
    return pressure**mu * np.sqrt(1 + 1j * omega / pressure**lam)


def test_limits_are_those_of_the_spectrum():
    omega = np.geomspace(1e-6, 1e2, 81)
    low = low_frequency_limit(omega, maxwell(omega))
    assert low.modulus == pytest.approx(G_LOW, rel=1e-6)
    assert low.viscosity == pytest.approx(ETA_HIGH + np.sum(WEIGHTS / RATES), rel=1e-6)
    assert low.crossover == pytest.approx(low.modulus / low.viscosity)
    G, shuffled = maxwell(omega), np.random.default_rng(1).permutation(81)  # the order does not matter,
    G[30] = np.nan  # nor do frequencies that failed
    assert low_frequency_limit(omega[shuffled], G[shuffled]) == low


def test_a_sweep_that_ends_early_has_no_limit():
    omega = np.geomspace(1e-3, 1e-1, 20)
    with pytest.raises(InputError, match=r"lowest frequency, 0\.001\. Begin the sweep lower"):
        low_frequency_limit(omega, maxwell(omega))
    with pytest.raises(InputError, match="1 frequencies with a modulus: too few"):
        low_frequency_limit([1.0, 2.0], [1.0, np.nan])


def test_collapse_brings_scaling_moduli_onto_one_curve():
    pressures, x = (1e-2, 1e-3, 1e-4), np.geomspace(1e-3, 10, 30)
    for pressure in pressures:
        omega = x * pressure**0.9
        scaled, g = collapse(omega, critical(omega, pressure, 0.4, 0.9), pressure, 0.4, 0.9)
        np.testing.assert_allclose(scaled, x, rtol=1e-14)
        np.testing.assert_allclose(g, np.sqrt(1 + 1j * x), rtol=1e-14)
    for pressure in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(InputError, match=f"pressure {pressure:g}: must be positive"):
            collapse(x, x, pressure)


def test_spread_leaves_out_high_frequencies_and_needs_overlap():
    omega = np.geomspace(1e-6, 1e2, 200)
    bent = critical(omega, 1e-2) + np.where(omega > 0.1, 5.0, 0.0)
    sweeps = [(omega, bent, 1e-2), (omega, critical(omega, 1e-3), 1e-3)]
    assert collapse_spread(sweeps) < 1e-3 < 0.1 < collapse_spread(sweeps, lam=0.9)
    short, ones = np.array([1e-3, 1e-2, 0.1, 0.11]), (1 + 1j) * np.ones(4)
    for last, least, most in (
        (1.0, 0.0, 1e-12),
        (2.0, 0.01, 1.0),
    ):  # 0.1 belongs to what is compared, 0.11 does not
        other = ones * [1, 1, last, 9]
        assert least <= collapse_spread([(short, ones, 1.0), (short, other, 1.0)]) < most
    with pytest.raises(InputError, match="no two sweeps overlap"):
        collapse_spread([(omega[:20], bent[:20], 1.0), (omega[:20], bent[:20], 1e-8)])
    with pytest.raises(InputError, match="no two sweeps overlap"):
        collapse_spread([(omega, bent, 1e-2)])


def test_the_error_of_three_points_by_hand():
    """ln x = −1, 0, 1 and ln y = 0, 1, 0: slope 0, mean ⅓, residuals −⅓, ⅔, −⅓ with 3 − 2 degrees of freedom."""
    fit = fit_power_law(np.exp([-1.0, 0.0, 1.0]), np.exp([0.0, 1.0, 0.0]))
    variance = 2 / 3 / (3 - 2)
    assert fit.exponent == pytest.approx(0.0, abs=1e-15)
    assert fit.exponent_error == pytest.approx(np.sqrt(variance / 2))
    assert fit.prefactor == pytest.approx(np.exp(1 / 3))
    assert fit.prefactor_error == pytest.approx(np.exp(1 / 3) * np.sqrt(variance / 3))


def test_local_slope_of_a_power_law_on_any_grid():
    x = np.sort(np.random.default_rng(5).uniform(1, 9, 20))
    np.testing.assert_allclose(local_slope(x, 3 * x**-0.5), -0.5, rtol=1e-9)


def test_critical_exponents_of_known_moduli():
    """(iω)^Δ has Δ in both; G*² = G₀² + iAω has ½ at every ω; Kelvin and Voigt's solid goes from ½ to 1 at ω*."""
    omega = np.geomspace(1e-6, 1e6, 241)
    for G, G0, wanted in (((1j * omega) ** 0.3, 0.0, 0.3), (np.sqrt(4.0 + 3j * omega), 2.0, 0.5)):
        for found in critical_exponents(omega, G, G0):
            np.testing.assert_allclose(found, wanted, rtol=1e-6)
    slope, phase = critical_exponents(omega, 2.0 + 4j * omega, 2.0)  # difference 16iω − 16ω²
    np.testing.assert_allclose(
        slope, 0.5 + 0.5 * omega**2 / (1 + omega**2), atol=1e-3
    )  # of ½ ln |ω√(1 + ω²)|
    np.testing.assert_allclose(phase, 0.5 + np.arctan(omega) / np.pi, rtol=1e-9)


def test_the_upper_border_is_where_the_slope_of_the_loss_is_three_quarters():
    """G'' = ω^½ + cω has slope ¾ at ω = 1/c²; a spring and a dashpot have no border; the last of several counts."""
    omega = np.geomspace(1e-8, 1e4, 121)
    assert upper_border(omega, 1j * (omega**0.5 + 2.0 * omega)) == pytest.approx(0.25, rel=2e-3)
    assert np.isnan(upper_border(omega, 1 + 1j * omega))
    u = np.linspace(-10, 10, 401)
    several = np.exp(0.75 * u + 0.25 * np.cos(u))  # whose slope, ¾ − ¼ sin u, rises through ¾ at ±π and ±3π
    assert upper_border(np.exp(u), 1j * several) == pytest.approx(np.exp(3 * np.pi), rel=1e-3)


@pytest.mark.parametrize("part", [1.0, 1j])
def test_how_far_extrapolation_may_move_a_limit(part):
    """G' or G''/ω = 1 + c (ω² − 1) from frequencies 1 and 2: the limit moves by c, 3 % of itself at most."""
    omega = np.array([1.0, 2.0])

    def limit(change):
        moved = part * omega ** (part != 1.0) * change * (omega**2 - 1)
        return low_frequency_limit(omega, 1 + 1j * omega + moved)

    found = limit(0.029)
    moved, other = (found.modulus, found.viscosity)[:: 1 if part == 1.0 else -1]
    assert moved == pytest.approx(1 - 0.029) and other == pytest.approx(1.0)
    with pytest.raises(InputError, match=r"still change at the lowest frequency, 1\. Begin the sweep lower"):
        limit(0.031)


def test_the_second_frequency_is_twice_the_first_or_more():
    omega = np.array([1.0, 1.99])
    with pytest.raises(InputError, match="Begin the sweep lower"):
        low_frequency_limit(omega, 1 + 1j * omega)
    omega = np.array([1.0, 1.5, 2.0, 8.0])  # 1.5 is too near, 8 is not looked at
    G = np.array([1.0, 7.0, 1.01, 9.0]) + 1j * omega
    assert low_frequency_limit(omega, G).modulus == pytest.approx(1 - 0.01 / 3)


def test_a_power_law_is_fitted_inside_its_window_whose_ends_belong_to_it():
    x = np.array([0.5, 1.0, 2.0, 4.0, 8.0])
    y = np.array([9.0, 1.0, 2.0, 4.0, 9.0])
    fit = fit_power_law(x, y, (1.0, 4.0))
    assert (fit.points, fit.exponent) == (3, pytest.approx(1.0)) and fit.exponent_error < 1e-10
    for wrong, message in (
        ((x, y, (1.01, 4.0)), r"2 points between 1\.01 and 4: .*at least 3\)\. Widen the window"),
        ((x, y, (1.0, 3.99)), r"2 points between .*at least 3\)\. Widen the window"),
        (([1.0, 1.0, 1.0, 2.0, 2.0], y), r"5 points .*at least 3"),  # of two frequencies
        ((x, [1.0, 1.0, 0.0, 1.0, 1.0]), r"value 0 between 0 and inf: not positive\. Narrow the window"),
    ):
        with pytest.raises(InputError, match=message):
            fit_power_law(*wrong)
    y[0] = np.nan
    assert fit_power_law(x, y).points == 4


def test_spread_is_over_all_that_two_of_the_sweeps_share():
    """Of three in a row each overlaps the next: a factor 1.2 apart over one decade, the same over another."""
    ranges = ((-6, -4), (-5, -3), (-4, -2))
    sweeps = [
        (np.logspace(*ends, 201), factor * (1 + 1j) * np.logspace(*ends, 201), 1.0)
        for ends, factor in zip(ranges, (1.2, 1.0, 1.0), strict=True)
    ]
    assert collapse_spread(sweeps[:2]) == pytest.approx(np.log(1.2) / np.sqrt(2), rel=1e-9)
    assert collapse_spread(sweeps) == pytest.approx(np.log(1.2) / np.sqrt(2) / np.sqrt(2), rel=0.02)


@pytest.mark.parametrize("alpha", [0.05, 0.5, 2.0, 5.0])
def test_an_equivalent_frequency_solves_its_equation(alpha):
    """y (1 + y²)^((α−1)/2) = C ω^α, for one frequency alone, from the least exponent that is known to the largest."""
    damping = EquivalentDamping(alpha, 1e-3)
    for omega in (1e-3, 1.0, 1e3):
        y = damping.frequency(omega)
        found = np.log(y) + 0.5 * (alpha - 1) * np.log1p(y**2)
        assert found == pytest.approx(np.log(damping.coefficient) + alpha * np.log(omega), abs=1e-9)
    for beyond in (0.0499, 5.01):
        with pytest.raises(InputError, match=r"must lie between 0\.05 and 5"):
            EquivalentDamping(beyond, 1e-3)

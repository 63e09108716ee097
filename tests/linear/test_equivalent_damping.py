"""Power-law damping: the self-consistent equivalent frequency, its limits, and the moduli that follow."""

import math
from dataclasses import replace

import numpy as np
import pytest
import samples
from scipy.integrate import quad

from jampetsc.analysis.equivalent_damping import EquivalentDamping
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.scaling import fit_power_law
from jampetsc.core.laws import Physics, damping_law
from jampetsc.core.potentials import Potential
from jampetsc.jobs import sweep as sweep_job

OMEGA = np.geomspace(1e-16, 1e12, 281)
ALPHAS = (0.1, 0.5, 2 / 3, 1.5, 2.0, 5.0)


def left_side(y, alpha):
    return y * np.hypot(1.0, y) ** (alpha - 1.0)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("stress", [1e-10, 1e-4, 0.3])
def test_the_root_is_the_only_one_and_grows_with_frequency(alpha, stress):
    damping = EquivalentDamping(alpha, stress)
    y = damping.frequency(OMEGA)
    assert np.all(np.diff(y) > 0)
    wanted = damping.coefficient * OMEGA**alpha
    for factor, side in ((1 - 1e-10, -1), (1 + 1e-10, 1)):
        assert np.all(side * (left_side(y * factor, alpha) - wanted) > 0)
    dense = left_side(np.geomspace(1e-30, 1e30, 4001), alpha)
    assert np.all(np.diff(dense) > 0)


@pytest.mark.parametrize("alpha", [0.5, 2 / 3, 1.7])
def test_equal_energy_per_cycle(alpha):
    """The power-law force and its dashpot dissipate alike at the amplitude u₀: BT 25, by quadrature."""
    damping, omega = EquivalentDamping(alpha, 1e-3), 0.7
    speed = damping.amplitude(omega) * omega
    shape, _ = quad(
        lambda phase: abs(math.cos(phase)) ** (alpha + 1), 0, 2 * math.pi, points=(1.5708, 4.7124)
    )
    assert damping.frequency(omega) / omega * speed**2 * math.pi == pytest.approx(
        speed ** (alpha + 1) * shape
    )


@pytest.mark.parametrize("alpha", [0.5, 2 / 3, 1.5])
def test_limits(alpha):
    """Ω = C ω^α where Ωτ₁ ≪ 1 and C^(1/α) ω where Ωτ₁ ≫ 1 (BT 26)."""
    damping = EquivalentDamping(alpha, 1e-5)
    y = damping.frequency(OMEGA)
    low, high = y < 1e-4, y > 1e4
    assert low.any() and high.any()
    np.testing.assert_allclose(y[low], damping.coefficient * OMEGA[low] ** alpha, rtol=1e-7)
    np.testing.assert_allclose(y[high], damping.coefficient ** (1 / alpha) * OMEGA[high], rtol=1e-7)
    np.testing.assert_allclose(damping.amplitude(OMEGA[low]), 1e-5, rtol=1e-7)


def test_exponent_one_changes_nothing():
    damping = EquivalentDamping(1.0, 1e-3)
    assert damping.coefficient == pytest.approx(1.0, rel=1e-15)
    np.testing.assert_array_equal(damping.frequency(OMEGA), OMEGA)
    for alpha in (1 - 1e-9, 1 + 1e-9):
        np.testing.assert_allclose(EquivalentDamping(alpha, 1e-3).frequency(OMEGA), OMEGA, rtol=1e-7)


def critical(pressure=1e-6):
    """A spectrum with G* ~ p^½ for ω ≪ p, ω^½ from p to 1, and a dashpot above, as contact damping has."""
    rates = np.geomspace(pressure, 1.0, 400)
    step = np.log(rates[1] / rates[0])
    return RelaxationSpectrum(np.sqrt(pressure), 0.4, rates, 0.3 * step * np.sqrt(rates))


@pytest.mark.parametrize("alpha", [0.5, 2 / 3])
def test_exponents_of_the_moduli(alpha):
    """BT 27–29 in frequency and in stress, for a spectrum with critical scaling."""
    spectrum, pressure = critical(), 1e-6
    regimes = (  # Ω, exponents of G', G'' in ω, of G', G'' in σ₀
        (1e-2 * pressure, 0.0, alpha, 0.0, alpha - 1),
        (np.sqrt(pressure), alpha / 2, alpha / 2, (alpha - 1) / 2, (alpha - 1) / 2),
        (1e3, 0.0, 1.0, 0.0, (alpha - 1) / alpha),
    )
    stress = 1e-7
    omega = np.geomspace(1e-30, 1e6, 3000)
    for place, *exponents in regimes:
        damping = EquivalentDamping(alpha, stress)
        near = np.abs(np.log(damping.frequency(omega) / place)) < 0.5
        G = spectrum.modulus(damping.frequency(omega[near]))
        stresses = stress * np.geomspace(0.5, 2, 9)
        middle = omega[near][np.count_nonzero(near) // 2]
        H = np.array([spectrum.modulus(EquivalentDamping(alpha, s).frequency(middle)) for s in stresses])
        found = [fit_power_law(omega[near], part).exponent for part in (G.real, G.imag)]
        found += [fit_power_law(stresses, part).exponent for part in (H.real, H.imag)]
        np.testing.assert_allclose(found, exponents, atol=0.02)


def test_a_strain_that_would_change_contacts_is_told_in_units_of_k():
    """σ₀ = 1e-3 k over |G*| = 2 k is a strain of 5e-4, more than p/k = 1e-4."""
    stiff = replace(samples.published(), potential=Potential(k=4.0)).with_record(pressure=4e-4)
    job = samples.run_of(stiff, Physics(damping_law()), [1.0], alpha=0.5, stress=1e-3)
    said = sweep_job._summary(job, job.asked(job.omega), np.array([8.0 + 0j]), np.full((1, 3), 1e-9))
    assert "alpha 0.5, stress 0.001 k: equivalent linear frequencies" in said
    assert "strain amplitude up to 5.0e-04, more than p/k = 1.0e-04" in said

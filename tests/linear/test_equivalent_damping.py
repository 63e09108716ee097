"""Power-law damping: the self-consistent equivalent frequency, its limits, and the moduli that follow."""

import math
import subprocess
import sys
from dataclasses import replace

import launch
import numpy as np
import pytest
import samples
from dense import Reference
from scipy.integrate import quad

from jampetsc.analysis.equivalent_damping import EquivalentDamping
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.scaling import fit_power_law
from jampetsc.core.laws import Physics, damping_law
from jampetsc.core.potentials import Potential
from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load
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


# The sweep


def jampetsc(*words):
    line = [sys.executable, "-m", "jampetsc", *map(str, words)]
    return subprocess.run(line, env=launch.environment(), capture_output=True, text=True, timeout=120)


def sweep(out, packing, *words):
    done = jampetsc("sweep", packing, "--out", out, *words)
    assert done.returncode == 0, done.stderr
    return load(out), done.stdout


@pytest.mark.parametrize("method", ["rational", "direct"])
def test_a_sweep_is_the_linear_one_at_equivalent_frequencies(tmp_path, method):
    packing = tmp_path / "packing.h5"
    write_packing(packing, samples.published())
    words = ("--method", method, "--omega", "1e-8:1:9", "--fields", "1e-4", "--tau1", "2.5", "--beta", "0.3")
    found, said = sweep(tmp_path / "a.h5", packing, *words, "--alpha", "0.5", "--stress", "1e-5")
    assert "alpha 0.5, stress 1e-05 k: equivalent linear frequencies" in said
    assert found.law["alpha"] == 0.5 and found.law["stress"] == 1e-5
    omega, solved = found.omega, found["equivalent_omega"]
    np.testing.assert_allclose(omega, np.geomspace(1e-8, 1, 9))
    np.testing.assert_allclose(solved, EquivalentDamping(0.5, 1e-5).frequency(omega * 2.5) / 2.5)
    np.testing.assert_array_equal(found.fields.omega, [1e-4])
    law = samples.physics(beta=0.3, tau1=2.5)
    exact = np.array([Reference(samples.published(), law).modulus(w) for w in solved[::4]])
    assert (np.abs(found.G[::4] - exact) <= found.error_bound[::4]).all()
    assert (found.error_bound < 1e-5 * np.abs(found.G)).all()
    if method == "rational":
        between = np.sqrt(omega[3] * omega[4])
        equivalent = EquivalentDamping(0.5, 1e-5).frequency(between * 2.5) / 2.5
        assert found.modulus(between) == pytest.approx(found.spectrum.modulus(equivalent), rel=1e-12)
        assert found.frequency_range == (solved[0], solved[-1])


def test_an_exponent_of_one_changes_no_sweep(tmp_path):
    packing = tmp_path / "packing.h5"
    write_packing(packing, samples.published())
    linear, _ = sweep(tmp_path / "linear.h5", packing, "--omega", "1e-4:1:5")
    found, _ = sweep(tmp_path / "one.h5", packing, "--omega", "1e-4:1:5", "--alpha", "1", "--stress", "1e-3")
    np.testing.assert_array_equal(found.G, linear.G)
    np.testing.assert_array_equal(found.error_bound, linear.error_bound)


def test_frequencies_that_cannot_be_solved_are_refused(tmp_path):
    packing = tmp_path / "packing.h5"
    write_packing(packing, samples.published())
    words = ("--omega", "1e-4:1e4:9", "--alpha", "0.2", "--stress", "1e-8")
    done = jampetsc("sweep", packing, "--out", tmp_path / "a.h5", *words)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "--alpha 0.2 --stress 1e-08: omega = " in done.stderr and "narrow --omega" in done.stderr
    assert not (tmp_path / "a.h5").exists()


def test_a_strain_that_would_change_contacts_is_told_in_units_of_k(tmp_path):
    """σ₀ = 1e-3 k over |G*| = 2 k is a strain of 5e-4, more than p/k = 1e-4."""
    stiff = replace(samples.published(), potential=Potential(k=4.0)).with_record(pressure=4e-4)
    write_packing(tmp_path / "p.h5", stiff)
    job = samples.run_of(tmp_path / "p.h5", Physics(damping_law()), [1.0], alpha=0.5, stress=1e-3)
    said = sweep_job._summary(job, job.asked(job.omega), np.array([8.0 + 0j]), np.full((1, 3), 1e-9))
    assert "strain amplitude up to 5.0e-04, more than p/k = 1.0e-04" in said

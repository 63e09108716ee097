"""Power-law damping: the self-consistent equivalent frequency, and what a sweep says of it."""

import math

import numpy as np
import pytest
import samples
from scipy.integrate import quad

from jampetsc.errors import InputError
from jampetsc.laws.damping import Physics, damping_law
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.packing.potentials import Potential

OMEGA = np.geomspace(1e-16, 1e12, 281)
ALPHAS = (0.1, 0.5, 1.0, 1.0 + 1e-9, 1.5, 5.0)


def left_side(y, alpha):
    return y * np.hypot(1.0, y) ** (alpha - 1.0)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("stress", [1e-10, 1e-4, 0.3])
def test_the_root_is_the_only_one_and_grows_with_frequency(alpha, stress):
    """y (1 + y²)^((α−1)/2) = C ω^α: so C ω^α where y ≪ 1, and C^(1/α) ω where y ≫ 1 (BT 26)."""
    damping = EquivalentDamping(alpha, stress)
    y = damping.frequency(OMEGA)
    assert np.all(np.diff(y) > 0)
    wanted = damping.coefficient * OMEGA**alpha
    for factor, side in ((1 - 1e-10, -1), (1 + 1e-10, 1)):
        assert np.all(side * (left_side(y * factor, alpha) - wanted) > 0)
    if alpha == 1.0:
        np.testing.assert_array_equal(y, OMEGA)
    np.testing.assert_allclose(damping.frequency([-OMEGA[0], 0.0, OMEGA[0]]), [-y[0], 0.0, y[0]], rtol=1e-12)


@pytest.mark.parametrize("alpha", [0.5, 2 / 3, 1.0, 1.7])
def test_equal_energy_per_cycle(alpha):
    """The power-law force and its dashpot dissipate alike at the amplitude u₀ = σ₀/√(1 + Ω²): BT 25, by quadrature."""
    damping, omega = EquivalentDamping(alpha, 1e-3), 0.7
    speed = 1e-3 / math.hypot(1.0, damping.frequency(omega)) * omega
    shape, _ = quad(
        lambda phase: abs(math.cos(phase)) ** (alpha + 1), 0, 2 * math.pi, points=(1.5708, 4.7124)
    )
    linear = damping.frequency(omega) / omega * speed**2 * math.pi
    assert linear == pytest.approx(speed ** (alpha + 1) * shape)


def test_a_stress_is_in_units_of_k():
    stiff = samples.published().replace(potential=Potential(k=4.0))
    job = samples.sweep_of(stiff, Physics(damping_law()), [1.0], alpha=0.5, stress=4e-3)
    assert job.damping(4.0) == EquivalentDamping(0.5, 1e-3)
    for stress in (4.1, 3.9e-30):
        beyond = samples.sweep_of(stiff, Physics(damping_law()), [1.0], alpha=0.5, stress=stress)
        with pytest.raises(InputError, match=r"must lie between 4e-30 and 4$"):
            beyond.damping(4.0)

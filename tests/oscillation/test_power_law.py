"""Power-law damping of one contact and the steps of a cycle, each by itself: inverses, derivatives, waves."""

import numpy as np
import pytest

from jampetsc.oscillation.half_cycle import Cycle
from jampetsc.oscillation.power_law import ContactPowerLaw, relative_softening

ALPHAS = (0.4, 2 / 3, 1.0, 1.5, 2.0)


@pytest.fixture
def z():
    """Velocities of 5 steps, 7 contacts, with 2 components, over some decades."""
    rng = np.random.default_rng(1)
    return rng.normal(size=(5, 7, 2)) * 10.0 ** rng.uniform(-3, 1, (5, 7, 1))


@pytest.mark.parametrize("alpha", ALPHAS)
def test_forces_are_a_power_of_the_length_along_the_velocity(z, alpha):
    """f = c |z|^(α−1) z; f·z is what is dissipated."""
    law = ContactPowerLaw(alpha, 1.7)
    f = law.forces(z, 0.0)
    length = np.linalg.norm(z, axis=-1, keepdims=True)
    np.testing.assert_allclose(f, 1.7 * length**alpha * (z / length), rtol=1e-13)
    np.testing.assert_allclose(law.dissipation(z), np.sum(f * z, axis=-1), rtol=1e-13)
    cut = law.forces(z, 0.3)
    np.testing.assert_allclose(cut, 1.7 * (length**2 + 0.09) ** ((alpha - 1) / 2) * z, rtol=1e-13)


@pytest.mark.parametrize("alpha", [alpha for alpha in ALPHAS if alpha <= 1.0])
def test_velocities_are_the_inverse(z, alpha):
    law = ContactPowerLaw(alpha, 1.7)
    assert law.by_force
    f = law.forces(z, 0.0)
    np.testing.assert_allclose(law.velocities(f), z, rtol=1e-12)
    np.testing.assert_allclose(law.mismatch(z, f, 3.0), 0.0, atol=1e-12)
    np.testing.assert_allclose(law.mismatch(1.1 * z, f, 3.0), 0.3 * z, atol=1e-11)
    assert not ContactPowerLaw(1.0001, 1.0).by_force
    np.testing.assert_allclose(
        ContactPowerLaw(1.5, 1.0).mismatch(z, 0 * z, 3.0), ContactPowerLaw(1.5, 1.0).forces(z, 0.0)
    )


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("softening", [0.0, 0.2])
def test_tangents_are_derivatives(z, alpha, softening):
    """Of the mismatch, in z and in f; each undoes the other, and what is held does not move."""
    if alpha > 1.0 and softening:
        return
    law, rng, unit = ContactPowerLaw(alpha, 1.7, softening), np.random.default_rng(2), 0.9
    f = ContactPowerLaw(alpha, 1.7).forces(z, 0.0)
    tangent = law.tangent(z, f)
    size = np.linalg.norm(z, axis=-1, keepdims=True), np.linalg.norm(f, axis=-1, keepdims=True)
    dz, df = (rng.normal(size=z.shape) * one for one in size)
    h = 1e-6
    ahead, behind = (law.mismatch(z + s * dz, f + s * df, unit) for s in (h, -h))
    change = (ahead - behind) / (2 * h)
    np.testing.assert_allclose(tangent.mismatch(dz, df, unit), change, rtol=1e-6, atol=1e-7 * size[1].max())
    np.testing.assert_allclose(tangent.velocities(tangent.forces(dz)), dz, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(tangent.forces(tangent.velocities(df)), df, rtol=1e-9, atol=1e-9)
    held = tangent.eliminated(ahead, unit)  # −df for which the mismatch changes as much at dz = 0
    np.testing.assert_allclose(tangent.mismatch(0 * dz, -held, unit), ahead, rtol=1e-9, atol=1e-9)
    whole = np.stack(
        [tangent.forces(np.broadcast_to(e, z.shape))[..., k] for k, e in enumerate(np.eye(2))], -1
    )
    mean = np.exp(np.log(whole).mean(axis=0)) if alpha < 1.0 else whole.mean(axis=0)
    np.testing.assert_allclose(tangent.mean_stiffness(), mean, rtol=1e-12)


@pytest.mark.parametrize("alpha", (0.1, *ALPHAS))
def test_stiffness_is_the_derivative_where_the_force_is_that_of_the_velocity(z, alpha):
    law, floor, z = ContactPowerLaw(alpha, 1.7), 0.1, z.reshape(-1, z.shape[-1])
    f = law.forces(z, floor)
    found = law.stiffness(z, f, floor)
    for axis in range(2):
        e = 1e-6 * np.eye(2)[axis]
        slope = (law.forces(z + e, floor) - law.forces(z - e, floor)) / 2e-6
        np.testing.assert_allclose(found[..., axis], slope, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(found, np.swapaxes(found, -1, -2))
    if alpha <= 1.0:
        secant = 1.7 * (np.sum(z**2, axis=-1) + floor**2) ** ((alpha - 1) / 2)
        np.testing.assert_allclose(law.stiffness(z, 0 * f, floor), secant[..., None, None] * np.eye(2))
    f, sharp = law.forces(z, 0.0), 1e-9
    too_large = law.stiffness(z, 100.0 * f, sharp)  # a force beyond the law's is taken for the law's
    np.testing.assert_allclose(too_large, law.stiffness(z, f, sharp), rtol=1e-9)
    any_force = 10.0 * np.random.default_rng(2).normal(size=z.shape)
    for predicted in (too_large, law.stiffness(z, any_force, floor)):
        np.testing.assert_array_equal(predicted, np.swapaxes(predicted, -1, -2))
        assert np.linalg.eigvalsh(predicted).min() > 0.0


@pytest.mark.parametrize("alpha", [0.4, 2 / 3])
def test_a_contact_at_rest_is_as_stiff_as_said(alpha):
    """`stiffest` times as stiff as at the typical velocity."""
    law = ContactPowerLaw(alpha, 1.7)
    for stiffest in (10.0, 1e5):
        soft = law.softened(0.3, stiffest)
        at_rest = soft.tangent(np.zeros((1, 2)), np.zeros((1, 2))).forces(np.array([[1.0, 0.0]]))[0, 0]
        moving = 1.7 * 0.3 ** (alpha - 1.0)  # the secant there, of the law itself
        assert at_rest == pytest.approx(stiffest * moving, rel=1e-9)
        assert soft.softening == pytest.approx(1.7 * 0.3**alpha * relative_softening(alpha, stiffest))
    assert relative_softening(1.0) == relative_softening(1.5) == 0.0
    assert ContactPowerLaw(1.5, 1.0).softened(0.3).softening == 0.0


@pytest.mark.parametrize("steps", [4, 16, 64])
def test_waves_of_a_cycle(steps):
    """Odd harmonics, there and back; the first at its own frequency, the others at those of the midpoint rule."""
    cycle, rng = Cycle(steps, 0.7), np.random.default_rng(1)
    m = steps // 2
    assert (cycle.m, len(cycle.orders), cycle.orders[-1]) == (m, m // 2, m - 1)
    assert cycle.frequencies[0] == pytest.approx(0.7, rel=1e-14)
    h = 2.0 * np.tan(np.pi / (2 * m)) / 0.7
    np.testing.assert_allclose(cycle.frequencies, 2.0 / h * np.tan(cycle.orders * np.pi / (2 * m)))
    values = rng.normal(size=(m, 3))
    found = cycle.harmonics(values)
    np.testing.assert_allclose(cycle.samples(found), values, atol=1e-12)
    t = (np.arange(m) + 0.5) * np.pi / m
    np.testing.assert_allclose(cycle.phase, t)
    wave = cycle.harmonics(np.cos(t - 0.3))
    np.testing.assert_allclose(wave, np.eye(m // 2)[0] * np.exp(-0.3j), atol=1e-13)
    finer = Cycle(2 * steps, 0.7)  # takes what there is, and less takes the lowest
    np.testing.assert_allclose(finer.harmonics(finer.samples(found))[: m // 2], found, atol=1e-12)
    assert cycle.samples(finer.harmonics(rng.normal(size=(2 * m, 3)))).shape == (m, 3)


@pytest.mark.parametrize("steps", [8, 32])
def test_displacements_obey_the_midpoint_rule(steps):
    """Q of the middles is the mean of both ends of a step, Q_{n+1} − Q_n = h v_n, odd from one half to the next."""
    cycle, rng = Cycle(steps, 0.7), np.random.default_rng(1)
    m, v = steps // 2, rng.normal(size=steps // 2)
    h = 2.0 * np.tan(np.pi / (2 * m)) / 0.7
    start = -0.5 * h * v.sum()  # Q(T/2) = −Q(0)
    ends = start + h * np.concatenate(([0.0], np.cumsum(v)))
    np.testing.assert_allclose(cycle.integral @ v, 0.5 * (ends[1:] + ends[:-1]), atol=1e-12)
    np.testing.assert_allclose(cycle.integral, -cycle.integral.T, atol=1e-13)

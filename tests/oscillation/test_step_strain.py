"""Step strains: against dense linear response, an ODE solver with contacts that open, and the balance of energy."""

from functools import cache

import numpy as np
import pytest
from relaxations import Relaxing, linear_relaxation
from samples import physics, published
from spheres import few_spheres

from jampetsc.errors import ConvergenceError
from jampetsc.laws.loads import LoadChoice
from jampetsc.oscillation import adaptive_steps
from jampetsc.oscillation import step_strain as module
from jampetsc.oscillation.adaptive_steps import AdaptiveSteps
from jampetsc.oscillation.drive import Imposed
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.step_strain import step_strain
from jampetsc.packing.contacts import find_contacts, measure
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.petsc.session import current
from jampetsc.response.contact_network import build_network
from jampetsc.response.minimum_check import negative_modes

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # a packing is one rank's own


def in_units(disks, k, length):
    """The packing with another stiffness and another unit of length."""
    potential = Potential(disks.potential.kind, k=k)
    return Packing.from_positions(
        length * disks.positions, length * disks.radii, length * disks.cell, potential
    )


def load_of(text, dimension=2):
    (load,) = LoadChoice(text).of(dimension)
    return load


def relaxed(disks, law, strain, times, load="xy", accuracy=1e-2):
    return step_strain(disks, law, load_of(load, disks.dimension), strain, times, accuracy)


LINEAR = [  # law, load, units of stiffness and length; the spheres are balanced to 1e-10 only
    (published, physics(normal=0.25, beta=3.0, tau1=2.0), "xy", 3.0, 2.0, 1e-7),
    (published, physics(beta=0.0), "pure-xy", 1.0, 0.5, 1e-7),
    (published, physics(normal=0.0, rotations=False, tau1=0.3), "xy", 1.0, 1.0, 1e-7),
    (published, physics("stokes", eta_f=0.7, tau1=0.3), "0.5,0.3,0,-0.2", 2.0, 2.0, 1e-7),
    (published, physics("custom", normal=0.5, sliding=0.7, drag=0.2, spin_drag=0.3), "xy", 1.0, 3.0, 1e-7),
    (few_spheres, physics(beta=0.5, tau1=2.0), "xz", 3.0, 2.0, 1e-5),
    (few_spheres, physics("custom", sliding=0.2, drag=0.3, spin_drag=0.1), "compression", 1.0, 1.0, 1e-5),
]


@pytest.mark.parametrize(("sample", "law", "load", "k", "length", "strain"), LINEAR)
def test_small_strains_are_linear_response(sample, law, load, k, length, strain):
    """G(t), its start, and the balance of energy under any law and load, in other units."""
    disks, times = in_units(sample(), k, length), law.law.tau1 * np.logspace(-2, 1, 4)
    found = relaxed(disks, law.law, strain, times, load)
    G, start, _ = linear_relaxation(disks, law, load_of(load, disks.dimension).gradient, times)
    assert np.all(abs(found.G - G) <= found.error + 1e-5 * start)
    assert found.error.max() < 2e-3 * start
    assert found.initial_G == pytest.approx(start, rel=2e-3)
    assert not found.contacts_opened.any() and not found.contacts_closed.any()
    balance = found.initial_energy - found.energy - found.dissipated
    assert np.abs(balance).max() < 1e-3 * 0.5 * start * strain**2


@cache
def finite(law="stokes", strain=8e-3, accuracy=1e-2):
    """A relaxation with contacts that open and close."""
    laws = {"stokes": physics("stokes", eta_f=0.0, tau1=2.0), "contact": physics(rotations=False, beta=0.5)}
    times = laws[law].law.tau1 * np.logspace(-1, 0.5, 4)
    return laws[law].law, times, relaxed(published(), laws[law].law, strain, times, accuracy=accuracy)


@pytest.mark.parametrize("law", ["stokes", "contact"])
def test_finite_strains_are_what_an_ode_solver_finds(law):
    weights, times, found = finite(law)
    G, energy = Relaxing(published(), weights, 8e-3).relax(times)
    assert found.contacts_opened.max() + found.contacts_closed.max() > 3
    assert np.abs(found.G - G).max() < found.error.max() + 5e-3 * found.initial_G
    np.testing.assert_allclose(found.energy, energy, atol=1e-2 * found.initial_energy)


def test_what_the_step_stores_is_dissipated():
    """U(0⁺) − U(t) = ∫ P dt, through contacts that open and close."""
    _, _, found = finite()
    balance = found.initial_energy - found.energy - found.dissipated
    assert np.abs(balance).max() < 2e-3 * found.initial_energy < found.dissipated[-1]
    assert np.all(np.diff(found.energy) < 0.0) and np.all(np.diff(found.dissipated) > 0.0)


def test_disks_come_to_rest_in_a_minimum():
    law = physics("stokes", eta_f=0.0).law
    found = relaxed(published(), law, 8e-3, np.logspace(-1, 6, 15), accuracy=0.1)
    state = measure(found.final)
    assert found.relaxed_time < 1e6 and len(found.G) < 15
    assert state.max_force < 1e-6 * state.pressure
    assert negative_modes(build_network(found.final, current().comm))[0] == 0
    exact = measure(published()).stress[0, 1]
    assert found.rest_stress == pytest.approx(exact, abs=1e-12)
    assert found.G[-1] == pytest.approx((state.stress[0, 1] - exact) / 8e-3, abs=1e-6)
    assert not np.array_equal(find_contacts(found.final).i, find_contacts(published()).i)


def test_the_order_of_the_disks_does_not_matter():
    law, times, found = finite()
    order = np.random.default_rng(1).permutation(16)
    other = relaxed(published().reordered(order), law, 8e-3, times)
    np.testing.assert_allclose(other.G, found.G, rtol=1e-7)
    np.testing.assert_array_equal(other.contacts_opened, found.contacts_opened)


@pytest.mark.parametrize(
    ("sample", "load"), [(published, "0.4,0.3,0,-0.2"), (few_spheres, "0.2,0.3,0.1,0,0,0.4,0,0,-0.3")]
)
def test_the_stress_of_a_load_is_the_slope_of_the_energy(sample, load):
    """At finite strain, with the list made at one strain and the disks at another."""
    disks, gamma = sample(), 0.1
    load = load_of(load, disks.dimension)
    motion = MovingContacts(disks, physics().law, 1.0, 1e-3, load=load)
    motion.gamma = 0.06
    motion.fold()
    at = [
        motion.at(motion.offsets, 0.0 * motion.offsets, strain)
        for strain in (gamma - 1e-5, gamma, gamma + 1e-5)
    ]
    change = motion.energy_change(at[0], at[2])
    assert motion.forces(at[1])[1] == pytest.approx(change / 2e-5, rel=1e-6)
    F = np.eye(disks.dimension) + 0.06 * load.gradient
    np.testing.assert_allclose(motion.disks.volume, np.linalg.det(F) * disks.volume, rtol=1e-12)
    assert motion.volume == disks.volume


def test_a_step_that_fails_is_told(monkeypatch):
    def fails(*_):
        raise ConvergenceError("forces of a time step not balanced.")

    monkeypatch.setattr(module.MovingContacts, "advance", fails)
    with pytest.raises(ConvergenceError, match=r"time steps after t = 0: .* Give a smaller strain\."):
        relaxed(published(), physics().law, 1e-3, np.array([0.1, 1.0]))


def test_steps_of_the_ramp_that_fail_are_divided(monkeypatch):
    """Until all succeed, from the packing at rest."""
    lengths, advance = [], MovingContacts.advance

    def advance_if_short(self, imposed):
        lengths.append(self.step)
        if self.step > 3e-4:
            raise ConvergenceError("too long.")
        return advance(self, imposed)

    law = physics("stokes", eta_f=0.0).law
    usual = relaxed(published(), law, 1e-3, np.array([0.1]))
    monkeypatch.setattr(module, "MAX_RAMP_STEPS", 1)
    monkeypatch.setattr(module.MovingContacts, "advance", advance_if_short)
    divided = module._Relaxation(published(), law, load_of("xy"), 1e-3, [0.1], 1e-2, 1.0)
    divided._ramp()
    assert max(lengths) == 1e-3 and min(lengths) == 2.5e-4
    assert divided._energy / divided.motion.volume == pytest.approx(usual.initial_energy, rel=1e-3)


def test_a_limit_that_no_step_keeps_is_raised():
    """After `patience` steps, so that an interval ends."""
    motion = MovingContacts(published(), physics("stokes", eta_f=0.0).law, 1.0, 1e-4)
    for strain in (0.3e-4, 1e-4):
        motion.advance([Imposed(strain, 1e-4)])
    steps = AdaptiveSteps(motion, lambda t: Imposed(1e-4, 0.0))
    taken = sum(1 for _ in steps.over(0.0, 4.0, 1e-18, patience=2))
    assert 8 < taken < 60


def test_an_interval_of_too_many_steps_fails(monkeypatch):
    monkeypatch.setattr(adaptive_steps, "MAX_ATTEMPTS", 0)
    with pytest.raises(ConvergenceError, match=r"time steps after t = 5e-05: too many"):
        relaxed(published(), physics("stokes").law, 1e-6, np.array([0.01, 0.1]))

"""Contacts that open and close under an oscillating strain: against the sweep, flow's own steps, and themselves."""

from functools import cache

import numpy as np
import pytest
from samples import isostatic, network_of, physics, published
from sweeps import Sweep

from jampetsc.contacts.pairs import PairList
from jampetsc.contacts.state import find_contacts, measure
from jampetsc.errors import ConvergenceError
from jampetsc.flows import steps as flow
from jampetsc.flows.slowly import SlowShear, look_at
from jampetsc.oscillation.moving import STAGE, MovingContacts
from jampetsc.oscillation.repeated import left_to_change, linear_starts, shake
from jampetsc.packing.hessian import Bonds
from jampetsc.session import current
from jampetsc.solvers.local import NewtonSolver

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # a packing is one rank's own


@cache
def start(omega, sample=published, **options):
    disks, law = sample(), physics(**options)
    return linear_starts(network_of(disks, law, current().comm), disks.n, law, [omega])[0]


@cache
def shaken(omega, strain, steps=32, cycles=None, **options):
    return shake(published(), physics(**options).law, start(omega, **options), strain, steps, cycles)


@pytest.mark.parametrize("omega", [1e-4, 3e-2, 3.0])
@pytest.mark.parametrize("options", [{}, {"rotations": False}, {"beta": 0.0, "tau1": 2.0}])
def test_small_strains_are_the_sweep(omega, options):
    with Sweep(published(), physics(**options), np.array([omega]), 1e-8, current().comm) as sweep:
        G, bound = sweep.G[0], sweep.bounds[0, 0]
    found = shaken(omega, 1e-7, **options)
    assert abs(found.G - G) <= found.error + bound
    assert found.error < 1e-2 * abs(G) and found.error < 0.2 * G.imag
    assert found.work == pytest.approx(np.pi * found.G.imag * 1e-14, rel=1e-6)
    assert abs(found.balance) < 5e-3


def test_rattlers_do_not_matter_where_they_touch_nothing():
    """Nothing holds them, and they have no say."""
    law = physics(rotations=False)
    with Sweep(isostatic(), law, np.array([1e-3]), 1e-8, current().comm) as sweep:
        G = sweep.G[0]
    found = shake(isostatic(), law.law, start(1e-3, isostatic, rotations=False), 1e-9, 32, None)
    assert abs(found.G - G) <= 2.0 * found.error < 0.05 * abs(G)


def flow_cycles(disks, law, omega, strain, steps, cycles):
    """G* of the last cycle, contacts opened and closed in it: by the steps of `flow`, explicit, with its own solver."""
    skin = 0.5
    pairs = PairList.build(disks, skin)
    place = (pairs.arrays, np.zeros((disks.n, 2)))
    o, forces, dt = place[1], np.empty((disks.n, 2)), 2.0 * np.pi / (omega * steps)
    weights, potential = law.on_contacts, disks.potential.constants

    def velocities(o, t, u):
        shear, rate = strain * np.sin(omega * t), strain * omega * np.cos(omega * t)
        flow.balance(
            pairs.arrays, o, shear, potential, weights, (0.0, 0.0, rate, 0.0, 0), dt, u, forces, 1e-9
        )
        return shear, rate

    total, counts = 0.0, []
    u, u2, ahead, moved = (np.zeros((disks.n, 2)) for _ in range(4))
    for step in range(cycles * steps):
        t = dt * step
        shear, rate = velocities(o, t, u)
        if step >= (cycles - 1) * steps:
            physical = (0.0, 0.0, rate, 0.0, 0)
            sums = flow.residual_at(pairs.arrays, o, shear, potential, weights, physical, u, forces, None)
            total += -(sums[2] + sums[7]) / disks.area * np.exp(-1j * (omega * t - 0.5 * np.pi))
            counts.append(sums[4])
        flow.move(o, u, shear, dt, ahead)
        u2[:] = u
        later, _ = velocities(ahead, t + dt, u2)
        flow.move(o, u, shear, 0.5 * dt, moved)
        flow.move(moved, u2, later, 0.5 * dt, o)
    assert np.hypot(*o.T).max() < 0.5 * skin
    return total * 2.0 / (steps * strain), np.ptp(counts)


def test_contacts_open_and_close_as_in_flow():
    """The same motion by other steps, another solver and the compiled pair loop."""
    law, omega, strain = physics(rotations=False).law, 0.1, 2e-3
    found = shaken(omega, strain, 64, rotations=False)
    G, changed = flow_cycles(published(), law, omega, strain, 200, 4)
    linear = shaken(omega, 1e-7, rotations=False)
    assert changed >= 2
    assert abs(found.G - G) < found.error + 1e-3 * abs(G)
    assert abs(found.G - linear.G) > 10 * abs(found.G - G)
    assert 1e-3 < abs(found.harmonics[0]) < 0.5


def test_order_of_the_steps():
    """While contacts stay, halving the steps takes off three quarters of the error."""
    runs = [shaken(0.1, 1e-5, steps, cycles=4, rotations=False).G for steps in (16, 32, 64)]
    assert 3.0 < abs(runs[1] - runs[0]) / abs(runs[2] - runs[1]) < 5.0


@pytest.mark.parametrize("rotations", [True, False])
def test_forces_balance_after_a_step(rotations):
    """Elastic and viscous forces of the compiled pair loop, at a state in which some contacts have opened."""
    law, strain = physics(rotations=rotations).law, 1e-2
    motion = MovingContacts(published(), law, 0.02, strain, "osc_factor_")
    for step in range(40):
        motion.advance(strain * 0.02 * np.array([step + 0.3, step + 1.0]), np.full(2, strain))
    disks = motion.disks
    assert len(find_contacts(disks)) != len(find_contacts(published()))
    pairs = PairList.build(disks, 0.1)
    forces, torques = np.empty((disks.n, 2)), np.empty(disks.n)
    rolling = (motion.u[:, 2].copy(), disks.radii, torques) if rotations else None
    flow.residual_at(
        pairs.arrays, np.zeros((disks.n, 2)), 0.0, disks.potential.constants, law.on_contacts,
        (0.0, 0.0, strain, 0.0, 0), motion.u[:, :2].copy(), forces, rolling,
    )  # fmt: skip
    motion.destroy()
    assert np.abs(forces).max() < 2e-3 * strain
    if rotations:
        assert np.abs(torques).max() < 2e-3 * strain


def sheared(disks, law, strain, steps, step=1.0):
    """`disks` after a steady shear in so many steps of this duration."""
    motion = MovingContacts(disks, law, step, 1e-3, "osc_factor_")
    for n in range(steps):
        motion.advance(strain / steps * np.array([n + STAGE, n + 1.0]), np.full(2, strain / steps / step))
    motion.destroy()
    return motion


def test_no_contact_is_missed():
    """Lists are made anew in time: after a long shear all contacts are seen, and the cell is where it should be."""
    motion = sheared(published(), physics(rotations=False).law, 0.8, 80, 20.0)
    r = Bonds.of(motion.pairs, motion.disks.potential, motion.offsets, 0.0, motion.gamma - motion.listed)
    assert motion.listed > 0.3  # not the first list
    assert np.count_nonzero(r.overlap > 0.0) == len(find_contacts(motion.disks))
    before, after = published().cell, motion.disks.cell
    turned = (after[1, 0] - before[1, 0] - 0.8 * before[1, 1]) / before[0, 0]
    assert turned == pytest.approx(round(turned), abs=1e-9) and motion.gamma == pytest.approx(0.8)


def test_slow_shear_goes_from_minimum_to_minimum():
    """Through events in which contacts open, disks come loose and K has negative modes; where steps are long."""
    law = physics(rotations=False).law
    motion = sheared(published(), law, 2e-2, 20, 1e6)
    state = measure(motion.disks)
    assert state.max_force < 1e-4 * state.pressure
    slow = SlowShear(published(), 1e-3, NewtonSolver(), 1e-10)
    for _ in range(20):
        slow.advance()
    assert look_at(slow.disks).shear_stress == pytest.approx(state.stress[0, 1], abs=1e-6)


def test_what_is_left_to_change():
    geometric = 1.0 + 0.5 ** np.arange(8)
    assert left_to_change(geometric) == pytest.approx(0.5**7)
    assert left_to_change(geometric[:2]) == np.inf
    assert left_to_change([1.0, 2.0, 1.0]) == np.inf and left_to_change([1.0, 1.1, 1.3]) == np.inf
    assert left_to_change([2.0, 2.0]) == 0.0
    assert left_to_change([1.0, 2.0, 2.9, 2.9 + 0.81]) == pytest.approx(
        7.29
    )  # slow: far more than the last change


def test_a_number_of_cycles_is_kept():
    assert shaken(0.1, 1e-5, 16, cycles=4, rotations=False).cycles == 8


def test_steps_that_are_too_long_are_refused():
    with pytest.raises(ConvergenceError, match="give more --steps"):
        shaken(1.0, 1.0, 16, cycles=3)

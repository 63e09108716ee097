"""Steepest descent of overdamped disks."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jampetsc
from jampetsc.minimisation.overdamped import OverdampedDescent
from jampetsc.packing.contacts import measure, typical_force
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import UNSTRAINED
from jampetsc.petsc.hessian_solver import HessianSolver


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("dimension", [2, 3])
def test_tiny_overlaps_come_to_rest(session, dimension):
    """Rounding of distances, 1e-16, is large beside energies of overlaps of 1e-7: rises of them end no descent."""
    for seed in (1, 2, 3):
        disks = jampetsc.pack(n=24, pressure=1e-7, seed=seed, dimension=dimension)
        moves = 1e-10 * np.random.default_rng(seed).standard_normal(disks.base.shape)
        descent = OverdampedDescent(disks.replace(offset=disks.offset + moves), HessianSolver(), 1.0, 1e-7)
        state = measure(descent.relax(1e-7, 1e-13))
        assert state.max_force <= 1e-7 * typical_force(disks, state.pressure) and descent.steps < 100


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(("dimension", "potential"), [(2, "harmonic"), (3, "harmonic"), (2, "hertzian")])
def test_the_descent_ends_where_the_dynamics_leads(session, dimension, potential):
    """From places far from a minimum, beside a general solver of differential equations; contacts come and go."""
    elsewhere = 0
    for seed in (1, 2, 3):
        disks = jampetsc.pack(n=20, pressure=0.02, dimension=dimension, potential=potential, seed=seed)
        disks = disks.replace(potential=Potential(potential, k=3.0))
        moves = 0.3 * np.random.default_rng(seed).standard_normal(disks.base.shape)
        start = disks.replace(offset=disks.offset + moves)
        pairs, forces = NeighbourList.build(start, 2.0), np.zeros(moves.shape)

        def velocities(_, x, pairs=pairs, forces=forces, constants=disks.potential.constants):
            bond_forces(pairs, x.reshape(forces.shape), UNSTRAINED, constants, forces, None, None)
            return forces.ravel()

        exact = solve_ivp(velocities, (0.0, 3e4), np.zeros(moves.size), "LSODA", rtol=1e-7, atol=1e-9)
        expected = measure(start.replace(offset=start.offset + exact.y[:, -1].reshape(moves.shape)))
        found = measure(OverdampedDescent(start, HessianSolver(), 3.0, 0.01).relax(1e-9, 1e-13))
        assert found.energy == pytest.approx(expected.energy, rel=1e-6)
        elsewhere += abs(found.energy / measure(disks).energy - 1.0) > 1e-3
    assert elsewhere  # not all of them went back

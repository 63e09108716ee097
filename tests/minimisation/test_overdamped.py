"""Steepest descent of overdamped disks."""

import numpy as np
import pytest

import jampetsc
from jampetsc.minimisation.overdamped import OverdampedDescent
from jampetsc.packing.contacts import measure, typical_force
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

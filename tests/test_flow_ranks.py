"""Velocities under contact damping by PETSc on any number of ranks, against dense numpy and the compiled solver."""

import numpy as np
import pytest
import sheared
from gathered import dense
from sheared import crowd, shear

from jampetsc.errors import ConvergenceError
from jampetsc.flows.models import Model, Scheme
from jampetsc.flows.shearing import Shear
from jampetsc.flows.walls import between_walls
from jampetsc.packing.sizes import radii_of


@pytest.fixture
def together(session):
    from jampetsc.flows.together import Together
    from jampetsc.solvers.resistance import ContactSolver

    solver = ContactSolver(1e-13)
    yield Together(solver)
    solver.destroy()


def beside(name, together, disks, **given):
    """The same run with PETSc."""
    alone = shear(name, disks, **given)
    return alone, Shear(disks, alone.model, alone.rate, alone.scheme, together)


@pytest.mark.scalar("real")
@pytest.mark.parametrize("phi", [0.55, 0.86])
@pytest.mark.parametrize("name", ["CD0", "unequal"])
def test_velocities_are_those_of_dense_numpy(session, together, name, phi):
    disks = crowd(phi=phi)
    _, run = beside(name, together, disks, rate=0.03)
    exact = sheared.overdamped_velocities(disks, run.model.law, run.rate)
    assert np.abs(run.velocities_now() - exact).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "name, method, steps", [("CD0", "euler", 100), ("CD0", "heun", 10), ("CD", "backward Euler", 20)]
)
def test_a_run_is_the_same_on_any_number_of_ranks(session, together, name, method, steps):
    alone, run = beside(name, together, crowd(), method=method, step=0.1)
    for one in (alone, run):
        one.advance(steps)
    assert np.abs(alone.disks.positions - run.disks.positions).max() < 1e-8
    assert np.abs(alone.seen[:8] - run.seen[:8]).max() < 1e-8 * np.abs(alone.seen[:8]).max()
    assert len(set(session.comm.allgather(run.offsets.tobytes()))) == 1
    law = alone.model.law
    rubbed = Shear(crowd(), Model(law, friction=0.1), 0.01, Scheme(0.1, "euler", 1e-13), together)
    rubbed.advance(3)
    assert rubbed.steps == 3


@pytest.mark.scalar("real")
def test_velocities_that_are_not_found_are_told(session, together):
    """By a solver that gives up, on every rank."""
    _, run = beside("CD0", together, crowd(16), rate=0.03)
    together.solver.ksp.setTolerances(max_it=2)
    with pytest.raises(ConvergenceError, match=r"velocities not found by KSP \(reason -3, 2 iterations\)"):
        run.velocities_now()


@pytest.mark.scalar("real")
def test_walls_stand_still_on_any_number_of_ranks(session, together):
    disks, held = between_walls(1.2 * radii_of("bidisperse", 32), 0.86, 1, crowd().potential)
    given = shear("CD0", disks)
    runs = [Shear(disks, given.model, given.rate, given.scheme, by, held) for by in (None, together)]
    for run in runs:
        run.advance(5)
    alone, run = (run.velocities_now() for run in runs)
    assert np.abs(alone - run).max() < 1e-8 * np.abs(alone).max() and (run[:held] == 0).all()
    matrix = dense(together.solver.ksp.getOperators()[0])
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * matrix.max())  # as preconditioners are told

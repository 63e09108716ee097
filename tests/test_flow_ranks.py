"""Velocities under contact damping by PETSc on any number of ranks, against dense numpy and the compiled solver."""

import time

import numpy as np
import pytest
import sheared
from gathered import dense
from sheared import crowd, shear

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flows import run as running
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
    """Also over lists that become stale."""
    alone, run = beside(name, together, crowd(), method=method, step=0.1, rate=0.1)
    for one in (alone, run):
        one.advance(steps)
        assert one.rebuilds and one.steps == steps
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


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name, method", [("CD0", "euler"), ("CD0", "heun"), ("CD", "backward Euler")])
def test_what_ranks_differ_by_does_not_grow(session, together, name, method):
    """As on processors that round in another way: what rank 0 has is what counts, from every batch of steps on."""
    _, run = beside(name, together, crowd(16), method=method, step=0.1)
    _, same = beside(name, together, crowd(16), method=method, step=0.1)
    run.velocities += 1e-9 * session.rank
    run.offsets += 1e-12 * session.rank
    for one in (run, same):
        one.advance(2)
    for array in ("offsets", "velocities"):
        assert len(set(session.comm.allgather(getattr(run, array).tobytes()))) == 1
        np.testing.assert_array_equal(getattr(run, array), getattr(same, array))


@pytest.mark.scalar("real")
def test_clocks_of_ranks_need_not_agree(session, together, shared_path, monkeypatch):
    """A checkpoint is due when rank 0 says so; a rank ahead of its time does not write or wait alone."""
    clock, saved = time.monotonic, []
    monkeypatch.setattr(running, "write_checkpoint", lambda *what: saved.append(what))
    for ahead, due in ((session.rank > 0, 0), (session.rank == 0, 3)):
        hours = iter(range(0, 10**6, 100))
        monkeypatch.setattr(running.time, "monotonic", lambda h=hours, a=ahead: clock() + a * next(h))
        _, run = beside("CD0", together, crowd(16), method="euler", step=0.1)
        with monkeypatch.context() as quiet:
            quiet.setattr(running, "LINES", 1)
            record = running.run(run, running.Plan(2, 3, 1.0, 0), shared_path / "x.h5", {})
        assert len(record) == 3 and len(saved) == (due if session.rank == 0 else 0)
        assert len(set(session.comm.allgather(tuple(record.series("energy"))))) == 1


@pytest.mark.scalar("real")
def test_a_checkpoint_that_cannot_be_written_is_every_rank_s_failure(
    session, together, shared_path, monkeypatch
):
    def full(*_):
        raise InputError("no space left")

    monkeypatch.setattr(running, "write_checkpoint", full)
    monkeypatch.setattr(running, "INTERVAL", -1.0)
    _, run = beside("CD0", together, crowd(16), method="euler", step=0.1)
    with pytest.raises(InputError, match="no space left"):
        running.run(run, running.Plan(2, 3, 1.0, 0), shared_path / "x.h5", {})

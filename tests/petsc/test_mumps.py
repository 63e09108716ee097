"""MUMPS where its workspace is too small at first: pivots that are put off fill more than its analysis expects."""

import pickle

import numpy as np
import pytest
from samples import published
from scipy.sparse import bmat, diags, eye, random

from jampetsc.cli import main as cli
from jampetsc.errors import named
from jampetsc.io.packing_file import write_packing
from jampetsc.linear import modes
from jampetsc.petsc import mumps
from jampetsc.petsc.matrices import distributed_matrix

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]

WORKSPACE_TOO_SMALL = -9  # INFOG(1)


@pytest.fixture
def saddle(session):
    """Symmetric, n zeros on the diagonal of 2n: the pivots there have to wait."""
    n, rng = 400, np.random.default_rng(1)
    coupling = random(n, n, 0.02, random_state=2)
    corner = 1e-9 * diags(rng.standard_normal(n))
    matrix = (bmat([[corner, coupling], [coupling.T, None]]) + 1e-12 * eye(2 * n)).tocsr()
    matrix.sort_indices()
    return distributed_matrix(session.comm, matrix, matrix.data)


def factorised(session, matrix, prefix, percent):
    """(attempts, ICNTL(14) in the end, how far A A⁻¹ b is from b)."""
    solver = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
    solver |= {"mat_mumps_icntl_14": percent}
    session.set_defaults({prefix + name: value for name, value in solver.items()})
    ksp = mumps.make_ksp(session.comm, prefix)
    attempts = mumps.factorise(ksp, matrix, "a saddle")
    b, x = matrix.createVecs()
    b.set(1.0)
    ksp.solve(b, x)
    return attempts, ksp.getPC().getFactorMatrix().getMumpsIcntl(14), (matrix * x - b).norm() / b.norm()


@pytest.mark.parametrize(("percent", "doubled"), [(20, 1), (0, 2)])
def test_workspace_is_doubled_until_it_is_enough(session, saddle, percent, doubled):
    attempts, workspace, left = factorised(session, saddle, f"workspace_{percent}_", percent)
    assert doubled < attempts <= mumps.ATTEMPTS
    assert workspace == 20 * 2 ** (attempts - doubled)
    assert left < 1e-4


def test_it_is_given_up_in_the_end(session, saddle, monkeypatch):
    monkeypatch.setattr(mumps, "ATTEMPTS", 1)
    with pytest.raises(
        mumps.Failure, match=r"factorisation of a saddle: out of memory \(MUMPS INFOG"
    ) as failed:
        factorised(session, saddle, "workspace_lost_", 20)
    assert failed.value.code == WORKSPACE_TOO_SMALL


@pytest.fixture
def scripted(session, monkeypatch):
    """scripted(codes): attempts of a small factorisation whose INFOG(1) are these, one after the other."""
    made = []

    def factorise(prefix, codes, pc="cholesky"):
        n = 6
        matrix = (2.0 * eye(n) - diags(np.ones(n - 1), 1) - diags(np.ones(n - 1), -1)).tocsr()
        matrix = distributed_matrix(session.comm, matrix, matrix.data)
        solver = {"ksp_type": "preonly", "pc_type": pc, "pc_factor_mat_solver_type": "mumps"}
        session.set_defaults({prefix + name: value for name, value in solver.items()})
        ksp, left = mumps.make_ksp(session.comm, prefix), list(codes)
        made.extend((ksp, matrix))
        monkeypatch.setattr(mumps, "failure", lambda pc: left.pop(0))
        attempts = mumps.factorise(ksp, matrix, "a chain")
        assert not left
        return attempts, session.PETSc.Options().getInt(prefix + "mat_mumps_icntl_14", 0)

    yield factorise
    for item in made:
        item.destroy()


@pytest.mark.parametrize("code", mumps.WORKSPACE)
def test_every_lack_of_workspace_is_cured_by_more(scripted, code):
    assert scripted(f"scripted{-code}_", [code, code, code, 0]) == (4, 160)


def test_a_factorisation_without_symmetry_is_looked_at_as_well(scripted):
    assert scripted("general_", [-9, 0], "lu") == (2, 40)
    with pytest.raises(mumps.Failure, match="is singular"):
        scripted("general_singular_", [-10], "lu")


def test_it_is_tried_so_often_and_no_more(scripted):
    """Up to 16 times the usual workspace."""
    assert scripted("often_", [-9] * 4 + [0]) == (5, 320)
    with pytest.raises(mumps.Failure, match="out of memory") as failed:
        scripted("too_often_", [-9] * 5)
    assert failed.value.code == -9


def test_a_warning_is_no_failure(scripted):
    assert scripted("warned_", [1])[0] == scripted("unknown_", [None])[0] == 1


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (-13, r"out of memory \(MUMPS INFOG\(1\) = -13\); use more ranks or nodes, or -options_file"),
        (-19, r"out of memory \(MUMPS INFOG\(1\) = -19\)"),
        (
            -90,
            r"MUMPS could not write its files \(INFOG\(1\) = -90\); free space in, or set, MUMPS_OOC_TMPDIR",
        ),
        (-10, r"the matrix is singular \(MUMPS INFOG\(1\) = -10\); is the packing a minimum\? see"),
        (-40, r"the solver reports MUMPS INFOG\(1\) = -40"),
        (-6, r"the solver reports MUMPS INFOG\(1\) = -6"),
    ],
)
def test_what_more_workspace_does_not_cure_is_told_at_once(scripted, code, says):
    with pytest.raises(mumps.Failure, match=f"factorisation of a chain: {says}") as failed:
        scripted(f"told{-code}_", [code])
    assert failed.value.code == code
    assert "a failed factorisation" in str(mumps.explain(None, "a chain"))


def test_the_command_line_knows_a_factorisation_that_failed(session, tmp_path, monkeypatch):
    """For what it is, with options as it has them."""
    write_packing(tmp_path / "p.h5", published())

    def fail(*_, **__):
        raise mumps.Failure(f"singular; see info with {named('matrices')}", -10)

    monkeypatch.setattr(modes, "lowest_modes", fail)
    with pytest.raises(mumps.Failure, match="singular; see info with --matrices") as told:
        cli.dispatch(["modes", str(tmp_path / "p.h5"), "--out", str(tmp_path / "m.h5")])
    assert pickle.loads(pickle.dumps(told.value)).code == -10  # on other ranks too

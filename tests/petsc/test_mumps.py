"""MUMPS where its workspace is too small at first: pivots that are put off fill more than its analysis expects."""

import pickle

import numpy as np
import pytest
from samples import DATA
from scipy.sparse import bmat, diags, eye, random

from jampetsc import main as cli
from jampetsc.errors import named
from jampetsc.petsc import mumps
from jampetsc.petsc.sparse_matrices import distributed_matrix
from jampetsc.response import vibrations as modes

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
SOLVER = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}


@pytest.fixture
def saddle(session):
    """Symmetric, n zeros on the diagonal of 2n: the pivots there have to wait."""
    n, rng = 400, np.random.default_rng(1)
    coupling = random(n, n, 0.02, random_state=2)
    corner = 1e-9 * diags(rng.standard_normal(n))
    matrix = (bmat([[corner, coupling], [coupling.T, None]]) + 1e-12 * eye(2 * n)).tocsr()
    matrix.sort_indices()
    return distributed_matrix(session.comm, matrix, matrix.data)


@pytest.mark.parametrize(("percent", "doubled"), [(20, 1), (0, 2)])
def test_workspace_is_doubled_until_it_is_enough(session, saddle, monkeypatch, percent, doubled):
    """And no more often than ATTEMPTS."""

    def factorised(prefix):
        ksp = mumps.make_ksp(session.comm, prefix, SOLVER | {"mat_mumps_icntl_14": percent})
        return ksp, mumps.factorise(ksp, saddle, "a saddle")

    ksp, attempts = factorised(f"workspace_{percent}_")
    assert doubled < attempts <= mumps.MAX_ATTEMPTS
    assert ksp.getPC().getFactorMatrix().getMumpsIcntl(14) == 20 * 2 ** (attempts - doubled)
    b, x = saddle.createVecs()
    b.set(1.0)
    mumps.solve(ksp, b, x, "a saddle")
    assert (saddle * x - b).norm() < 1e-4 * b.norm()
    monkeypatch.setattr(mumps, "MAX_ATTEMPTS", 1)
    with pytest.raises(
        mumps.FactorisationError, match=r"factorisation of a saddle: out of memory \(MUMPS"
    ) as failed:
        factorised(f"workspace_lost_{percent}_")
    assert failed.value.code == -9


@pytest.fixture
def scripted(session, monkeypatch):
    """scripted(codes): (attempts, ICNTL(14)) of a small factorisation whose INFOG(1) are these, one after the other."""

    def factorise(prefix, codes, pc="cholesky"):
        matrix = (2.0 * eye(6) - diags(np.ones(5), 1) - diags(np.ones(5), -1)).tocsr()
        ksp, left = mumps.make_ksp(session.comm, prefix, SOLVER | {"pc_type": pc}), list(codes)
        monkeypatch.setattr(mumps, "failure_code", lambda pc: left.pop(0))
        attempts = mumps.factorise(ksp, distributed_matrix(session.comm, matrix, matrix.data), "a chain")
        assert not left
        return attempts, session.PETSc.Options().getInt(prefix + "mat_mumps_icntl_14", 0)

    return factorise


@pytest.mark.parametrize(
    ("codes", "pc", "found"),
    [
        *(([code] * 3 + [0], "cholesky", (4, 160)) for code in mumps.WORKSPACE_CODES),
        ([-9] * 4 + [0], "cholesky", (5, 320)),  # up to 16 times the usual
        ([-9, 0], "lu", (2, 40)),  # also without symmetry
        ([1], "cholesky", (1, 0)),  # a warning
        ([None], "cholesky", (1, 0)),  # another solver
        ([-9] * 5, "lu", r"out of memory \(MUMPS INFOG\(1\) = -9\)"),
        (
            [-13],
            "cholesky",
            r"out of memory \(MUMPS INFOG\(1\) = -13\)\. Use more ranks or nodes, or -options_file",
        ),
        ([-19], "lu", r"out of memory \(MUMPS INFOG\(1\) = -19\)"),
        ([-90], "lu", r"files of MUMPS not written \(MUMPS INFOG\(1\) = -90\)\. .* MUMPS_OOC_TMPDIR"),
        (
            [-10],
            "cholesky",
            r"singular matrix \(MUMPS INFOG\(1\) = -10\)\. See info with matrices",
        ),
        ([-40], "lu", r"the solver reports MUMPS INFOG\(1\) = -40"),
    ],
    ids=str,
)
def test_lack_of_workspace_is_cured_by_more_and_the_rest_is_told(scripted, codes, pc, found):
    prefix = f"scripted_{pc}{codes[0]}_{len(codes)}_"
    if not isinstance(found, str):
        assert scripted(prefix, codes, pc) == found
        return
    with pytest.raises(mumps.FactorisationError, match=f"factorisation of a chain: {found}") as failed:
        scripted(prefix, codes, pc)
    assert failed.value.code == codes[0]


def test_the_command_line_knows_a_factorisation_that_failed(monkeypatch):
    """For what it is, with options as it has them."""

    def fail(*_, **__):
        raise mumps.FactorisationError(f"singular; see info with {named('matrices')}", -10)

    monkeypatch.setattr(modes, "lowest_modes", fail)
    with pytest.raises(mumps.FactorisationError, match="singular; see info with --matrices") as told:
        cli.dispatch(["modes", str(DATA / "isostatic-N24-p1e-7.h5"), "--out", "none.h5"])
    assert pickle.loads(pickle.dumps(told.value)).code == -10  # on other ranks too

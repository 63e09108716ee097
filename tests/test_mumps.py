"""MUMPS where its workspace is too small at first: pivots that are put off fill more than its analysis expects."""

import numpy as np
import pytest
from scipy.sparse import bmat, diags, eye, random

from jampetsc.solvers import mumps
from jampetsc.solvers.matrices import distributed_matrix

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

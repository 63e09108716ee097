"""What `modes` asks of SLEPc and LAPACK, and the factor of K − σ that one rank solves with."""

import numpy as np
import pytest
from samples import SAMPLES, physics
from sheared import crowd

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.minimisation import ldl
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.petsc import eigen, hessian_solver
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.vibrations import lowest_modes

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]


@pytest.mark.parametrize("ordering", ["amd", "qmd"])
def test_factor_solves_with_the_matrix_shifted(session, ordering, monkeypatch):
    """Also by a PETSc without SuiteSparse; a shift into the spectrum is noticed."""
    monkeypatch.setattr(hessian_solver, "has_suitesparse", lambda: ordering == "amd")
    pencil = assemble(
        build_network(SAMPLES["polydisperse"](), session.comm), physics("stokes").law, pinned=False
    )
    K = pencil.K.convert("dense").getDenseArray().copy()
    b = np.random.default_rng(0).standard_normal(len(K))
    found = hessian_solver.block_inverse(pencil.K, 1e-3)(b)
    np.testing.assert_allclose((K + 1e-3 * np.eye(len(K))) @ found, b, rtol=0, atol=1e-11)
    assert hessian_solver.block_inverse(pencil.K, -0.5 * np.linalg.eigvalsh(K)[2]) is None


@pytest.mark.parametrize("ordering", ["amd", "qmd"])
def test_an_order_of_elimination_fills_little(session, ordering, monkeypatch):
    """A chain not at all, of a packing a third of what the order of the disks does; also where pairs are told twice."""
    monkeypatch.setattr(hessian_solver, "has_suitesparse", lambda: ordering == "amd")
    chain = np.random.default_rng(1).permutation(30).astype(np.uint32)

    def entries(order, n, i, j):
        assert sorted(order.tolist()) == list(range(n))
        matter = i, j, np.tile(np.eye(2), (len(i), 1, 1)), np.ones(len(i), bool)
        return len(ldl.factorise(order, *matter, ldl.diagonal_of(*matter, np.ones(n)))[1][2])

    links = chain[:-1], chain[1:]
    assert entries(hessian_solver.elimination_order(30, *links), 30, *links) == 29
    disks = crowd(n=400, phi=0.9)
    pairs = NeighbourList.build(disks, 0.3)
    near = np.hypot(*pairs.r0) < pairs.sigma
    i, j = pairs.i[near], pairs.j[near]
    found = hessian_solver.elimination_order(400, i, j)
    assert entries(found, 400, i, j) < entries(np.arange(400, dtype=np.uint32), 400, i, j) / 3
    twice = hessian_solver.elimination_order(400, np.concatenate((i, j)), np.concatenate((j, i)))
    np.testing.assert_array_equal(found, twice)


def test_blocks_and_libraries_factorise_alike(session, monkeypatch):
    """Blocks where one rank has a matrix that is not too large and no option says otherwise."""
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    pencil = assemble(network, physics("stokes").law, pinned=False)
    assert eigen.suits_blocks(pencil)
    ours = lowest_modes(network, 9).eigenvalues
    assert eigen.suits_blocks(pencil)
    monkeypatch.setattr(eigen, "DENSE_BLOCK_UNKNOWNS", 2 * network.n - 1)
    assert not eigen.suits_blocks(pencil)
    np.testing.assert_allclose(lowest_modes(network, 9).eigenvalues, ours, rtol=1e-11)
    monkeypatch.undo()
    options = session.PETSc.Options()
    options.setValue("modes_st_ksp_rtol", "1e-13")
    try:
        assert not eigen.suits_blocks(pencil)
        np.testing.assert_allclose(lowest_modes(network, 9).eigenvalues, ours, rtol=1e-11)
    finally:
        options.delValue("modes_st_ksp_rtol")


def test_a_stop_while_the_factor_is_applied_is_passed_on(session, monkeypatch):
    """Nothing else takes its place, and the next search finds what it would have."""
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    wanted, factorised, solved = lowest_modes(network, 9).eigenvalues, hessian_solver.block_inverse, []

    def stopped(*given):
        solve = factorised(*given)

        def some(b):
            solved.append(len(b))
            if len(solved) == 15:
                raise KeyboardInterrupt
            return solve(b)

        return some

    with monkeypatch.context() as patch:
        patch.setattr(hessian_solver, "block_inverse", stopped)
        with pytest.raises(KeyboardInterrupt):
            lowest_modes(network, 9)
    np.testing.assert_array_equal(lowest_modes(network, 9).eigenvalues, wanted)


def test_modes_that_slepc_does_not_find_are_told(session, monkeypatch):
    monkeypatch.setattr(eigen, "PREFIX", "short_modes_")  # whose defaults have not been set yet
    options = session.PETSc.Options("short_modes_eps_")
    options["max_it"], options["ncv"] = 1, 18
    try:
        with pytest.raises(ConvergenceError, match=r"SLEPc: \d+ of \d+ modes found in 1 restarts"):
            lowest_modes(build_network(SAMPLES["polydisperse"](), session.comm), 9)
    finally:
        for name in ("max_it", "ncv"):
            options.delValue(name)


def test_a_large_part_of_a_large_spectrum_is_refused(session, monkeypatch):
    """Up to MAX_LAPACK_UNKNOWNS LAPACK finds it."""
    network = build_network(SAMPLES["published"](), session.comm)
    monkeypatch.setattr(eigen, "MAX_LAPACK_UNKNOWNS", 2 * network.n)
    assert lowest_modes(network, 20).method == "lapack"
    monkeypatch.setattr(eigen, "MAX_LAPACK_UNKNOWNS", 2 * network.n - 1)
    with pytest.raises(
        InputError, match=r"20 of 30 modes: more than half the spectrum is found up to 15 particles"
    ):
        lowest_modes(network, 20)
    assert lowest_modes(network, 2).method == "krylovschur"
    monkeypatch.undo()
    assert len(lowest_modes(network, 30).eigenvalues) == 30
    with pytest.raises(InputError, match="31 modes: K has 30 besides its translations"):
        lowest_modes(network, 31)


def test_where_k_is_no_minimum_or_slepc_is_missing_it_is_said(session, monkeypatch):
    with pytest.raises(ConvergenceError, match="so K has negative modes"):
        lowest_modes(build_network(SAMPLES["gears"](), session.comm), 1, proved=True)
    monkeypatch.setattr(session, "SLEPc", None)
    with pytest.raises(InputError, match=r"slepc4py: missing\. Install it for the PETSc in use"):
        lowest_modes(build_network(SAMPLES["published"](), session.comm), 2)

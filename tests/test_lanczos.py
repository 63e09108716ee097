"""The Lanczos method of `modes` on one rank against dense eigenpairs, and the factor of K − σ that it solves with."""

import numpy as np
import pytest
from samples import SAMPLES, physics

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.network import build_network
from jampetsc.response.modes import lowest_modes
from jampetsc.solvers import blocks, eigen, lanczos
from jampetsc.solvers.lanczos import lowest_eigenpairs

SHIFT = -1e-7
alone = pytest.mark.most_ranks(1)
real = pytest.mark.scalar("real")


def solver(values, vectors=None):
    """b → (A − σ)⁻¹b for A with these eigenvalues; diagonal, unless there are vectors (columns)."""
    if vectors is None:
        return lambda b: b / (values - SHIFT)
    return lambda b: vectors @ ((vectors.T @ b) / (values - SHIFT))


def find(values, count, vectors=None, known=()):
    """Eigenpairs by Lanczos, those numbered `known` (columns of `vectors`) deflated."""
    axes = np.eye(len(values)) if vectors is None else vectors
    return lowest_eigenpairs(solver(values, vectors), axes[:, list(known)].T, count, SHIFT)


@pytest.mark.parametrize("count", [1, 7, 40])
def test_against_the_spectrum_it_was_made_of(count):
    """Eigenvalues over nine decades: without orthogonalisation the lowest would be found again and again."""
    generator = np.random.default_rng(count)
    n, known = 300, (0, 5)
    values = np.sort(10.0 ** generator.uniform(-8, 1, n))
    vectors = np.linalg.qr(generator.standard_normal((n, n)))[0]
    found, modes = find(values, count, vectors, known)
    left = np.delete(np.arange(n), known)[:count]
    np.testing.assert_allclose(found, values[left], rtol=1e-8, atol=1e-17)
    np.testing.assert_allclose(modes @ modes.T, np.eye(count), rtol=0, atol=1e-13)
    np.testing.assert_allclose(modes @ vectors[:, list(known)], 0.0, rtol=0, atol=1e-13)
    # components outside the wanted eigenspace, which is what the tolerance bounds
    np.testing.assert_allclose(np.abs(np.sum(modes.T * vectors[:, left], axis=0)), 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("different", "copies", "count"), [(8, 5, 12), (3, 10, 3)])
def test_every_copy_of_equal_eigenvalues_is_found(different, copies, count):
    """One vector leads to one copy of each, and then nowhere: after as many vectors as values, or twice as many."""
    values = np.repeat(np.arange(1.0, different + 1.0), copies)
    found, modes = find(values, count)
    np.testing.assert_allclose(found, values[:count], rtol=1e-12)
    np.testing.assert_allclose(modes @ modes.T, np.eye(count), rtol=0, atol=1e-12)
    np.testing.assert_allclose(modes * values, found[:, None] * modes, rtol=0, atol=1e-11)


def test_fewer_are_returned_where_there_are_no_more():
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found, modes = find(values, 9, known=(1, 3))
    np.testing.assert_allclose(found, [1.0, 3.0, 5.0], rtol=1e-12)
    assert modes.shape == (3, 5)


def test_nothing_is_left_to_find_once_the_vectors_span_the_space():
    values = np.linspace(1.0, 2.0, 60)
    found, modes = find(values, 25)
    np.testing.assert_allclose(found, values[:25], rtol=1e-12)
    np.testing.assert_allclose(modes * values, found[:, None] * modes, rtol=0, atol=1e-12)


def test_vectors_that_do_not_suffice_are_refused(monkeypatch):
    monkeypatch.setattr(lanczos, "BESIDES", 16)
    with pytest.raises(
        ConvergenceError, match="2 modes are not found with 24 Lanczos vectors: -modes_eps_type"
    ):
        find(1.0 / np.linspace(1.0, 2.0, 500), 2)


@real
@alone
@pytest.mark.parametrize("ordering", ["amd", "qmd"])
def test_factor_solves_with_the_matrix_shifted(session, ordering, monkeypatch):
    """Also by a PETSc without SuiteSparse; a shift into the spectrum is noticed."""
    monkeypatch.setattr(blocks, "suitesparse", lambda: ordering == "amd")
    pencil = assemble(
        build_network(SAMPLES["polydisperse"](), session.comm), physics("stokes").law, pinned=False
    )
    K = pencil.K.convert("dense").getDenseArray().copy()
    made = blocks.Blocks(pencil.K)
    pencil.destroy()
    n = len(K) // 2
    np.testing.assert_array_equal(np.sort(made.order), np.arange(n))
    b = np.random.default_rng(0).standard_normal(2 * n)
    np.testing.assert_allclose((K + 1e-3 * np.eye(2 * n)) @ made.factorise(1e-3)(b), b, rtol=0, atol=1e-11)
    lowest = np.linalg.eigvalsh(K)[2]
    assert made.factorise(-0.5 * lowest) is None


@real
@alone
def test_an_option_of_the_user_has_slepc_find_the_same(session):
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    ours = lowest_modes(network, 9)
    options = session.PETSc.Options()
    options.setValue("modes_eps_ncv", 40)
    try:
        theirs = lowest_modes(network, 9)
    finally:
        options.delValue("modes_eps_ncv")
    assert (ours.method, theirs.method) == ("lanczos", "krylovschur")
    np.testing.assert_allclose(ours.eigenvalues, theirs.eigenvalues, rtol=1e-11)
    assert (
        lowest_modes(network, 9).method == "lanczos"
    )  # what SLEPc was told by default is no option of the user


@real
@alone
def test_modes_that_slepc_does_not_find_are_told(session, monkeypatch):
    monkeypatch.setattr(eigen, "PREFIX", "short_modes_")  # whose defaults have not been set yet
    options = session.PETSc.Options("short_modes_eps_")
    options["max_it"], options["ncv"] = 1, 18
    try:
        with pytest.raises(ConvergenceError, match=r"SLEPc found \d+ of \d+ modes in 1 restarts"):
            lowest_modes(build_network(SAMPLES["polydisperse"](), session.comm), 9)
    finally:
        for name in ("max_it", "ncv"):
            options.delValue(name)


@real
@alone
def test_very_many_disks_are_left_to_slepc(session, monkeypatch):
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    monkeypatch.setattr(eigen, "MANY", 2 * network.n)
    assert lowest_modes(network, 3).method == "lanczos"
    monkeypatch.setattr(eigen, "MANY", 2 * network.n - 1)
    assert lowest_modes(network, 3).method == "krylovschur"


@real
@alone
def test_a_matrix_with_negative_modes_is_refused(session):
    with pytest.raises(ConvergenceError, match="K has negative modes"):
        lowest_modes(build_network(SAMPLES["gears"](), session.comm), 1, proved=True)


@real
@alone
def test_a_large_part_of_a_large_spectrum_is_refused(session, monkeypatch):
    """Up to DENSE unknowns LAPACK finds it."""
    network = build_network(SAMPLES["published"](), session.comm)
    monkeypatch.setattr(eigen, "DENSE", 2 * network.n)
    assert lowest_modes(network, 20).method == "lapack"
    monkeypatch.setattr(eigen, "DENSE", 2 * network.n - 1)
    with pytest.raises(
        InputError, match=r"20 of 30 modes: so large a part of the spectrum is found up to 15 disks"
    ):
        lowest_modes(network, 20)
    assert lowest_modes(network, 2).method == "lanczos"


@real
@alone
def test_more_modes_than_there_are(session):
    network = build_network(SAMPLES["published"](), session.comm)
    assert len(lowest_modes(network, 30).eigenvalues) == 30
    with pytest.raises(InputError, match="31 modes: K has 30 besides its translations; ask for no more"):
        lowest_modes(network, 31)


@real
@alone
def test_without_slepc_it_is_said(session, monkeypatch):
    monkeypatch.setattr(session, "SLEPc", None)
    monkeypatch.setattr(eigen, "MANY", 0)
    with pytest.raises(InputError, match="slepc4py is missing: install it for the PETSc in use"):
        lowest_modes(build_network(SAMPLES["published"](), session.comm), 2)

"""Low modes against dense eigen-decompositions; planted floppy modes, clusters and pieces; refusals."""

from dataclasses import replace

import numpy as np
import pytest
from dense import Reference
from samples import SAMPLES, crystal, cut, on_ranks, pairs_of, physics, published, reference, strips, wide
from scipy.linalg import eigh
from spheres import few_spheres
from whole_arrays import unknowns

import jampetsc
from jampetsc.commands.modes import PER_MODE
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.laws.masses import BY_VOLUME, Masses
from jampetsc.packing.potentials import Potential
from jampetsc.petsc import eigen
from jampetsc.response import vibrations as modes_module
from jampetsc.response.contact_network import build_network
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.mode_counts import count_between
from jampetsc.response.vibrations import LOWEST, lowest_modes

pytestmark = pytest.mark.scalar("real")


def spectrum(sample, prestress=True):
    """(λ (m,), φ (unknowns, m), exact) of the dense K, translations left out."""
    law = physics("stokes") if prestress else physics("stokes", prestress=False, eta_f=1e-5)
    exact = Reference(SAMPLES[sample](), law) if sample == "hertzian" else reference(sample, str(law))
    K = exact.K[:-1, :-1].astype(float)
    moves = exact.free_moves().astype(float)
    moves /= np.sqrt(np.sum(moves**2, axis=0))
    values, vectors = np.linalg.eigh(K + 100.0 * moves @ moves.T)
    m = len(values) - moves.shape[1]
    return values[:m], vectors[:, :m], exact


def vectors_of(modes):
    """Modes of all ranks, (unknowns, m)."""
    whole = np.concatenate(modes.network.comm.allgather(modes.vectors), axis=1)
    return whole.reshape(len(whole), -1).T


def check(modes, wanted, vectors, exact):
    """Eigenvalues and vectors (up to sign; the spectra compared here are simple) against dense ones."""
    m = len(modes.eigenvalues)
    np.testing.assert_allclose(modes.eigenvalues, wanted[:m], rtol=1e-10, atol=1e-13)
    found = vectors_of(modes)
    np.testing.assert_allclose(found.T @ found, np.eye(m), rtol=0, atol=1e-10)
    rows = unknowns(modes.network, 2, exact.disks)
    overlap = np.abs(np.sum(found * vectors[rows, :m], axis=0))
    np.testing.assert_allclose(overlap, 1.0, rtol=0, atol=1e-10)
    assert modes.residuals.max() < 1e-10
    assert modes.inertia_count == m


@pytest.fixture
def converged(session):
    """SLEPc goes on until rounding stops it, else rounding decides how exact vectors are when it stops."""
    session.PETSc.Options().setValue("modes_eps_tol", "1e-14")
    yield
    session.PETSc.Options().delValue("modes_eps_tol")


@pytest.mark.usefixtures("converged")
@pytest.mark.parametrize(
    ("sample", "count"),
    [("published", 4), ("published", 30), ("hertzian", 3), ("polydisperse", 20), ("isostatic", 5)],
)
@pytest.mark.parametrize("prestress", on_ranks([True, False], [True]))
def test_against_dense(session, sample, count, prestress):
    """Few modes come from SLEPc, many from LAPACK; every quantity from its definition."""
    wanted, vectors, exact = spectrum(sample, prestress)
    modes = lowest_modes(build_network(SAMPLES[sample](), session.comm, prestress), count)
    assert modes.method == ("lapack" if 2 * (count + 2) >= len(wanted) else "krylovschur")
    check(modes, wanted, vectors, exact)
    assert modes.complete == (count == len(wanted))
    assert count == len(wanted) or wanted[count - 1] < modes.inertia_shift < wanted[count]
    for row in range(count):
        phi = vectors[:, row].reshape(-1, 2)
        move = phi[exact.j] - phi[exact.i]
        n = (exact.r / exact.distance[:, None]).astype(float)
        normal = np.mean(np.sum(n * move, axis=1) ** 2)
        transverse = np.mean((n[:, 0] * move[:, 1] - n[:, 1] * move[:, 0]) ** 2)
        sizes = np.sum(phi**2, axis=1)
        force = float(exact.K[:-1, -1].astype(float) @ vectors[:, row])
        assert modes.normal[row] == pytest.approx(normal, rel=1e-8)
        assert modes.transverse[row] == pytest.approx(transverse, rel=1e-8)
        assert modes.floppiness[row] == pytest.approx(np.sqrt(transverse / normal), rel=1e-8)
        assert modes.participation_ratio[row] == pytest.approx(1 / (len(sizes) * np.sum(sizes**2)), rel=1e-8)
        assert abs(modes.shear_force[row]) == pytest.approx(abs(force), rel=1e-7, abs=1e-10)
    check_contributions(modes, vectors, wanted, exact)


def check_contributions(modes, vectors, wanted, exact):
    """Shares are projections on the response that a dense solve gives; medians are those of sums of dense modes."""
    m, whole = len(modes.eigenvalues), exact.quasistatic()[0].astype(float)
    n, t = (exact.r / exact.distance[:, None]).astype(float), np.empty((len(exact.r), 2))
    t[:, 0], t[:, 1] = -n[:, 1], n[:, 0]

    def motions(u):
        move = u.reshape(-1, 2)[exact.j] - u.reshape(-1, 2)[exact.i]
        return {
            "normal": np.sum(n * move, axis=1),
            "transverse": np.sum(t * move, axis=1),
            "nonaffine": u.ravel(),
        }

    force = exact.K[:-1, -1].astype(float) @ vectors
    parts = -(force / wanted) * vectors
    contributions, target, each = modes.contributions, motions(whole), [motions(part) for part in parts.T]
    shares = {name: [one[name] @ of / (of @ of) for one in each] for name, of in target.items()}
    shares["modulus"] = force**2 / wanted / np.sum(force**2 / wanted)
    for name, share in shares.items():
        np.testing.assert_allclose(contributions.share[name], share[:m], rtol=1e-6, atol=1e-8, err_msg=name)
        assert sum(share) == pytest.approx(1.0, abs=1e-7)
    for name, axis in (("normal", n), ("transverse", t)):
        total = target[name] + axis[:, 0] * exact.r[:, 1].astype(float)
        assert contributions.whole[name] == pytest.approx(np.median(np.abs(total)), rel=1e-7)
    assert contributions.count.tolist() == [count for count in LOWEST if count <= m]
    for row, count in enumerate(contributions.count):
        alone = motions(parts[:, :count].sum(axis=1))
        alone["nonaffine"] = np.hypot(*alone["nonaffine"].reshape(-1, 2).T)
        for name, values in alone.items():
            assert contributions.median[name][row] == pytest.approx(np.median(np.abs(values)), rel=1e-6), name
    if not modes.network.prestress and np.ptp(modes.network.contacts.stiffness) == 0:
        np.testing.assert_allclose(contributions.share["normal"], contributions.share["modulus"], rtol=1e-7)


@pytest.mark.usefixtures("converged")
@pytest.mark.parametrize("make", on_ranks((SAMPLES["polydisperse"], wide, few_spheres), (wide, few_spheres)))
def test_masses_by_volume_against_dense(session, make):
    """Kφ = λMφ, few modes by SLEPc and all by LAPACK, with shares of ũᵀMũ, and exact counts of states."""
    disks = make()
    exact, masses = Reference(disks, physics("stokes")), Masses(1.0, BY_VOLUME)
    network = build_network(disks, session.comm, masses=masses)
    D, rows = disks.dimension, unknowns(network, disks.dimension, exact.disks)
    K = exact.K[:-1, :-1].astype(float)[np.ix_(rows, rows)]
    M = np.diag(np.repeat((2 * network.radii / network.diameter) ** D, D))
    wanted = eigh(K, M, eigvals_only=True)[D:]
    for count in (3, len(wanted)):
        modes = lowest_modes(network, count)
        found = vectors_of(modes)
        np.testing.assert_allclose(modes.eigenvalues, wanted[:count], rtol=1e-9)
        np.testing.assert_allclose(found.T @ M @ found, np.eye(count), rtol=0, atol=1e-9)
        assert np.abs(K @ found - M @ found * modes.eigenvalues).max() < 1e-9 * wanted[-1]
        energies = np.sum((np.sqrt(np.diag(M))[:, None] * found).reshape(-1, D, count) ** 2, axis=1)
        np.testing.assert_allclose(modes.participation_ratio, 1 / np.sum(energies**2, axis=0) / network.n)
    assert modes.complete and modes.contributions.share["nonaffine"].sum() == pytest.approx(1.0, abs=1e-8)
    assert modes.contributions.share["modulus"].sum() == pytest.approx(1.0, abs=1e-8)
    edges = np.geomspace(0.9 * np.sqrt(wanted[0]), 0.7 * np.sqrt(wanted[-1]), 5)
    counts = count_between(network, edges)
    np.testing.assert_array_equal(counts.counts, np.histogram(np.sqrt(wanted), edges)[0])
    assert counts.below == 0 and counts.above + counts.counts.sum() == len(wanted)


@pytest.mark.most_ranks(1)
def test_all_below(session):
    wanted, vectors, exact = spectrum("polydisperse")
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    for count in (15, 1):
        modes = lowest_modes(network, below=float(0.5 * (wanted[count - 1] + wanted[count])))
        assert len(modes.eigenvalues) == count
        check(modes, wanted, vectors, exact)


@pytest.mark.most_ranks(1)
def test_a_mode_that_was_missed_is_found(session, monkeypatch):
    """The list loses a mode: the count tells, and it is looked for beside the others."""
    calls = []

    def forgetful(*args, **words):
        pairs = eigen.lowest(*args, **words)
        calls.append(words.get("excluded"))
        return pairs[np.arange(len(pairs.values)) != (4 if len(calls) == 1 else -1)]

    monkeypatch.setattr("jampetsc.response.vibrations.lowest", forgetful)
    wanted, vectors, exact = spectrum("polydisperse")
    modes = lowest_modes(build_network(SAMPLES["polydisperse"](), session.comm), 9)
    assert len(calls) > 1 and calls[-1] is not None
    check(modes, wanted, vectors, exact)


@pytest.mark.usefixtures("converged")
@pytest.mark.most_ranks(2)
def test_planted_floppy_mode(session):
    """2n − 1 contacts, all of them needed: the first that goes takes the self-stress along, the second leaves
    a floppy mode.

    That mode costs nothing and only slides; the modes above it are ordinary.
    """
    network = build_network(SAMPLES["isostatic"](), session.comm, prestress=False)
    assert network.contact_count == 2 * network.n - 1
    contacts = pairs_of(network)
    degree = np.bincount(np.array(contacts).ravel(), minlength=network.n)
    free = [pair for pair in contacts if (degree[list(pair)] > 3).all()]
    one = lowest_modes(cut(network, free[:1]), 3)
    assert one.eigenvalues[0] > 1e-6
    floppy = cut(network, [free[0], free[-1]])
    modes = lowest_modes(floppy, 3)
    assert abs(modes.eigenvalues[0]) < 1e-13 and modes.eigenvalues[1] > 1e-6
    assert modes.normal[0] < 1e-20 and modes.transverse[0] > 1e-3
    assert modes.floppiness[0] > 1e8 and modes.floppiness[1] < 1e3
    assert modes.contributions is None
    assert abs(modes.shear_force[0]) < 1e-10
    with pytest.raises(InputError, match="K has 1 floppy mode besides its translations"):
        ElasticResponse(floppy)


@pytest.mark.most_ranks(1)
def test_how_exact_and_how_different_modes_must_be(session, monkeypatch):
    """Residuals of 1e-9 in units of the stiffness; products and lengths to 1e-6."""
    network = build_network(published().replace(potential=Potential(k=2.5)), session.comm)
    right = lowest_modes(network, 3)
    lowest = eigen.lowest
    for size, stretch, rows, said in (
        (0.99, 0.45e-6, None, None),
        (1.01, 0.0, None, r"a mode has a residual of 2.5e-09: tighten"),
        (0.0, 0.55e-6, None, "modes are not orthonormal, but for 1.1e-06"),
        (0.0, 0.0, [0, 1, 1], "modes are not orthonormal, but for 1.0e"),
        (0.0, np.nan, None, "modes are not orthonormal, but for nan"),
    ):

        def rough(*args, size=size, stretch=stretch, rows=rows, **words):
            pairs = lowest(*args, **words)[rows or slice(None)]
            worse = np.full(len(pairs.values), 2.5e-9 * size)
            return replace(pairs, residuals=worse, vectors=(1.0 + stretch) * pairs.vectors)

        monkeypatch.setattr(modes_module, "lowest", rough)
        if said is None:
            np.testing.assert_allclose(lowest_modes(network, 3).eigenvalues, right.eigenvalues, rtol=1e-6)
        else:
            with pytest.raises(ConvergenceError, match=said):
                lowest_modes(network, 3)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("beyond", [-1, 1])
def test_a_count_that_never_agrees_is_an_error(session, monkeypatch, beyond):
    """Too few below, or too many: either way modes are not what they are said to be."""
    count = modes_module.count_below
    monkeypatch.setattr(modes_module, "count_below", lambda *given: count(*given) + beyond)
    network = build_network(SAMPLES["polydisperse"](), session.comm)
    with pytest.raises(ConvergenceError, match="their count does not agree with inertia"):
        lowest_modes(network, 5)


@pytest.mark.most_ranks(1)
def test_where_a_cluster_ends():
    """Just above it, if the next value is farther than 1e-7 relatively and than rounding; else with it."""
    apart, together = 1.0 + 1.5e-7, 1.0 + 0.5e-7
    for values, count, there, wanted in (
        ([0.5, 1.0, apart], 2, 9, (2, 0.5 * (1.0 + apart))),
        ([0.5, 1.0, together, 2.0], 2, 9, (3, 0.5 * (together + 2.0))),
        ([0.5, 1.0, together], 2, 9, (None, None)),
        ([0.5, 1.0, together], 2, 3, (3, together)),
        ([1e-13, 4e-13, 1.0], 1, 9, (2, 0.5 * (1.0 + 4e-13))),  # nothing but rounding apart
        ([0.5, 1.0], 2, 9, (None, None)),
    ):
        assert modes_module.find_cluster_end(np.array(values), count, there, 1.0) == pytest.approx(
            wanted, rel=1e-15
        )
    assert modes_module.find_cluster_end(np.array([1e-6, 4e-6]), 1, 9, 1e7) == (
        None,
        None,
    )  # in units of the stiffness


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("count", [1, 5, 12])
def test_clusters_are_kept_whole(session, count):
    """In a crystal; where a shear moves every disk with the cell, so that there is nothing for modes to share."""
    network = build_network(crystal(), session.comm)
    every = lowest_modes(network)
    modes = lowest_modes(network, count=count)
    m = len(modes.eigenvalues)
    assert m >= count and modes.contributions is None
    assert np.abs(modes.shear_force).max() < 1e-12
    np.testing.assert_allclose(modes.eigenvalues, every.eigenvalues[:m], rtol=1e-10)
    assert every.eigenvalues[m] - every.eigenvalues[m - 1] > 1e-6
    assert every.eigenvalues[count - 1] == pytest.approx(every.eigenvalues[m - 1], rel=1e-10)
    assert modes.inertia_count == m
    found = vectors_of(modes)
    np.testing.assert_allclose(found.T @ found, np.eye(m), rtol=0, atol=1e-10)


def test_each_piece_has_its_translations(session):
    """Two strips that do not touch, without pre-stress: four moves of no cost, and the rest as dense says."""
    exact = Reference(strips(), physics(prestress=False, beta=0.0))
    values = np.linalg.eigvalsh(exact.K[:-1, :-1].astype(float))
    zeros = int(np.sum(np.abs(values) < 1e-12))
    modes = lowest_modes(build_network(strips(), session.comm, prestress=False), 8)
    found = modes.eigenvalues
    np.testing.assert_allclose(found, values[4 : 4 + len(found)], rtol=1e-9, atol=1e-13)
    assert int(np.sum(np.abs(found) < 1e-12)) == min(zeros - 4, 8)


@pytest.mark.most_ranks(2)
def test_modes_without_eigenvectors_have_all_their_numbers(session, shared_path):
    """What needs eigenvectors refuses the file in one line; pictures of numbers take it."""
    path, out = shared_path / "p.h5", shared_path / "bare.h5"
    if session.comm.rank == 0:
        write_packing(path, SAMPLES["published"]())
    session.comm.barrier()
    jampetsc.modes(path, all=True, eigenvectors=False, out=out)
    bare, whole = jampetsc.load(out), jampetsc.modes(path, all=True)
    assert set(whole) - set(bare) == {"modes"}
    for name in PER_MODE:
        np.testing.assert_allclose(bare[name], whole[name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert bare.attributes["complete"]
    if session.size > 1:
        return
    for draw_or_export in (
        lambda: jampetsc.plot(bare, "mode", packing=path),
        lambda: jampetsc.plot(bare, mode=[2], packing=path),
        lambda: jampetsc.export(out, mode=2, out=shared_path / "mode.xyz"),
    ):
        with pytest.raises(
            InputError, match=r"bare\.h5: modes without eigenvectors\. Run modes again with them"
        ):
            draw_or_export()
    for kind in ("modes", "states", "participation"):
        jampetsc.plot(bare, kind)

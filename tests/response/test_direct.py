"""G*(ω) frequency by frequency: published values, the dense reference, and a bound that is never exceeded."""

from dataclasses import replace

import numpy as np
import pytest
from dense import Reference, without
from samples import (
    LAWS,
    ORACLE,
    SAMPLES,
    lattice,
    laws_of,
    modulus,
    network_of,
    physics,
    published,
    put,
    reference,
    sweep_of,
)
from sweeps import Sweep, errors
from whole_arrays import dense, unknowns

import jampetsc
from jampetsc.errors import ConvergenceError
from jampetsc.io.outlet import Outlet
from jampetsc.io.reader import load
from jampetsc.io.request import Request
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.packing.packing import Packing, with_proof
from jampetsc.petsc.cholesky import least_singular_value
from jampetsc.response import direct_sweep
from jampetsc.response.assembly import assemble
from jampetsc.response.certificate import SingularBound
from jampetsc.response.direct import FrequencySolver

pytestmark = pytest.mark.scalar("complex", "real")

OMEGA = (1e-10, 1e-6, 1e-3, 1.0, 1e3)


def solver_of(disks, physics, comm, positive=False):
    """The FrequencySolver of these disks. Collective."""
    return FrequencySolver(assemble(network_of(disks, physics, comm), physics.law), positive)


def compare(found, wanted, accuracy, what):
    """G' and G'' each within `accuracy`, and within their bounds."""
    error, size = errors(np.array([found.G]), [wanted])
    assert np.all(error <= found.bounds), what
    assert np.all(error[:, 1:] <= accuracy * size[:, 1:]), what


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("case", ORACLE["cases"], ids=lambda case: case["case"])
def test_published_moduli(session, case):
    """Nine laws at eleven frequencies in 50-digit arithmetic; printed to 14 digits. By both methods."""
    parameters = dict(case["parameters"])
    law, omegas = physics(parameters.pop("law"), **parameters), case["omega"]
    solver = solver_of(published(), law, session.comm)
    found = [(np.array([solver.solve(omega, 1e-9).G for omega in omegas]), 1e-12)]
    if session.scalar_type == "real":
        sweep = Sweep(published(), law, omegas, 1e-10, session.comm).solved()
        found.append((sweep.G, 1e-10))
    for G, rtol in found:
        np.testing.assert_allclose(G.real, case["G_storage"], rtol=rtol)
        np.testing.assert_allclose(G.imag, case["G_loss"], rtol=rtol)


@pytest.mark.parametrize("sample", SAMPLES)
def test_against_the_dense_reference(session, sample):
    """Also of packings that are no minima: K may have negative modes, the solve does not mind."""
    # sliding rows of the gears hardly resist without pre-stress: G' is 1e-7 of the affine modulus there
    accuracy = 1e-8 if sample == "gears" else 1e-10
    omegas = OMEGA if session.size == 1 else (1e-6, 1.0)  # ranks that share a factor take long
    for law in laws_of(sample, session.size):
        solver = solver_of(SAMPLES[sample](), LAWS[law], session.comm)
        for omega in omegas:
            found = solver.solve(omega, 1e-6)
            compare(found, modulus(sample, law, omega), accuracy, (law, omega))


@pytest.mark.parametrize("name", [str(physics()), str(physics("stokes"))])
def test_field(session, name):
    """x is the non-affine motion per unit strain, up to moves that cost nothing: translations, but for drag."""
    law, exact = LAWS[name], reference("strips", name)
    solver = solver_of(SAMPLES["strips"](), law, session.comm)
    solver.solve(0.1, 1e-6)
    x = np.concatenate(session.comm.allgather(solver.x))
    rows = unknowns(solver.pencil.network, law.law.dofs(2), exact.disks)
    wanted = exact.solution(0.1)[0][rows]
    difference = x - wanted if law.law.drag else without(exact.free_moves()[rows], x - wanted)
    np.testing.assert_allclose(difference.astype(complex), 0, atol=1e-10 * float(np.abs(wanted).max()))


@pytest.mark.most_ranks(2)
def test_disks_far_from_a_minimum(session):
    """Where they overlap by much pre-stress outweighs stiffness, even on the diagonal of K."""
    places = np.random.default_rng(3).uniform(0.0, 3.0, (16, 2))
    disks = Packing.from_positions(places, np.full(16, 0.5), 3.0 * np.eye(2))
    exact = Reference(disks, physics())
    assert np.diag(exact.K).min() < -1.0
    solver = solver_of(disks, physics(), session.comm)
    compare(solver.solve(1e-3, 1e-6), exact.modulus(1e-3), 1e-10, "far from a minimum")


# type of KSP, type of PC, tolerance, iterations; a second solver of each kind keeps its factor
HOSTILE = [
    ("preonly", "none", None, None),
    ("preonly", "jacobi", None, None),
    ("preonly", "bjacobi", None, None),
    ("richardson", "jacobi", 0.5, None),
    ("cg", "none", 0.1, None),
    ("gmres", "none", 0.9, 5000),
    ("gmres", "cholesky", None, 1),
    ("bcgs", "jacobi", 1e-2, 5000),
]


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("sample, positive", [("published", True), ("two images", False)])
@pytest.mark.parametrize("hostile", HOSTILE, ids=str)
def test_no_solver_makes_a_bound_false(session, hostile, sample, positive):
    """Found or refused, G' and G'' of the last field are within their bounds, also at low ω and of no minimum."""
    if session.size > 1 and hostile not in HOSTILE[2:3]:
        return  # slow there, and no other than on one rank
    kind, pc, rtol, iterations = hostile
    for law in (physics(), physics("stokes")):
        solver = solver_of(SAMPLES[sample](), law, session.comm, positive)
        solver.ksp.setType(kind)
        solver.ksp.getPC().setType(pc)
        solver.ksp.setTolerances(rtol=rtol, max_it=iterations)
        solver.reuse = kind != "gmres"
        for omega in OMEGA:
            try:
                found = solver.solve(omega, 1e-2)
            except ConvergenceError:
                if solver.x is None or not (positive or solver.singular_bound.omega == omega):
                    continue
                found = solver.functional.certify(
                    solver.functional.trial(omega, solver.x), solver.singular_bound
                )
            else:
                assert positive or solver.singular_bound.omega == omega  # it serves at others only if K ≥ 0
            compare(found, modulus(sample, str(law), omega), np.inf, (law, omega))


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("law", [physics(), physics("stokes")], ids=str)
def test_a_singular_bound_holds(session, monkeypatch, law):
    """No r makes more of A⁻¹ than said, at its own frequency and, where K ≥ 0, at others.

    A poor solver has none, nor one whose residuals may be rounding.
    """
    solver = solver_of(published(), law, session.comm)
    K, B = dense(solver.pencil.K), dense(solver.pencil.B)
    free = np.delete(np.arange(len(K)), solver.pencil.pins)
    moves = 2 if law.law.drag else 0  # translations, along which no force is left

    def gain(omega, diagonal):
        A = (K + 1j * omega * B)[np.ix_(free, free)] / np.sqrt(np.outer(diagonal, diagonal))
        return 1.0 / np.linalg.svd(A, compute_uv=False)[-1 - moves]

    solver.solve(1.0, 1e-6)
    lower = solver.singular_bound
    diagonal = np.concatenate(session.comm.allgather(lower.diagonal))[free]
    exact = replace(lower, least=1.0 / gain(1.0, diagonal))
    assert 1e-4 * exact.least < lower.least <= exact.least
    for omega in (1e-3, 1.0, 30.0):
        assert gain(omega, diagonal) <= 1.000001 * exact.reach(omega)
    poor = solver_of(published(), law, session.comm)
    poor.ksp.setType("preonly")
    poor.ksp.getPC().setType("none")
    with pytest.raises(ConvergenceError, match="only known to"):
        poor.solve(1.0, 1e-6)
    assert poor.singular_bound.least == 0.0
    blurred = solver_of(published(), law, session.comm)
    monkeypatch.setattr(blurred.functional, "rounding", lambda *_: 1.0)
    with pytest.raises(ConvergenceError, match="only known to"):
        blurred.solve(1.0, 1e-6)
    assert blurred.singular_bound.least == 0.0


@pytest.mark.most_ranks(1)
def test_a_singular_bound_reaches_softer_motions_at_lower_frequencies(session):
    """With K = 0 what a force makes of A⁻¹ grows as 1/ω; with B = 0 it does not change, while D does."""
    for K, B in ((0.0, 2.0), (3.0, 0.0), (1e-3, 1.0)):
        for at in (1e-2, 1.0, 50.0):
            diagonal = K + at * B
            lower = SingularBound(at, np.array([diagonal]), abs(K + 1j * at * B) / diagonal)
            assert lower.reach(at) == pytest.approx(diagonal / abs(K + 1j * at * B), rel=1e-14)
            for omega in (1e-6, 1e-2, 0.5, 1.0, 2.0, 1e4):
                assert diagonal / abs(K + 1j * omega * B) <= lower.reach(omega) * (1 + 1e-12)
    assert (
        SingularBound(1.0, np.ones(1), 0.0).reach(2.0)
        == SingularBound(1.0, np.ones(1), float("nan")).reach(1.0)
        == np.inf
    )


def test_least_singular_value_is_a_lower_bound():
    """Of a matrix whose smallest singular value belongs to u = (1, i)/√2, and is found with its conjugate only."""
    u = np.array([[1.0, 1.0], [1j, -1j]]) / np.sqrt(2.0)
    for least in (1e-2, 1e-6, 1e-10):
        A = u @ np.diag([least, 1.0]) @ u.T
        generator = np.random.default_rng(3)

        def step(x, A=A):
            y = np.linalg.solve(A, x)
            return y, 1e-12, float(np.linalg.norm(y))

        found = least_singular_value(lambda g=generator: g.standard_normal(4).view(complex), step)
        assert 1e-3 * least < found <= least


@pytest.mark.most_ranks(1)
def test_what_is_asked_is_what_is_certified(session):
    """Of G'' as well, which sliding rows of gears without pre-stress leave 1e-10 of nothing."""
    refused, law = 0, physics(prestress=False)
    solver = solver_of(SAMPLES["gears"](), law, session.comm)
    for accuracy in np.geomspace(1e-4, 1e-10, 4):
        try:
            found = solver.solve(1e-10, accuracy)
        except ConvergenceError:
            refused += 1
        else:
            assert found.bounds[1] <= accuracy * found.G.real and found.bounds[2] <= accuracy * found.G.imag
    assert 0 < refused < 4


@pytest.mark.most_ranks(2)
def test_a_singular_bound_is_renewed_where_it_is_too_coarse(session):
    """Fourteen decades further on: the bound is as small as it was."""
    solver = solver_of(published(), physics(), session.comm, True)
    for omega in (1e-10, 1e-9, 1e8):
        found = solver.solve(omega, 1e-3)
        assert max(found.bounds[1] / found.G.real, found.bounds[2] / found.G.imag) < 1e-11
        assert solver.singular_bound.omega == (1e-10 if omega < 1.0 else omega)
    trial = solver.functional.trial(1e8, solver.x)
    unseen = solver.functional.certify(replace(trial, left=0.0 * trial.left), solver.singular_bound)
    assert 0.0 < unseen.error <= found.error  # what rounding hides of the residual counts


@pytest.mark.most_ranks(2)
def test_the_bound_of_a_wrong_field(session):
    """Of a field that is off by noise the bound is never less than the error, and like it of second order."""
    law, omega = str(physics()), 0.01
    exact = modulus("published", law, omega)
    solver = solver_of(published(), LAWS[law], session.comm)
    solver.solve(omega, 1e-10)
    right = solver.x
    noise = np.random.default_rng(session.rank).normal(size=(2, len(right)))
    pins = solver.pencil.pins - solver.pencil.K.getOwnershipRange()[0]
    noise[:, pins[(pins >= 0) & (pins < noise.shape[1])]] = 0.0
    bounds = []
    for size in (1e-1, 1e-3, 1e-5):
        trial = solver.functional.trial(omega, right + size * (noise[0] + 1j * noise[1]))
        found = solver.functional.certify(trial, solver.singular_bound)
        error = abs(found.G - exact)
        assert error <= found.bounds[0]
        bounds.append(found.error / size**2)
    np.testing.assert_allclose(bounds, bounds[0], rtol=0.1)


@pytest.mark.most_ranks(2)
def test_what_cannot_be_solved_is_an_error(session):
    """On all ranks, where the solution of one is no number."""
    solver = solver_of(published(), physics(), session.comm)
    solver.ksp.setType("gmres")
    solver.ksp.getPC().setType("none")
    solver.ksp.setTolerances(max_it=2)
    with pytest.raises(ConvergenceError, match=r"ω = 0\.01: KSP stopped with DIVERGED_M"):
        solver.solve(0.01, 1e-6)
    solver.ksp.setType("preonly")
    with pytest.raises(ConvergenceError, match=r"ω = 0\.01: G' = .* only known to .* after refinement"):
        solver.solve(0.01, 1e-10)
    solve = solver.form.solve
    solver.form.solve = lambda *words: solve(*words) * (np.nan if session.rank == session.size - 1 else 1.0)
    with pytest.raises(ConvergenceError, match=r"ω = 0\.01: KSP returned NaN or Inf"):
        solver.solve(0.01, 1e-6)


@pytest.mark.most_ranks(1)
def test_disks_that_do_not_span_the_cell_resist_nothing(session):
    """Four that all touch each other: rounding is all that is left of G*, which was called ill-conditioned."""
    disks = jampetsc.Packing([[1, 1], [1.6, 1], [1, 1.6], [1.6, 1.6]], [0.5] * 4, 5.0)
    solver = solver_of(disks, physics(), session.comm)
    for omega in (1e-6, 1e3):
        with pytest.raises(
            ConvergenceError, match="G\\* is zero to rounding, where affine motion would have"
        ):
            solver.solve(omega, 1e-6)


@pytest.mark.most_ranks(2)
@pytest.mark.usefixtures("reporting")
def test_frequencies_that_fail_are_told_beside_the_others(session, shared_path, capfd):
    """Of G'' of gears too little is left at the lowest ones. Frequencies are those of the experiment throughout."""
    packing, omega = shared_path / "gears.h5", [1e-16, 1e-15, 1e-6, 1.0]
    put(packing, SAMPLES["gears"](), session.comm)

    def solve(name, omega, fields=()):
        how = {"alpha": 0.6, "stress": 1.0}
        job = sweep_of(packing, physics(prestress=False), omega, fields, "direct", 1e-10, **how)
        job.work(Outlet(shared_path / name, shared_path / name, Request(job)))
        session.comm.barrier()

    lowest = EquivalentDamping(0.6, 1.0).frequency(omega[0])
    first = rf"2 of 4 frequencies failed, the others are in .*some.h5; the first: ω = {lowest:g}:"
    with pytest.raises(ConvergenceError, match=first):
        solve("some.h5", omega, omega[1:3])
    assert (capfd.readouterr().err.count("failed: ω = ") == 2) == (session.rank == 0)
    with pytest.raises(ConvergenceError, match=rf"^ω = {lowest:g}: G' = .* only known to"):
        solve("none.h5", omega[:2])  # where all of them fail
    assert not (shared_path / "none.h5").exists()
    solve("all.h5", omega[2:])
    for name, failed in (("some.h5", omega[:2]), ("all.h5", [])):
        found = load(shared_path / name)
        np.testing.assert_allclose(found.omega, omega[2:], rtol=1e-12)
        np.testing.assert_allclose(found.G, load(shared_path / "all.h5").G, rtol=1e-9)
        np.testing.assert_allclose(found.attributes.get("failed_omega", []), failed, rtol=1e-12)
    assert np.all(found["error_bound_storage"] != found["error_bound_loss"])
    fields = load(shared_path / "some.h5")
    np.testing.assert_allclose(fields["fields/omega"], omega[2:3], rtol=1e-12)
    assert fields["fields/displacement"].shape[0] == fields["fields/error_bound"].shape[0] == 1


@pytest.mark.most_ranks(1)
def test_a_singular_bound_serves_elsewhere_only_where_K_is_known_to_have_no_negative_modes(
    session, monkeypatch
):
    told, make = [], FrequencySolver
    monkeypatch.setattr(
        direct_sweep, "FrequencySolver", lambda pencil, **how: told.append(how) or make(pencil, **how)
    )
    cases = [
        (published(), physics(), "direct", False),  # not known
        (published(), physics(prestress=False), "direct", True),  # by construction
        (with_proof(published()), physics(), "direct", True),
    ]
    if session.scalar_type == "real":  # modes are counted for the rational method, which has real scalars
        cases.append((lattice(), physics(), "rational", False))  # 14 negative modes
    for packing, law, method, _ in cases:
        sweep_of(packing, law, [1.0], method=method).work(Outlet())
    assert [how["positive_semidefinite"] for how in told] == [is_known for *_, is_known in cases]


@pytest.mark.most_ranks(2)
def test_a_factor_of_another_frequency_will_do(session):
    """With -freq_ksp_reuse_preconditioner a factor serves until it no longer converges."""
    law = str(physics())
    solver = solver_of(published(), LAWS[law], session.comm)
    solver.reuse = True
    solver.ksp.setType("gmres")
    solver.ksp.setTolerances(rtol=1e-8, max_it=30)
    grid = np.geomspace(1e-6, 1e2, 9)
    for omega in grid:
        compare(solver.solve(omega, 1e-9), modulus("published", law, omega), 1e-9, omega)
    assert 1 < solver.factorisations < len(grid)


def test_the_matrix_is_scaled_to_a_unit_diagonal(session):
    """At every frequency: angles are of order ω."""
    solver = solver_of(published(), physics(), session.comm)
    K, B = (np.diag(dense(matrix)) for matrix in (solver.pencil.K, solver.pencil.B))
    for omega in (1e-6, 1.0, 1e4):
        solver.form.set(omega)
        magnitude = np.concatenate(session.comm.allgather(solver.form.magnitude))
        np.testing.assert_allclose(magnitude, np.abs(K + 1j * omega * B), rtol=1e-14)

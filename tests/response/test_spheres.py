"""Linear response in three dimensions against the dense reference, on any number of ranks."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from dense import Reference
from samples import TABLE_LAWS, TENSOR_TABLE, errors_of, on_ranks, physics, put, sizes_of, table_tensor
from samples import network_of as build
from scipy.linalg import null_space
from spheres import SPHERES, bidisperse, few_spheres
from whole_arrays import dense, unknowns, whole

import jampetsc
from jampetsc.errors import InputError
from jampetsc.laws.loads import symmetric_loads
from jampetsc.laws.relative_motion import transverse_axes
from jampetsc.packing.contacts import measure
from jampetsc.packing.spring_network import Network
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor, shifted
from jampetsc.response import factor_memory, shift_factors
from jampetsc.response.assembly import ROW, assemble
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.modulus_sweep import sweep_rationally
from jampetsc.response.shift_factors import Factors
from jampetsc.response.slow_response import infinite_viscosity, solve_quasistatic

LOADS = symmetric_loads(3)
TABLE = TENSOR_TABLE[3]
CUSTOM = physics("custom", normal=0.5, transverse=0.3, sliding=0.7, drag=0.2, eta_f=0.4, prestress=False)
LAWS = {
    str(one): one
    for one in (physics(beta=0.3), physics(rotations=False), physics("stokes", eta_f=0.4), CUSTOM)
}
GEARS = str(physics(beta=0.3, prestress=False))  # for a lattice that is no minimum
LAWS[GEARS] = physics(beta=0.3, prestress=False)
OMEGA = np.geomspace(1e-3, 10.0, 4)


@cache
def reference(sample, law):
    return Reference(SPHERES[sample](), LAWS[law], [load.gradient for load in LOADS])


@cache
def exact_tensor(sample, law):
    return np.array([reference(sample, law).tensor(omega).astype(complex) for omega in OMEGA])


def pencil_of(sample, law):
    return assemble(build(SPHERES[sample](), LAWS[law], current().comm), LAWS[law].law)


def test_transverse_axes_are_right_handed():
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(50, 3))
    normal = np.vstack((normal / np.linalg.norm(normal, axis=1)[:, None], np.eye(3), -np.eye(3)))
    first, second = transverse_axes(normal)
    frames = np.stack((first, second, normal), axis=1)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (56, 1, 1)), atol=4e-16)
    np.testing.assert_allclose(np.cross(first, second), normal, atol=4e-16)


@pytest.mark.scalar("real", "complex")
@pytest.mark.parametrize("sample", on_ranks(SPHERES, ("few", "body-centred")))
def test_matrices_and_borders(session, sample):
    """K, B, their borders and corners for all loads; pinned moves are those that cost nothing."""
    for law in LAWS:
        pencil, exact = pencil_of(sample, law), reference(sample, law)
        rows = unknowns(pencil.network, exact.dofs, exact.disks)
        free = np.delete(np.arange(len(rows)), pencil.pins)
        for name, border, corner in (("K", "k_gamma", "k_gg"), ("B", "b_gamma", "b_gg")):
            wanted = getattr(exact, name).astype(float)
            about = {"rtol": 0, "atol": 1e-13 * np.abs(wanted).max(), "err_msg": f"{name}, {law}"}
            found = dense(getattr(pencil, name))
            np.testing.assert_allclose(
                found[np.ix_(free, free)], wanted[np.ix_(rows, rows)][np.ix_(free, free)], **about
            )
            for number, load in enumerate(LOADS):
                loaded = pencil.under(load)
                column = wanted[rows, len(rows) + number]
                np.testing.assert_allclose(whole(getattr(loaded, border))[free], column[free], **about)
                assert getattr(loaded, corner) == pytest.approx(
                    wanted[len(rows) + number, len(rows) + number]
                )
        if not LAWS[law].law.drag:
            moves = exact.free_moves()[rows].astype(float)
            assert moves.shape[1] == len(pencil.pins) == np.linalg.matrix_rank(moves[pencil.pins])
        matrix = exact.B.astype(float)[: len(rows), : len(rows)]
        assert np.linalg.norm(matrix, 2) <= ROW[3] * np.diag(matrix).max()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("s", [1e-6, 1.0])
@pytest.mark.parametrize("sample", ["few", "body-centred"])
def test_the_shift_bound_under_drag_on_spheres_that_roll(session, sample, s):
    """K + sB ≥ μ apart from translations, which are its eigenvectors with s kτ₁ drag whatever spins are pinned."""
    law = physics("custom", normal=0.5, transverse=0.3, sliding=0.7, drag=1e-6, prestress=False).law
    network = build(SPHERES[sample](), LAWS[GEARS], session.comm)
    pencil = assemble(network, law)
    A = dense(pencil.K) + s * dense(pencil.B)
    moves = np.kron(np.ones((len(A) // 6, 1)), np.eye(6, 3))
    np.testing.assert_allclose(A @ moves, s * network.damping(law) * law.drag * moves, atol=1e-14)
    others = null_space(moves.T)
    least = np.linalg.eigvalsh(others.T @ A @ others)[0]
    factors = Factors(pencil, "matrix")
    factors.factorise([s])
    assert 1e-3 * least < factors.least_eigenvalue(s) <= least


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("sample, law", [("few", law) for law in LAWS] + [("hertzian", next(iter(LAWS)))])
def test_the_tensor_and_its_bounds(session, sample, law):
    """Both methods, as close as their bounds say, far above rounding and near it."""
    pencil, expected = pencil_of(sample, law), exact_tensor(sample, law)
    size = np.abs(expected).max()
    for accuracy in (1e-2, 1e-6):
        found = sweep_rationally(pencil, OMEGA, accuracy, LOADS).tensor
        assert np.all(errors_of(found.C - expected) <= found.bounds + 1e-14 * sizes_of(expected))
        assert found.bounds.max() <= accuracy * size
    found = sweep_directly(pencil, OMEGA, 1e-9, LOADS, positive_semidefinite=True).tensor
    assert (
        np.all(errors_of(found.C - expected) <= found.bounds + 1e-14 * sizes_of(expected))
        and found.bounds.max() <= 1e-9 * size
    )


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "sample, law",
    [
        pytest.param("few", law, marks=() if law == next(iter(LAWS)) else pytest.mark.most_ranks(1))
        for law in LAWS
    ]
    + [("body-centred", GEARS)],
)
def test_quasistatic_motion_and_viscosities(session, sample, law):
    pencil, exact = pencil_of(sample, law), reference(sample, law)
    network, (load, number) = pencil.network, (LOADS[3], 3)
    found = solve_quasistatic(network, LAWS[law].law, load=load, tensor=LOADS)
    response = found.responses[""]
    field, G0 = exact.quasistatic(number)
    particles = np.concatenate(network.comm.allgather(network.particles)).tolist()
    nonaffine = np.concatenate(network.comm.allgather(response.nonaffine))
    np.testing.assert_allclose(
        nonaffine[np.argsort(particles)], field.astype(float), atol=1e-9 * np.abs(field).max()
    )
    assert response.G0 == pytest.approx(G0, rel=1e-9)
    assert response.eta0 == pytest.approx(exact.eta0(number), rel=1e-8)
    assert found.eta_inf == pytest.approx(exact.eta_infinity(number), rel=1e-8)
    sums = [network.sum(np.sum(w * motion**2)) for w, motion in zip(
        (network_weights(network)), (response.normal, response.transverse), strict=True)]  # fmt: skip
    assert sum(sums) / network.volume == pytest.approx(G0, rel=1e-9)
    assert np.all(response.transverse >= 0.0)


def network_weights(network):
    """k and −f/r of the contacts with i < j."""
    once = network.contacts[network.contacts.i < network.contacts.j]
    return once.stiffness, -once.force_per_length * network.prestress


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_results_in_files(session, shared_path):
    """Arrays have three components, also where ranks write parts of them; they are read as their formats declare."""
    packing, law = few_spheres(), LAWS[next(iter(LAWS))].law
    path = put(shared_path / "p.h5", packing, session.comm)
    options = {
        "sweep": {"omega": OMEGA, "fields": OMEGA[:1], "load": "xz"},
        "quasistatic": {"load": "tensor"},
    }
    for command, more in options.items():
        out = shared_path / f"{command}.h5"
        getattr(jampetsc, command)(path, law, **more, out=out)
        session.comm.barrier()
        result = jampetsc.load(out)
        held = getattr(jampetsc, command)(packing, law, **more)
        assert result.attributes["dimension"] == 3
        for name in held:
            if result[name].shape == held[name].shape:  # held are only rows of this rank
                np.testing.assert_allclose(result[name], held[name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert result["C0"].shape == (6, 6) and result["contacts/bonds"].shape[1] == 3
    sweep, slow = jampetsc.load(shared_path / "sweep.h5"), result
    assert sweep.fields.displacement[0].shape == slow["nonaffine"].shape == (14, 3)
    assert sweep.fields.rotation[0].shape == slow["rotation"].shape == (14, 3)
    np.testing.assert_array_equal(sweep.shear_modulus, sweep.G)
    modes = jampetsc.modes(packing, all=True, load="tensor")
    network = Network.of_packing(packing)
    np.testing.assert_allclose(
        jampetsc.modes(network, all=True)["eigenvalues"], modes["eigenvalues"], rtol=1e-11
    )
    assert modes["modes"].shape[::2] == (39, 3) and modes["tensor/force"].shape == (39, 6)
    np.testing.assert_allclose(modes["tensor/modulus"].sum(axis=0), 1.0, rtol=1e-9)
    for name in ("nonaffine", "normal", "transverse", "modulus"):
        assert modes[f"share/{name}"].sum() == pytest.approx(1.0, rel=1e-9)
    if session.size == 1:
        # a∥² and the square of both transverse components are all of the motion of a contact
        contacts, rows = measure(packing).contacts, np.argsort(modes["particles"])
        apart = modes["modes"][:, rows][:, contacts.j] - modes["modes"][:, rows][:, contacts.i]
        squares = np.sum(apart**2, axis=2).mean(axis=1)
        np.testing.assert_allclose(modes["normal"] + modes["transverse"], squares, rtol=1e-9)
    few = jampetsc.modes(packing, count=5)
    np.testing.assert_allclose(few["eigenvalues"], modes["eigenvalues"][: len(few["eigenvalues"])], rtol=1e-9)
    matrices = jampetsc.assemble(packing, law).to_scipy()
    assert set(matrices.dofs[:, 1].tolist()) == set(range(6)) and len(matrices.pins) == 3


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_the_network_of_a_packing_responds_alike(session):
    packing, law = few_spheres(), LAWS[next(iter(LAWS))]
    network = assemble(build(Network.of_packing(packing), law, session.comm), law.law)
    found = sweep_directly(network, OMEGA, 1e-9, LOADS).tensor.C
    np.testing.assert_allclose(found, exact_tensor("few", str(law)), rtol=0, atol=1e-11 * np.abs(found).max())


@pytest.mark.scalar("real")
@pytest.mark.parametrize("law", on_ranks(TABLE["laws"], ("contact beta=0.1",)))
def test_moduli_of_an_independent_program(session, law):
    """The table of the first of jax-md's packings, to 1e-9 of the largest constant, with bounds that hold."""
    pencil = assemble(build(bidisperse()[0], TABLE_LAWS[law], session.comm), TABLE_LAWS[law].law)
    omega, expected = np.array(TABLE["omega"]), table_tensor(3, law)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    found = sweep_rationally(pencil, omega, 1e-6, LOADS).tensor
    assert np.all(errors_of(found.C - expected) <= found.bounds + 1e-13 * sizes_of(expected))
    simple = sweep_directly(pencil, omega[::2], 1e-9)
    np.testing.assert_allclose(simple.G, (np.array(TABLE["laws"][law]["shear"]) @ [1, 1j])[::2], rtol=1e-9)
    found = sweep_directly(pencil, omega[1:3], 1e-9, LOADS).tensor
    assert np.all(np.abs(found.C - expected[1:3]) <= 1e-9 * size[1:3])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_energies_stresses_and_constants_published_with_jaxmd(session):
    """All ten packings; constants xxxx, yyyy, zzzz, yzyz, … of their file, in the order of `constants`."""
    for index in range(10):
        packing, record = bidisperse(index)
        state = measure(packing)
        assert state.energy == pytest.approx(record["Energy"], rel=1e-8)
        np.testing.assert_allclose(state.stress.ravel(), record["Stress"], rtol=1e-7, atol=1e-9)
        network = build(packing, physics(), session.comm)
        C = solve_quasistatic(network, physics().law, tensor=LOADS).tensors[""].C0
        voigt = {"xx": 0, "yy": 1, "zz": 2, "yz": 3, "xz": 4, "xy": 5}
        found = [C[voigt[name[:2]], voigt[name[2:]]] for name in TABLE["constants"]]
        np.testing.assert_allclose(found, record["Cijkl"], rtol=0, atol=1e-8 * np.abs(C).max())


@pytest.fixture
def option(session):
    """option("name value"): give PETSc this option until the test ends."""
    database, names = session.PETSc.Options(), []

    def give(text):
        session.forget_defaults()  # which would count as defaults even when given
        name, value = text.split()
        names.append(name)
        database.setValue(name, value)

    yield give
    for name in names:
        database.delValue(name)


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "sample, law",
    [
        pytest.param("few", next(iter(LAWS)), marks=pytest.mark.most_ranks(1)),
        pytest.param("few", str(CUSTOM), marks=pytest.mark.most_ranks(1)),
        ("body-centred", GEARS),
    ],
)
def test_a_factor_of_displacements_alone(session, option, sample, law):
    """Few iterations at any shift; energies, least eigenvalues and the sweep are those of the whole matrix."""
    option("shift_fieldsplit_spin_pc_type sor")
    pencil = pencil_of(sample, law)
    projected, row = LAWS[law].law.holds_translations, whole(pencil.k_gamma)
    for s in (1e-8, 1e2):
        matrix = shifted(pencil.K, pencil.B, s)
        A = dense(matrix)
        factor = ShiftedFactor(matrix, "A", pencil.project if projected else None, pencil.spins)
        e, left = factor.energy(pencil.k_gamma)
        assert e == pytest.approx(row @ np.linalg.lstsq(A, row, rcond=1e-12)[0], rel=1e-9)
        ksp, diagonal = factor.cholesky.ksp, 1.0 if projected else np.sqrt(np.diag(A))
        assert 0 < ksp.getIterationNumber() < 50 and 0.0 < left < 1e-10
        spins, moves = ksp.getPC().getFieldSplitSubKSP()
        assert spins.getOperators()[1].size == moves.getOperators()[1].size == (len(A) // 2, len(A) // 2)
        wanted = np.linalg.eigvalsh(A / np.outer(diagonal, diagonal) if not projected else A)
        assert factor.least_eigenvalue() <= wanted[3 if projected else 0] * (1.0 + 1e-12)
        assert not factor.prove() and "cg is not preonly" in factor.cholesky.doubt
    found, expected = (
        sweep_rationally(pencil.under(LOADS[0]), OMEGA, 1e-6),
        exact_tensor(sample, law)[:, 0, 0],
    )
    assert np.all(np.abs(found.G - expected) <= found.bounds[:, 0] + 1e-14 * np.abs(expected))
    assert np.all(found.bounds[:, 0] <= 1e-6 * np.abs(expected))
    fastest = infinite_viscosity(pencil.under(LOADS[0]))
    assert fastest == pytest.approx(reference(sample, law).eta_infinity(0), rel=1e-8)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_spins_are_split_off_large_matrices_alone(session, option, monkeypatch):
    """By their size, unless options choose; a factor that breaks down says that K has negative modes."""
    law = next(iter(LAWS))
    pencil, wrong = pencil_of("few", law), pencil_of("body-centred", law)
    assert not shift_factors.splits_spins(pencil) and shift_factors.factored_unknowns(pencil) == 84
    ratio = shift_factors.bytes_of_factor(pencil)
    monkeypatch.setattr(shift_factors, "MIN_SPLIT_UNKNOWNS", 84)
    assert shift_factors.splits_spins(pencil) and shift_factors.factored_unknowns(pencil) == 42
    assert ratio / shift_factors.bytes_of_factor(pencil) == pytest.approx(4.0)  # blocks of 6 × 6, 3 × 3
    assert not shift_factors.splits_spins(pencil_of("few", str(physics(rotations=False))))
    for heavy in (physics(beta=11.0), physics("custom", normal=0.5, sliding=6.0)):
        assert not shift_factors.splits_spins(replace(pencil, law=heavy.law))
    with pytest.raises(NotPositiveDefinite, match="A is not positive definite"):
        ShiftedFactor(shifted(wrong.K, wrong.B, 1e-8), "A", None, wrong.spins)
    option("shift_mat_cholmod_print 0")
    assert not shift_factors.splits_spins(pencil)
    option("shift_fieldsplit_spin_pc_type sor")
    assert shift_factors.splits_spins(pencil)


@pytest.mark.scalar("real", "complex")
@pytest.mark.most_ranks(2)
def test_factors_that_memory_cannot_hold_are_refused(session, monkeypatch):
    """Before they are made, in a line with what is needed and the remedy; options of the solver are the user's."""
    pencil = pencil_of("few", next(iter(LAWS)))
    solvers = {"freq_": lambda: sweep_directly(pencil, OMEGA, 1e-6)}
    if session.scalar_type == "real":
        solvers["shift_"] = lambda: sweep_rationally(pencil, OMEGA, 1e-6)
        solvers["shift_ "] = lambda: solve_quasistatic(pencil.network, pencil.law)
    monkeypatch.setattr(factor_memory, "SPACE_BYTES", 1e12)
    for prefix, solve in solvers.items():
        with pytest.raises(
            InputError, match=r"factor of (42|84) unknowns: needs about .* GB of .* GB"
        ) as refused:
            solve()
        assert f"-{prefix.strip()}mat_mumps_icntl_22 1." in str(refused.value)
    assert "Without rotations" in str(refused.value) or len(solvers) == 3
    monkeypatch.setattr(type(session), "has_options", lambda self, prefix: True)
    assert np.all(np.isfinite(solvers["freq_"]().G))

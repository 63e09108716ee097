"""A factorisation counts as a proof only where its success is one: whatever options say, nothing false is proved."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from launch import run
from samples import SAMPLES, lattice, polydisperse

import jampetsc
from jampetsc.cli import main as cli
from jampetsc.core.minimum import with_proof
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.linear.elastic import ElasticResponse
from jampetsc.mechanics.network import build_network
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite
from jampetsc.petsc.local import NewtonSolver
from jampetsc.petsc.shifted import ShiftedFactor

pytestmark = pytest.mark.most_ranks(2)
PROGRAM = "../jampetsc/__main__.py"
NUMBER = (
    itertools.count()
)  # of a test's prefix: under one used before, its defaults would win over the options

# options, without their prefix, with which a factorisation of an indefinite matrix may succeed
MUMPS = ["pc_factor_mat_solver_type mumps"]
UNPROVING = [
    ["mat_cholmod_factor SIMPLICIAL"],
    ["mat_cholmod_factor AUTO"],
    ["mat_cholmod_dbound 1e-3"],
    ["pc_factor_mat_solver_type petsc"],
    ["pc_type lu", "pc_factor_mat_solver_type petsc"],
    ["pc_type jacobi", "ksp_type cg", "ksp_rtol 1e-12"],
    ["ksp_type cg"],
    ["ksp_reuse_preconditioner"],
    [*MUMPS, "mat_mumps_icntl_24 1"],
    [*MUMPS, "mat_mumps_icntl_35 1"],
    [*MUMPS, "mat_mumps_cntl_4 0.01"],
    [*MUMPS, "mat_mumps_cntl_4 0"],  # at a size that MUMPS chooses
]
PROVING = [
    [],
    MUMPS,
    [*MUMPS, "mat_mumps_icntl_7 0", "mat_mumps_icntl_14 50"],
    ["mat_cholmod_factor supernodal"],
]


@pytest.fixture
def given(session):
    """given(options): sets PETSc options with a prefix that nothing else has, and returns it."""
    database = session.PETSc.Options()
    prefix = f"trial{next(NUMBER)}_"

    def set_options(options):
        for option in options:
            name, _, value = option.partition(" ")
            database.setValue(prefix + name, value or None)
        return prefix

    yield set_options
    for name in database.getAll():
        if name.startswith(prefix):
            database.delValue(name)


def matrix(session, dense):
    """A distributed PETSc Mat with these entries, zeros on the diagonal included."""
    made = session.PETSc.Mat().createAIJ(len(dense), nnz=len(dense), comm=session.comm)
    for row in range(*made.getOwnershipRange()):
        made.setValues(row, range(len(dense)), dense[row])
    made.assemble()
    return made


def definite(n=12):
    """A tridiagonal matrix with eigenvalues between 0.06 and 3.94."""
    return 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)


@pytest.mark.scalar("real")
@pytest.mark.parametrize("options", PROVING, ids=" ".join)
def test_what_proves(session, given, options):
    prefix = given(options)
    if session.size > 1 and any("cholmod" in option for option in options):
        return
    cholesky = Cholesky(matrix(session, definite()), prefix, "A")
    cholesky.factorise()
    assert cholesky.prove(), cholesky.doubt
    cholesky.destroy()
    cholesky = Cholesky(matrix(session, definite() - 0.1 * np.eye(12)), prefix, "A")
    with pytest.raises(NotPositiveDefinite):
        cholesky.factorise()
    assert not cholesky.prove()
    cholesky.destroy()


@pytest.mark.scalar("real")
@pytest.mark.parametrize("options", UNPROVING, ids=" ".join)
def test_what_does_not_prove(session, given, options):
    """The doubt names the option."""
    if session.size > 1 and (any("cholmod" in option for option in options) or options[-1].endswith("petsc")):
        return  # for one rank
    prefix = given(options)
    cholesky = Cholesky(matrix(session, definite()), prefix, "A")
    cholesky.factorise()
    assert not cholesky.prove()
    assert any(f"-{prefix}{option.split()[0]}" in cholesky.doubt for option in options)
    cholesky.destroy()


@pytest.mark.scalar("real")
def test_a_diagonal_that_is_wrong_on_one_rank_is_everybodys(session):
    """Without a factorisation: the others must not wait for this rank in one."""
    wrong = definite()
    wrong[-1, -1] = 0.0  # of the last rank
    with pytest.raises(NotPositiveDefinite, match="A is not positive definite"):
        ShiftedFactor(matrix(session, wrong), "A")


@pytest.mark.scalar("real")
def test_on_several_ranks_the_root_must_be_counted(session, given):
    prefix = given([*MUMPS, "mat_mumps_icntl_13 0"])
    cholesky = Cholesky(matrix(session, definite()), prefix, "A")
    cholesky.factorise()
    assert cholesky.prove() == (session.size == 1)
    cholesky.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "options",
    [
        ["ksp_type cg", "pc_type jacobi", "ksp_rtol 1e-2"],
        [*MUMPS, "mat_mumps_icntl_35 1", "mat_mumps_cntl_7 1e-2"],
    ],
    ids=" ".join,
)
def test_a_poor_solver_is_refined(session, given, options):
    """A solve that returns is right to rounding, whatever made it."""
    dense = definite(30)
    prefix = given(options)
    cholesky = Cholesky(matrix(session, dense), prefix, "A")
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    b.set(1.0)
    cholesky.solve(b, x)
    found = np.concatenate(session.comm.allgather(x.getArray()))
    np.testing.assert_allclose(found, np.linalg.solve(dense, np.ones(30)), rtol=1e-11)
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.scalar("real")
def test_a_solve_leaves_rounding_and_knows_how_much(session, given):
    dense, generator = definite(30) + np.eye(30), np.random.default_rng(1)
    prefix = given(["ksp_type cg", "pc_type jacobi", "ksp_rtol 0.2"])
    cholesky = Cholesky(matrix(session, dense), prefix, "A")
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    for values in generator.standard_normal((5, 30)):
        b.setArray(values[slice(*cholesky.matrix.getOwnershipRange())])
        left = cholesky.solve(b, x)
        found = np.concatenate(session.comm.allgather(x.getArray()))
        residual = np.linalg.norm(values - dense @ found)
        assert residual <= left <= 2e-14 * (5.0 * np.linalg.norm(found) + np.linalg.norm(values))
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_an_energy_is_off_in_second_order_of_what_a_solve_leaves(session, given, monkeypatch):
    monkeypatch.setattr("jampetsc.petsc.cholesky.SOLVED", 1e-2)
    dense, values = definite(30), np.linspace(1.0, 2.0, 30)
    prefix = given(["ksp_type gmres", "pc_type jacobi", "ksp_rtol 1e-2"])
    cholesky = Cholesky(matrix(session, dense), prefix, "A")
    cholesky.factorise()
    b = cholesky.matrix.createVecRight()
    b.setArray(values[slice(*cholesky.matrix.getOwnershipRange())])
    e, left = cholesky.energy(b)
    missing = values @ np.linalg.solve(dense, values) - e
    assert 0.0 < missing <= left**2 / np.linalg.eigvalsh(dense)[0]
    for item in (cholesky, b):
        item.destroy()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("raised", "kind"),
    [
        (mumps.Failure("lost", -10), NotPositiveDefinite),
        (mumps.Failure("lost", -40), NotPositiveDefinite),
        (mumps.Failure("lost", -9), mumps.Failure),
        (mumps.Failure("lost", None), mumps.Failure),
        (81, NotPositiveDefinite),
        (63, None),
    ],
    ids=str,
)
def test_which_failures_mean_that_a_matrix_is_not_definite(session, given, monkeypatch, raised, kind):
    """Other failures say nothing about its signs, and stay what they are."""
    petsc = session.PETSc.Error

    def fail(*_):
        raise petsc(raised) if isinstance(raised, int) else raised

    cholesky = Cholesky(matrix(session, definite()), given([]), "A")
    cholesky.factorise()
    assert not cholesky.doubt
    monkeypatch.setattr(mumps, "factorise", fail)
    with pytest.raises(kind or petsc) as caught:
        cholesky.factorise()
    assert type(caught.value) is (kind or petsc)
    assert (
        cholesky.doubt == "nothing is factorised" and not cholesky.prove()
    )  # what was before counts no more
    cholesky.destroy()


@pytest.mark.scalar("real")
def test_one_negative_eigenvalue_is_enough(session, given):
    """Which MUMPS, told that there is none, passes over and counts."""
    dense = definite(30)
    dense[7, 7] = -1e-3
    cholesky = Cholesky(matrix(session, dense), given(MUMPS), "A")
    with pytest.raises(NotPositiveDefinite, match="A is not positive definite"):
        cholesky.factorise()
    cholesky.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_a_solve_that_fails_says_how(session, given):
    cholesky = Cholesky(
        matrix(session, definite(30)), given(["ksp_type cg", "pc_type none", "ksp_max_it 1"]), "A"
    )
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    b.setArray(np.arange(*cholesky.matrix.getOwnershipRange()) + 1.0)
    with pytest.raises(ConvergenceError, match=r"solve with A failed \(KSP: DIVERGED_M"):
        cholesky.solve(b, x)
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_a_factor_that_does_not_solve_proves_nothing(session, given):
    cholesky = Cholesky(matrix(session, definite(30)), given(["pc_type jacobi"]), "A")
    cholesky.factorise()
    cholesky.doubt = ""  # as if its options could be trusted
    assert not cholesky.prove() and "refinement does not remove it" in cholesky.doubt
    cholesky.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_zero_is_solved_for_zero(session, given):
    cholesky = Cholesky(matrix(session, definite(12)), given([]), "A")
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    assert cholesky.solve(b, x) == 0.0 and x.norm() == 0.0
    assert cholesky.energy(b) == (0.0, 0.0)
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.scalar("real")
def test_solutions_stay_where_they_are_projected(session, given):
    """The part along a direction that is taken out does not grow back with refinement."""

    def project(x):
        x[:] -= session.comm.allreduce(x.sum()) / 12.0

    dense = definite(12)
    dense[0, 0] = dense[-1, -1] = 1.0  # now constant vectors cost nothing but what is added
    cholesky = Cholesky(matrix(session, dense + 1e-13 * np.eye(12)), given([]), "A", project)
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    values = np.arange(12.0) - 5.5
    b.setArray(values[slice(*cholesky.matrix.getOwnershipRange())])
    cholesky.solve(b, x)
    found = np.concatenate(session.comm.allgather(x.getArray()))
    np.testing.assert_allclose(found, np.linalg.lstsq(dense, values, rcond=1e-10)[0], atol=1e-10)
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
@pytest.mark.parametrize("options", [["pc_type none"], ["pc_type jacobi"]], ids=" ".join)
def test_a_solver_that_cannot_be_refined_is_refused(session, given, options, monkeypatch):
    """As soon as a step does not halve what is left."""
    prefix = given(options)
    cholesky, solves = Cholesky(matrix(session, definite(30)), prefix, "A"), []
    monkeypatch.setattr(
        cholesky, "_apply", lambda *words: (solves.append(0), Cholesky._apply(cholesky, *words))
    )
    cholesky.factorise()
    x, b = cholesky.matrix.createVecs()
    b.set(1.0)
    with pytest.raises(
        ConvergenceError, match="refinement does not remove it: the options that begin with -trial"
    ):
        cholesky.solve(b, x)
    assert 1 <= len(solves) <= 10
    for item in (cholesky, x, b):
        item.destroy()


@pytest.mark.scalar("complex")
@pytest.mark.most_ranks(1)
def test_a_quench_needs_real_scalars(session):
    with pytest.raises(InputError, match="Cholesky needs the real build of PETSc"):
        NewtonSolver()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_newton_solver_takes_no_factor_for_a_proof_that_is_none(session, given):
    """It is not even made, unless nothing is to be proved."""
    upper = np.array([0, 2, 3], np.int32), np.array([0, 1, 1], np.int32)
    prefix = given(["pc_factor_mat_solver_type petsc"])
    with pytest.raises(InputError, match="petsc does not show the signs of its pivots: that would prove no"):
        NewtonSolver(prefix, "A")
    solver = NewtonSolver(prefix, "A", proves=False)
    assert solver.factorise(*upper, np.array([2.0, -1.0, 2.0]))
    np.testing.assert_allclose(solver.solve(np.array([1.0, 0.0])), [2 / 3, 1 / 3])
    solver.destroy()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_newton_solver_sees_that_a_pattern_has_changed(session):
    """Also one of as many entries, of which some stand elsewhere."""
    solver = NewtonSolver()
    for columns in ([0, 1, 1, 2], [0, 2, 1, 2], [0, 1, 1, 2]):
        indptr, indices = np.array([0, 2, 3, 4], np.int32), np.array(columns, np.int32)
        assert solver.factorise(indptr, indices, np.array([2.0, -1.0, 2.0, 2.0]))
        dense = 2.0 * np.eye(3)
        dense[0, columns[1]] = dense[columns[1], 0] = -1.0
        np.testing.assert_allclose(dense @ solver.solve(np.arange(1.0, 4.0)), [1.0, 2.0, 3.0], rtol=1e-14)
    solver.destroy()


def test_what_does_not_count_is_refused(tmp_path):
    packing, out, option = tmp_path / "packing.h5", tmp_path / "modes.h5", "-inertia_mat_mumps_icntl_35"
    write_packing(packing, polydisperse(3)[0])
    done = run(0, PROGRAM, "modes", packing, "--out", out, "--count", 3, option, 1)
    assert done.returncode == 2 and not out.exists()
    assert option in done.stderr and "would count no eigenvalues" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_lack_of_memory_is_said():
    done = run(0, "run_out_of_memory.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("factorisation of a large grid: out of memory; use more ranks")
    assert "-trial_pc_factor_mat_solver_type mumps" in done.stdout


def sweep(folder, disks, *words):
    """`jampetsc sweep` of these disks: the process, and the result if there is one."""
    packing, out = folder / "packing.h5", folder / "sweep.h5"
    write_packing(packing, disks)
    done = run(0, PROGRAM, "sweep", packing, "--out", out, *words)
    return done, jampetsc.load(out) if out.exists() else None


@pytest.mark.parametrize("options", (UNPROVING[0], UNPROVING[5]), ids=" ".join)
def test_an_indefinite_packing_is_never_certified(tmp_path, options):
    """14 negative modes, which these options let pass."""
    given = [word for option in options for word in f"-shift_{option}".split()]
    done, result = sweep(tmp_path, lattice(), "--omega", "10,100", *given)
    assert done.returncode == 0, done.stderr
    assert "K has 14 negative modes" in done.stderr
    assert "certified" not in done.stdout and "estimated to" in done.stdout
    assert result.attributes["positive_semidefinite"].startswith("no: 14 negative modes")


def test_a_count_stands_in_for_a_factorisation_that_proves_nothing(tmp_path):
    done, result = sweep(
        tmp_path, polydisperse(3)[0], "--omega", "1,10", "-shift_mat_cholmod_factor", "SIMPLICIAL"
    )
    assert done.returncode == 0, done.stderr
    assert "certified to" in done.stdout
    assert result.attributes["positive_semidefinite"] == "proved by the inertia of K"


def test_a_quench_does_not_take_what_proves_nothing(tmp_path):
    out = tmp_path / "packing.h5"
    done = run(
        0,
        PROGRAM,
        "pack",
        "--n",
        16,
        "--pressure",
        "1e-2",
        "--out",
        out,
        "-newton_pc_factor_mat_solver_type",
        "petsc",
    )
    assert done.returncode == 2 and not out.exists()
    assert (
        "-newton_pc_factor_mat_solver_type petsc" in done.stderr and "would prove no minimum" in done.stderr
    )
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("words", [(), ("--no-prestress",)], ids=["pre-stress", "no pre-stress"])
def test_a_packing_that_is_not_at_rest_is_not_certified(session, tmp_path, capfd, words):
    """One disk taken away, in effect: the forces on its neighbours are not balanced any more."""
    disks = with_proof(polydisperse(3)[0])
    radii = disks.radii.copy()
    radii[5] = 1e-300
    packing, out = tmp_path / "packing.h5", tmp_path / "sweep.h5"
    write_packing(packing, replace(disks, radii=radii))
    assert cli.dispatch(["sweep", str(packing), "--out", str(out), "--omega", "1,10", *words]) == 0
    told = capfd.readouterr()
    assert "forces are not balanced" in told.err
    assert "estimated to" in told.out and "certified" not in told.out
    assert "but forces are not balanced" in jampetsc.load(out).attributes["positive_semidefinite"]


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_softness_is_counted_where_it_cannot_be_told_from_nothing(session):
    """Two springs a million million times weaker than the others: what they hold is softer than solves can tell."""
    network = build_network(SAMPLES["isostatic"](), session.comm, prestress=False)
    ElasticResponse(network).destroy()
    c = network.contacts
    degree = session.comm.allreduce(np.bincount(c.i, minlength=network.n))
    pairs = [pair for part in session.comm.allgather(list(zip(c.i, c.j, strict=True))) for pair in part]
    free = sorted((i, j) for i, j in pairs if i < j and degree[i] > 3 and degree[j] > 3)
    weak = np.zeros(len(c), bool)
    for i, j in (free[0], free[-1]):
        weak |= ((c.i == i) & (c.j == j)) | ((c.i == j) & (c.j == i))
    contacts = replace(c, stiffness=np.where(weak, 1e-13 * c.stiffness, c.stiffness))
    with pytest.raises(InputError, match="K has 1 floppy mode besides its translations"):
        ElasticResponse(replace(network, contacts=contacts))

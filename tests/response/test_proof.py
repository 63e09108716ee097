"""A factorisation counts as a proof only where its success is one: whatever options say, nothing false is proved."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from launch import run
from samples import SAMPLES, among, lattice, pairs_of, polydisperse
from whole_arrays import spread, whole

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.packing.packing import with_proof
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite
from jampetsc.petsc.hessian_solver import NewtonSolver
from jampetsc.petsc.shifted import ShiftedFactor
from jampetsc.response.contact_network import build_network
from jampetsc.response.elastic import ElasticResponse
from jampetsc.studies.study_table import numbers_of

pytestmark = pytest.mark.most_ranks(2)
PROGRAM = "../jampetsc/__main__.py"
NUMBER = itertools.count()  # of a prefix: under one used before, its defaults would win over the options

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
def factor(session):
    """factor(dense, options): a Cholesky of this matrix with a prefix that nothing else has, not yet factorised."""
    database = session.PETSc.Options()

    def make(dense, options=(), project=None):
        prefix = f"trial{next(NUMBER)}_"
        for option in options:
            name, _, value = option.partition(" ")
            database.setValue(prefix + name, value or None)
        return Cholesky(spread(session.comm, dense), prefix, "A", project)

    yield make
    for name in database.getAll():
        if name.startswith("trial"):
            database.delValue(name)


def definite(n=12):
    """A tridiagonal matrix with eigenvalues between 0.06 and 3.94."""
    return 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)


def solved(cholesky, values):
    """(x on every rank, what `solve` says is left) for a right-hand side (n,)."""
    x, b = cholesky.matrix.createVecs()
    b.setArray(values[slice(*cholesky.matrix.getOwnershipRange())])
    left = cholesky.solve(b, x)
    return whole(x), left


@pytest.mark.scalar("real")
@pytest.mark.parametrize("options", PROVING, ids=" ".join)
def test_what_proves(session, factor, options):
    if session.size > 1 and any("cholmod" in option for option in options):
        return
    cholesky = factor(definite(), options)
    cholesky.factorise()
    assert cholesky.prove(), cholesky.doubt
    one_negative = definite(30)
    one_negative[7, 7] = -1e-3  # which MUMPS, told that there is none, passes over and counts
    for dense in (definite() - 0.1 * np.eye(12), one_negative):
        cholesky = factor(dense, options)
        with pytest.raises(NotPositiveDefinite, match="A is not positive definite"):
            cholesky.factorise()
        assert not cholesky.prove()


@pytest.mark.scalar("real")
@pytest.mark.parametrize("options", UNPROVING, ids=" ".join)
def test_what_does_not_prove(session, factor, options):
    """The doubt names the option."""
    if session.size > 1 and (any("cholmod" in option for option in options) or options[-1].endswith("petsc")):
        return  # for one rank
    cholesky = factor(definite(), options)
    cholesky.factorise()
    assert not cholesky.prove()
    assert any(f"-{cholesky.prefix}{option.split()[0]}" in cholesky.doubt for option in options)


@pytest.mark.scalar("real")
def test_a_diagonal_that_is_wrong_on_one_rank_is_everybodys(session):
    """Without a factorisation: the others must not wait for this rank in one."""
    wrong = definite()
    wrong[-1, -1] = 0.0  # of the last rank
    with pytest.raises(NotPositiveDefinite, match="A is not positive definite"):
        ShiftedFactor(spread(session.comm, wrong), "A")


@pytest.mark.scalar("real")
def test_on_several_ranks_the_root_must_be_counted(session, factor):
    cholesky = factor(definite(), [*MUMPS, "mat_mumps_icntl_13 0"])
    cholesky.factorise()
    assert cholesky.prove() == (session.size == 1)


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "options",
    [
        ["ksp_type cg", "pc_type jacobi", "ksp_rtol 0.2"],
        [*MUMPS, "mat_mumps_icntl_35 1", "mat_mumps_cntl_7 1e-2"],
    ],
    ids=" ".join,
)
def test_a_solve_leaves_rounding_and_knows_how_much(session, factor, options):
    """Whatever made it: a poor solver is refined."""
    dense = definite(30) + np.eye(30)
    cholesky = factor(dense, options)
    cholesky.factorise()
    for values in np.random.default_rng(1).standard_normal((5, 30)):
        found, left = solved(cholesky, values)
        np.testing.assert_allclose(found, np.linalg.solve(dense, values), rtol=0, atol=1e-12)
        residual = np.linalg.norm(values - dense @ found)
        assert residual <= left <= 2e-14 * (5.0 * np.linalg.norm(found) + np.linalg.norm(values))
    found, left = solved(cholesky, np.zeros(30))
    assert left == 0.0 and not found.any()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_an_energy_is_off_in_second_order_of_what_a_solve_leaves(session, factor, monkeypatch):
    monkeypatch.setattr("jampetsc.petsc.cholesky.SOLVE_TOLERANCE", 1e-2)
    dense, values = definite(30), np.linspace(1.0, 2.0, 30)
    cholesky = factor(dense, ["ksp_type gmres", "pc_type jacobi", "ksp_rtol 1e-2"])
    cholesky.factorise()
    b = cholesky.matrix.createVecRight()
    assert cholesky.energy(b) == (0.0, 0.0)
    b.setArray(values)
    e, left = cholesky.energy(b)
    missing = values @ np.linalg.solve(dense, values) - e
    assert 0.0 < missing <= left**2 / np.linalg.eigvalsh(dense)[0]


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("raised", "kind"),
    [
        (mumps.FactorisationError("lost", -10), NotPositiveDefinite),
        (mumps.FactorisationError("lost", -40), NotPositiveDefinite),
        (mumps.FactorisationError("lost", -9), mumps.FactorisationError),
        (mumps.FactorisationError("lost", None), mumps.FactorisationError),
        (81, NotPositiveDefinite),
        (63, None),
    ],
    ids=str,
)
def test_which_failures_mean_that_a_matrix_is_not_definite(session, factor, monkeypatch, raised, kind):
    """Other failures say nothing about its signs, and stay what they are."""
    petsc = session.PETSc.Error

    def fail(*_):
        raise petsc(raised) if isinstance(raised, int) else raised

    cholesky = factor(definite())
    cholesky.factorise()
    assert not cholesky.doubt
    monkeypatch.setattr(mumps, "factorise", fail)
    with pytest.raises(kind or petsc) as caught:
        cholesky.factorise()
    assert type(caught.value) is (kind or petsc)
    assert cholesky.doubt == "nothing has been factorised" and not cholesky.prove()  # what was before is over


class CountedIdentity:
    """A preconditioner of PETSc that does nothing, as `-pc_type none`, and counts how often."""

    applied = 0

    def apply(self, pc, b, x):
        self.applied += 1
        b.copy(x)


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["pc_type python"], "refinement does not remove it"),
        (["ksp_type cg", "pc_type python", "ksp_max_it 1"], "^solve with A: KSP stopped with DIVERGED_M"),
    ],
    ids=str,
)
def test_a_solver_that_gets_nowhere_is_refused_and_proves_nothing(factor, options, message):
    """As soon as a step does not halve what is left."""
    cholesky, identity = factor(definite(30), options), CountedIdentity()
    cholesky.ksp.getPC().setPythonContext(identity)
    cholesky.factorise()
    with pytest.raises(ConvergenceError, match=message):
        solved(cholesky, np.arange(30.0))
    assert 1 <= identity.applied <= 10
    cholesky.doubt = ""  # as if its options could be trusted
    assert not cholesky.prove() and "solve with A" in cholesky.doubt


@pytest.mark.scalar("real")
def test_solutions_stay_where_they_are_projected(session, factor):
    """The part along a direction that is taken out does not grow back with refinement."""

    def project(x):
        x[:] -= session.comm.allreduce(x.sum()) / 12.0

    dense = definite(12)
    dense[0, 0] = dense[-1, -1] = 1.0  # now constant vectors cost nothing but what is added
    cholesky = factor(dense + 1e-13 * np.eye(12), project=project)
    cholesky.factorise()
    values = np.arange(12.0) - 5.5
    found, _ = solved(cholesky, values)
    np.testing.assert_allclose(found, np.linalg.lstsq(dense, values, rcond=1e-10)[0], atol=1e-10)


@pytest.mark.scalar("complex")
@pytest.mark.most_ranks(1)
def test_a_quench_needs_real_scalars(session):
    with pytest.raises(InputError, match="Cholesky: complex scalars"):
        NewtonSolver()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_newton_solver_takes_no_factor_for_a_proof_that_is_none(session):
    """It is not even made, unless nothing is to be proved."""
    upper = np.array([0, 2, 3], np.int32), np.array([0, 1, 1], np.int32)
    session.PETSc.Options().setValue("unproving_pc_factor_mat_solver_type", "petsc")
    with pytest.raises(InputError, match="petsc does not show the signs of its pivots, which would prove no"):
        NewtonSolver("unproving_", "A")
    solver = NewtonSolver("unproving_", "A", proves=False)
    assert solver.factorise(*upper, np.array([2.0, -1.0, 2.0]))
    np.testing.assert_allclose(solver.solve(np.array([1.0, 0.0])), [2 / 3, 1 / 3])
    session.PETSc.Options().delValue("unproving_pc_factor_mat_solver_type")


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


def test_lack_of_memory_is_said():
    done = run(0, "run_out_of_memory.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("factorisation of a large grid: out of memory. Use more ranks")
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
    assert done.returncode == 0 and "K has 14 negative modes" in done.stderr
    assert "certified" not in done.stdout and "estimated to" in done.stdout
    assert result.attributes["positive_semidefinite"].startswith("no: 14 negative modes")
    assert "not a minimum: K has 14 negative modes, so method direct" in result.attributes["notes"]


def test_a_count_stands_in_for_a_factorisation_that_proves_nothing(tmp_path):
    option = "-shift_mat_cholmod_factor", "SIMPLICIAL"
    done, result = sweep(tmp_path, polydisperse(3)[0], "--omega", "1,10", *option)
    assert done.returncode == 0 and "certified to" in done.stdout
    assert result.attributes["positive_semidefinite"] == "proved by the inertia of K"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("modes packing.h5 --count 3 -inertia_mat_mumps_icntl_35 1", "would count no eigenvalues"),
        ("pack --n 16 --pressure 1e-2 -newton_pc_factor_mat_solver_type petsc", "would prove no minimum"),
    ],
)
def test_what_proves_nothing_is_refused(tmp_path, line, says):
    write_packing(tmp_path / "packing.h5", polydisperse(3)[0])
    done = run(0, PROGRAM, *line.split(), "--out", "out.h5", cwd=tmp_path)
    assert done.returncode == 2 and not (tmp_path / "out.h5").exists()
    assert line.split()[-2] in done.stderr and says in done.stderr
    assert len(done.stderr.splitlines()) == 1


MILD = "--omega 1e-2 --strain 1e-6 --alpha 0.9 --steps 16"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("words", [(), ("--no-prestress",)], ids=["pre-stress", "no pre-stress"])
def test_a_packing_that_is_not_at_rest_is_not_certified(session, tmp_path, capfd, words):
    """One disk taken away, in effect: the forces on its neighbours are not balanced any more."""
    disks = with_proof(polydisperse(3)[0])
    radii = disks.radii.copy()
    radii[5] = 1e-300
    packing, out = tmp_path / "packing.h5", tmp_path / "sweep.h5"
    write_packing(packing, disks.replace(radii=radii))
    assert cli.dispatch(["sweep", str(packing), "--out", str(out), "--omega", "1,10", *words]) == 0
    told = capfd.readouterr()
    assert "forces are not balanced" in told.err
    assert "estimated to" in told.out and "certified" not in told.out
    for job, more in (
        ("sweep", "--omega 1"),
        ("quasistatic", ""),
        ("modes", "--count 2"),
        ("oscillate", MILD),
    ):
        line = [
            job,
            str(packing),
            "--out",
            str(tmp_path / f"{job}-quiet.h5"),
            "--quiet",
            *more.split(),
            *words,
        ]
        assert cli.dispatch(line) == 0
        told = capfd.readouterr()
        assert told.err.count("forces are not balanced") == 1, job  # a warning
        result = jampetsc.load(tmp_path / f"{job}-quiet.h5")
        assert "\n  note: forces are not balanced: " in told.out
        assert result.attributes["notes"].startswith("forces are not balanced: max|F|/(p d) = "), job
        assert "\nnote: forces are not balanced: " in jampetsc.info(result), job
        assert numbers_of(tmp_path / f"{job}-quiet.h5")["notes"] == result.attributes["notes"]
    assert "but forces are not balanced" in jampetsc.load(out).attributes["positive_semidefinite"]


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_softness_is_counted_where_it_cannot_be_told_from_nothing(session):
    """Two springs a million million times weaker than the others: what they hold is softer than solves can tell."""
    network = build_network(SAMPLES["isostatic"](), session.comm, prestress=False)
    ElasticResponse(network)
    pairs = pairs_of(network)
    degree = np.bincount(np.ravel(pairs))
    free = [pair for pair in pairs if (degree[list(pair)] > 3).all()]
    c, weak = network.contacts, among(network, (free[0], free[-1]))
    contacts = replace(c, stiffness=np.where(weak, 1e-13 * c.stiffness, c.stiffness))
    with pytest.raises(InputError, match="K has 1 floppy mode besides its translations"):
        ElasticResponse(replace(network, contacts=contacts))

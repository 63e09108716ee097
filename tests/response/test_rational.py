"""The rational sweep: published values, dense references, its bounds, its shortcuts, its files."""

import re
from collections import Counter

import numpy as np
import pytest
from dense import without
from samples import (
    LAWS,
    SAMPLES,
    crystal,
    isostatic,
    laws_of,
    modulus,
    on_ranks,
    physics,
    published,
    put,
    reference,
    sweep_of,
)
from sweeps import Sweep, errors, judge
from whole_arrays import unknowns

from jampetsc.analysis.error_bounds import storage_and_loss
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.io.outlet import Outlet
from jampetsc.io.reader import load
from jampetsc.io.request import Request
from jampetsc.packing.packing import Packing, with_proof
from jampetsc.response import factor_memory, rational
from jampetsc.response import shift_factors as factors
from jampetsc.response.certificate import Certified
from jampetsc.response.minimum_check import MinimumCheck

pytestmark = pytest.mark.scalar("real")

OMEGA = np.geomspace(1e-10, 1e4, 15)
MINIMA = ("published", "hertzian", "polydisperse", "isostatic")


def exact(sample, law, omega=OMEGA):
    return np.array([modulus(sample, law, w) for w in omega])


@pytest.mark.parametrize("sample", on_ranks(MINIMA, ("published", "isostatic")))
def test_bounds_hold_and_accuracies_are_met(session, sample):
    for law in laws_of(sample, session.size):
        wanted = exact(sample, law)
        for accuracy in (1e-2, 1e-6):
            found = Sweep(SAMPLES[sample](), LAWS[law], OMEGA, accuracy, session.comm).solved()
            judge(found.G, found.bounds, wanted, accuracy, (law, accuracy))


@pytest.mark.parametrize("parallel", ["shifts", "matrix"])
def test_ranks_may_be_used_in_two_ways(session, parallel):
    law = str(physics())
    found = Sweep(SAMPLES["polydisperse"](), LAWS[law], OMEGA, 1e-8, session.comm, parallel).solved()
    judge(found.G, found.bounds, exact("polydisperse", law), 1e-8, parallel)


@pytest.mark.most_ranks(2)
def test_factors_that_do_not_fit_are_made_again(session, monkeypatch):
    """With room for one the factor at hand is not that of every shift: what is found does not depend on it."""
    law = str(physics())
    disks, accuracy = SAMPLES["polydisperse"](), 1e-8
    plenty = Sweep(disks, LAWS[law], OMEGA, accuracy, session.comm, "matrix").solved()
    made, n = plenty.sweep.factors, plenty.pencil.unknowns
    assert len(made.held) == len(made.shifts) > 1
    monkeypatch.setattr(factor_memory, "PLANE_BYTES", 1.0)
    share = 2.5 * n * np.log2(n) / session.comm.allreduce(session.memory())
    monkeypatch.setitem(factors.FACTOR_MEMORY_SHARE, 2, share)
    assert factors.most_held(plenty.pencil) == 2
    monkeypatch.setitem(factors.FACTOR_MEMORY_SHARE, 2, 0.0)
    few = Sweep(disks, LAWS[law], OMEGA, accuracy, session.comm, "matrix").solved()
    assert len(few.sweep.factors.held) == 1
    np.testing.assert_allclose(few.sweep.factors.shifts, made.shifts, rtol=1e-9)
    np.testing.assert_allclose(few.G, plenty.G, rtol=1e-11)
    judge(few.G, few.bounds, exact("polydisperse", law), accuracy, law)


def test_frequencies_are_those_of_rank_0(session):
    """Ranks that compute them may differ by an ulp."""
    found = Sweep(published(), physics(), OMEGA * (1.0 + 0.1 * session.rank), 1e-6, session.comm).solved()
    np.testing.assert_array_equal(found.sweep.omega, OMEGA)


@pytest.mark.most_ranks(1)
def test_the_bound_is_not_far_from_the_error(session, monkeypatch):
    """Where rounding is far away: never below the error, half of the time within a factor of ten."""
    monkeypatch.setattr(rational, "VECTORS", 4)  # of small packings eight leave no error at all
    ratios = []
    for sample in ("polydisperse", "isostatic"):
        for law in (str(physics()), str(physics("stokes"))):
            found = Sweep(SAMPLES[sample](), LAWS[law], OMEGA, 1e-2, session.comm, "matrix").solved()
            error, size = errors(found.G, exact(sample, law))
            large = error[:, 0] > 1e-10 * size[:, 0]
            ratios.extend(found.bounds[large, 0] / error[large, 0])
    assert len(ratios) > 20
    assert min(ratios) >= 1.0
    assert np.median(ratios) < 10.0


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(
    "law", [physics(), physics(beta=1e4), physics(beta=1e-7), physics("stokes")], ids=str
)
@pytest.mark.parametrize("parallel", ["shifts", "matrix"])
def test_residual_is_one_vector_times_one_function(session, law, parallel):
    """K x(iω) + iωB x(iω) + k_γ + iω b_γ = f φ q, which the bound rests on: at any ω, to rounding."""
    found = Sweep(SAMPLES["polydisperse"](), law, OMEGA, 1e-4, session.comm, parallel).solved()
    pencil, basis = found.pencil, found.basis
    q, _ = basis.residual()
    q2 = found.network.sum(q @ q)
    c = found.compatibility
    for omega in (3e-7, 2e-3, 0.4, 700.0):
        x = found.galerkin.field(omega)
        forces = (c.w_K + 1j * omega * c.w_B) * (c.motions(x) + c.g)
        r = c.forces(forces) + 1j * omega * c.drag * x
        size2 = found.network.sum(np.vdot(r, r).real)
        wanted2 = np.abs(basis.factor(np.array(1j * omega))) ** 2 * basis.phi([omega])[0] * q2
        border = pencil.k_gamma.norm() + omega * pencil.b_gamma.norm()
        assert np.sqrt(size2) == pytest.approx(np.sqrt(wanted2), rel=1e-3, abs=1e-11 * border)


@pytest.mark.most_ranks(1)
def test_a_factor_serves_again_nearby(session, monkeypatch):
    """Once more, which saves factorisations, and not for ever, since more and more vectors of one shift are alike."""
    monkeypatch.setattr(rational, "VECTORS", 2)
    law, omega, made, most = physics("stokes"), np.geomspace(1e-10, 1e4, 29), [], []
    for nearby in (1.0, 20.0, 1e9):
        monkeypatch.setattr(rational, "NEARBY", nearby)
        found = Sweep(SAMPLES["isostatic"](), law, omega, 1e-8, session.comm, "matrix").solved()
        made.append(found.sweep.factorisations)
        most.append(max(Counter(found.basis.shifts).values()))
    assert made[0] > made[1] >= made[2] and max(most) == 4


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(
    ("disks", "law", "eta"),
    [
        (published, physics(beta=0.0, prestress=False, tau1=0.3), None),
        (isostatic, physics(beta=0.0, prestress=False, tau1=0.3), None),
        (crystal, physics("stokes", eta_f=2.0, prestress=False), 2.0),
    ],
)
def test_where_nothing_relaxes_one_factorisation_is_enough(session, disks, law, eta):
    """β = 0 without pre-stress, one stiffness for all: G* = G₀(1 + iωτ₁) (identity 4); a crystal has but its fluid."""
    omega = np.geomspace(1e-14, 1e8, 23)
    found = Sweep(disks(), law, omega, 1e-10, session.comm, "matrix").solved()
    assert (found.sweep.factorisations, found.basis.size) == (1, 0)
    G0 = found.galerkin.spectrum.G0
    np.testing.assert_allclose(found.G, G0 + 1j * omega * (eta or 0.3 * G0), rtol=1e-12)
    if eta:
        assert G0 == pytest.approx(found.pencil.k_gg / found.network.volume, rel=1e-12)


def rows():
    """Two rows of touching disks along x, three deep: each can move so that the shear does nothing to it."""
    row, column = np.divmod(np.arange(24), 8)
    one = np.column_stack((column + 0.5 * (row % 2), np.sqrt(0.75) * row)) * 0.98
    one += np.random.default_rng(5).normal(0, 0.002, one.shape)
    both = np.vstack((one, one + np.array([0, 4])))
    return Packing.from_positions(both, np.full(48, 0.5), [(8 * 0.98, 0), (0.0, 8.0)])


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(
    ("disks", "law", "accuracy", "message"),
    [
        (rows, physics(), 1e-6, "nothing resists the load: .* reaches around the cell"),
        (isostatic, physics(), 1e-16, "only certain to .*, by rounding; accuracy 1e-16 cannot be met"),
        (
            SAMPLES["polydisperse"],
            physics(),
            1e-8,
            r"the bound on the error of G\* stays at .* times what acc",
        ),
    ],
)
def test_what_cannot_be_certified_is_refused(session, monkeypatch, disks, law, accuracy, message):
    """Nor is a space grown for ever."""
    monkeypatch.setattr(rational, "MOST_VECTORS", 4)
    monkeypatch.setattr(rational, "VECTORS", 2)
    omega = OMEGA[:: 1 if accuracy > 1e-16 else 20]
    with pytest.raises(ConvergenceError, match=message):
        Sweep(disks(), law, omega, accuracy, session.comm, "matrix").solved()


@pytest.mark.most_ranks(1)
def test_rounding_at_one_frequency_is_enough_to_refuse():
    """At once, as nothing makes it less; what a bound has left over otherwise may still become less."""
    G = np.array([0.1 + 2e-4j, 0.2 + 0.15j])
    for share, is_last, told in (
        (1e-5, False, "G″ at ω = 1 is only certain to 1.3e-01, by rounding; accuracy 1e-06 cannot"),
        (1e-9, False, None),
        (1e-9, True, "by what the solves at the shifts leave; accuracy 1e-06 cannot be met"),
    ):
        rounding = 1e-9 * np.abs(storage_and_loss(G))
        rounding[1, 1] = share * G[1].imag
        found = Certified(np.array([1e-3, 1.0]), G, np.array([1e-5, 0.02]), rounding)
        if told:
            with pytest.raises(ConvergenceError, match=told):
                found.is_met(1e-6, is_last)
        else:
            assert not found.is_met(1e-6, is_last) and found.is_met(0.2, is_last)


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("name", [str(physics()), str(physics(rotations=False)), str(physics("stokes"))])
def test_fields_and_their_bounds(session, name):
    """Energy norm of the error of a field against the dense one, over that of the field."""
    law, exact_law = LAWS[name], reference("polydisperse", name)
    ratios = []
    found = Sweep(SAMPLES["polydisperse"](), law, OMEGA, 1e-4, session.comm, "matrix").solved()
    rows = unknowns(found.network, law.law.dofs(2), exact_law.disks)
    for omega in OMEGA[::3]:
        bound = found.galerkin.field_bound(omega, found.sweep.error_at(omega))
        assert session.comm.allgather(bound) == [bound] * session.size
        x = np.concatenate(session.comm.allgather(found.galerkin.field(omega)))
        wanted = exact_law.solution(omega)[0][rows]
        moves = exact_law.free_moves()[rows]
        S = (exact_law.K + omega * exact_law.B)[:-1, :-1][np.ix_(rows, rows)]
        energy = [float((np.conj(v) @ S @ v).real) for v in (without(moves, x - wanted), wanted)]
        error = np.sqrt(energy[0] / energy[1])
        assert error <= bound
        assert bound < 0.05
        if error > 1e-9:
            ratios.append(bound / error)
    assert np.median(ratios) < 10.0


@pytest.mark.parametrize("parallel", ["shifts", "matrix"])
def test_a_job_shares_among_ranks_what_it_is_asked_to(session, monkeypatch, parallel):
    asked, make = [], rational.Factors
    monkeypatch.setattr(rational, "Factors", lambda pencil, how: asked.append(how) or make(pencil, how))
    sweep_of(published(), physics(), [1e-2], accuracy=1e-4, parallel=parallel).work(Outlet())
    assert asked == [parallel]


def unstable():
    """A packing pushed off its minimum: K with pre-stress has negative modes."""
    disks = SAMPLES["polydisperse"]()
    noise = np.random.default_rng(4).normal(0, 0.015, (disks.n, 2))
    return Packing.from_positions(disks.positions + noise, disks.radii, disks.cell, disks.potential)


@pytest.mark.most_ranks(2)
def test_a_claim_that_does_not_hold_is_found_out(session):
    """Said to be a minimum, and is none: the first factorisation tells."""
    job = sweep_of(with_proof(unstable()), physics(), [1e-6, 1e-5])
    with pytest.raises(InputError, match=r": K \+ sB at s = .* is not .* definite\. Use method direct"):
        job.work(Outlet())


@pytest.mark.most_ranks(1)
def test_what_a_job_says_of_its_bounds():
    """They hold for a minimum at rest, and where it is known to be one."""
    for construction, modes, by, imbalance, certified, says in (
        ("", 0, "", 1e-4, True, "proved when the packing was made"),
        ("", 0, "X", 1e-4, True, "proved by X"),
        ("", 0, "", 1.01e-4, False, "; but forces are not balanced: max|F|/(p d) = 1.0e-04"),
        ("", 0, "", np.nan, False, "; but forces are not balanced"),
        ("", None, "", 1e-4, False, "not shown: that of fields is a bound only if"),
        ("", 3, "", 1e-4, False, "no: 3 negative modes; error_bound is an estimate for fields"),
        ("no pre-stress", 0, "", 1e-4, True, "by construction (no pre-stress)"),
    ):
        text = f"max|F|/(p d) = {imbalance:.1e}"
        check = MinimumCheck(construction, modes, by, imbalance, text)
        assert check.certified == certified and says in check.description


@pytest.mark.most_ranks(1)
def test_frequencies_of_fields_are_among_those_of_the_sweep():
    near, apart = 1.0 + 5e-10, 1.0 + 2e-9
    for field, wanted in ((near, [1e-3, near, 10.0]), (apart, [1e-3, 1.0, apart, 10.0])):
        frequencies = sweep_of(published(), physics(), [1e-3, 1.0, 10.0], [field]).frequencies()
        assert frequencies.solved.tolist() == wanted and frequencies.of_fields.tolist() == [field]
        assert frequencies.of_experiment(frequencies.of_fields).tolist() == [field]
    law = physics(tau1=2.0)
    for omega, alpha in ((1e-12, 2.0), (5e11, 0.5)):  # equivalent to what is far beyond, on either side
        with pytest.raises(InputError, match=rf"omega = {re.escape(format(omega, 'g'))} is equivalent to"):
            sweep_of(published(), law, [1.0, omega], alpha=alpha, stress=1e-5).work(Outlet())


@pytest.mark.usefixtures("reporting")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(
    ("method", "line"),
    [
        ("rational", r"shift \d\S+.*  vectors [1-9]\d*  worst bound / allowed \d\S+"),
        ("direct", r"omega 1\.000e\+00  G' \d\S+  G'' \d\S+  bound \d\S+  iterations [1-9]"),
    ],
)
def test_what_a_sweep_says_on_its_way(session, shared_path, capfd, method, line):
    """Once, whatever the number of ranks; where a checkpoint goes on, how much of it there is."""
    packing, out = shared_path / "packing.h5", shared_path / "sweep.h5"
    put(packing, published(), session.comm)
    job = sweep_of(packing, physics(), [1e-3, 1.0], [], method, 1e-6)
    capfd.readouterr()
    job.work(Outlet(out, out, Request(job)))
    said = capfd.readouterr().err
    assert bool(re.search(line, said)) == (session.rank == 0)
    assert "continuing" not in said and not session.comm.bcast(list(shared_path.glob("*.resume*")))
    if method == "direct":
        kept = Checkpoint(out, Request(job).digest, session.comm)
        known = {"singular_bound": (1e-3, 1.0), "factorisations": 1}
        kept.save(0, {"G": 1 + 1j, "bounds": [0.0, 0.0, 0.0], **known}, None)
        job.work(Outlet(out, out, Request(job)))
        said = capfd.readouterr().err
        assert ("sweep.h5.resume: 1 frequencies are finished" in said) == (session.rank == 0)
        session.comm.barrier()
        assert load(out).G[0] == 1 + 1j and "omega 1.000e-03" not in said
        assert not session.comm.bcast(list(shared_path.glob("*.resume*")))

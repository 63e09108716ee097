"""Drag on spins and tangential springs, in two and three dimensions, against the dense reference."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from dense import NetworkReference, Reference
from samples import SAMPLES, errors_of, network_of, on_ranks, physics, published
from spheres import SPHERES
from springs import pulling_springs
from sweeps import Sweep, errors, judge
from whole_arrays import dense, unknowns, whole

import jampetsc
from jampetsc.laws.damping import Physics
from jampetsc.laws.loads import LoadChoice, simple_shear, symmetric_loads
from jampetsc.packing.spring_network import Network
from jampetsc.petsc.session import current
from jampetsc.response.assembly import assemble
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.minimum_check import check_minimum, examine, negative_modes
from jampetsc.response.modulus_sweep import sweep_rationally
from jampetsc.response.rational import largest_rate
from jampetsc.response.slow_response import infinite_viscosity, solve

pytestmark = pytest.mark.scalar("real")

OMEGA = np.geomspace(1e-9, 1e4, 7)
SOURCES = {
    "polydisperse": SAMPLES["polydisperse"],
    "gears": SAMPLES["gears"],  # bipartite
    "few spheres": SPHERES["few"],
    "spheres that mesh": SPHERES["body-centred"],  # bipartite
    "springs": pulling_springs,
}
BIPARTITE = "gears", "spheres that mesh"


def bare(*name, **options):
    """Physics without pre-stress: the lattices are no minima with it."""
    return physics(*name, prestress=False, **options)


LAWS = {
    "drag on spins": bare("custom", normal=0.5, sliding=0.7, spin_drag=0.3, tau1=2.5),
    "weak drag on spins": bare("custom", normal=1.0, sliding=1.0, drag=0.1, spin_drag=1e-6),
    "springs": bare(beta=0.3, tau1=0.4, tangential_stiffness=0.7),
    "springs and drag": bare("stokes", eta_f=0.3, tangential_stiffness=0.4),
    "springs in a fluid": bare("custom", transverse=0.3, drag=0.2, spin_drag=0.5, tangential_stiffness=0.4),
    "springs, spins alone damped": bare("custom", spin_drag=0.3, tau1=0.3, tangential_stiffness=0.7),
}
ROTATION = LoadChoice([[0.1, 1.0], [-0.8, 0.2]])
LAWS["pre-stress"] = physics(
    "custom", normal=0.5, sliding=0.2, drag=0.1, spin_drag=0.3, eta_f=0.4, tangential_stiffness=0.3
)
MINIMA = "polydisperse", "few spheres", "springs"
CASES = [(source, law) for source in SOURCES for law in LAWS if not LAWS[law].prestress or source in MINIMA]
SEVERAL = [
    ("gears", "weak drag on spins"),
    ("spheres that mesh", "springs in a fluid"),
    ("polydisperse", "springs"),
]


def load_of(dimension):
    """A load with shear, compression and rotation."""
    if dimension == 2:
        return ROTATION.of(2)[0]
    gradient = np.array([[0.1, 1.0, 0.3], [-0.8, 0.2, 0.0], [0.5, 0.4, -0.1]])
    return LoadChoice(gradient).of(3)[0]


@cache
def reference(source, law):
    """The dense reference under simple shear and `load_of`, made once per process."""
    disks = SOURCES[source]()
    dimension = len(disks.cell)
    loads = [load.gradient for load in (simple_shear(dimension), load_of(dimension))]
    return (NetworkReference if isinstance(disks, Network) else Reference)(disks, LAWS[law], loads)


def pencil_of(source, law):
    network = network_of(SOURCES[source](), LAWS[law], current().comm)
    return assemble(network, LAWS[law].law)


@pytest.mark.parametrize("case", on_ranks(CASES, SEVERAL), ids=str)
def test_matrices_and_load_columns(session, case):
    source, law = case
    pencil, exact = pencil_of(source, law), reference(source, law)
    rows, m = unknowns(pencil.network, exact.dofs, exact.disks), exact.n * exact.dofs
    free = np.delete(np.arange(m), pencil.pins)
    kept = rows[free]
    follows = pencil.network.spins_follow_load(pencil.law)
    assert follows == (LAWS[law].tangential_stiffness > 0 or LAWS[law].law.spin_drag > 0)
    for name, column, corner in (("K", "k_gamma", "k_gg"), ("B", "b_gamma", "b_gg")):
        wanted = exact.turning_with_loads(getattr(exact, name)).astype(float)
        about = {"rtol": 0, "atol": 1e-13 * np.abs(wanted).max(), "err_msg": name}
        found = dense(getattr(pencil, name))[np.ix_(free, free)]
        np.testing.assert_allclose(found, wanted[np.ix_(kept, kept)], **about)
        for number, load in enumerate((pencil.load, load_of(pencil.dimension))):
            loaded = pencil.under(load)
            np.testing.assert_allclose(
                whole(getattr(loaded, column))[free], wanted[kept, m + number], **about
            )
            assert getattr(loaded, corner) == pytest.approx(wanted[m + number, m + number], rel=1e-12)
    # gears that the fluid turns are not pinned, and projected as translations are under drag
    spins = 0 if not exact.dofs > pencil.dimension else exact.dofs - pencil.dimension
    gears = spins * (source in BIPARTITE) * (not pencil.law.holds_spins)
    assert len(pencil.pins) == gears + pencil.dimension * (not pencil.law.drag)
    assert pencil.projects == bool(pencil.law.drag or (pencil.law.holds_spins and source in BIPARTITE))


@pytest.mark.parametrize("case", on_ranks(CASES, SEVERAL), ids=str)
def test_certified_sweeps(session, case):
    """By both methods, and under a load that turns."""
    source, law = case
    exact, disks = reference(source, law), SOURCES[source]()
    wanted = np.array([[exact.modulus(omega, load) for omega in OMEGA] for load in (0, 1)])
    # gears hardly resist: G' is 1e-7 of the affine modulus there
    accuracy = 1e-6
    found = Sweep(disks, LAWS[law], OMEGA, accuracy, session.comm).solved()
    judge(found.G, found.bounds, wanted[0], accuracy, (source, law))
    loads = found.pencil.load, load_of(found.pencil.dimension)
    swept = sweep_rationally(found.pencil.under(loads[1]), OMEGA, accuracy)
    error, _ = errors(swept.G, wanted[1])
    assert np.all(error <= swept.bounds)
    solver = FrequencySolver(found.pencil, loads=loads)
    for number, omega in enumerate(OMEGA[::3]):
        for load, result in enumerate(solver.solve_loads(omega, accuracy)):
            error, _ = errors(np.array([result.G]), [wanted[load, 3 * number]])
            assert np.all(error <= result.bounds), (source, law, omega)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("case", CASES, ids=str)
def test_largest_rate_bounds_K_by_B(session, case):
    """K ≤ λ_max B, on dense matrices; and K ≥ 0."""
    source, law = case
    pencil, exact = pencil_of(source, law), reference(source, law)
    m = exact.n * exact.dofs
    K, B = (matrix[:m, :m].astype(float) for matrix in (exact.K, exact.B))
    assert np.linalg.eigvalsh(K)[0] > -1e-12 * np.abs(K).max()
    rate = largest_rate(pencil)
    damps_spins = law != "springs and drag"
    assert np.isfinite(rate) == (damps_spins and law != "springs, spins alone damped")
    if np.isfinite(rate):
        assert np.linalg.eigvalsh(rate * B - K)[0] > -1e-12 * rate * np.abs(B).max()


@pytest.mark.parametrize("case", on_ranks(CASES, SEVERAL), ids=str)
def test_slow_and_fast_shear(session, case):
    source, law = case
    exact, pencil = reference(source, law), pencil_of(source, law)
    network = pencil.network
    slow, _ = solve(network, pencil)
    field, G0 = exact.quasistatic()
    rows = unknowns(network, 1, exact.disks)
    found = np.concatenate(network.comm.allgather(slow.nonaffine))
    np.testing.assert_allclose(
        found, field[rows].astype(float), rtol=0, atol=1e-8 * float(np.abs(field).max())
    )
    assert slow.G0 == pytest.approx(G0, rel=1e-9)
    assert slow.flow.eta0 == pytest.approx(exact.eta0(), rel=1e-9, abs=1e-12)
    assert infinite_viscosity(pencil) == pytest.approx(exact.eta_infinity(), rel=1e-9, abs=1e-12)
    if LAWS[law].law.spin_drag:
        assert slow.flow.parts["spin_drag"] > 0.0
    if LAWS[law].tangential_stiffness:  # without springs lattices relax far more slowly
        assert slow.flow.eta0 == pytest.approx(exact.modulus(1e-9).imag / 1e-9, rel=1e-4, abs=1e-9)


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("make", [published, SPHERES["few"]])
def test_springs_that_are_damped_alike(session, make):
    """B = τ₁ K without pre-stress: G* = G₀ (1 + iωτ₁) exactly, with the G₀ of `quasistatic` (BT eq. 18)."""
    law = bare("custom", normal=1.0, sliding=0.6, tau1=2.5, tangential_stiffness=0.6)
    disks = make()
    found = Sweep(disks, law, OMEGA, 1e-9, session.comm).solved()
    slow, _ = solve(found.network, found.pencil)
    np.testing.assert_allclose(found.G, slow.G0 * (1.0 + 2.5j * OMEGA), rtol=1e-9)
    assert slow.eta0 == pytest.approx(2.5 * slow.G0, rel=1e-9)
    network = network_of(disks, bare(), session.comm)
    softer, _ = solve(network, assemble(network, law.law))
    assert softer.G0 < slow.G0 < slow.G_affine


@pytest.mark.most_ranks(1)
def test_units(session):
    """Lengths, k and τ₁ in other units: G*/k of ωτ₁ is the same, with the weight of the drag on spins."""
    law = LAWS["springs in a fluid"]
    usual, omega = pulling_springs(), np.array([1e-3, 0.1, 10.0])
    k, length, tau1 = 3.7, 1e-3, 25.0
    other = usual.replace(
        positions=usual.positions * length, cell=usual.cell * length, stiffness=usual.stiffness * k,
        tension=usual.tension * k * length, radii=usual.radii * length, k=usual.k * k,
    )  # fmt: skip
    # drag has no length in it: disks move by lengths, as contacts do
    in_units = replace(law, law=replace(law.law, tau1=law.law.tau1 * tau1))
    G = Sweep(usual, law, omega, 1e-9, session.comm).solved().G
    G_in_units = Sweep(other, in_units, omega / tau1, 1e-9, session.comm).solved().G
    np.testing.assert_allclose(G_in_units, k * G, rtol=1e-8)


@pytest.mark.most_ranks(1)
def test_constants_between_loads(session):
    """C* of the symmetric loads by both methods."""
    law, loads = LAWS["springs in a fluid"], symmetric_loads(2)
    pencil = pencil_of("polydisperse", "springs in a fluid")
    exact = Reference(SOURCES["polydisperse"](), law, [load.gradient for load in loads])
    wanted = np.array([exact.tensor(omega).astype(complex) for omega in OMEGA])
    for sweep in (
        sweep_rationally(pencil, OMEGA, 1e-8, loads),
        sweep_directly(pencil, OMEGA, 1e-8, loads),
    ):
        assert np.all(errors_of(sweep.tensor.C - wanted) <= sweep.tensor.bounds)


def test_K_with_springs_is_no_less_stable(session):
    """K ≥ 0 is counted with the spins; springs hold a network that floppy motions soften."""
    network = network_of(published(), physics(tangential_stiffness=0.5), session.comm)
    assert negative_modes(network)[0] == 0
    minimum = check_minimum(network, False)
    assert minimum.certified and "Cholesky" in minimum.description


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(("sample", "gears"), [("gears", 1), ("polydisperse", 0)])
def test_facts_count_gears_that_springs_let_pass(session, sample, gears):
    law = LAWS["springs in a fluid"]
    facts = examine(network_of(SOURCES[sample](), law, session.comm), law.law)
    assert (facts.translations, facts.free_moves, facts.pins) == (2, 2 + gears, 0)
    assert facts.without_prestress.zero == facts.free_moves


def test_results_name_their_springs(session, shared_path):
    sweep = jampetsc.sweep(published(), tangential_stiffness=0.5, omega=[0.1])
    assert sweep.attributes["tangential_stiffness"] == 0.5
    assert "tangential_stiffness" not in jampetsc.sweep(published(), omega=[0.1]).attributes
    law = jampetsc.Law("mine", normal=1.0, sliding=1.0, spin_drag=0.2)
    slow = jampetsc.quasistatic(published(), law)
    assert slow.attributes["spin_drag"] == 0.2
    exact = Reference(published(), Physics(law))
    assert slow.attributes["eta0"] == pytest.approx(exact.eta0(), rel=1e-9)
    assert slow.attributes["eta0_spin_drag"] > 0.0


@pytest.mark.most_ranks(1)
def test_spins_turn_with_the_fluid_that_drags_them(session):
    """Under strong drag all spins are −½ under simple shear, half its vorticity."""
    law = jampetsc.Law("strong", normal=1.0, sliding=1.0, spin_drag=1e9)
    slow = jampetsc.quasistatic(published(), law)
    np.testing.assert_allclose(slow["rotation"], -0.5, atol=1e-6)

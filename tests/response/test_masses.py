"""G*(ω) with masses: dense reference, exact relations, bounds that hold, and what a file of it gives."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from dense import Reference
from picture_contents import figure_of
from samples import LAWS, SAMPLES, physics, put
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import eigh
from spheres import few_spheres
from sweeps import errors, judge

import jampetsc
from jampetsc.analysis.elasticity import dimension_of
from jampetsc.collective import on_root
from jampetsc.errors import InputError
from jampetsc.laws.loads import symmetric_loads
from jampetsc.laws.masses import Masses
from jampetsc.laws.probes import PointForces
from jampetsc.plots.spectrum_plots import plot_transient
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.massive_sweep import sweep_with_inertia
from jampetsc.response.probe_loads import probe_loads

OMEGA = np.geomspace(1e-6, 1e2, 9)
MASSES = Masses(2.5), Masses(0.3, "volume"), Masses(200.0, "volume")
EVERY = {**SAMPLES, "spheres": few_spheres}
CASES = [
    (sample, str(law), masses)
    for sample, law, masses in (
        *(("published", law, MASSES[number % 3]) for number, law in enumerate(LAWS.values())),
        ("k = 2.5", physics(beta=1e2, tau1=2.5), MASSES[0]),
        ("hertzian", physics(), MASSES[1]),
        ("gears", physics(prestress=False), MASSES[1]),
        ("strips", physics(), MASSES[1]),
        ("strips", physics("stokes"), MASSES[1]),
        ("two images", physics("stokes"), MASSES[0]),
        ("isostatic", physics(), MASSES[0]),
        ("spheres", physics(), MASSES[1]),
        ("spheres", physics("stokes"), MASSES[1]),
        ("spheres", physics("custom", normal=0.5, sliding=0.7, spin_drag=0.3, tau1=2.5), MASSES[2]),
    )
]
ON_RANKS = CASES[-6], CASES[-3]  # drag on strips, contacts of spheres: more would show the same
REAL = pytest.mark.scalar("real")


def pencil_of(disks, model, masses, comm):
    springs = model.tangential_stiffness
    return assemble(build_network(disks, comm, model.prestress, springs, masses), model.law)


@cache
def exact(sample, law, masses):
    """C* (M, L, L) of all symmetric loads after simple shear, complex."""
    disks = EVERY[sample]()
    D = disks.dimension
    shear = np.zeros((1, D, D))
    shear[0, 0, 1] = 1.0
    loads = np.concatenate((shear, [load.gradient for load in symmetric_loads(D)]))
    reference = Reference(disks, LAWS[law], loads)
    of_disks = masses.of(reference.radii.astype(float), reference.n, float(reference.diameter), D)
    return np.array([reference.massive_tensor(omega, of_disks).astype(complex) for omega in OMEGA])


@REAL
@pytest.mark.parametrize(
    ("sample", "law", "masses"),
    [pytest.param(*case, marks=() if case in ON_RANKS else pytest.mark.most_ranks(1)) for case in CASES],
)
def test_both_methods_against_the_dense_reference(session, sample, law, masses):
    pencil = pencil_of(EVERY[sample](), LAWS[law], masses, session.comm)
    G = on_root(session.comm, lambda: exact(sample, law, masses))[:, 0, 0]
    is_minimum = sample != "two images"
    for solve in (sweep_with_inertia, sweep_directly) if is_minimum else (sweep_directly,):
        sweep = solve(pencil, OMEGA, 1e-6)
        assert not sweep.failures
        judge(sweep.G, sweep.bounds + 1e-17, G, 1e-6, solve.__name__)  # the reference is right to some 1e-18
        if sweep.inertia is not None:
            np.testing.assert_allclose(sweep.inertia.modulus(OMEGA)[:, 0, 0], G, rtol=1e-5)


@REAL
@pytest.mark.parametrize(("sample", "masses"), [("published", MASSES[0]), ("spheres", MASSES[1])])
def test_elastic_constants(session, sample, masses):
    disks = EVERY[sample]()
    pencil = pencil_of(disks, physics(), masses, session.comm)
    loads = symmetric_loads(disks.dimension)
    C = on_root(session.comm, lambda: exact(sample, str(physics()), masses))[:, 1:, 1:]
    for solve in (sweep_with_inertia, sweep_directly):
        tensor = solve(pencil, OMEGA, 1e-6, loads).tensor
        d = tensor.C - C
        error = np.stack((np.abs(d), np.abs(d.real), np.abs(d.imag)), axis=-1)
        assert np.all(error <= tensor.bounds + 1e-15 * np.abs(C).max())
        assert error.max() <= 1e-6 * np.abs(C).max()


def modes_of(pencil):
    """(eigenvalues of K, forces of the load on the modes, k_γγ) of displacements without a mean, masses 1. One rank."""
    D, force = pencil.dimension, pencil.k_gamma.getArray().copy()
    indptr, columns, values = pencil.K.getValuesCSR()
    K = np.zeros((len(force),) * 2)
    K[np.repeat(np.arange(len(force)), np.diff(indptr)), columns] = values
    free = np.setdiff1d(np.arange(len(force)), pencil.pins)
    lift = np.eye(len(force))[:, free]  # fields whose pinned unknowns are zero
    for axis in range(D):
        lift[axis::D] -= lift[axis::D].mean(axis=0)
    values, vectors = eigh(K[np.ix_(free, free)], lift.T @ lift)
    return values, vectors.T @ force[free], pencil.k_gg


@REAL
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("mass", [0.01, 1.0, 100.0])
def test_exact_modes(session, jammed, mass):
    """Under drag (K + s w + s²m is K at s' = s + s²m/w) and where B = τK modes resonate by themselves: k = 1."""
    tau, s = 0.7, 1j * OMEGA
    model = physics(beta=0.0, tau1=tau, prestress=False)
    values, forces, affine = modes_of(pencil_of(jammed, model, None, session.comm))
    pencil = pencil_of(jammed, model, Masses(mass), session.comm)
    relaxed = ((1 + tau * s[:, None]) * forces) ** 2 / (
        (1 + tau * s[:, None]) * values + mass * s[:, None] ** 2
    )
    expected = (affine * (1 + tau * s) - relaxed.sum(axis=1)) / pencil.network.volume
    require(sweep_with_inertia(pencil, OMEGA, 1e-9), expected)

    model = physics("stokes", eta_f=0.0, tau1=tau)
    values, forces, affine = modes_of(pencil_of(jammed, physics(beta=0.0), None, session.comm))
    pencil = pencil_of(jammed, model, Masses(mass), session.comm)
    relaxed = forces**2 / (values + (tau * s + mass * s**2)[:, None])
    require(sweep_with_inertia(pencil, OMEGA, 1e-9), (affine - relaxed.sum(axis=1)) / pencil.network.volume)


def require(sweep, expected):
    """Errors are within their bounds, but for the rounding of `expected`."""
    error, size = errors(sweep.G, expected)
    assert np.all(error <= sweep.bounds + 1e-12 * size[:, :1])


@REAL
@pytest.mark.most_ranks(1)
def test_units(jammed):
    """Moduli are stiffness, masses stiffness × time²: numbers follow their units, to rounding."""
    model = physics(beta=0.3)
    usual = jampetsc.sweep(jammed, law=model.law, omega=OMEGA, mass=1.5)
    k, tau = 1e6, 1e-3
    scaled = jammed.replace(potential=dataclasses.replace(jammed.potential, k=k * jammed.potential.k))
    law = jampetsc.ContactDamping(0.3, tau1=tau)
    other = jampetsc.sweep(scaled, law=law, omega=OMEGA / tau, mass=1.5 * k * tau**2)
    np.testing.assert_allclose(other.G / k, usual.G, rtol=1e-9)


@REAL
@pytest.mark.most_ranks(1)
def test_poles_decay(session, jammed):
    """All poles of the reduced response lie in Re s < 0, so that G' and G'' obey Kramers and Kronig."""
    reduced = sweep_with_inertia(
        pencil_of(jammed, physics(), Masses(30.0), session.comm), OMEGA, 1e-6
    ).inertia
    m = len(reduced.stiffness)
    companion = np.block([[np.zeros((m, m)), np.eye(m)], [-np.diag(reduced.stiffness), -reduced.damping]])
    poles = np.linalg.eigvals(companion)
    assert poles.real.max() <= 1e-9
    assert np.abs(poles.imag).max() > 0.0


@REAL
def test_finished_steps_are_not_repeated(session, jammed):
    steps = {}

    def save(number, record, arrays):
        steps[number] = record, arrays

    pencil = pencil_of(jammed, physics(tangential_stiffness=0.4, rotations=False), MASSES[0], session.comm)
    omega = OMEGA[::2]
    whole = sweep_with_inertia(pencil, omega, 1e-6, save=save)
    assert whole.direct  # springs whose motion nothing damps: no bound but by single frequencies
    part, made = {number: steps[number] for number in range(len(steps) // 2)}, []
    again = sweep_with_inertia(pencil, omega, 1e-6, resume=part, save=lambda number, *_: made.append(number))
    assert made == list(range(len(part), len(steps)))
    np.testing.assert_allclose(again.G, whole.G, rtol=1e-9)
    assert (again.direct, again.vectors) == (whole.direct, whole.vectors)


@REAL
@pytest.mark.most_ranks(2)
def test_files(session, tmp_path, jammed):
    path = put(tmp_path / "p.h5", jammed, session.comm)
    settings = {"omega": OMEGA, "mass": 2.5, "mass_by": "volume"}
    sweep, direct = (
        jampetsc.sweep(path, fields=[1e-2], method=method, **settings) for method in ("rational", "direct")
    )
    assert sweep.attributes["mass"] == 2.5 and sweep.attributes["mass_by"] == "volume"
    assert np.all(np.abs(sweep.G - direct.G) <= sweep.error_bound + direct.error_bound)
    np.testing.assert_allclose(sweep.modulus(OMEGA * 1.000001), sweep.G, rtol=1e-4)
    first, second = (result.fields.displacement[0] for result in (sweep, direct))
    largest = max(sweep["fields/error_bound"][0], direct["fields/error_bound"][0])
    assert np.abs(first - second).max() <= 20.0 * largest * np.abs(first).max()
    with pytest.raises(InputError, match="has no relaxation spectrum"):
        _ = sweep.spectrum
    tensor = jampetsc.sweep(path, load="tensor", **settings)
    assert dimension_of(tensor["C"]) == jammed.dimension
    modulus = tensor.modulus(OMEGA[3] * 1.000001)
    np.testing.assert_allclose(modulus, tensor["C"][3], atol=1e-4 * np.abs(modulus).max())


@REAL
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", [physics(), physics("stokes", eta_f=0.4)], ids=str)
@pytest.mark.parametrize("sample", ["strips", "spheres"])
def test_waves_and_points_with_masses(session, sample, law):
    disks, masses = EVERY[sample](), MASSES[1]
    D, reference = disks.dimension, Reference(disks, law)
    of_disks = masses.of(reference.radii.astype(float), reference.n, float(reference.diameter), D)
    pencil = pencil_of(disks, law, masses, session.comm)
    particles = [int(reference.disks[number]) for number in (0, 5)]
    unit = np.zeros((len(particles), D, reference.n, D))
    for number, particle in enumerate(particles):
        unit[number, range(D), reference.number[particle], range(D)] = 1.0
    chi = [
        [np.mean([reference.massive_susceptibility(at, force, of_disks) for force in each]) for each in unit]
        for at in OMEGA
    ]
    of_probe = probe_loads(PointForces(tuple(particles)), disks, pencil.network)
    for solve in (sweep_with_inertia, sweep_directly):
        sweep = solve(pencil, OMEGA, 1e-6, of_probe.loads)
        found, bounds = of_probe.susceptibility(sweep.G, sweep.bounds, pencil.network.volume)
        for column in range(len(particles)):
            exact_chi = np.array(chi)[:, column]
            judge(found[:, column], bounds[:, column] + 1e-16, exact_chi, 1e-6, solve.__name__)


@REAL
@pytest.mark.most_ranks(1)
def test_relaxation_in_time(session, jammed):
    """Exact for B = τK: each mode is a damped oscillator. For small masses as the relaxation spectrum has it."""
    tau, mass, time = 0.7, 5.0, np.geomspace(1e-2, 1e3, 12)
    model = physics(beta=0.0, tau1=tau, prestress=False)
    values, forces, affine = modes_of(pencil_of(jammed, model, None, session.comm))
    settings = {"law": model.law, "prestress": False, "accuracy": 1e-9, "omega": np.geomspace(1e-4, 1e3, 60)}
    sweep = jampetsc.sweep(jammed, mass=mass, **settings)
    with np.errstate(over="ignore"):
        lam, b = values.astype(complex) / mass, tau * values / mass
        root = np.sqrt((b / 2) ** 2 - lam)
        poles = -b / 2 + root, -b / 2 - root
    # residues of −(1 + τs)² f²/(m (s − p)(s − q)) / s at its poles 0, p, q, without the Dirac part
    parts = [
        (1 + tau * p) ** 2 * forces**2 / (mass * (p - q) * p) * np.exp(p * time[:, None])
        for p, q in (poles, poles[::-1])
    ]
    exact_G = affine - np.sum(forces**2 / values) - np.sum(sum(parts), axis=1).real
    found = sweep.stress_relaxation(time)
    volume = pencil_of(jammed, model, None, session.comm).network.volume
    np.testing.assert_allclose(found, exact_G / volume, atol=1e-7 * affine / volume)
    light, without = jampetsc.sweep(jammed, mass=1e-9, **settings), jampetsc.sweep(jammed, **settings)
    slow = time[time > 1.0]
    np.testing.assert_allclose(light.stress_relaxation(slow), without.stress_relaxation(slow), rtol=1e-6)


@REAL
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("model", [physics("contact", beta=0.5, tau1=0.7), physics("stokes")], ids=str)
def test_response_in_time(jammed, model):
    """∫ G(t − x) J(x) dx + η J(t) = t with the Dirac part η, zero for drag; and Kramers–Kronig for G*."""
    sweep = jampetsc.sweep(jammed, law=model.law, omega=np.geomspace(1e-4, 1e3, 50), mass=3.0, accuracy=1e-8)
    reduced = sweep.reduced_inertia
    found, viscosity = jampetsc.spectrum(sweep), reduced.b_gg.item()
    np.testing.assert_allclose(found["stress/G"][::97], sweep.stress_relaxation(found["stress/time"][::97]))
    assert found.attributes["mass"] == 3.0 and "relaxation/rates" not in found
    creeping = reduced.creeping()
    for t in (0.3, 5.0, 40.0):
        x, weights = np.polynomial.legendre.leggauss(150)
        x, weights = 0.5 * t * (x + 1.0), 0.5 * t * weights
        J = np.array([creeping.at(at).item() for at in (*x, t)])
        value = np.sum(weights * sweep.stress_relaxation(t - x) * J[:-1]) + viscosity * J[-1]
        assert value == pytest.approx(t, rel=1e-6)
    step = 0.01
    grid = np.arange(-25.0, 14.0, step)
    x = np.exp(grid)
    loss = sweep.modulus(x).imag - viscosity * x
    for omega in (0.01, 1.0):
        here = sweep.modulus(omega)
        parts = (x * loss - omega * (here.imag - viscosity * omega)) / (x**2 - omega**2) * x
        storage = sweep.modulus(1e6).real - 2.0 / np.pi * np.sum(parts) * step
        assert storage == pytest.approx(here.real, rel=1e-4)
    if model.law.family == "stokes":
        return
    with pytest.raises(InputError, match=r"no relaxation spectrum\. Draw them by kind transient"):
        _ = found.spectrum
    with pytest.raises(InputError, match="Run spectrum for a result, which has its G"):
        _ = sweep.spectrum
    shown = figure_of(plot_transient, [found, jampetsc.spectrum(jampetsc.sweep(jammed))])
    assert [len(ax.lines) >= 2 for ax in shown.axes] == [True, True]


@REAL
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("dimension", "tau1", "rotations"), [(2, 0.7, False), (3, 1.0, False), (2, 1.0, True)]
)
def test_massive_flow_begins_as_the_response_in_time(dimension, tau1, rotations):
    """σ(t) − σ(0) = γ̇ (η + ∫₀ᵗ G dt): steps in time of disks that collide, at a strain too small for new contacts.

    Spins of a flow begin at rest, not with the rotation of affine motion, and need some time to catch up.
    """
    disks, mass, rate = (
        few_spheres() if dimension == 3 else jampetsc.pack(n=24, pressure=1e-2, seed=3),
        1.5,
        1e-8,
    )
    law = jampetsc.ContactDamping(rotations=rotations, tau1=tau1)
    model = jampetsc.models.Model(law, mass=mass)
    flow = jampetsc.flow(disks, model=model, rate=rate, strain=40 * rate, discard=0, step=0.01)
    sweep = jampetsc.sweep(disks, law=law, omega=np.geomspace(1e-3, 1e2, 20), mass=mass, accuracy=1e-6)
    rows, points = np.append(0.0, flow["strain"] / rate), 20  # a row of a flow is a mean over its strain
    time = np.linspace(0.0, rows[-1], points * len(flow["strain"]) + 1)
    viscosity, moduli = sweep.reduced_inertia.b_gg.item(), sweep.stress_relaxation(time)
    expected = viscosity + cumulative_trapezoid(moduli, time, initial=0.0)
    means = np.diff(cumulative_trapezoid(expected, time, initial=0.0)[::points]) / np.diff(rows)
    found = (flow["shear_stress"].sum(axis=1) - disks.stress[0, 1]) / rate
    first = 4 if rotations else 0
    np.testing.assert_allclose(found[first:], means[first:], atol=1e-3 * np.ptp(expected))


@REAL
@pytest.mark.parametrize("lattice", ["square", "cubic"])
def test_a_lattice_that_moves_affinely(session, lattice):
    """Its space has no vector: G* = k (1 + iωτ₁ w) / d^(D−2) under normal damping of weight w, and G(t) = G(0)."""
    network = jampetsc.springs(lattice=lattice, size=3)
    law, omega = jampetsc.Law("mine", normal=2.0, drag=0.3, tau1=0.7), np.array([0.01, 1.0, 100.0])
    sweep = jampetsc.sweep(network, law=law, omega=omega, load="xx", mass=2.0)
    assert sweep.attributes["vectors"] == 0
    np.testing.assert_allclose(sweep.G, 1.0 + 1.4j * omega, rtol=1e-10)
    np.testing.assert_allclose(sweep.stress_relaxation(np.array([0.1, 10.0])), 1.0, rtol=1e-10)

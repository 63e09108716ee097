"""Waves and single particles that forces push: susceptibilities and bounds against the dense reference, and limits."""

import numpy as np
import pytest
from dense import LONG, NetworkReference, Reference, solve, total
from samples import LAWS, SAMPLES, isostatic, on_ranks, physics, published, strips
from samples import network_of as build
from spheres import few_spheres

import jampetsc as jp
from jampetsc.analysis.susceptibility import modulus_of_wave
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.laws.damping import Law, Physics
from jampetsc.laws.loads import LoadChoice
from jampetsc.laws.probes import Forces, PointForces, Wave, Waves
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.response import modulus_sweep, rational
from jampetsc.response.assembly import assemble
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.modulus_sweep import sweep_rationally
from jampetsc.response.probe_loads import probe_loads

OMEGA = np.array([1e-8, 1e-4, 1e-2, 1.0, 1e2, 1e4])
SEVERAL = (str(physics()),)  # laws on several ranks


def waves(dimension):
    """A transverse and a longitudinal wave, across the axes."""
    return (
        Waves((Wave((1, 0, 0)[:dimension], "transverse"),)),
        Waves((Wave((1, -2, 1)[:dimension], "longitudinal"),)),
    )


def solved(disks, law, probe, comm, sweep=sweep_rationally, accuracy=1e-6, omega=OMEGA):
    """χ (M, P) and its bounds (M, P, 3)."""
    network = build(disks, law, comm)
    loads = probe_loads(probe, disks, network)
    result = sweep(assemble(network, law.law), omega, accuracy, loads.loads)
    np.testing.assert_array_equal(result.omega, omega)
    return loads.susceptibility(result.G, result.bounds, network.volume)


def wave_forces(wave, positions, cell):
    """Forces (n, D) of cos and of sin for each polarisation, in extended precision."""
    k = 2 * np.arccos(LONG(-1)) * solve(cell, np.array(wave.numbers, LONG))
    along = k / np.sqrt(k @ k)
    directions = [along]
    if wave.polarisation == "transverse":
        directions = []
        for axis in np.eye(len(k), dtype=LONG):
            rest = axis - sum(direction * (direction @ axis) for direction in (along, *directions))
            if rest @ rest > 1e-3 and len(directions) < len(k) - 1:
                directions.append(rest / np.sqrt(rest @ rest))
    phase = positions @ k
    return [part[:, None] * direction for direction in directions for part in (np.cos(phase), np.sin(phase))]


def expected(disks, law, probe, omega=OMEGA, reference=Reference):
    """χ (M, P) of the dense reference."""
    whole = reference(disks, law)
    D = whole.dimension
    if isinstance(probe, Waves):
        place = (disks.base, disks.offset) if hasattr(disks, "base") else (disks.positions,)
        cell = (disks.cell_base, disks.cell_offset) if hasattr(disks, "base") else (disks.cell,)
        forces = wave_forces(probe.waves[0], total(*place)[whole.disks], total(*cell))
        polarisations = len(forces) // 2
        return np.array(
            [[sum(whole.susceptibility(w, f) for f in forces) / (whole.n * polarisations)] for w in omega]
        )
    unit = np.zeros((len(probe.particles), D, whole.n, D))
    for number, particle in enumerate(probe.particles):
        unit[number, range(D), whole.number[particle], range(D)] = 1.0
    return np.array([[np.mean([whole.susceptibility(w, f) for f in each]) for each in unit] for w in omega])


def judge(found, exact, accuracy=1e-6, spare=1e-14):
    """Errors within the bounds, but for what a double cannot hold, and bounds within the accuracy."""
    chi, bounds = found
    error, size = (
        np.abs(np.stack((np.abs(values), values.real, values.imag), axis=-1))
        for values in (chi - exact, exact)
    )
    assert np.all(error <= bounds + spare * size)
    assert np.all(bounds[..., 1:] <= 2.0 * accuracy * size[..., 1:])


@pytest.mark.scalar("real", "complex")
@pytest.mark.parametrize("name", on_ranks(list(LAWS)[::3], SEVERAL))
def test_waves_by_the_direct_method(session, name):
    disks, law = SAMPLES["k = 2.5"](), LAWS[name]
    for wave in waves(2):
        found = solved(disks, law, wave, session.comm, sweep_directly, 1e-9, OMEGA[1:5])
        judge(found, expected(disks, law, wave, OMEGA[1:5]), 1e-9)


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(LAWS, SEVERAL))
def test_waves_by_the_rational_method(session, name):
    """Over twelve decades, in which χ' falls by as many."""
    disks, law = SAMPLES["k = 2.5"](), LAWS[name]
    for wave in waves(2):
        judge(solved(disks, law, wave, session.comm), expected(disks, law, wave))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", [physics(beta=0.3, tau1=2.5), physics("stokes")], ids=str)
@pytest.mark.parametrize("make", [few_spheres, isostatic, strips, published], ids=lambda make: make.__name__)
def test_waves_and_points(session, make, law):
    """Spheres, nearly isostatic packings with rattlers, two components, in other units of length and of k."""
    disks = make()
    if make is published:
        disks = Packing.from_positions(
            3.0 * disks.positions, 3.0 * disks.radii, 3.0 * disks.cell, Potential(k=1e6)
        )
    bearing = Reference(disks, law).disks
    for probe in (*waves(disks.dimension), PointForces((bearing[1], bearing[4]))):
        judge(solved(disks, law, probe, session.comm), expected(disks, law, probe), spare=1e-12)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_sizes_far_apart(session):
    disks, law = jp.pack(n=24, pressure=1e-2, seed=2, sizes="powerlaw:2:30"), physics(beta=0.1)
    for wave in waves(2):
        judge(solved(disks, law, wave, session.comm), expected(disks, law, wave), spare=1e-12)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", [physics(), physics("stokes")], ids=str)
def test_bounds_hold_where_the_accuracy_is_low(session, law, monkeypatch):
    """Errors far above rounding, with few vectors at each shift."""
    for module in (rational, modulus_sweep):
        monkeypatch.setattr(module, "VECTORS", 2)
    disks = SAMPLES["polydisperse"]()
    omega = np.geomspace(1e-3, 10.0, 5)
    chi, bounds = solved(disks, law, waves(2)[1], session.comm, accuracy=0.1, omega=omega)
    error = np.abs(chi - expected(disks, law, waves(2)[1], omega))[:, 0]
    assert np.all(error <= bounds[:, 0, 0]) and error.max() > 1e-9 * np.abs(chi).max()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_network_that_pulls(session):
    """K is a sum of squares with large weights across the bonds."""
    network = build_lattice("triangular", (4, 4)).diluted(0.9, 3)
    network = network.replace(tension=0.3 * network.stiffness * network.linear_bonds.distance)
    law = Physics(Law("drag and bonds", normal=1.0, transverse=0.1, drag=0.2, tau1=0.3))
    for wave in (Waves((Wave((1, 0), "transverse"),)), Waves((Wave((0, 1), "longitudinal"),))):
        exact = expected(network, law, wave, reference=NetworkReference)
        judge(solved(network, law, wave, session.comm), exact)


def repeated(disks, times):
    """Copies of a packing along x: of the same response to strain, in a cell that long."""
    steps = np.arange(times)[:, None, None] * disks.cell[0]
    cell = disks.cell * np.array([times, *([1.0] * (disks.dimension - 1))])[:, None]
    positions = (disks.positions + steps).reshape(-1, disks.dimension)
    return Packing.from_positions(positions, np.tile(disks.radii, times), cell, disks.potential)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", [physics(beta=0.3), physics("stokes", eta_f=0.0, tau1=0.3)], ids=str)
def test_long_waves_have_the_moduli_of_strains(session, law):
    """G(k) → 1/(A⁻¹)_ee, A_ab = C_ab + iω (n/V) w_d kτ₁/k² δ_ab between strains e_a k̂, pre-stress included, as k²."""
    disks, omega = SAMPLES["polydisperse"](), np.array([1e-3, 0.3, 10.0])
    loads = [LoadChoice(name).of(2)[0] for name in ("xx", "yx", "yy")]
    pencil = assemble(build(disks, law, session.comm), law.law)
    C = sweep_directly(pencil, omega, 1e-9, loads).tensor.C[:, :2, :2]
    for number, polarisation in enumerate(("longitudinal", "transverse")):
        differences = []
        for times in (8, 16):
            wave, supercell = Waves((Wave((1, 0), polarisation),)), repeated(disks, times)
            network = build(supercell, law, session.comm)
            particles = probe_loads(wave, supercell, network).particles
            chi, _ = solved(supercell, law, wave, session.comm, sweep_directly, 1e-9, omega)
            k = 2.0 * np.pi / supercell.cell[0, 0]
            drag = law.law.drag * disks.potential.k * law.law.tau1 * network.n / (supercell.volume * k**2)
            A = C + 1j * omega[:, None, None] * drag * np.eye(2)
            limit = 1.0 / np.linalg.inv(A)[:, number, number]
            G = wave.modulus_factors(particles)[0] / chi[:, 0]
            differences.append(np.abs(G - limit) / np.abs(C[:, number, number]))
        assert np.all(differences[0] < 0.1)
        ratio = differences[0] / differences[1]
        assert np.all((ratio > 3.0) & (ratio < 6.0))  # 4 for an error of order k²


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_an_array_of_forces_is_a_load(session):
    """χ of any forces, of which only what is left without their mean acts."""
    disks, law = published(), physics("stokes", tau1=0.3)
    whole, omega = Reference(disks, law), np.array([1e-3, 1.0])
    forces = np.random.default_rng(3).normal(size=(disks.n, 2))
    forces[np.setdiff1d(np.arange(disks.n), whole.disks)] = 0.0
    result = jp.sweep(disks, law.law, omega=omega, load=forces)
    exact = np.array([whole.susceptibility(w, forces[whole.disks]) for w in omega])
    error = np.abs(result["susceptibility"] - exact)
    assert np.all(error <= result["susceptibility_error_bound"] + 1e-15 * np.abs(exact))
    np.testing.assert_array_equal(result["probe/forces"], forces)
    assert "worst bound, χ''" in jp.info(result)
    assert result.attributes["load"].startswith("forces:") and "stress_measure" not in result.attributes
    more = jp.sweep(disks, law.law, omega=omega, load=3.0 * forces)
    np.testing.assert_allclose(more["susceptibility"], 9.0 * result["susceptibility"], rtol=1e-9)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("sweep", [sweep_rationally, sweep_directly])
def test_several_loads_continue_from_any_step(session, sweep):
    disks, law, omega, steps = published(), physics(), np.geomspace(1e-4, 1.0, 4), {}
    network = build(disks, law, session.comm)
    pencil, loads = assemble(network, law.law), probe_loads(PointForces((1, 2)), disks, network).loads
    whole = sweep(pencil, omega, 1e-8, loads, save=lambda step, *found: steps.update({step: found}))
    assert len(steps) >= 4
    for number in range(0, len(steps) + 1, 2):
        more, resume = [], {step: steps[step] for step in range(number)}
        found = sweep(
            pencil, omega, 1e-8, loads, resume=resume, save=lambda step, *_, more=more: more.append(step)
        )
        assert more == list(range(number, len(steps)))
        np.testing.assert_allclose(found.G, whole.G, rtol=1e-7)
        assert found.factorisations == whole.factorisations


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(list(LAWS)[::2], ()))
def test_slow_forces(session, name):
    """χ₀ within its bound, χ₁ and what follows of waves; with pre-stress and without."""
    disks, law, slow = SAMPLES["k = 2.5"](), LAWS[name], np.array([1e-10])
    probe, points = waves(2)[0], PointForces((1, 4))
    elastic = {"prestress": law.prestress, "tangential_stiffness": law.tangential_stiffness}
    result, sample = (jp.quasistatic(disks, law.law, load=str(load), **elastic) for load in (probe, points))
    for prefix in ("", "no_prestress/") if law.prestress else ("",):
        bare = law if not prefix else Physics(law.law, False, law.tangential_stiffness)
        exact = expected(disks, bare, probe, slow)[0, 0]
        chi, bound = (result[f"{prefix}susceptibility{part}"][()] for part in ("", "_error_bound"))
        assert abs(chi - exact.real) <= bound + 1e-14 * chi and bound < 1e-11 * chi
        assert result[f"{prefix}susceptibility_slope"] == pytest.approx(-exact.imag / slow[0], rel=1e-6)
        number = prefix.replace("/", "_")
        G = result.attributes[f"{number}G0"] + 1j * slow[0] * result.attributes[f"{number}eta0"]
        k2 = result.attributes["wave_vector"] @ result.attributes["wave_vector"]
        n = disks.n - result.attributes["rattlers"]
        assert G.real == pytest.approx(n / (disks.volume * k2 * exact).real, rel=1e-12)
        assert G.imag == pytest.approx((n / (disks.volume * k2 * exact)).imag, rel=1e-6)
        each = expected(disks, bare, points, slow)[0]
        np.testing.assert_allclose(sample[f"{prefix}susceptibility"], each.real, rtol=1e-11)
    np.testing.assert_array_equal(sample["probe/particles"], points.particles)
    assert sample.attributes["susceptibility_mean"] == sample["susceptibility"].mean()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_several_waves_share_factors(session):
    """Columns of one file are the files of single waves, in sweep and quasistatic."""
    disks, loads, omega = published(), ["wave:1,0:transverse", "wave:1,2:longitudinal"], [1e-3, 1.0]
    several, *single = (jp.sweep(disks, load=load, omega=omega) for load in ("+".join(loads), *loads))
    for name in ("susceptibility", "G"):
        np.testing.assert_allclose(several[name].T, [result[name] for result in single], rtol=1e-6)
    assert several["error_bound_loss"].shape == several.G.shape == (2, 2)
    assert several.attributes["factorisations"] <= max(one.attributes["factorisations"] for one in single)
    np.testing.assert_array_equal(several["waves/vectors"], [one.attributes["wave_vector"] for one in single])
    assert several.modulus(1.0).shape == (2,) and "worst bound, χ'" in jp.info(several)
    slow, *alone = (jp.quasistatic(disks, load=load) for load in ("+".join(loads), *loads))
    for name in ("G0", "eta0", "omega_star", "G0_error_bound"):
        for prefix, number in (("", ""), ("no_prestress/", "no_prestress_")):
            found = slow[f"{prefix}waves/{name}"]
            np.testing.assert_allclose(found, [one.attributes[f"{number}{name}"] for one in alone], rtol=1e-9)


def test_the_bounds_of_a_quotient():
    """G(k) of every χ within the bounds of χ is within those of G(k)."""
    rng = np.random.default_rng(1)
    chi = (rng.uniform(0.1, 1.0, 50) - 1j * 10.0 ** rng.uniform(-8, 1, 50)) * 1e3
    relative = 10.0 ** rng.uniform(-6, -0.5, (50, 2))
    parts = relative * np.abs(np.stack((chi.real, chi.imag), axis=-1))
    bounds = np.column_stack((np.hypot(*parts.T), parts))
    G, of_G = modulus_of_wave(chi, bounds, 7.0)
    for _ in range(200):
        moved = chi + (rng.uniform(-1, 1, (50, 2)) * parts) @ [1, 1j]
        error = 7.0 / moved - G
        assert np.all(np.abs(error) <= of_G[:, 0])
        assert np.all(np.abs(error.real) <= of_G[:, 1]) and np.all(np.abs(error.imag) <= of_G[:, 2])
    assert np.all(np.isinf(modulus_of_wave(chi, 2.0 * np.abs(chi)[:, None] * np.ones(3), 1.0)[1]))


def test_probes_are_read_as_they_are_written():
    for text in (
        "wave:1,0:transverse",
        "wave:2,-1,3:longitudinal",
        "point:7",
        "point:3,7",
        "points:9",
        "points:9:5",
    ):
        choice = LoadChoice(text)
        assert str(choice) == text and LoadChoice(choice) == choice and not choice.is_shear
        assert str(LoadChoice(choice.probe)) == text
    forces = LoadChoice(np.ones((5, 2)) * np.arange(5)[:, None])
    assert isinstance(forces.probe, Forces) and LoadChoice(str(forces)) == forces
    assert LoadChoice("wave:1,0:transverse").of(2) == ()
    for wrong, match in {
        "wave:0,0:transverse": "must not all be zero",
        "wave:1.5,0:transverse": "not a probe",
        "wave:1:transverse": "1 numbers of cell vectors",
        "wave:1,0": "not a probe",
        "wave:1,0:sideways": "not a probe",
        "wave:1,0:transverse+point:3": "not a probe",
        "wave:1,0:transverse+wave:1,0:transverse": "a wave twice",
        "wave:1,0:transverse+wave:1,0,0:transverse": "waves of two and of three numbers",
        "wave:1,100000:transverse": "nor exceed",
        "point:3,3": "a particle twice",
        "point:-1": "at least 0",
        "points:0": "from 1 to",
        "points:x": "not a probe",
    }.items():
        with pytest.raises(InputError, match=match):
            LoadChoice(wrong)
    for wrong in (np.zeros((5, 2)), np.full((5, 3), np.nan), [["x", "y"]] * 5):
        with pytest.raises(InputError, match="forces must be"):
            LoadChoice(wrong)
    with pytest.raises(InputError, match="not a load in 3 dimensions"):
        LoadChoice("wave:1,0:transverse").of(3)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_probes_that_nothing_holds(session):
    disks = isostatic()
    network = build(disks, physics(), session.comm)
    loose = int(np.setdiff1d(np.arange(disks.n), network.particles)[0])
    for load, match in {
        f"point:{loose}": f"particle {loose} bears no load",
        f"point:{disks.n}": f"particle {disks.n} of {disks.n}",
        f"points:{disks.n}": "22 particles bear load",
        "wave:1,0,0:transverse": "not a load in 2 dimensions",
    }.items():
        with pytest.raises(InputError, match=match):
            jp.sweep(disks, load=load, omega=1.0)
    one = np.zeros((disks.n, 2))
    one[loose] = 1.0
    with pytest.raises(InputError, match=f"particle {loose} bears no load"):
        jp.sweep(disks, load=one, omega=1.0)
    with pytest.raises(InputError, match="forces for 24 particles"):
        jp.sweep(disks, load=one[1:], omega=1.0)
    lattice = build_lattice("triangular", (4, 4))
    with pytest.raises(InputError, match="acts on all particles alike"):
        jp.sweep(lattice, jp.ContactDamping(rotations=False), load="wave:4,0:transverse", omega=1.0)
    with pytest.raises(ConvergenceError, match="floppy"):  # that turn a strip of bonds as a whole
        jp.sweep(lattice.diluted(0.4, 1), jp.StokesDrag(), load="wave:1,0:transverse", omega=[1e-3, 1.0])

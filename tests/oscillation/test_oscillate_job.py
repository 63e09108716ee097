"""A run of `oscillate`: every point in its place, whoever solved it, and what becomes of those that fail."""

from dataclasses import replace

import numpy as np
import pytest
from samples import SAMPLES, network_of, physics, polydisperse, published, put
from spheres import few_spheres
from sweeps import Sweep

import jampetsc
from jampetsc.commands.oscillate import Oscillate
from jampetsc.errors import ConvergenceError
from jampetsc.io.checkpoint import read_entry, write_entry
from jampetsc.io.outlet import Outlet
from jampetsc.io.reader import load
from jampetsc.io.request import Request
from jampetsc.oscillation.amplitude_sweep import END, INTEGERS, PointSolver, sweep_amplitudes
from jampetsc.oscillation.drive import WAVEFORM_TIMES
from jampetsc.oscillation.steady_oscillation import SteadyOscillation, SteadyResult
from jampetsc.petsc.session import current

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]
OMEGA = {"fixed": (0.1, 1.0), "moving": (0.3, 1.0)}


@pytest.fixture
def packing(session, shared_path):
    return put(shared_path / "p.h5", published(), session.comm)


def ask(
    packing,
    alpha=1.0,
    contacts="fixed",
    amplitude=(1e-5, 1e-4),
    omega=None,
    out="o.h5",
    stress=True,
    **options,
):
    """The job, and where its result goes."""
    how = {"stress" if stress else "strain": amplitude, "omega": OMEGA[contacts] if omega is None else omega}
    how |= {"contacts": contacts, "cycles": 3 if contacts == "moving" else None, "steps": 16, "alpha": alpha}
    out = packing.parent / out
    job = Oscillate(packing, physics(rotations=False).law, **how, **options)
    return job, Outlet(out, out, Request(job))


def work(job, to):
    """Datasets of the result, first axes (A, M)."""
    job.work(to)
    file = load(to.path)
    return {name: file[name] for name in file if name not in ("omega", "amplitude")}


def left_behind(packing):
    others = (path for path in packing.parent.iterdir() if path != packing and path.suffix != ".parts")
    return sorted(path.name for path in others)


@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("contacts", ["fixed", "moving"])
def test_every_point_is_in_its_place(packing, contacts):
    """G* grows with ω, and work says which strain there was; of moving contacts three points, for two ranks."""
    asked, to = ask(packing, 1.0, contacts, *(((1e-4,), (0.03, 0.3, 1.0)) if contacts == "moving" else ()))
    arrays = work(asked, to)
    current().comm.barrier()
    file = load(to.path)
    facts = {"control": "stress", "contacts": contacts, "steps": 16, "alpha": 1.0, "regularisation": 0.0}
    facts |= {"solver": {"fixed": "cycle", "moving": "steps"}[contacts]}
    assert {name: file.attributes[name] for name in facts} == facts
    shape = len(asked.amplitude), len(asked.omega)
    for name, values in arrays.items():
        np.testing.assert_array_equal(file[name], values)
        assert values.shape[:2] == shape and np.all(np.isfinite(values))
        assert (values.dtype.kind == "i") == (name in INTEGERS)
    G, strain = arrays["G"], asked.amplitude[:, None] / abs(arrays["G"])
    np.testing.assert_allclose(arrays["work"], np.pi * G.imag * strain**2, rtol=1e-3)
    assert np.all(np.diff(abs(G), axis=1) > 0.0)
    np.testing.assert_array_equal(file["omega"], asked.omega)
    np.testing.assert_array_equal(file["amplitude"], asked.amplitude)
    assert left_behind(packing) == ["o.h5"]


def test_a_sweep_in_memory_is_resumed(session):
    """Without a file: `save` gets each record, and `resume` gives them back unchanged."""
    law, records = physics(rotations=False).law, {}
    network = network_of(published(), physics(rotations=False), session.comm)
    first = sweep_amplitudes(
        published(),
        network,
        law,
        omega=[0.1],
        amplitudes=[1e-5],
        control="strain",
        steps=16,
        save=records.__setitem__,
    )
    assert list(records) == [0] and records[0]["G"] == first.arrays["G"][0, 0] and not first.failures
    marked = {0: records[0] | {"G": 7.0 + 1.0j}}
    again = sweep_amplitudes(
        published(),
        network,
        law,
        omega=[0.1, 1.0],
        amplitudes=[1e-5],
        control="strain",
        steps=16,
        resume=marked,
    )
    assert again.arrays["G"][0, 0] == 7.0 + 1.0j and list(marked) == [0]
    assert abs(again.arrays["G"][0, 1]) > abs(first.arrays["G"][0, 0])


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(("sample", "stress"), [(published, True), (published, False), (few_spheres, False)])
def test_a_chain_of_amplitudes_that_is_resumed_is_the_same(session, tmp_path, sample, stress):
    """Each amplitude begins where the one before ended, from the record that a checkpoint keeps of it."""
    disks, records = sample(), {}
    options = physics(rotations=False, tau1=2.0, beta=0.5)
    network = network_of(disks, options, session.comm)
    words = {"omega": [0.3], "amplitudes": [1e-5, 2e-3] if stress else [1e-4, 3e-2], "steps": 16, "cycles": 1}
    words |= {"control": "stress" if stress else "strain", "contacts": "moving"}

    def sweep(**more):
        return sweep_amplitudes(disks, network, options.law, **words | more).arrays

    whole = sweep(save=records.__setitem__)
    write_entry(tmp_path / "0", records[0])
    kept = {0: read_entry(tmp_path / "0")[0]}
    again, alone = sweep(resume=kept), sweep(amplitudes=words["amplitudes"][1:])
    for name, values in whole.items():
        np.testing.assert_array_equal(again[name], values, err_msg=name)
    assert alone["G"][0, 0] != whole["G"][1, 0]
    assert END not in whole and whole["strain_waveform"].shape == (2, 1, WAVEFORM_TIMES)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("sample", [published, few_spheres])
@pytest.mark.parametrize("contacts", ["fixed", "moving"])
@pytest.mark.parametrize("stress", [True, False])
def test_the_area_within_a_waveform_is_the_work(session, sample, contacts, stress):
    """∮σdγ = πG''γ₁² of the harmonics of the waveforms, which are those of the file, for 1/ω and k other than 1."""
    disks = sample().replace(potential=replace(sample().potential, k=2.5))
    options, amplitude = physics(rotations=False, tau1=0.5, exponent=0.7), 1e-3
    network = network_of(disks, options, session.comm)
    words = {"omega": [0.2], "amplitudes": [amplitude], "control": "stress" if stress else "strain"}
    words |= {"contacts": contacts, "steps": 64 if contacts == "fixed" else 16, "cycles": 1}
    arrays = sweep_amplitudes(disks, network, options.law, **words).arrays
    strain, stresses = arrays["strain_waveform"][0, 0], arrays["stress_waveform"][0, 0]
    first = [2.0 * np.fft.rfft(wave)[1] / len(wave) for wave in (strain, stresses)]
    G, third = first[1] / first[0], np.fft.rfft(strain if stress else stresses)[3] * 2.0 / WAVEFORM_TIMES
    imposed = first[1] if stress else first[0]
    assert imposed == pytest.approx(-1j * amplitude, rel=1e-9)
    area = 0.5 * np.sum((stresses + np.roll(stresses, -1)) * (np.roll(strain, -1) - strain))
    assert pytest.approx(G, rel=2e-2) == arrays["G"][0, 0]
    assert area == pytest.approx(np.pi * arrays["G"][0, 0].imag * abs(first[0]) ** 2, rel=3e-2)
    assert arrays["work"][0, 0] == pytest.approx(area, rel=3e-2)
    ratio = third / (first[0] if stress else first[1])
    assert abs(abs(ratio) - abs(arrays["harmonics"][0, 0, 0])) < 5e-3


@pytest.mark.most_ranks(2)
def test_any_load_of_fixed_contacts(session):
    """Linear damping has the modulus of a sweep, whatever is imposed."""
    law, load = physics(beta=0.3).law, ((0.5, 0.2), (-0.1, 0.5))
    swept = jampetsc.sweep(published(), law, omega=[0.1], load=load)
    for imposed in ({"strain": [1e-6]}, {"stress": [1e-6]}):
        found = jampetsc.oscillate(published(), law, omega=[0.1], load=load, steps=16, **imposed)
        assert found["G"][0, 0] == pytest.approx(swept.G[0], rel=1e-8)
        assert found.attributes["load"] == swept.load


def failing(monkeypatch, points, solver):
    """From now on these (ω, amplitude) fail; the list of what is solved, by this rank."""
    real, seen = solver.solve, []

    def solve(self, point, *end):
        seen.append((point.omega, point.amplitude))
        if seen[-1] in points:
            raise ConvergenceError("something went wrong")
        return real(self, point, *end)

    monkeypatch.setattr(solver, "solve", solve)
    return seen


@pytest.mark.least_ranks(2)
@pytest.mark.usefixtures("reporting")
@pytest.mark.parametrize("contacts", ["fixed", "moving"])
def test_what_fails_is_left_out_and_tried_again(monkeypatch, session, packing, capfd, contacts):
    """On whichever rank: the others are kept and in the file, and only what is missing is done next time."""
    (asked, to), omega = ask(packing, contacts=contacts), OMEGA[contacts]
    bad = [(omega[1], 1e-5), (omega[0], 1e-4)]  # one on each rank
    with monkeypatch.context() as patch:
        failing(patch, bad, PointSolver)
        with pytest.raises(ConvergenceError) as told:
            work(asked, to)
    named = f"omega {omega[1]:.3e}  stress 1.0e-05: something went wrong"
    assert str(told.value) == f"2 of 4 points failed, the others are in {to}; the first: {named}"
    session.comm.barrier()
    shown = session.comm.bcast(capfd.readouterr().err)
    assert shown.count("failed: ") == 2 and f"failed: {named}" in shown
    first = {name: load(to.path)[name] for name in ("G", "error", "newton_steps")}
    missing = [[False, True], [True, False]]
    assert np.isnan(first["G"]).tolist() == np.isnan(first["error"]).tolist() == missing
    assert (first["newton_steps"] == 0).tolist() == missing
    with monkeypatch.context() as patch:
        seen = failing(patch, [], PointSolver)
        arrays = work(asked, to)
    everyone = session.comm.allgather(seen)
    solved = {tuple(point) for points in everyone for point in points}
    assert solved == set(bad)
    shown = session.comm.bcast(capfd.readouterr().err)
    assert "2 points are finished" in shown and "[4/4]" in shown
    kept = ~np.isnan(first["G"])
    np.testing.assert_array_equal(arrays["G"][kept], first["G"][kept])
    strain = asked.amplitude[:, None] / abs(arrays["G"])
    np.testing.assert_allclose(arrays["work"], np.pi * arrays["G"].imag * strain**2, rtol=1e-3)
    told = load(to.path).attributes
    assert (told["solver"], told["regularisation"]) == ({"fixed": "cycle", "moving": "steps"}[contacts], 0.0)
    assert left_behind(packing) == ["o.h5"]


def test_where_all_fail_there_is_no_file(monkeypatch, packing):
    asked, to = ask(packing)
    failing(monkeypatch, [(o, a) for o in OMEGA["fixed"] for a in asked.amplitude], PointSolver)
    with pytest.raises(ConvergenceError, match=r"omega 1.*e-0.  stress 1.0e-05: something went wrong$"):
        work(asked, to)
    assert not to.path.exists()


@pytest.mark.most_ranks(1)
def test_where_moving_contacts_start(monkeypatch, packing):
    """At the oscillation with fixed contacts down to α = 0.45; below, at rest."""
    seen = failing(monkeypatch, [], SteadyOscillation)
    for alpha, solved in ((0.45, 1), (0.449, 1)):
        work(*ask(packing, alpha, "moving", (1e-7,), (1e-8,), f"m{alpha}.h5", False))
        assert len(seen) == solved


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("contacts", ["fixed", "moving"])
def test_prestress_and_stiffness_are_those_of_the_packing(session, packing, contacts):
    """On all ranks together and on each alone."""
    disks = SAMPLES["k = 2.5"]()
    put(packing, disks, session.comm)
    omega, strain, options = OMEGA[contacts][:1], 1e-7, {"prestress": contacts == "moving"}
    G = work(*ask(packing, 1.0, contacts, (strain,), omega, stress=False, **options))["G"][0, 0]
    law = physics(rotations=False, **options)
    exact = Sweep(disks, law, np.array(omega), 1e-8, session.comm).solved().G[0]
    assert pytest.approx(exact, rel=1e-6 if contacts == "fixed" else 1e-2) == G


@pytest.mark.most_ranks(1)
def test_what_shears_by_itself_answers_a_strain(session, packing):
    """K is positive and G₀ negative: no stress holds such a packing, but a strain does."""
    put(packing, polydisperse(6)[0], session.comm)
    G = work(*ask(packing, stress=False, omega=(1e-6,)))["G"]
    np.testing.assert_allclose(G.real, -0.0724275937399935, rtol=1e-6)


def test_what_a_file_has_of_a_response():
    """Numbers that there are, and nothing else that a solver hands on."""
    common = {"G": 1.0 + 2.0j, "error": 3.0, "work": 6.0, "energy_balance": -7.0, "newton_steps": 8}
    common |= {"linear_iterations": 0, "drift": 0.0}
    steady = SteadyResult(**common, harmonics=np.array([4.0, 5.0j]), speed=9.0, velocity=None)
    assert steady.record() == common | {"harmonics": [4.0, 5.0j]}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_large_errors_of_moving_contacts_are_noted(session):
    """Of those amplitudes alone whose G' or G'' is known worse than to 5 %."""
    law = jampetsc.ContactDamping(rotations=False)
    settings = {"omega": 0.1, "contacts": "moving", "steps": 16, "cycles": 3, "law": law}
    result = jampetsc.oscillate(published(), strain=[1e-6, 5e-2], **settings)
    G, errors = result["G"].ravel(), result["G_error"].ravel()
    shares = np.maximum(abs(errors.real / G.real), abs(errors.imag / G.imag))
    assert shares[0] < 0.05 < shares[1]
    note = "uncertain: errors of G' or G'' exceed 5 % at strain 0.05. Give more steps or cycles"
    assert result.attributes["notes"] == note
    assert "notes" not in jampetsc.oscillate(published(), strain=1e-6, **settings).attributes

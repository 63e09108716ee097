"""What runs write: every array and attribute of a file is that of the run, under its name, on any number of ranks."""

import numpy as np
import pytest
from samples import isostatic, network_of, physics, published, put, sweep_of

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import packing_network
from jampetsc.commands.modes import Modes
from jampetsc.commands.packing_network import PackingNetwork
from jampetsc.commands.quasistatic import Quasistatic
from jampetsc.io.outlet import Outlet
from jampetsc.io.reader import load
from jampetsc.io.request import Request
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.packing import contacts
from jampetsc.packing.potentials import Potential
from jampetsc.response import contact_network, direct_sweep, modulus_sweep, slow_response, vibrations
from jampetsc.response.certificate import Functional
from jampetsc.response.minimum_check import BY_CHOLESKY
from jampetsc.response.slow_response import solve_quasistatic

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]


@pytest.fixture
def path(shared_path):
    return shared_path / "p.h5"


def whole(comm, local, axis=0):
    return np.concatenate(comm.allgather(local), axis=axis)


def compare(file, expected):
    for name, values in expected.items():
        np.testing.assert_allclose(file[name], values, rtol=1e-13, err_msg=name)


def recorded(monkeypatch, module, name):
    """What this function of a module returns from now on, call by call.

    Parallel factorisations round otherwise each time, so that a file is compared with its own run.
    """
    results, function = [], getattr(module, name)
    monkeypatch.setattr(
        module, name, lambda *words, **how: results.append(function(*words, **how)) or results[-1]
    )
    return results


def test_facts_of_a_packing(session):
    disks = isostatic().replace(potential=Potential(k=2.5)).with_record(seed=17)
    network = network_of(disks, physics(), session.comm)
    source = PackingNetwork("p.h5", disks, ("p.h5", "abc"), network, 0.0)
    found = source.record(physics(beta=3.0).parameters)
    overlaps, n = network.contact_count, network.n
    expected = {
        "packing": "p.h5", "packing_sha256": "abc", "beta": 3.0, "scalar_type": "real", "ranks": session.size,
        "particle_count": 24, "rattlers": 2, "k": 2.5, "seed": 17, "coordination": 2.0 * overlaps / 22,
        "force_threshold": network.threshold, "phi": disks.phi,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == expected and n == 22
    assert found["pressure"] == pytest.approx(2.5e-7, rel=0.01) and found["wall_seconds"] > 0.0
    assert 0.0 < found["force_threshold"] < found["pressure"]
    for name, value in session.options().items():
        assert f"-{name} {value or ''}".strip() in found["petsc_options"]


def test_options_of_petsc_are_all_that_are_in_force(session, path):
    """Whatever made the file: those of the user, and defaults of the solvers that it used."""
    session.PETSc.Options().setValue("record_given", "1")
    files = [
        jampetsc.jam(n=16, phi="0.9", seeds="1:2"),
        jampetsc.sweep(put(path, isostatic(), session.comm), omega=[1.0]),
    ]
    if session.size == 1:  # as quasistatic shear wants it
        files.append(jampetsc.shear(n=16, phi=0.9, step=0.01, strain=0.02))
    session.comm.barrier()
    for file in files:
        assert "-record_given 1" in file.attributes["petsc_options"]
    session.PETSc.Options().delValue("record_given")


def test_modes(session, path, monkeypatch):
    put(path, isostatic(), session.comm)
    out, results = path.parent / "m.h5", recorded(monkeypatch, vibrations, "lowest_modes")
    Modes(path, count=10).work(Outlet(out))
    (found,) = results
    session.comm.barrier()
    file = load(out)
    names = "eigenvalues residuals normal transverse shear_force participation_ratio floppiness".split()
    compare(file, {name: getattr(found, name) for name in names})
    contributions = found.contributions
    for name, share in contributions.share.items():
        compare(file, {f"share/{name}": share, f"cumulative/{name}": np.cumsum(share)})
    compare(
        file, {"lowest/count": [10], **{f"lowest/{k}_median": v for k, v in contributions.median.items()}}
    )
    assert {name: file.attributes[f"{name}_median"] for name in contributions.whole} == contributions.whole
    compare(file, {"modes": whole(session.comm, found.vectors, 1)})
    np.testing.assert_array_equal(file["particles"], whole(session.comm, found.network.particles))
    told = {name: getattr(found, name) for name in ("inertia_shift", "method", "restarts")}
    told |= {"inertia_count": 10, "complete": False, "contacts": 43, "prestress": True, "rattlers": 2}
    assert {name: file.attributes[name] for name in told} == told
    to = Outlet()
    Modes(path, below=0.5 * sum(found.eigenvalues[2:4])).work(to)
    np.testing.assert_allclose(to.result["eigenvalues"], found.eigenvalues[:3], rtol=1e-9)


@pytest.mark.parametrize("prestress", [True, False])
def test_quasistatic(session, path, prestress, monkeypatch):
    disks = published().replace(potential=Potential(k=2.5))
    put(path, disks, session.comm)
    out, law = path.parent / "q.h5", physics(beta=2.0, prestress=prestress)
    network = network_of(disks, law, session.comm)
    results = recorded(monkeypatch, slow_response, "solve_quasistatic")
    Quasistatic(path, law.law, prestress=prestress, betas=(0.5, 3.0)).work(Outlet(out))
    (found,) = results
    session.comm.barrier()
    file, comm = load(out), session.comm
    assert set(found.responses) == ({"", "no_prestress"} if prestress else {""})
    c = found.network.contacts
    once = c.i < c.j
    compare(file, {"contacts/bonds": whole(comm, c.r[once])})
    for name, one in found.responses.items():
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        arrays = {f"contacts/{key}": getattr(one, key) for key in ("normal", "transverse")}
        arrays |= {"contacts/sliding": one.flow.sliding, "rotation": one.flow.rotation}
        arrays |= {"nonaffine": one.nonaffine}
        compare(file, {group + key: whole(comm, value) for key, value in arrays.items()})
        numbers = file["contacts/pairs"]
        x = disks.positions[numbers]  # of the packing
        image = np.round((file["contacts/bonds"] - x[:, 1] + x[:, 0]) @ np.linalg.inv(disks.cell))
        np.testing.assert_allclose(
            x[:, 1] - x[:, 0] + image @ disks.cell, file["contacts/bonds"], rtol=0, atol=1e-12
        )
        i, j = np.array([np.flatnonzero(file["particles"] == n)[0] for n in numbers.ravel()]).reshape(-1, 2).T
        move, bonds = file[f"{group}nonaffine"][j] - file[f"{group}nonaffine"][i], file["contacts/bonds"]
        move[:, 0] += bonds[:, 1]
        normal = np.sum(move * bonds, axis=1) / np.hypot(*bonds.T)
        np.testing.assert_allclose(normal, file[f"{group}contacts/normal"], rtol=0, atol=1e-9)
        names = "G0 G_affine bulk_modulus field_error identity_difference".split()
        told = {name: getattr(one, name) for name in names} | {"eta0": one.flow.eta0}
        told |= {f"eta0_{part}": one.flow.parts[part] for part in ("normal", "transverse")}
        told |= {"omega_star": one.G0 / one.flow.eta0}
        for quantity in ("normal", "transverse", "nonaffine"):
            local = getattr(one, quantity)
            sizes = np.abs(whole(comm, local)) if local.ndim == 1 else np.hypot(*whole(comm, local).T)
            told |= {f"{quantity}_median": np.median(sizes), f"{quantity}_mean": sizes.mean()}
            told |= {f"{quantity}_rms": np.sqrt(np.mean(sizes**2))}
            assert file[f"{group}histogram/{quantity}/counts"].sum() == len(sizes)
        for key, value in told.items():
            assert file.attributes[prefix + key] == pytest.approx(value, rel=1e-12), prefix + key
        assert one.G_affine > one.G0 > 0.0 and one.field_error < 1e-9
    assert file.attributes["eta_inf"] == found.eta_inf
    columns = dict(zip(("beta", "eta0", "no_prestress_eta0", "eta_inf"), found.scan.T, strict=True))
    compare(file, {f"beta_scan/{name}": column for name, column in columns.items()})
    for beta, eta0, bare, eta_inf in found.scan:
        again = solve_quasistatic(network, physics(beta=beta).law)
        other = again.responses.get("no_prestress", again.responses[""])
        expected = again.responses[""].flow.eta0, other.flow.eta0, again.eta_inf
        np.testing.assert_allclose((eta0, bare, eta_inf), expected, rtol=1e-9)
    assert np.any(found.scan[:, 1] != found.scan[:, 2]) == prestress


@pytest.mark.parametrize("method", ["rational", "direct"])
def test_sweeps_under_power_law_damping(session, path, method, monkeypatch):
    """Frequencies are those of the experiment everywhere; those solved for are beside them."""
    put(path, published(), session.comm)
    damping = EquivalentDamping(0.5, 1e-5)
    out, law, omega, field = path.parent / "s.h5", physics(tau1=2.0), np.array([1e-4, 1e-2, 1.0]), 3e-3
    job = sweep_of(path, law, omega, [field], method, alpha=0.5, stress=1e-5)
    certain, real = [], Functional.field_bound
    monkeypatch.setattr(Functional, "field_bound", lambda *words: certain.append(real(*words)) or certain[-1])
    module, name = {
        "rational": (modulus_sweep, "sweep_rationally"), "direct": (direct_sweep, "sweep_directly"),
    }[method]  # fmt: skip
    sweeps = recorded(monkeypatch, module, name)
    job.work(Outlet(out, out, Request(job)))
    session.comm.barrier()
    solved, G, bounds = sweeps[0].omega, sweeps[0].G, sweeps[0].bounds
    file = load(out)
    asked = np.array([1e-4, field, 1e-2, 1.0])
    names = ("error_bound", "error_bound_storage", "error_bound_loss")
    compare(file, {"omega": asked, "equivalent_omega": solved, "G": G, "fields/omega": [field]})
    compare(file, dict(zip(names, bounds.T, strict=True)))
    np.testing.assert_allclose(solved, damping.frequency(2.0 * asked) / 2.0, rtol=1e-12)
    told = {"method": method, "accuracy": 1e-6, "alpha": 0.5, "stress": 1e-5, "tau1": 2.0, "unknowns": 48}
    proof = "not shown: that of fields is a bound only if K has no negative modes"
    told |= {"positive_semidefinite": f"proved by {BY_CHOLESKY}" if method == "rational" else proof}
    assert {name: file.attributes[name] for name in told} == told
    if method == "rational":
        between = EquivalentDamping(0.5, 1e-5).frequency(2.0 * 0.1) / 2.0
        assert file.modulus(0.1) == pytest.approx(file.spectrum.modulus(between), rel=1e-12)
        assert file.frequency_range == (solved[0], solved[-1])
    bound = file["fields/error_bound"]
    assert 0.0 < bound < 1e-3 and (method == "rational" or bound.tolist() == certain)
    at = physics(tau1=2.0)
    plain = Outlet()
    sweep_of(path, at, solved, [solved[1]], "direct").work(plain)
    same = plain.result.gathered()
    np.testing.assert_allclose(same["G"], G, rtol=1e-5)
    for name in ("displacement", "rotation"):
        np.testing.assert_allclose(file[f"fields/{name}"], same[f"fields/{name}"], rtol=1e-3, atol=1e-5)


@pytest.mark.most_ranks(1)
def test_a_packing_unstable_to_shear_is_noted(session, path, capsys):
    """In the summary, with what to do, and in the file; one in about nine small packings of fixed shape."""
    for seed in range(1, 100):
        disks = jampetsc.pack(n=24, pressure=1e-4, seed=seed, tolerance=1e-8)
        if jampetsc.quasistatic(disks).attributes["G0"] < 0.0:
            break
    put(path, disks, session.comm)
    for words in ("quasistatic", "sweep --omega 1e-9,1"):
        out = path.with_name("s.h5")
        cli.dispatch([*words.split(), str(path), "--out", str(out)])
        (note,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  note: ")]
        assert note.startswith("  note: unstable to shear: G") and note.endswith(": pack --stabilise shear")
        assert note == f"  note: {load(out).attributes['notes']}"
        out.unlink()
    assert "notes" not in jampetsc.quasistatic(isostatic()).attributes


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    "make",
    [
        lambda path: sweep_of(path, physics(), [1.0], fields=[1.0]),
        lambda path: sweep_of(path, physics(), [1.0], method="direct"),
        lambda path: Quasistatic(path, betas=(0.5, 2.0)),
        lambda path: Modes(path, count=3),
    ],
    ids=["rational", "direct", "quasistatic", "modes"],
)
def test_a_run_searches_contacts_and_builds_its_network_once(session, path, monkeypatch, make):
    """The packing has no proof of its minimum, which is then examined with the same network."""
    put(path, isostatic(), session.comm)
    calls = {"neighbour_pairs": 0, "build_network": 0}

    def count(module, name):
        original = getattr(module, name)

        def counted(*arguments, **options):
            calls[name] += 1
            return original(*arguments, **options)

        monkeypatch.setattr(module, name, counted)

    count(contacts, "neighbour_pairs")
    for module in (packing_network, contact_network):
        count(module, "build_network")
    make(path).work(Outlet())
    assert calls == {"neighbour_pairs": 1, "build_network": 1}

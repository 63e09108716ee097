"""`jampetsc flow`: its file, continuation after a kill and after the end, and errors of bad input."""

import fcntl
import json
import re
import shutil

import h5py
import launch
import numpy as np
import pytest
from sheared import crowd, stop_after

import jampetsc
from jampetsc import main as cli
from jampetsc import progress
from jampetsc.commands import flow_files
from jampetsc.commands.run_files import save_rows, saved_rows
from jampetsc.errors import InputError
from jampetsc.io.checkpoint import Checkpoint, folder_of
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import write_packing
from jampetsc.packing.potentials import Potential

SMALL = "flow --n 64 --phi 0.86 --seed 2 --model RD0 --rate 1e-2 --strain 0.6 --discard 0.2".split()


def flow(*words):
    """Exit status of `jampetsc words`."""
    return cli.main([str(word) for word in words])


def test_unused_ranks_are_reported(tmp_path):
    words = "flow --n 16 --phi 0.86 --model RD0 --rate 1e-2 --strain 0.1".split()
    done = launch.run(2, "../jampetsc/__main__.py", *words, "--out", tmp_path / "f.h5")
    assert done.returncode == 0 and done.stderr.count("one rank does one flow") == 1


def test_a_task_of_a_study_does_not_speak_of_ranks(monkeypatch, capsys):
    """Of several ranks each does a task of its own: every flow said that the others were idle."""
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    for shown in (False, True):
        with progress.reporting(True), progress.reporting(shown):
            jampetsc.flow(n=16, phi=0.86, model="RD0", rate=1e-2, strain=0.02)
        assert capsys.readouterr().err.count("one rank does one flow") == shown


def test_progress_can_be_silenced(tmp_path, capsys):
    for words in (SMALL, ["flow", tmp_path / "flow.h5", "--strain", 0.1]):
        assert flow(*words, "--quiet", "--out", tmp_path / "flow.h5") == 0
        text, log = capsys.readouterr()
        assert "sigma" in text and log == ""


def test_steps_in_which_disks_would_jump_are_divided(tmp_path):
    """Large clusters rotate, fast at their rims."""
    words = "flow --n 64 --phi 0.9 --seed 2 --model CD0 --rate 0.3 --step 1 --strain 6".split()
    assert flow(*words, "--out", tmp_path / "f.h5") == 0
    result = jampetsc.load(tmp_path / "f.h5")
    assert result.attributes["substeps"] >= 20 and len(result["strain"]) == 20


def test_the_file(tmp_path, capsys):
    out, last = tmp_path / "flow.h5", tmp_path / "last.h5"
    assert flow(*SMALL, "--snapshots", 4, "--out", out, "--last", last) == 0
    text, log = capsys.readouterr()
    lines = log.splitlines()
    assert len(lines) == 50 and "transient" in lines[0]
    assert lines[-1].startswith("[50/50] strain 0.6, sigma ") and lines[-1].endswith(", 0 s left")
    result = jampetsc.load(out)
    strain, facts = result["strain"], result.attributes
    assert strain[-1] == pytest.approx(0.6, rel=0.02) and (np.diff(strain) > 0).all()
    assert np.allclose(result["time"], strain / 1e-2)
    rows = len(strain)
    assert result["shear_stress"].shape == result["pressure"].shape == (rows, 3)
    for name in ("energy", "dissipation", "contact_number", "clusters", "largest_cluster", "deepest_overlap"):
        assert result[name].shape == (rows,)
    assert (result["shear_stress"][:, 1:] == 0).all()  # drag alone has no other stress
    kept = strain > 0.2 * (1 + 1e-12)
    assert facts["shear_stress_mean"] == pytest.approx(result["shear_stress"].sum(1)[kept].mean())
    assert facts["pressure_mean"] == pytest.approx(result["pressure"].sum(1)[kept].mean())
    assert 0 < facts["shear_stress_error"] < facts["shear_stress_mean"]
    assert facts["model"] == "RD0" and facts["rate"] == 1e-2 and facts["phi"] == pytest.approx(0.86)
    assert facts["seed"] == 2 and facts["mass"] == 0 and "k_e" in facts["units"]
    assert 0.5 < facts["energy_balance"] < 2
    assert f"{facts['pressure_mean']:.5g}" in text and "short for a correlation strain" in text
    snapshots = result["snapshots/strain"]
    assert len(snapshots) == 4 and snapshots[0] > 0.2 and snapshots[-1] == strain[-1]
    packing = jampetsc.load(last)
    assert np.allclose(packing.positions, result["snapshots/positions"][-1], atol=1e-12)
    assert np.allclose(packing.cell, result["snapshots/cell"][-1])
    assert packing.radii.min() == 0.5 and packing.potential.stiffness == "inverse-square-diameter"
    # the drag balances the forces of the snapshot: u = f/k_d
    from jampetsc.packing.contacts import find_contacts, net_forces

    forces = net_forces(packing.n, find_contacts(packing))
    assert np.abs(result["snapshots/velocities"][-1] - forces).max() < 1e-9


def test_a_killed_run_continues_to_the_last_bit(tmp_path, monkeypatch, capsys):
    """If its command is given again; another command does not use its checkpoint."""
    left = stop_after(monkeypatch, 0)
    whole, out = tmp_path / "whole.h5", tmp_path / "out.h5"
    command = [*SMALL, "--snapshots", "3"]
    for left[0], place, status in ((0, whole, 0), (40, out, 130)):
        assert flow(*command, "--out", place) == status
    assert not out.exists() and (tmp_path / "out.h5.resume").exists()
    assert flow(*command, "--out", out) == 0
    assert "continues from strain" in capsys.readouterr().err
    assert not (tmp_path / "out.h5.resume").exists()
    one, other = jampetsc.load(whole), jampetsc.load(out)
    for name in one:
        assert np.array_equal(one[name], other[name]), name
    assert one.attributes["pressure_mean"] == other.attributes["pressure_mean"]
    left[0], place = 1, tmp_path / "another.h5"
    assert flow(*SMALL, "--out", place) == 130
    assert flow(*("2e-2" if word == "1e-2" else word for word in SMALL), "--out", place) == 0
    assert "goes on" not in capsys.readouterr().err
    assert jampetsc.load(place).attributes["rate"] == 2e-2


@pytest.mark.parametrize("name", ["RD0", "CDn"])
def test_a_finished_run_continues_to_the_last_bit(tmp_path, name):
    mass = ["--mass", "1"] if name == "CDn" else []
    common = ["flow", "--n", 32, "--phi", 0.84, "--model", name, *mass, "--rate", 1e-2, "--discard", 0.1]
    one, two, farther = tmp_path / "one.h5", tmp_path / "two.h5", tmp_path / "farther.h5"
    assert flow(*common, "--strain", 1.0, "--out", one) == 0
    assert flow(*common, "--strain", 2.0, "--out", two) == 0
    assert flow("flow", one, "--strain", 1.0, "--out", farther) == 0
    whole, parts = jampetsc.load(two), jampetsc.load(farther)
    assert len(jampetsc.load(one)["strain"]) == len(whole["strain"]) // 2
    for name in ("strain", "shear_stress", "pressure", "energy", "dissipation"):
        assert np.array_equal(whole[name], parts[name])
    assert parts.attributes["seed"] == 1
    place = ["--out", tmp_path / "link.h5"] if whole.attributes["model"] == "RD0" else []
    (tmp_path / "link.h5").symlink_to(one)
    assert flow("flow", one, "--strain", 1.0, *place) == 0  # in its own place
    assert np.array_equal(jampetsc.load(one)["energy"], whole["energy"])
    assert (tmp_path / "link.h5").is_symlink()


def test_a_continued_run_takes_more_snapshots(tmp_path, monkeypatch):
    """At the same distance in strain; disk space is checked for all of them."""
    out, room = tmp_path / "flow.h5", []
    common = "flow --n 16 --phi 0.9 --model RD0 --rate 0.1 --strain 0.1 --discard 0 --snapshots 4".split()
    assert flow(*common, "--out", out) == 0
    before = jampetsc.load(out)["snapshots/strain"]
    monkeypatch.setattr(
        flow_files, "check_space", lambda to, disks, snapshots: room.append((disks, snapshots))
    )
    assert flow("flow", out, "--strain", 0.1) == 0
    after = jampetsc.load(out)
    assert np.array_equal(after["snapshots/strain"][:4], before)
    assert after["snapshots/strain"] == pytest.approx([0, 0.035, 0.065, 0.1, 0.135, 0.165, 0.2])
    assert room == [(16, 7)] and len(after["snapshots/images"]) == 7


def test_a_packing_keeps_its_own_units(tmp_path):
    packing, out = tmp_path / "p.h5", tmp_path / "flow.h5"
    disks = crowd(exponent=2.5)
    write_packing(packing, disks)
    words = ["flow", packing, "--model", "CD0", "--rate", 1e-2, "--strain", 0.3, "--out", out]
    assert flow(*words) == 0
    facts = jampetsc.load(out).attributes
    assert facts["phi"] == pytest.approx(disks.phi) and facts["potential"] == "hertzian"
    assert facts["packing"] == "p.h5" and "packing" in facts["units"]
    assert flow("flow", out, "--strain", 0.1) == 0
    farther = jampetsc.load(out).attributes
    kept = flow_files.ORIGIN_ATTRIBUTES
    assert "packing_sha256" in kept and all(farther.get(name) == facts.get(name) for name in kept)


def test_quality_and_the_stress_of_the_fluid_are_in_units_of_k_and_tau1(tmp_path):
    """m = Q² k τ₁² and σ_F = η_F kτ₁ γ̇, here with k = 4 and τ₁ = 2."""
    packing, out, fluid = (tmp_path / name for name in ("p.h5", "flow.h5", "fluid.h5"))
    write_packing(packing, crowd(16).replace(potential=Potential(k=4.0)))
    common = ["flow", packing, "--tau1", 2, "--rate", 1e-2, "--strain", 0.01]
    assert flow(*common, "--model", "CD", "--quality", 0.1, "--out", out) == 0
    facts = jampetsc.load(out).attributes
    assert facts["mass"] == pytest.approx(0.16) and facts["quality"] == pytest.approx(0.1)
    assert facts["method"] == "backward Euler"
    assert flow(*common, "--law", "stokes", "--eta-f", 3, "--out", fluid) == 0
    assert jampetsc.load(fluid)["shear_stress"][:, 1] == pytest.approx(0.24)


def test_a_law_of_the_linear_part(tmp_path):
    """Contact damping without rotations and β = 1 is CD0; with rotations it needs a mass."""
    common = "flow --n 64 --phi 0.86 --rate 1e-2 --strain 0.3".split()
    law, named, rolling = (tmp_path / name for name in ("law.h5", "named.h5", "rolling.h5"))
    assert flow(*common, "--law", "contact", "--no-rotations", "--out", law) == 0
    assert flow(*common, "--model", "CD0", "--out", named) == 0
    assert np.array_equal(jampetsc.load(law)["shear_stress"], jampetsc.load(named)["shear_stress"])
    assert flow(*common, "--law", "contact", "--beta", 2, "--mass", 1, "--out", rolling) == 0
    assert jampetsc.load(rolling).law["beta"] == 2


BAD = [  # (options, words of the message) of runs that fail
    ("--n 16 --phi 0.1 --strain 0.05 --discard 0.04", "no two particles touched"),
    ("--step 0.8", "work and dissipation differ"),  # nothing blows up
]


@pytest.mark.parametrize("words, message", BAD)
def test_bad_words(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    status = flow(*SMALL, *words.split(), "--out", "out.h5")
    error = capsys.readouterr().err
    assert status == 3 and message in error
    assert len(re.findall("jampetsc: error:", error)) == 1
    assert not list(tmp_path.iterdir())


def test_threads_do_not_change_a_result(tmp_path, capsys):
    """A flow file may be continued with another number of them."""
    files = [tmp_path / name for name in ("one.h5", "two.h5")]
    for threads, out in enumerate(files, 1):
        assert flow(*SMALL, "--threads", threads, "--out", out) == 0
        assert flow("flow", out, "--strain", 0.2, "--threads", 3 - threads) == 0
    one, two = map(jampetsc.load, files)
    for name in ("shear_stress", "energy", "state/offsets", "state/velocities"):
        assert np.array_equal(one[name], two[name]), name


def test_given_radii(tmp_path):
    listed, out = tmp_path / "radii", tmp_path / "flow.h5"
    radii = np.random.default_rng(1).uniform(0.8, 1.4, 40)
    np.savetxt(listed, radii, fmt="%.17g")
    words = ["flow", "--radii", listed, "--phi", 0.86, "--model", "RD0", "--rate", 1e-2, "--strain", 0.2]
    assert flow(*words, "--out", out) == 0
    result = jampetsc.load(out)
    assert np.array_equal(np.sort(result["state/radii"]), np.sort(radii))
    assert result.attributes["sizes"] == "radii of radii" and "length" in result.attributes["units"]


WRONG_STATES = {  # dataset or attribute -> what it holds instead, what is said of it
    "order": (np.zeros(16, int), "dataset state/order: not the state of a flow"),  # which ended the process
    "skin": (np.nan, "dataset state/skin: not the state"),
    "offsets": (np.full((16, 2), np.inf), "dataset state/offsets: not the state"),
    "steps": (-1, "dataset state/steps: not the state"),
    "radii": (np.full(16, -0.5), r"radii\[0\] = -0.5: must be positive"),
    "cell_base": (np.ones((2, 2)), "cell: .*must be rows"),
    "settings": ("[]", "damaged"),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A short flow of 16 disks."""
    path = tmp_path_factory.mktemp("flow") / "f.h5"
    assert flow(*"flow --n 16 --phi 0.86 --model RD0 --rate 1e-2 --strain 0.02 --out".split(), path) == 0
    return path


@pytest.mark.parametrize("name", [*WRONG_STATES, "schedule"])
def test_a_flow_is_not_continued_from_a_state_that_it_cannot_have(finished, tmp_path, name):
    path = shutil.copy(finished, tmp_path / "f.h5")
    value, said = WRONG_STATES.get(name, (None, r"\d+ rows, but settings of \d+"))
    with h5py.File(path, "r+") as h5:
        if name == "schedule":
            settings = json.loads(h5.attrs["settings"])
            settings["schedule"]["rows"] += 1
            value, name = json.dumps(settings), "settings"
        if name == "settings":
            h5.attrs[name] = value
        else:
            h5[f"state/{name}"][...] = value
    with pytest.raises(InputError, match=f"f.h5: .*{said}"):
        jampetsc.flow(path, strain=0.01)


def test_snapshots_need_room_twice(tmp_path, monkeypatch):
    """Positions, images, velocities and spins of 10 disks, strain and cell, in the file and in the checkpoint."""
    needed = 2 * 7 * (10 * (3 * 2 + 1) + 1 + 4) * 8
    usage = shutil.disk_usage(tmp_path)
    for free, fits in ((needed, True), (needed - 1, False)):
        monkeypatch.setattr(
            flow_files.shutil, "disk_usage", lambda path, free=free: usage._replace(free=free)
        )
        if fits:
            flow_files.check_space(Outlet(tmp_path / "x.h5"), 10, 7)
        else:
            with pytest.raises(InputError, match="snapshots 7: of 10 particles need"):
                flow_files.check_space(Outlet(tmp_path / "x.h5"), 10, 7)


def test_only_an_intact_checkpoint_of_the_same_job_is_used(tmp_path):
    out, digest = tmp_path / "x.h5", "a" * 64
    checkpoint = Checkpoint(out, digest)
    assert saved_rows(checkpoint) is None
    save_rows(checkpoint, {"energy": np.arange(3.0)}, {"base": np.eye(2)})
    arrays, state = saved_rows(Checkpoint(out, digest))
    assert arrays.keys() == {"energy"} and np.array_equal(arrays["energy"], np.arange(3.0))
    assert state.keys() == {"base"} and np.array_equal(state["base"], np.eye(2))
    with open(folder_of(out) / "lock") as lock, pytest.raises(BlockingIOError):
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # another process may not use it
    assert saved_rows(Checkpoint(out, "b" * 64)) is None
    (path,) = folder_of(out).glob("0*")
    path.write_bytes(path.read_bytes()[:-100])
    assert saved_rows(Checkpoint(out, digest)) is None

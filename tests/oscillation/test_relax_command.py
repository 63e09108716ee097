"""`jampetsc relax` as a program and as a function: what it writes, and that it continues on any number of ranks."""

import subprocess
import sys

import launch
import numpy as np
import pytest
from samples import published

import jampetsc
from jampetsc.errors import ConvergenceError
from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load
from jampetsc.oscillation import strain_sweep


def relax(*words, ranks=0):
    line = [*launch.mpirun(ranks), sys.executable, "-m", "jampetsc", "relax", *map(str, words)]
    return subprocess.run(line, env=launch.environment(), capture_output=True, text=True, timeout=120)


def test_strains_are_shared_by_ranks_and_kept_after_a_kill(tmp_path):
    """Each is the same to the last bit on any number of ranks; a journal of one rank serves two."""
    packing = tmp_path / "published.h5"
    write_packing(packing, published())
    words = "--strain 1e-5,1e-3 --law stokes --times 0.1,1 --accuracy 0.1".split()
    line = ("relax", packing, "--out", tmp_path / "2.h5", *words)
    assert launch.run(0, "run_with_disk_faults.py", "steps", 1, *line).returncode < 0  # killed
    files = []
    for ranks in (0, 2):
        done = relax(packing, "--out", tmp_path / f"{ranks}.h5", *words, ranks=ranks)
        assert done.returncode == 0, done.stderr
        assert "2 step strains" in done.stdout and "[2/2]" in done.stderr
        assert ("1 of 2 strains are finished" in done.stderr) == (ranks == 2)
        files.append(load(tmp_path / f"{ranks}.h5"))
    one, two = files
    for name in ("G", "error", "energy", "dissipated", "initial_G", "contacts_opened"):
        np.testing.assert_array_equal(one[name], two[name])
    assert "not at rest" in one.attributes["notes"]


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_the_default_ends_at_rest(session):
    """Times are those until the last strain is at rest; a strain that is at rest before keeps its last value."""
    found = jampetsc.relax(published(), jampetsc.StokesDrag(tau1=0.5), strain=[1e-6, 1e-3], accuracy=0.1)
    time, relaxed = found["time"], found["relaxed_time"]
    assert time[0] == pytest.approx(5e-4) and len(time) < 100
    assert found["G"].shape == (2, len(time)) and time[-1] >= relaxed.max() > time[-2]
    np.testing.assert_array_equal(found["negative_modes"], [0, 0])
    first = int(np.argmin(relaxed))
    assert np.all(found["G"][first, time > relaxed[first]] == found["G"][first, -1])
    assert found.attributes["notes"] == "" if "notes" in found.attributes else True


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_strain_that_fails_leaves_the_others(session, shared_path, monkeypatch):
    original = strain_sweep.step_strain

    def fails_above(disks, law, load, strain, times, accuracy):
        if strain > 1e-4:
            raise ConvergenceError("time steps after t = 1: too many, or too short.")
        return original(disks, law, load, strain, times, accuracy)

    monkeypatch.setattr(strain_sweep, "step_strain", fails_above)
    words = {"strain": [1e-6, 1e-3], "times": [0.1], "accuracy": 0.1, "out": shared_path / "r.h5"}
    with pytest.raises(
        ConvergenceError, match=r"1 of 2 strains failed, .*strain 0\.001: time steps after t = 1"
    ):
        jampetsc.relax(published(), jampetsc.StokesDrag(), **words)
    session.comm.Barrier()
    found = load(shared_path / "r.h5")
    assert np.isfinite(found["G"][0]).all() and np.isnan(found["G"][1]).all()
    assert "for strain 1e-06" in found.attributes["notes"]
    np.testing.assert_array_equal(found["newton_steps"] > 0, [True, False])

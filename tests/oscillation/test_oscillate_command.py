"""`jampetsc oscillate` as a program: what it writes, what it refuses, and that it goes on where it was."""

import subprocess
import sys

import launch
import numpy as np
import pytest
from samples import published

from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("oscillate") / "published.h5"
    write_packing(path, published())
    return path


def oscillate(*words, ranks=0):
    line = [*launch.mpirun(ranks), sys.executable, "-m", "jampetsc", "oscillate", *map(str, words)]
    return subprocess.run(line, env=launch.environment(), capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--stress 1e-5 -osc_snes_type nrichardson", "-osc_snes_type nrichardson: not supported. Use one of"),
        # limits of stresses are known once the packing is read
        ("--contacts moving --stress 1e-12", "stress 1e-12: must lie between 1e-09 and 1 with"),
    ],
)
def test_what_is_refused_once_the_packing_is_read(packing, tmp_path, words, message):
    done = oscillate(packing, "--out", tmp_path / "out.h5", "--omega", 1, *words.split())
    assert done.returncode == 2 and not (tmp_path / "out.h5").exists()
    assert message in done.stderr and len(done.stderr.splitlines()) == 1


def test_steps_in_time_on_any_number_of_ranks(packing, tmp_path):
    """Frequencies are shared between ranks, and each chain of amplitudes is the same to the last bit; a journal of one
    rank serves two.
    """
    words = "--contacts moving --omega 0.3,1 --cycles 3 --stress 1e-6,1e-4 --steps 16".split()
    line = ("oscillate", packing, "--out", tmp_path / "2.h5", *words)
    assert launch.run(0, "run_with_disk_faults.py", "steps", 1, *line).returncode < 0  # killed
    files = []
    for ranks in (0, 2):
        done = oscillate(packing, "--out", tmp_path / f"{ranks}.h5", *words, ranks=ranks)
        assert done.returncode == 0, done.stderr
        assert "4 oscillations" in done.stdout and "[4/4]" in done.stderr
        assert ("1 points are finished" in done.stderr) == (ranks == 2)
        files.append(load(tmp_path / f"{ranks}.h5"))
    one, two = files
    for name in ("G", "stress_waveform", "steps_taken"):
        np.testing.assert_array_equal(one[name], two[name])
    np.testing.assert_array_equal(one["cycles"], [[6, 6]] * 2)
    assert np.all(one["error"] < 0.05 * abs(one["G"]))

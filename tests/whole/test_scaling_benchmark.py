"""The benchmark of time and memory against N, at a tiny size: benchmarks/scaling.py."""

import os
import subprocess
import sys

import launch
import numpy as np
import pytest

sys.path.insert(0, str(launch.ROOT / "benchmarks"))

import scaling

import jampetsc


def test_a_table_grows_by_what_it_lacks(tmp_path, capsys, monkeypatch):
    """A packing and its sweep, each a process; what failed is told and tried again, nothing else."""
    monkeypatch.setenv("OMPI_MCA_mpi_yield_when_idle", "1")  # which `measure` changes
    scaling.measure(tmp_path, [16], [1], ["sweep"])
    assert "n16.h5: no such file" in capsys.readouterr().out and not scaling.read(tmp_path / "scaling.csv")
    scaling.measure(tmp_path, [16], [1], ["pack", "sweep"])
    rows = scaling.read(tmp_path / "scaling.csv")
    assert [row["command"] for row in rows] == ["pack", "sweep"] and list(rows[0]) == scaling.COLUMNS
    assert all(row["n"] == 16 and row["processor"] > 0 and row["memory"] > 0.01 for row in rows)
    assert 0 < rows[1]["certified"] <= float(scaling.ACCURACY)
    assert rows[1]["G0"] < rows[1]["G_inf"] and rows[1]["eta_inf"] > 0 and np.isnan(rows[0]["G0"])
    capsys.readouterr()
    scaling.measure(tmp_path, [16], [1], ["pack", "sweep"])
    assert scaling.read(tmp_path / "scaling.csv")[1] == rows[1]
    assert capsys.readouterr().out.startswith("N = 16: factor of the displacements about ")
    scaling.draw(rows, tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 5000


def test_spheres_and_their_accuracy(tmp_path, monkeypatch):
    monkeypatch.setenv("OMPI_MCA_mpi_yield_when_idle", "1")  # which `measure` changes
    scaling.measure(tmp_path, [16], [1], ["pack", "sweep"], dimension=3, accuracy="1e-6")
    assert scaling.read(tmp_path / "scaling.csv")[1]["certified"] <= 1e-6
    assert jampetsc.load(tmp_path / "n16.h5").dimension == 3


@pytest.mark.parametrize("power", [0.5, 1.2])
def test_an_exponent_is_that_of_the_largest_sizes(power):
    n = np.array([10.0, 100.0, 1000.0, 3000.0])
    values = np.where(n < 1000, 7.0, n**power)
    assert scaling.exponent(n, values) == pytest.approx(power)
    assert np.isnan(scaling.exponent(n[:1], values[:1]))


def test_the_job_of_slurm_goes_on_and_draws(tmp_path):
    """All that one rank does for N = 16 is in the table already. It has to be told where the clone is."""
    for command in scaling.commands_on(1):
        row = {"command": command, "n": 16, "ranks": 1, "processor": 1.0, "memory": 0.1}
        scaling.append(tmp_path / "scaling.csv", row)
    kept = (tmp_path / "scaling.csv").read_bytes()
    path = f"{os.path.dirname(sys.executable)}:/usr/bin:/bin"
    job = launch.environment() | {"N": "16", "FOLDER": str(tmp_path), "PATH": path}
    script = ["bash", launch.ROOT / "run" / "slurm" / "scaling.sbatch"]
    settings = {"capture_output": True, "text": True, "cwd": tmp_path}
    done = subprocess.run(script, env=job | {"TREE": str(launch.ROOT)}, **settings)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "scaling.csv").read_bytes() == kept
    assert (tmp_path / "scaling.png").stat().st_size > 5000
    done = subprocess.run(script, env=job | {"TREE": ""}, **settings)
    assert done.returncode and "say where the clone is: TREE=" in done.stderr

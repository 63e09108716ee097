"""Programs that the benchmarks start: where one does not start or fails, one line says so."""

import subprocess
import sys

import common
import lammps
import launch
import pytest


def script(folder, body, mode=0o755):
    path = folder / "lmp"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    ("body", "mode", "message"),
    [
        (None, 0, "does not start (No such file or directory). Install it, or give the path of one that does."),
        ("exit 0", 0o644, "does not start (Permission denied)."),
        ("echo 'lmp: error while loading shared libraries: libmpi.so.12'; echo; exit 127", 0o755,
         "-help: exit status 127. It says: lmp: error while loading shared libraries: libmpi.so.12"),
        ("exit 3", 0o755, "-help: exit status 3. It says: nothing"),
        ("kill -9 $$", 0o755, "-help: killed by signal 9."),
        ("echo Usage", 0o755, "not LAMMPS, whose -help names it. Give the path of its program lmp."),
    ],
)  # fmt: skip
def test_a_program_that_is_not_lammps_or_does_not_start(tmp_path, body, mode, message):
    path = tmp_path / "lmp" if body is None else script(tmp_path, body, mode)
    with pytest.raises(SystemExit) as ended:
        lammps.program(path, tmp_path)
    said = str(ended.value.code)
    assert said.startswith(str(path)) and message in said and "\n" not in said


def test_lammps_is_asked_for_its_name_before_anything_is_computed(tmp_path):
    path = script(tmp_path, "echo 'Large-scale Atomic/Molecular Massively Parallel Simulator - LAMMPS'")
    assert lammps.program(path, tmp_path) == path


@pytest.mark.parametrize("words", [["flow.py", "--lammps"], ["quench.py", "lammps", "--lammps"]])
def test_a_benchmark_ends_with_one_line(tmp_path, words):
    benchmark, *options = words
    line = [sys.executable, launch.ROOT / "benchmarks" / benchmark, *options, tmp_path / "none"]
    done = subprocess.run(line, env=launch.environment(), capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith(f"{tmp_path}/none: does not start (No such file or directory)")


def test_a_worker_that_fails_and_a_machine_without_mpirun(tmp_path, monkeypatch):
    worker = tmp_path / "worker.py"
    worker.write_text("print('begun')\nraise ValueError('no such packing')\n")
    with pytest.raises(SystemExit) as ended:
        common.worker(worker)
    assert str(ended.value.code).endswith("worker.py: exit status 1. It says: ValueError: no such packing")
    worker.write_text("import common\ncommon.report(value=1)\n")
    monkeypatch.setenv("PYTHONPATH", str(launch.ROOT / "benchmarks"))
    assert common.worker(worker)["value"] == 1
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SystemExit) as ended:
        common.worker(worker, ranks=2)
    assert str(ended.value.code) == "mpirun: not in PATH, and 2 ranks need it. Install an MPI."

"""The commands as python functions: the same file, loaded, and the same refusals."""

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import launch
import numpy as np
import pytest
import samples

import jampetsc
from jampetsc import cli, functions
from jampetsc.commands import spectrum
from jampetsc.errors import InputError
from jampetsc.storage.hdf5 import attributes, open_file
from jampetsc.storage.result_file import ResultWriter


@pytest.fixture
def packing(session, shared_path):
    return samples.put(shared_path / "p.h5", samples.published(), session.comm)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_function_gives_what_load_gives_for_the_command(session, packing, shared_path):
    out = shared_path / "command.h5"
    words = ["--beta", "0.1", "--no-prestress", "--omega", "0.01,1.0"]
    assert cli.dispatch(["sweep", str(packing), "--out", str(out), *words]) == 0
    command = jampetsc.load(out)
    options = {"beta": np.float64(0.1), "no_prestress": True, "omega": np.array([0.01, 1.0]), "fields": None}
    disks = jampetsc.load(packing)
    arrays = jampetsc.Packing(disks.positions, disks.radii, disks.cell)
    for source in (packing, str(packing), disks, arrays):
        function = jampetsc.sweep(source, **options)
        np.testing.assert_allclose(function.G, command.G, rtol=1e-9)
        assert function.law == command.law and function.attributes["ranks"] == session.size
    kept = jampetsc.sweep(packing, out=shared_path / "kept.h5", **options)
    assert kept.attributes["argv"].endswith(f"sweep {packing} --out {shared_path}/kept.h5 {' '.join(words)}")
    assert kept.path == shared_path / "kept.h5"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_functions_take_what_functions_give(session):
    disks = jampetsc.pack(n=16, pressure=1e-2, seed=3)
    assert disks.n == 16 and disks.record["seed"] == 3
    assert jampetsc.modes(disks, count=2)["eigenvalues"][0] > 0
    sweep = jampetsc.sweep(disks, omega=[1e-3, 1.0])
    spectrum = jampetsc.spectrum(sweep)  # has nothing to do with PETSc: one rank does it
    slow = jampetsc.quasistatic(disks)
    assert spectrum.spectrum.G0 == pytest.approx(slow.attributes["G0"], rel=1e-6)
    denser = jampetsc.pack(pressure=2e-2, from_=disks)
    assert denser.record["pressure"] == pytest.approx(2e-2)
    session.comm.Barrier()
    left = {
        one.path for one in (sweep, spectrum, slow)
    }  # files that results are read from, none of a packing
    assert {Path(functions._folder, name) for name in os.listdir(functions._folder)} >= left
    assert not any(open_format(path) == "jampetsc-packing" for path in Path(functions._folder).glob("*.h5"))
    session.comm.Barrier()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_packing_is_minimised_in_its_cell(session, packing):
    rest = jampetsc.load(packing)
    moved = rest.positions + 1e-3 * np.random.default_rng(1).normal(size=(rest.n, 2))
    start = jampetsc.Packing(moved, rest.radii, rest.cell)
    found = start.minimise(tolerance=1e-8)
    assert np.array_equal(found.cell, start.cell) and found.record["negative_modes"] == 0
    assert (
        found.record["max_force"] < 1e-7 * found.pressure and found.record["energy"] < start.record["energy"]
    )


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_what_needs_no_petsc_is_done_by_one_rank(session, shared_path, monkeypatch):
    if session.rank == 0:
        with ResultWriter(shared_path / "s.h5", "jampetsc-sweep") as writer:
            for name, values in {
                "omega": [0.1, 1.0],
                "G": [1 + 1j, 2 + 2j],
                "error_bound": [0.0, 0.0],
            }.items():
                writer.dataset(name, np.array(values))
            for name, values in {"G0": 1.0, "eta_inf": 0.5, "rates": [1.0], "weights": [2.0]}.items():
                writer.dataset(f"reduced/{name}", values)
    session.comm.Barrier()
    runs, run = [], spectrum.run
    monkeypatch.setattr(spectrum, "run", lambda *words: runs.append(session.rank) or run(*words))
    monkeypatch.setattr("sys.stdout", said := io.StringIO())
    found = jampetsc.spectrum(shared_path / "s.h5")
    assert found["relaxation/rates"].tolist() == [1.0] and said.getvalue() == ""
    assert session.comm.allreduce(len(runs)) == 1 and runs == [0] * (session.rank == 0)


def open_format(path):
    """What kind of file it is."""
    with open_file(path) as h5:
        return attributes(h5)["format"]


@pytest.mark.scalar("real")
def test_the_folder_of_files_without_a_name_is_made_again(session, monkeypatch):
    first = functions._temporary()
    session.comm.Barrier()
    assert os.path.dirname(functions._temporary()) == os.path.dirname(first)
    session.comm.Barrier()
    if session.rank == 0:
        shutil.rmtree(os.path.dirname(first))
    session.comm.Barrier()
    again = functions._temporary()
    assert os.path.isdir(os.path.dirname(again)) and session.comm.bcast(again) == again
    session.comm.Barrier()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_packing_in_memory_is_written_once(session, monkeypatch):
    written, write = [], functions.write_packing
    monkeypatch.setattr(
        functions, "write_packing", lambda *words: written.append(session.rank) or write(*words)
    )
    path = functions._file(samples.published())
    assert session.comm.allgather(written) == [[0], []][: session.size]
    assert jampetsc.load(path).n == samples.published().n
    assert functions._file(jampetsc.load(path)) != path and functions._file(Path("a.h5")) == "a.h5"


def test_values_as_a_command_line_has_them():
    assert (
        functions._one([1e-3, 0.1 + 0.2]) == "0.001,0.30000000000000004" and functions._one((1, 2)) == "1,2"
    )
    assert functions._one(np.array([0.5])) == "0.5" and functions._one(np.array([0.5, 2])) == "0.5,2.0"
    plain = [functions._one(value) for value in (np.float64(0.1), np.int64(3), np.bool_(True))]
    assert [repr(value) for value in plain] == ["0.1", "3", "True"]
    assert (
        functions._one(Path("a") / "b") == "a/b"
        and functions._one("x") == "x"
        and functions._one(True) is True
    )
    for call in (
        lambda: jampetsc.run("modes", "p.h5", help=True),
        lambda: jampetsc.run("modes", "p.h5", cuont=3),
    ):
        with pytest.raises(InputError, match=r"modes: (help|cuont): no such option"):
            call()


@pytest.mark.scalar("real")
def test_what_a_command_refuses_a_function_refuses(session, packing):
    for call, message in (
        (lambda: jampetsc.sweep(packing, bta=1), "sweep: bta: no such option; did you mean beta?"),
        (lambda: jampetsc.sweep(packing, beta=-1.0), "--beta -1: must lie between"),
        (lambda: jampetsc.run("swep", packing), "swep: no such function: there are pack, sweep"),
        (lambda: jampetsc.run("pack", packing, n=16), "pack: takes no file, but 1 are given"),
        (lambda: jampetsc.sweep("none.h5"), "none.h5: no such file"),
    ):
        with pytest.raises(InputError) as refusal:
            call()
        assert str(refusal.value).startswith(message)
    session.comm.Barrier()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)  # RD0 has nothing to share, and says so
def test_flows_and_studies_are_functions_too(session, shared_path):
    flow = jampetsc.flow(n=16, phi=0.9, model="RD0", rate=1e-2, strain=0.2, discard=0.1, snapshots=2)
    farther = jampetsc.flow(flow, strain=0.3, out=shared_path / "farther.h5")
    assert farther["strain"][-1] > flow["strain"][-1]
    assert jampetsc.correlate(flow, bin=0.5)["pairs"].sum() > 0
    assert jampetsc.jam(n=16, phi=0.9, seeds="1:2")["pressure"].shape == (2,)
    session.comm.Barrier()
    if session.rank == 0:
        (shared_path / "s.toml").write_text(
            '[pack]\nn = 16\npressure = 1e-2\nseeds = "1:2"\nstabilise = "shear"\n[quasistatic]\nbeta = 0.1\n'
        )
    session.comm.Barrier()
    table = jampetsc.study(shared_path / "s.toml", out=shared_path / "study")
    assert set(table["state"]) == {"done"} and table.where(command="quasistatic")["G0"].min() > 0
    session.comm.Barrier()


@pytest.mark.parametrize("name", functions.FUNCTIONS)
def test_every_function_runs_its_own_command(monkeypatch, name):
    calls = []
    monkeypatch.setattr(functions, "run", lambda *words, **options: calls.append((words, options)))
    inputs = () if name in ("pack", "jam") else ("a.h5",)
    getattr(jampetsc, name)(*inputs, out="o.h5", n=3)
    assert calls == [((name, *inputs), {"out": "o.h5", "n": 3})]


def test_every_function_has_a_name_in_the_package():
    from jampetsc import functions

    assert {name for name in functions.FUNCTIONS if callable(getattr(jampetsc, name))} == set(
        functions.FUNCTIONS
    )
    assert set(functions.FUNCTIONS) < set(jampetsc.__all__)


def test_temporary_files_go_with_the_process(tmp_path):
    code = "import jampetsc, sys; assert 'petsc4py' not in sys.modules; print(jampetsc.pack(n=16, phi=0.9).n)"
    environment = launch.environment() | {"TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "16\n", done.stderr
    assert not [name for name in os.listdir(tmp_path) if not name.startswith("ompi")]

"""`jampetsc pack` as a user types it: files, ensembles over ranks, continuation, and what bad input gets."""

import subprocess
import sys

import h5py
import launch
import numpy as np
import pytest
from samples import published

from jampetsc import cli
from jampetsc.contacts.disks import Disks
from jampetsc.contacts.potentials import Potential
from jampetsc.contacts.state import measure
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.storage.packing_file import read_packing, write_packing


def pack(folder, *words, ranks=0):
    """`jampetsc pack words…` in `folder`, on so many ranks (0: without mpirun)."""
    command = [*launch.mpirun(ranks), sys.executable, "-m", "jampetsc", "pack", *map(str, words)]
    finished = {"capture_output": True, "text": True, "timeout": 100, "cwd": folder}
    return subprocess.run(command, env=launch.environment(), **finished)


def content(path):
    """Datasets and attributes of a file, as bytes and values."""
    with h5py.File(path) as file:
        return {name: file[name][()].tobytes() for name in file}, dict(file.attrs)


def test_one_packing(tmp_path):
    done = pack(tmp_path, "--n", 64, "--pressure", "1e-3", "--seed", 3, "--out", "a.h5")
    assert done.returncode == 0 and done.stderr == ""
    assert len(done.stdout.splitlines()) == 1 and "p = 0.001" in done.stdout
    disks = read_packing(tmp_path / "a.h5")
    assert disks.n == 64 and disks.record["seed"] == 3 and disks.record["negative_modes"] == 0
    state = measure(disks)
    assert state.max_force <= 1e-13 and abs(state.pressure - 1e-3) <= 1e-13
    assert disks.record["max_force"] == state.max_force


def test_a_tolerance_that_rounding_forbids_is_told(tmp_path):
    done = pack(tmp_path, "--n", 24, "--pressure", "1e-7", "--seed", 2, "--out", "a.h5")
    disks = read_packing(tmp_path / "a.h5")
    residual = disks.record["max_force"] / (disks.record["pressure"] * 2 * disks.radii.mean())
    assert residual > 1e-10
    assert (
        f"max|F|/(p d) = {residual:.1e} is what rounding leaves, more than --tolerance 1e-10" in done.stdout
    )


def test_ensemble_is_the_same_on_any_number_of_ranks(tmp_path):
    words = ("--n", 32, "--pressure", "1e-2,1e-3", "--seeds", "1:3", "--out", "p{pressure}-{seed}.h5")
    for ranks in (0, 2):
        (tmp_path / str(ranks)).mkdir()
        done = pack(tmp_path / str(ranks), *words, ranks=ranks)
        assert done.returncode == 0, done.stderr
        assert len(done.stdout.splitlines()) == 6
    names = sorted(path.name for path in (tmp_path / "0").iterdir())
    assert len(names) == 6
    for name in names:
        assert content(tmp_path / "0" / name) == content(tmp_path / "2" / name)
    (tmp_path / "2" / names[0]).unlink()
    again = pack(tmp_path / "2", *words, ranks=2)
    assert again.returncode == 0 and "5 of 6 packings are there already" in again.stdout
    assert content(tmp_path / "0" / names[0]) == content(tmp_path / "2" / names[0])


def test_from_a_packing(tmp_path):
    first = ("--n", 48, "--pressure", "1e-2", "--potential", "hertzian", "--out", "a.h5")
    assert pack(tmp_path, *first).returncode == 0
    done = pack(tmp_path, "--from", "a.h5", "--pressure", "1e-4", "--out", "b.h5")
    assert done.returncode == 0, done.stderr
    a, b = read_packing(tmp_path / "a.h5"), read_packing(tmp_path / "b.h5")
    assert b.potential == a.potential and np.array_equal(a.radii, b.radii)
    assert measure(b).pressure == pytest.approx(1e-4, rel=1e-10)
    assert b.record["source"] == "a.h5" and "seed" not in b.record
    done = pack(tmp_path, "--from", "a.h5", "--phi", "0.95", "--out", "c.h5")
    assert done.returncode == 0, done.stderr
    assert read_packing(tmp_path / "c.h5").phi == pytest.approx(0.95, rel=1e-12)


def test_radii_from_a_file(tmp_path):
    radii = np.random.default_rng(1).uniform(0.4, 0.6, 40)
    np.savetxt(tmp_path / "radii.txt", radii, fmt="%.17g")
    done = pack(tmp_path, "--radii", "radii.txt", "--pressure", "1e-2", "--out", "a.h5")
    assert done.returncode == 0, done.stderr
    assert np.array_equal(np.sort(read_packing(tmp_path / "a.h5").radii), np.sort(radii))


def test_a_failed_seed_does_not_stop_the_others(tmp_path):
    """At φ = 0.8 some small packings are jammed and others are not: those are named, the others written."""
    done = pack(tmp_path, "--n", 16, "--phi", "0.8", "--seeds", "1:12", "--out", "{seed}.h5")
    made = len(list(tmp_path.iterdir()))
    assert done.returncode == 3 and 0 < made < 12
    assert f"{12 - made} of 12 packings failed" in done.stderr and len(done.stderr.splitlines()) == 1
    assert len(done.stdout.splitlines()) == made


GOOD = {"--n": "64", "--pressure": "1e-3", "--out": "a.h5"}
BAD = [
    ({"--n": "15"}, "15 disks"),
    ({"--n": None}, "--n is missing"),
    ({"--n": "many"}, "--n"),
    ({"--pressure": "2"}, "--pressure 2: must lie in"),
    ({"--pressure": "1e-9"}, "--pressure 1e-9"),
    ({"--pressure": "nan"}, "--pressure nan"),
    ({"--pressure": "1e-3,low"}, "--pressure low: must be a number"),
    ({"--pressure": "1e-3,1e-4"}, "put {pressure} into it"),
    ({"--pressure": None, "--phi": "0.5"}, "--phi 0.5"),
    ({"--phi": "0.9"}, "not allowed with"),
    ({"--pressure": None, "--phi": "0.9", "--stabilise": "shear"}, "needs --pressure"),
    ({"--seed": "-1"}, "--seed -1"),
    ({"--seeds": "1"}, "FIRST:LAST"),
    ({"--seeds": "3:1", "--out": "{seed}.h5"}, "--seeds 3:1"),
    ({"--seeds": "1:2"}, "put {seed} into it"),
    ({"--tolerance": "0.1"}, "--tolerance 0.1"),
    ({"--potential": "soft"}, "soft"),
    ({"--radii": "none.txt"}, "leave out --n"),
    ({"--n": None, "--radii": "none.txt"}, "none.txt: cannot be read"),
    ({"--n": None, "--radii": "words.txt"}, "words.txt"),
    ({"--n": None, "--radii": "negative.txt"}, "negative.txt: radii must be positive"),
    ({"--sizes": "monodisperse", "--from": "none.h5"}, "--sizes: belongs to the packing"),
    ({"--n": None, "--from": "none.h5"}, "none.h5"),
    ({"--n": None, "--from": "words.txt"}, "words.txt"),
    ({"--out": "nowhere/a.h5"}, "nowhere"),
    ({"--out": "."}, "folder"),
    ({"--out": "words.txt"}, "words.txt"),
]


@pytest.mark.parametrize(("change", "said"), BAD, ids=[said for _, said in BAD])
def test_bad_input_gets_one_line(change, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "words.txt").write_text("one two\n")
    (tmp_path / "negative.txt").write_text("0.5\n-0.5\n" * 10)
    line = [
        word for option, value in (GOOD | change).items() if value is not None for word in (option, value)
    ]
    with pytest.raises(InputError) as raised:
        cli.dispatch(["pack", *line])
    assert said in str(raised.value) and "\n" not in str(raised.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["negative.txt", "words.txt"]


def test_a_number_of_disks_beside_a_packing_must_be_its_own(tmp_path):
    assert pack(tmp_path, "--n", 16, "--pressure", "1e-2", "--out", "a.h5").returncode == 0
    onwards = ("--pressure", "5e-3", "--from", "a.h5", "--out", "b.h5")
    wrong = pack(tmp_path, "--n", 17, *onwards)
    assert wrong.returncode == 2 and "a.h5 has 16 disks" in wrong.stderr
    assert pack(tmp_path, "--n", 16, *onwards).returncode == 0


def test_another_packing_is_not_overwritten(tmp_path):
    assert pack(tmp_path, "--n", 16, "--pressure", "1e-2", "--out", "a.h5").returncode == 0
    before = (tmp_path / "a.h5").read_bytes()
    done = pack(tmp_path, "--n", 16, "--pressure", "1e-3", "--out", "a.h5")
    assert done.returncode == 2 and "requested_pressure = 0.01" in done.stderr
    assert (tmp_path / "a.h5").read_bytes() == before


def test_unknown_petsc_option(tmp_path):
    done = pack(tmp_path, "--n", 16, "--pressure", "1e-2", "--out", "a.h5", "-newton_pc_tpye", "cholesky")
    assert done.returncode == 2 and "newton_pc_tpye" in done.stderr
    assert not list(tmp_path.iterdir())


def test_mumps_instead_of_cholmod(tmp_path):
    words = ("--n", 32, "--pressure", "1e-3", "--out", "a.h5", "-newton_pc_factor_mat_solver_type", "mumps")
    done = pack(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert measure(read_packing(tmp_path / "a.h5")).max_force <= 1e-13


@pytest.mark.scalar("real")
def test_one_packing_that_fails_says_so_itself_and_several_are_counted(session, shared_path):
    line = ["pack", "--n", "24", "--phi", "0.8", "--out", str(shared_path / "p{seed}.h5")]
    with pytest.raises(InputError, match=r"^phi = 0\.8: the disks do not touch"):
        cli.dispatch([*line, "--seed", "1"])
    with pytest.raises(
        ConvergenceError, match=r"^2 of 2 packings failed, the others are on disk: .*p1\.h5: .*p2"
    ):
        cli.dispatch([*line, "--seeds", "1:2"])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_pressure_is_in_units_of_the_k_of_the_packing_that_is_changed(session, tmp_path):
    disks = published()
    stiff = Disks.from_positions(
        disks.positions, disks.radii, disks.cell, Potential("harmonic", "constant", 2.0)
    )
    write_packing(tmp_path / "p.h5", stiff)
    line = ["pack", "--from", str(tmp_path / "p.h5"), "--pressure", "2e-3", "--out", str(tmp_path / "q.h5")]
    assert cli.dispatch(line) == 0
    found = read_packing(tmp_path / "q.h5")
    assert found.record["requested_pressure"] == 4e-3 and measure(found).pressure == pytest.approx(
        4e-3, rel=1e-9
    )


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_radii_are_those_that_one_rank_has_read(session, shared_path, tmp_path):
    """Every rank reads a file of its own, as if it were replaced meanwhile; packings are of the first one's disks."""
    radii = np.linspace(0.5, 0.6 + 0.1 * session.rank, 16)
    np.savetxt(tmp_path / "r.txt", radii)
    out = shared_path / "p{seed}.h5"
    line = [
        "pack",
        "--radii",
        str(tmp_path / "r.txt"),
        "--phi",
        "0.95",
        "--seeds",
        "1:2",
        "--tolerance",
        "1e-6",
    ]
    assert cli.dispatch([*line, "--out", str(out)]) == 0
    for seed in (1, 2):
        found = read_packing(shared_path / f"p{seed}.h5")
        np.testing.assert_allclose(np.sort(found.radii), np.linspace(0.5, 0.6, 16))
        assert found.record["seed"] == seed


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_packings_that_are_there_are_counted_and_left(session, tmp_path, capsys):
    line = [*"pack --n 16 --phi 0.95 --seeds 1:3 --tolerance 1e-6 --out".split(), str(tmp_path / "{seed}.h5")]
    assert cli.dispatch(line) == 0 and "already" not in capsys.readouterr().out
    (tmp_path / "2.h5").unlink()
    kept = (tmp_path / "1.h5").read_bytes()
    assert cli.dispatch(line) == 0
    first, made = capsys.readouterr().out.splitlines()
    assert first == "2 of 3 packings are there already" and made.startswith(f"{tmp_path}/2.h5: N = 16, ")
    assert (tmp_path / "1.h5").read_bytes() == kept
    assert cli.dispatch(line) == 0
    assert capsys.readouterr().out == "3 of 3 packings are there already\n"

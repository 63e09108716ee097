"""Packings as a user asks for them: in memory and in files, on several ranks, from others, and bad input."""

import subprocess
import sys
import tempfile

import h5py
import launch
import numpy as np
import pytest
from samples import published

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import pack as job
from jampetsc.commands import packings
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_packing
from jampetsc.minimisation.protocols import Target, changed
from jampetsc.minimisation.sizes import Radii
from jampetsc.packing import compiled
from jampetsc.packing.contacts import measure
from jampetsc.studies.study_table import numbers_of


def pack(folder, *words, ranks=0):
    """`jampetsc pack words…` in `folder`, on so many ranks (0: without mpirun)."""
    command = [*launch.mpirun(ranks), sys.executable, "-m", "jampetsc", "pack", *map(str, words)]
    finished = {"capture_output": True, "text": True, "timeout": launch.MINUTES, "cwd": folder}
    return subprocess.run(command, env=launch.environment(), **finished)


def content(path):
    """Datasets and attributes of a file, as bytes and values."""
    with h5py.File(path) as file:
        return {name: file[name][()].tobytes() for name in file}, dict(file.attrs)


def test_a_packing_is_the_same_on_any_number_of_ranks(tmp_path):
    words = ("--n", 32, "--pressure", "1e-2", "--seed", 3, "--out")
    for ranks in (0, 2):
        done = pack(tmp_path, *words, f"{ranks}.h5", ranks=ranks)
        assert done.returncode == 0, done.stderr
        idle = "one rank makes a packing: 1 of 2 ranks had nothing to do\n" if ranks else ""
        assert done.stdout.startswith(f"{idle}{ranks}.h5: N = 32, ")
        assert done.stdout.splitlines()[-1].startswith("  units: ")
    assert content(tmp_path / "0.h5") == content(tmp_path / "2.h5")


OTHER_PROCESSOR = {
    "NUMBA_CPU_NAME": "generic",
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-AVX2,-FMA",
}


@pytest.mark.skipif(
    compiled.instruction_set() != compiled.BASELINE, reason="needs a processor with x86-64-v3"
)
def test_a_seed_is_one_packing_on_every_processor(tmp_path, monkeypatch):
    """To the last bit of file and record, whatever numba, BLAS, numpy and the C library find there."""
    words = ("--n", 64, "--pressure", "1e-3", "--stabilise", "shear", "--out")
    assert pack(tmp_path, *words, "here.h5").returncode == 0
    for name, value in OTHER_PROCESSOR.items():
        monkeypatch.setenv(name, value)
    assert pack(tmp_path, *words, "there.h5").returncode == 0
    assert content(tmp_path / "here.h5") == content(tmp_path / "there.h5")
    assert read_packing(tmp_path / "here.h5").record["instruction_set"] == compiled.BASELINE


def test_mumps_instead_of_cholmod(tmp_path):
    words = ("--n", 32, "--pressure", "1e-3", "--out", "a.h5", "-newton_pc_factor_mat_solver_type", "mumps")
    done = pack(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert measure(read_packing(tmp_path / "a.h5")).max_force <= 1e-13


@pytest.fixture
def empty(shared_path, monkeypatch):
    """The working directory, and the one for temporary files; nothing may come to be in it."""
    monkeypatch.chdir(shared_path)
    monkeypatch.setattr(tempfile, "tempdir", str(shared_path))
    yield shared_path
    assert not list(shared_path.iterdir())


@pytest.mark.scalar("real")
def test_packings_in_memory_are_those_of_files(session, empty):
    """On every rank; and one that is made of another."""
    one = jampetsc.pack(n=24, pressure=1e-3, seed=2)
    state = measure(one)
    assert state.max_force <= 1e-13 and abs(state.pressure - 1e-3) <= 1e-13
    assert (one.n, one.record["requested_n"], one.record["negative_modes"]) == (24, 24, 0)
    assert one.record["max_force"] == state.max_force
    assert session.comm.bcast(one.fingerprint) == one.fingerprint
    softer = jampetsc.pack(from_=one, pressure=1e-4)
    assert measure(softer).pressure == pytest.approx(1e-4, rel=1e-10)
    assert np.array_equal(softer.radii, one.radii)
    assert softer.record["source_sha256"] == one.fingerprint and "seed" not in softer.record


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_packing_file_is_changed_with_its_potential_and_record(session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = jampetsc.pack(n=48, pressure=1e-2, potential="hertzian", out="a.h5")
    for aim in ({"pressure": 1e-4}, {"pressure": 5e-2}, {"phi": 0.95}):
        found = jampetsc.pack(from_="a.h5", **aim, out="b.h5", overwrite=True)
        assert found.potential == first.potential and np.array_equal(found.radii, first.radii)
        assert found.record["source"] == "a.h5" and "seed" not in found.record
    assert found.phi == pytest.approx(0.95, rel=1e-12)


def test_a_changed_packing_leaves_its_record_behind():
    old = published().with_record(protocol="old", pressure=1.0)
    same, wider = changed(old, Target(1e-3)), changed(old, Target(phi=0.7))
    assert same.record == wider.record == {} and same.fingerprint == old.fingerprint
    assert wider.phi == pytest.approx(0.7)
    apart = old.replace(radii=0.5 * old.radii)
    assert changed(apart, Target(phi=0.9)).phi == pytest.approx(0.9)
    with pytest.raises(InputError, match=r"^no particles touch, so the pressure is 0"):
        changed(apart, Target(1e-3))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_radii_are_those_that_one_rank_has_read(session, shared_path, tmp_path):
    """Every rank reads a file of its own, as if it were replaced meanwhile; packings are of the first one's disks."""
    np.savetxt(tmp_path / "r.txt", np.linspace(0.5, 0.6 + 0.1 * session.rank, 16))
    how = {"phi": 0.95, "tolerance": 1e-6}
    found = jampetsc.pack(radii=tmp_path / "r.txt", **how, out=shared_path / "p.h5")
    given = np.linspace(0.5, 0.6, 16), Radii(np.linspace(0.5, 0.6, 16))
    for disks in (found, *(jampetsc.pack(radii=radii, **how) for radii in given)):
        np.testing.assert_allclose(np.sort(disks.radii), np.linspace(0.5, 0.6, 16))
    assert found.record["sizes"] == "radii of r.txt"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_packing_that_is_there_is_left_or_refused(session, tmp_path, capsys):
    path = tmp_path / "2.h5"
    line = [*"pack --n 16 --phi 0.95 --seed 2 --tolerance 1e-6 --out".split(), str(path)]
    assert cli.dispatch(line) == 0 and "finished earlier" not in capsys.readouterr().out
    kept = path.read_bytes()
    same = (
        "pack --phi 0.950 --seed 2 --n 16 --sizes bidisperse --dimension 2 --tolerance 1e-6 --threads 1 --out"
    )
    for words in (line, [*same.split(), str(path)]):
        assert cli.dispatch(words) == 0
        assert capsys.readouterr().out.startswith(
            f"{path}: finished earlier with the same settings and inputs."
        )
    with pytest.raises(InputError, match=r"2\.h5: exists and has phi = 0\.95, not 0\.96"):
        cli.dispatch([*line, "--phi", "0.96"])
    assert path.read_bytes() == kept
    assert cli.dispatch([*line, "--phi", "0.96", "--overwrite"]) == 0
    assert read_packing(path).record["requested_phi"] == 0.96


def test_a_target_is_what_was_asked_for():
    how = {"stabilise": "shear", "tolerance": 1e-8}
    assert job.Pack(n=16, pressure="1e-2", **how).target == Target(1e-2, **how)
    assert job.Pack(n=16, phi=0.9, **how).target == Target(phi=0.9, **how)


@pytest.mark.parametrize(("factor", "note"), [(0.999, False), (1.001, True)])
def test_a_packing_tells_when_rounding_forbids_its_tolerance(factor, note):
    disks = published()
    force = factor * 1e-13 * 2 * disks.radii.mean()
    known = {"pressure": 1e-3, "phi": 0.84, "coordination": 4.0, "rattlers": 1, "max_force": force}
    text = packings.packing_line("p.h5", disks.with_record(**known, tolerance=1e-10, evaluations=7), 1.234)
    said = f"p.h5: N = {disks.n}, p = 0.001, phi = 0.840000, Z = 4.0000, 1 rattlers, max|F|/p = "
    assert text.startswith(said)
    assert "7 force evaluations, 1.23 s" in text and ("  note: limited by rounding: " in text) == note


def test_a_packing_keeps_the_note_that_rounding_limits_it(tmp_path):
    """Also in the table of a study and in `info`; the packing made from it has none."""
    disks = jampetsc.pack(n=16, pressure=1e-6, seed=2, tolerance=1e-13, out=tmp_path / "p.h5")
    assert disks.record["notes"].startswith("limited by rounding: max|F|/(p d) = ")
    assert numbers_of(tmp_path / "p.h5")["notes"] == disks.record["notes"]
    assert f"\nnote: {disks.record['notes']}" in jampetsc.info(disks)
    assert "notes" not in jampetsc.pack(from_=disks, pressure=1e-6, tolerance=1e-6).record


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1e-6] * 8 + [1e6] * 8, None), ([1.0] * 15, "15 particles: not supported"), ([1.0] * 21, "21 particles"),
        ([1.0] * 15 + [0.99e-6], "radii from 9.9e-07 to 1: outside"),
        ([1.0] * 15 + [1.01e6], "radii from 1 to 1.01e+06: outside"),
        ([1.0] * 15 + [0.0], ": line 16: not a positive number (0)"),
        ([1.0] * 15 + ["inf"], ": line 16: not a positive number (inf)"),
        (["1 2"] * 16, ": line 1: '1 2', not a radius"), (["1 # one", "", "x"] * 16, ": line 3: 'x', not a radius"),
        ([], "0 particles"),
    ],
)  # fmt: skip
def test_radii_of_a_file_and_of_an_array(values, said, tmp_path, monkeypatch):
    monkeypatch.setattr("jampetsc.minimisation.sizes.MAX_DISKS", 20)
    path = tmp_path / "r.txt"
    path.write_text("\n".join(map(str, values + ([1.0] * 40 if len(values) > 20 else []))))  # read no farther
    if said is None:
        assert Radii.read(path).values.tolist() == Radii(values).values.tolist() == values
        return
    with pytest.raises(InputError) as raised:
        Radii.read(path)
    assert str(raised.value).startswith(f"{path}: ") and said in str(raised.value)
    if "radius" not in said:
        with pytest.raises(InputError, match=r"^radii(\[15\])?: "):
            Radii(values)

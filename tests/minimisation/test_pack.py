"""Packings as a user asks for them: in memory and in files, ensembles over ranks, continuation, and bad input."""

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
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import read_packing, write_packing
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


def test_ensemble_is_the_same_on_any_number_of_ranks(tmp_path):
    words = ("--n", 32, "--pressure", "1e-2,1e-3", "--seeds", "1:3", "--out", "p{pressure}-{seed}.h5")
    for ranks in (0, 2):
        (tmp_path / str(ranks)).mkdir()
        done = pack(tmp_path / str(ranks), *words, ranks=ranks)
        assert done.returncode == 0, done.stderr
        told = [line.partition(":")[0] for line in done.stdout.splitlines()]
        assert told.pop() == "  units"
        assert told == [f"p{p}-{seed}.h5" for seed in (1, 2, 3) for p in ("1e-2", "1e-3")]
    names = sorted(path.name for path in (tmp_path / "0").iterdir())
    assert names == sorted(told)
    for name in names:
        assert content(tmp_path / "0" / name) == content(tmp_path / "2" / name)


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
    """One; a list of several, each on every rank; and one that is made of another."""
    one = jampetsc.pack(n=24, pressure=1e-3, seed=2)
    state = measure(one)
    assert state.max_force <= 1e-13 and abs(state.pressure - 1e-3) <= 1e-13
    assert (one.n, one.record["requested_n"], one.record["negative_modes"]) == (24, 24, 0)
    assert one.record["max_force"] == state.max_force
    many = jampetsc.pack(n=24, pressure=[1e-2, 1e-3], seeds=[2, 3])
    asked = [(disks.record["seed"], disks.record["requested_pressure"]) for disks in many]
    assert asked == [(2, 1e-2), (2, 1e-3), (3, 1e-2), (3, 1e-3)]
    assert many[1].fingerprint == one.fingerprint and many[1].record == one.record
    assert [session.comm.bcast(disks.fingerprint) for disks in many] == [disks.fingerprint for disks in many]
    (alone,) = jampetsc.pack(n=24, pressure=1e-3, seeds="2:2")
    assert alone.fingerprint == one.fingerprint
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
        found = jampetsc.pack(from_="a.h5", n=48, **aim, out="b.h5", overwrite=True)
        assert found.potential == first.potential and np.array_equal(found.radii, first.radii)
        assert found.record["source"] == "a.h5" and "seed" not in found.record
    assert found.phi == pytest.approx(0.95, rel=1e-12)
    with pytest.raises(InputError, match=r"^n 47: a\.h5 has 48 particles"):
        jampetsc.pack(from_="a.h5", n=47, pressure=1e-3)


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
    how = {"phi": 0.95, "seeds": "1:2", "tolerance": 1e-6}
    found = jampetsc.pack(radii=tmp_path / "r.txt", **how, out=shared_path / "p{seed}.h5")
    given = np.linspace(0.5, 0.6, 16), Radii(np.linspace(0.5, 0.6, 16))
    for disks in (*found, *(disks for radii in given for disks in jampetsc.pack(radii=radii, **how))):
        np.testing.assert_allclose(np.sort(disks.radii), np.linspace(0.5, 0.6, 16))
    assert found[0].record["sizes"] == "radii of r.txt"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_packing_that_fails_leaves_the_others_alone(session, shared_path, monkeypatch):
    """At φ = 0.8 some small packings are jammed and others are not: those are named, the others written."""
    monkeypatch.chdir(shared_path)
    with pytest.raises(ConvergenceError, match=r"of 6 packings failed, the others are on disk: ") as told:
        jampetsc.pack(n=16, phi=0.8, seeds="1:6", out="{seed}.h5")
    session.comm.Barrier()
    made = {path.name for path in shared_path.iterdir()}
    assert 0 < len(made) < 6 and str(told.value).startswith(f"{6 - len(made)} of 6 ")
    assert all((f"{seed}.h5: phi" in str(told.value)) != (f"{seed}.h5" in made) for seed in range(1, 7))
    with pytest.raises(InputError, match=r"^phi = 0\.8: the disks do not touch"):
        jampetsc.pack(n=24, phi=0.8, seed=1)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_packings_that_are_there_are_counted_left_or_refused(session, tmp_path, capsys):
    line = [*"pack --n 16 --phi 0.95 --seeds 1:3 --tolerance 1e-6 --out".split(), str(tmp_path / "{seed}.h5")]
    assert cli.dispatch(line) == 0 and "already" not in capsys.readouterr().out
    (tmp_path / "2.h5").unlink()
    kept = (tmp_path / "1.h5").read_bytes()
    assert cli.dispatch(line) == 0
    first, made, _ = capsys.readouterr().out.splitlines()
    assert first == "2 of 3 packings are there already" and made.startswith(f"{tmp_path}/2.h5: N = 16, ")
    assert cli.dispatch(line) == 0 and capsys.readouterr().out == "3 of 3 packings are there already\n"
    one = [
        *"pack --phi 0.950 --seed 2 --n 16 --sizes bidisperse --tolerance 1e-6 --out".split(),
        str(tmp_path / "2.h5"),
    ]
    assert cli.dispatch(one) == 0 and capsys.readouterr().out == "1 of 1 packings are there already\n"
    with pytest.raises(InputError, match=r"1\.h5: exists and has phi = 0\.95, not 0\.96"):
        cli.dispatch([*line, "--phi", "0.96"])
    assert (tmp_path / "1.h5").read_bytes() == kept
    assert cli.dispatch([*line, "--phi", "0.96", "--overwrite"]) == 0
    assert read_packing(tmp_path / "1.h5").record["requested_phi"] == 0.96


# Ladders

LADDER = {"n": 24, "pressure": "1e-2,1e-3,1e-4", "seeds": "2:3", "tolerance": 1e-6, "ladder": True}


@pytest.fixture(scope="module")
def by_hand():
    """The same as LADDER, each pressure asked for by itself: {(seed, pressure): Packing}."""
    found = {}
    for seed in (2, 3):
        one = jampetsc.pack(n=24, pressure=1e-2, seed=seed, tolerance=1e-6)
        found[seed, "1e-2"] = one
        for pressure in ("1e-3", "1e-4"):
            one = found[seed, pressure] = jampetsc.pack(from_=one, pressure=pressure, tolerance=1e-6)
    return found


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_files_of_a_ladder_are_gone_on_with(session, shared_path, monkeypatch, by_hand):
    """Whatever is missing; and what another packing is like is not taken for one of them."""
    monkeypatch.chdir(shared_path)
    how = LADDER | {"out": "p{pressure}-{seed}.h5"}
    names = [f"p{pressure}-{seed}.h5" for seed, pressure in by_hand]

    def found(**more):
        session.comm.Barrier()
        return [one.fingerprint for one in jampetsc.pack(**how | more)]

    def written():
        session.comm.Barrier()
        times = {name: (shared_path / name).stat().st_mtime_ns for name in names}
        session.comm.Barrier()
        return times

    whole = [one.fingerprint for one in by_hand.values()]
    assert found(pressure="1e-2,1e-3") == [whole[k] for k in (0, 1, 3, 4)]
    assert found() == whole  # a lower pressure
    wanted = by_hand[3, "1e-4"].with_record(source="p1e-3-3.h5")  # what `--from` makes
    assert read_packing("p1e-4-3.h5").record == wanted.record
    for lost in (["p1e-3-2.h5"], ["p1e-2-3.h5", "p1e-3-3.h5"], ["p1e-4-2.h5"]):
        before = written()
        if session.rank == 0:
            for name in lost:
                (shared_path / name).unlink()
        assert found() == whole
        assert {name for name, time in written().items() if time != before[name]} == set(lost)
    with pytest.raises(InputError, match=r"p1e-3-2\.h5: exists and has n = its default, not 24"):
        found(ladder=False)
    assert len(set(found(ladder=False, overwrite=True)) & set(whole)) == 2
    with pytest.raises(InputError, match=r"p1e-3-2\.h5: exists and has other inputs; n = 24, not"):
        found()
    assert found(overwrite=True) == whole
    one = by_hand[2, "1e-2"]
    down = jampetsc.pack(
        from_=one, pressure="1e-3,1e-4", tolerance=1e-6, ladder=True
    )  # in memory, and from one
    assert [below.record for below in down] == [by_hand[2, pressure].record for pressure in ("1e-3", "1e-4")]
    assert [above.fingerprint for above in (one, down[0])] == [
        below.record["source_sha256"] for below in down
    ]


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_what_starts_from_a_packing_that_failed_fails_too(session, shared_path, monkeypatch):
    monkeypatch.chdir(shared_path)
    whole = packings.make_packing

    def make_packing(start, target, solver, **how):
        if target.pressure == 1e-3 and lost.fingerprint == start.fingerprint:
            raise ConvergenceError("no minimum")
        return whole(start, target, solver, **how)

    lost = jampetsc.pack(n=24, pressure=1e-2, seed=3, tolerance=1e-6)
    monkeypatch.setattr(packings, "make_packing", make_packing)
    with pytest.raises(ConvergenceError) as told:
        jampetsc.pack(**LADDER, out="p{pressure}-{seed}.h5")
    assert str(told.value).startswith("2 of 6 packings failed, the others are on disk: p1e-3-3.h5: ")
    assert str(told.value).endswith("; p1e-4-3.h5: p1e-3-3.h5, from which it starts, failed")
    session.comm.Barrier()
    made = {path.name for path in shared_path.iterdir()}
    assert made == {"p1e-2-2.h5", "p1e-3-2.h5", "p1e-4-2.h5", "p1e-2-3.h5"}


def test_a_packing_that_is_there_is_the_one_that_is_asked_for(tmp_path):
    def task(**how):
        (found,) = job.Pack(**{"n": 16, "pressure": 1e-3, "seed": 3} | how).tasks(str(tmp_path / "p.h5"))
        return found

    assert not task().is_finished()
    write_packing(task().path, published(), task().request)
    same = {"pressure": "0.001", "seed": None, "seeds": "3:3", "sizes": "bidisperse", "threads": 2}
    assert task().is_finished() and task(**same).is_finished()
    for other in (
        {"pressure": 1e-2},
        {"seed": 4},
        {"n": 17},
        {"potential": "hertzian"},
        {"stabilise": "shear"},
    ):
        with pytest.raises(InputError, match=f"exists and has {next(iter(other))} = .*out.*overwrite"):
            task(**other).is_finished()
    write_packing(task().path, read_packing(task().path))  # other disks may have this record
    with pytest.raises(InputError, match="exists and does not record its settings"):
        task().is_finished()


def test_packings_are_asked_for_as_told():
    words = {"n": 16, "pressure": "1e-2,1e-3", "seeds": "0:2", "tolerance": 1e-8, "stabilise": "shear"}
    asked = job.Pack(**words)
    tasks = asked.tasks("s{seed}-p{pressure}.h5")
    assert [task.path.name for task in tasks[:3]] == ["s0-p1e-2.h5", "s0-p1e-3.h5", "s1-p1e-2.h5"]
    assert [task.seed for task in tasks] == [0, 0, 1, 1, 2, 2]
    for task, pressure in zip(tasks, (1e-2, 1e-3) * 3, strict=True):
        assert task.target == Target(pressure, stabilise="shear", tolerance=1e-8)
    for seed, meant in ((None, 1), (0, 0)):
        (task,) = job.Pack(n=16, phi=0.9, seed=seed).tasks(None)
        assert (task.path, task.seed, task.target.phi) == (None, meant, 0.9)
    (task,) = job.Pack(n=16, phi=0.9, stabilise="shear", tolerance=1e-8).tasks(None)
    assert task.target == Target(phi=0.9, stabilise="shear", tolerance=1e-8)
    down = job.Pack(**words, ladder=True).tasks("s{seed}-p{pressure}.h5")
    assert [(task.path, task.target) for task in down] == [(task.path, task.target) for task in tasks]
    rungs = [rung for seed in range(3) for rung in ((seed, 0), (None, 1))]
    assert [(task.seed, task.rung) for task in down] == rungs
    with pytest.raises(InputError, match=r"^ladder: a ladder without pressures\. Give pressure\.$"):
        job.Pack(n=16, phi=0.9, ladder=True)
    soft = job.Pack(from_="soft.h5", pressure=[1e-3, 1e-2]).tasks("p{pressure}.h5")
    assert [(task.path.name, task.seed) for task in soft] == [("p0.001.h5", None), ("p0.01.h5", None)]
    assert [task.target.pressure for task in soft] == [1e-3, 1e-2]


@pytest.mark.parametrize(("factor", "note"), [(0.999, False), (1.001, True)])
def test_a_packing_tells_when_rounding_forbids_its_tolerance(factor, note):
    disks = published()
    force = factor * 1e-13 * 2 * disks.radii.mean()
    known = {"pressure": 1e-3, "phi": 0.84, "coordination": 4.0, "rattlers": 1, "max_force": force}
    text = packings._line("p.h5", disks.with_record(**known, tolerance=1e-10, evaluations=7), 1.234)
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


GOOD = {"--n": "64", "--pressure": "1e-3", "--out": "a.h5"}
BAD = [  # options that are changed, what is named
    ({"--n": "15"}, "--n 15"), ({"--n": None}, "--n: missing. Give the number of particles"),
    ({"--n": "many"}, "--n many"),
    ({"--pressure": "2"}, "--pressure 2"), ({"--pressure": "1e-9"}, "1e-9"), ({"--pressure": "nan"}, "nan"),
    ({"--pressure": "-1e-4"}, "--pressure -1e-4"), ({"--pressure": "1e-3,"}, "--pressure 1e-3,"),
    ({"--pressure": "1e-3,low"}, "--pressure 1e-3,low"),
    ({"--pressure": None}, "--pressure, --phi: missing. Give one of them"),
    ({"--presure": "1e-3"}, "--presure: no such option; did you mean --pressure"),
    ({"--pressure": "1e-3,1e-4"}, "Put {pressure} into it"), ({"--pressure": None, "--phi": "0.5"}, "--phi 0.5"),
    ({"--phi": "0.9"}, "--phi, --pressure: both given"),
    ({"--seed": "-1"}, "--seed -1"), ({"--seed": "9223372036854775808"}, "--seed 9223372036854775808"),
    ({"--seed": "1", "--seeds": "1:2"}, "--seeds, --seed: both given"),
    ({"--seeds": "1:2:3"}, "FIRST:LAST"), ({"--seeds": "3:1", "--out": "{seed}.h5"}, "--seeds 3:1"),
    ({"--seeds": "1:9999999999", "--out": "{seed}.h5"}, "must be at most 1000000 seeds"),
    ({"--seeds": "1:2"}, "Put {seed} into it"), ({"--tolerance": "0.1"}, "--tolerance 0.1"),
    ({"--out": "k{foo}.h5"}, "--out k{foo}.h5: unknown field {foo}"),
    ({"--out": "k{seed.h5"}, "unknown field {seed.h5"),
    ({"--pressure": None, "--phi": "0.86", "--out": "k{pressure}.h5"}, "{pressure} is not defined with --phi"),
    ({"--potential": "soft"}, "--potential soft"), ({"--radii": "r.h5"}, "--n: fixed by r.h5"),
    ({"--n": None, "--radii": "none.txt"}, "none.txt: not "), ({"--n": None, "--radii": "."}, ".: a folder"),
    ({"--n": None, "--radii": "words.txt"}, "words.txt"), ({"--n": None, "--radii": "r.h5", "--out": "./r.h5"}, "r.h5"),
    ({"--n": None, "--radii": "negative.txt"}, "negative.txt: line 2: not a positive number (-0.5)"),
    ({"--n": None, "--sizes": "monodisperse", "--from": "none.h5"}, "--sizes: fixed by the packing"),
    ({"--n": None, "--from": "none.h5"}, "none.h5"), ({"--n": None, "--from": "words.txt"}, "words.txt"),
    ({"--out": "nowhere/a.h5"}, "nowhere"), ({"--out": "."}, "folder"), ({"--out": "words.txt"}, "words.txt"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), BAD, ids=[said for _, said in BAD])
def test_bad_input_gets_one_line(change, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {"words.txt": "one two\n", "negative.txt": "0.5\n-0.5\n" * 10, "r.h5": "1\n" * 16}
    for name, text in given.items():
        (tmp_path / name).write_text(text)
    line = [word for pair in (GOOD | change).items() if pair[1] is not None for word in pair]
    with pytest.raises(InputError) as raised:
        cli.dispatch(["pack", *line])
    assert said in str(raised.value) and "\n" not in str(raised.value)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == given


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

"""Studies: the same table on any number of ranks, after any kill, and whatever fails."""

import itertools
import os
import re
from threading import Timer

import launch
import numpy as np
import pytest
import samples

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import packings, study_inputs
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.petsc.session import current
from jampetsc.response.factor_memory import factor_bytes
from jampetsc.studies import journal, study_run, task_runner
from jampetsc.studies.journal import Claims, Lock, keep_record, records_of, tidy
from jampetsc.studies.plan import plan

ALL = """
pack = {n = 16, pressure = "1e-2", seeds = "1:2"}
sweep = [
    {omega = "1e-4:1:5", beta = [1.0, 0.1]},
    {omega = "1e-3:1:4", law = "stokes", fields = "1e-3,1", no-prestress = true},
]
quasistatic = {}
modes = {count = 3}
oscillate = {omega = 1.0, strain = 1e-6, steps = 16}
relax = {strain = 1e-6, law = "stokes", times = "1,10", accuracy = 0.1}
shear = {step = 1e-3, strain = 2e-3}
flow = [
    {model = "CD0", rate = 1e-2, strain = 0.05},
    {n = 16, phi = 0.8, model = "RD0", seeds = "1:2", rate = 1e-2, strain = 0.05, snapshots = 2},
]
jam = {n = 16, phi = [0.75, 0.9], seeds = "1:3"}
spectrum = {}
correlate = {}
"""


def study(folder, text, status=0):
    """The study `text` in a folder, on all ranks; its table."""
    path = folder.with_suffix(".toml")
    if current().rank == 0:
        path.write_text(text)
    assert cli.dispatch(["study", str(path), "--out", str(folder)]) == status
    return jampetsc.load(folder)


def require_same(table, other, rtol=1e-7):
    """The two tables are the same to rounding, but for times."""
    assert list(table) == list(other)
    assert table.rows == other.rows
    for name in set(table) - {"seconds"}:
        if table[name].dtype.kind == "f":
            atol = max(1e-12, rtol * np.nanmax(np.abs(table[name]), initial=0.0))
            np.testing.assert_allclose(table[name], other[name], rtol=rtol, atol=atol, err_msg=name)
        else:
            assert table[name].tolist() == other[name].tolist(), name


@pytest.mark.least_ranks(2)
@pytest.mark.most_ranks(2)
@pytest.mark.scalar("real")
def test_the_table_is_the_same_on_any_number_of_ranks(session, shared_path):
    table = study(shared_path / "all", ALL)
    commands = [name for name in study_inputs() if name != "springs"]  # in place of packings: test_springs.py
    assert set(table["state"]) == {"done"} and set(table["command"]) == set(commands)
    counts = [len(table.where(command=name).results()) for name in commands]
    assert counts == list(map(int, "2 6 2 2 2 2 4 2 2 6 2".split()))
    if session.rank == 0:
        with session.alone():
            require_same(study(shared_path / "alone", ALL), table)
    assert table.where(command="jam")["jammed_fraction"].tolist() == [0.0, 1.0]
    files = sorted(path.name for path in (shared_path / "all").glob("*.h5"))
    assert files == sorted(table["file"])
    sweep = table.where(command="sweep").results()[0]
    assert sweep.attributes["argv"].split()[:2] == ["jampetsc", "sweep"] and sweep.attributes["ranks"] == 1


SMALL = """
[pack]
n = 16
pressure = 1e-2
seeds = "1:2"
[quasistatic]
"""


@pytest.mark.scalar("real")
@pytest.mark.least_ranks(2)
def test_large_tasks_are_done_by_all_ranks_together(session, shared_path, monkeypatch, capsys):
    """And what came out is told once."""
    text = SMALL.replace("1:2", "1:1") + '[sweep]\nomega = "1"\nfields = "1"\n[correlate]\n'
    apart = study(shared_path / "apart", text)
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 15)
    capsys.readouterr()
    together = study(shared_path / "together", text)
    assert capsys.readouterr().out.count("together") == (session.rank == 0)
    require_same(apart, together)
    ranks = [result.attributes["ranks"] for result in together.where(command="quasistatic").results()]
    assert ranks == [session.size]
    if session.rank == 0:  # what one rank has written is part of the file
        next((shared_path / "together").glob("sweep*.parts/*-rank-0001.h5")).unlink()
    session.comm.Barrier()
    require_same(together, study(shared_path / "together", text))
    said = capsys.readouterr().err
    assert session.rank or study_run.changed_note(together.where(command="sweep")["file"]) in said


def told(capsys):
    """What a study said of its tasks on this rank: [(count, the rest of the line)]."""
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("[")]
    return [tuple(line[1:].split("] ", 1)) for line in lines]


def times(folder):
    """When each result was written."""
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("*.h5")}


@pytest.mark.scalar("real")
def test_a_task_that_fails_is_a_row_and_the_others_go_on(session, shared_path, capsys, monkeypatch):
    monkeypatch.setattr(study_run, "ESTIMATE_INTERVAL", -1.0)
    text = "[pack]\nn = 24\nphi = [0.8, 0.95]\n[quasistatic]\n[modes]\ncount = [2, 1000]\n"
    table = study(shared_path / "study", text, status=3)
    keys = zip(table["command"], table["phi"].round(2), table["count"].tolist(), strict=True)
    states = {" ".join(map(str, key)): state for key, state in zip(keys, table["state"], strict=True)}
    assert len(states) == 8 and sum(state != "done" for state in states.values()) == 5
    assert "phi = 0.8: the disks do not touch" in states["pack 0.8 nan"]
    assert "failed: pack-n24-phi0.8" in states["quasistatic 0.8 nan"]
    assert "1000 modes: K has" in states["modes 0.95 1000.0"]
    assert str(shared_path) not in "".join(states.values())
    if session.size == 1:
        said = told(capsys)
        assert [count for count, _ in said] == [f"{n}/8" for n in range(1, 9)]
        failed = [int((re.findall(r"; (\d+) failed\b", line) or [0])[-1]) for _, line in said]
        assert failed == sorted(failed) and failed[-1] == 5 and "left" not in said[-1][1]
    # what is asked for no more fails no more; what was done stays as it is
    before = times(shared_path / "study")
    session.comm.Barrier()
    table = study(shared_path / "study", text.replace("0.8, ", "").replace(", 1000", ", 4"))
    assert set(table["state"]) == {"done"} and table.rows == 4
    after = times(shared_path / "study")
    assert before.items() <= after.items() and len(after) == len(before) + 1


def losing(monkeypatch, lost, rank=None):
    """What raises where a file is read whose name has one of these parts, on all ranks or on one: {part: error}."""
    read = task_runner.numbers_of

    def numbers_of(path):
        for part, error in lost.items():
            if part in path.name and rank in (None, current().rank):
                raise error
        return read(path)

    monkeypatch.setattr(task_runner, "numbers_of", numbers_of)


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
def test_an_error_that_nobody_foresaw_is_a_row_too(session, shared_path, monkeypatch):
    first = {"quasistatic-n16-p0.01-s2": session.PETSc.Error(62)}
    losing(monkeypatch, first | {"quasistatic": ZeroDivisionError("no reason")})
    states = study(shared_path / "study", SMALL, status=3)["state"].tolist()
    assert states[:3] == ["done", "done", "failed: ZeroDivisionError: no reason"]
    assert states[3].startswith("failed: Error: ")


MEAN = SMALL.replace("[quasistatic]", '[sweep]\nomega = "1"\nfields = "1"\n[correlate]')


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_mean_is_of_the_seeds_that_there_are_and_is_not_taken_twice(session, shared_path, monkeypatch):
    """More seeds are added; of fewer all that was done stays."""
    folder, lost = shared_path / "study", {f"sweep-n16-p0.01-s{n}-": InputError("lost") for n in (1, 2)}

    def mean(text=MEAN, status=0):
        return study(folder, text, status).where(command="correlate")

    losing(monkeypatch, lost)
    (state,) = mean(status=3)["state"]
    assert state.startswith("failed: sweep-n16-p0.01-s1-") and state.endswith(".h5 failed")
    del lost["sweep-n16-p0.01-s1-"]
    first = mean(status=3)
    assert first["packings"] == [1]
    assert mean(status=3)["seconds"] == first["seconds"]  # what it cost, not what a look at it does
    lost.clear()
    assert mean()["packings"] == [2] and mean(MEAN.replace("1:2", "1:3"))["packings"] == [3]
    more = jampetsc.load(folder)
    fewer = study(folder, MEAN.replace("1:2", "2:2"))
    assert more.rows == fewer.rows == 7 and sorted(fewer["file"]) == sorted(more["file"])


LADDER = '[pack]\nn = 16\npressure = [1e-2, 1e-3, 1e-4]\nseeds = "1:2"\nladder = true\n'


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_ladder_is_the_one_that_pack_makes_and_what_is_below_a_packing_that_fails_fails_too(
    session, shared_path, monkeypatch
):
    """And is made by the next run."""
    make, folder = packings.make_packing, shared_path / "study"

    def make_packing(start, target, solver, **how):
        if target.pressure == 1e-3:
            raise ConvergenceError("no minimum")
        return make(start, target, solver, **how)

    monkeypatch.setattr(packings, "make_packing", make_packing)
    states = study(folder, LADDER, status=3)["state"].tolist()
    session.comm.Barrier()
    assert states[:2] == ["done"] * 2 and all(state.startswith("failed: no minimum") for state in states[2:4])
    assert all(re.fullmatch(r"failed: pack-n16-p0\.001-s[12]-\w+\.h5 failed", state) for state in states[4:])
    monkeypatch.setattr(packings, "make_packing", make)
    whole = study(folder, LADDER)
    assert set(whole["state"]) == {"done"}
    expected = {}
    for seed in (1, 2):
        above = expected[seed, 1e-2] = jampetsc.pack(n=16, pressure=1e-2, seed=seed)
        for pressure in (1e-3, 1e-4):
            above = expected[seed, pressure] = jampetsc.pack(from_=above, pressure=pressure)
    for seed, pressure, disks in zip(whole["seed"], whole["pressure"], whole.results(), strict=True):
        assert disks.fingerprint == expected[seed, pressure].fingerprint
        assert disks.record.get("source_sha256") == expected[seed, pressure].record.get("source_sha256")
    assert np.isnan(whole["ladder"][:2]).all() and whole["ladder"][2:].tolist() == [1.0] * 4
    session.comm.Barrier()
    if session.rank == 0:
        truncated(folder / whole["file"][2])
    before = times(folder)
    session.comm.Barrier()
    require_same(whole, study(folder, LADDER))
    made = [name for name, time in times(folder).items() if time != before[name]]
    assert made == [whole["file"][2]]  # it comes out as it was, so that what was made of it stays


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_table_of_packings_needs_no_other(session, shared_path):
    """Every one is that which `pack` makes; the file is found again, by its digest, without the journal."""
    text = '[pack]\nn = 16\npressure = [1e-2, 1e-3]\nseeds = "1:2"\n'
    table, folder = study(shared_path / "packs", text), shared_path / "packs"
    asked = set(zip(table["seed"], table["pressure"], strict=True))
    assert asked == set(itertools.product((1, 2), (1e-2, 1e-3))) and set(table["state"]) == {"done"}
    for seed, pressure, disks in zip(table["seed"], table["pressure"], table.results(), strict=True):
        alone = jampetsc.pack(n=16, pressure=pressure, seed=int(seed))
        assert disks.fingerprint == alone.fingerprint and disks.record == alone.record
    before = times(folder)
    session.comm.Barrier()
    if session.rank == 0:
        for record in (folder / "journal").iterdir():
            record.unlink()
    session.comm.Barrier()
    require_same(table, study(folder, text))
    assert times(folder) == before and len(records_of(folder)) == 4


@pytest.mark.parametrize(
    ("words", "used"),
    [("[jam]\nseeds = '1:1'", None), ("[flow]\nthreads = 2", 2), ("[flow]", 5)],
)
def test_a_task_is_a_job_with_its_share_of_the_cores(tmp_path, words, used):
    """One that takes threads and was not told how many."""
    more = 'model = "RD0"\nrate = 1e-2\nstrain = 0.1\n' if "flow" in words else ""
    (task,) = plan("s.toml", f"{words}\nn = 16\nphi = 0.9\n{more}".encode())
    seen = []

    def copy(job, out, argv, overwrite):
        seen.append((getattr(job, "threads", None), argv, overwrite))
        write_packing(out, samples.published().with_record(pressure=0.5))

    made = task_runner.TaskRunner(tmp_path, {}, 5, execute=copy).run(task, [])
    assert seen == [(used, task.words, False)] and made["state"] == "done"
    assert (made["row"]["n"], made["row"]["pressure"]) == (16, 0.5)


# Who does what


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_each_task_is_one_ranks_and_all_know_what_became_of_it(session, shared_path, monkeypatch):
    comm, names = session.comm, ["a", "b/b", "c.5", "d"]
    (shared_path / "journal").mkdir(exist_ok=True)
    claims = comm.bcast(Claims(shared_path) if comm.rank == 0 else None)
    mine, numbers = [name for name in names if claims.take(name)], []
    for name in mine:
        claims.settle(name, name != "c.5")
        numbers.append(claims.tally()[0])
    assert sorted(number for some in comm.allgather(numbers) for number in some) == [1, 2, 3, 4]
    assert sorted(name for some in comm.allgather(mine) for name in some) == names
    assert [claims.done(name) for name in names] == [True, True, False, True]
    comm.Barrier()
    monkeypatch.setattr(
        journal, "TALLY_INTERVAL", -1.0
    )  # what the others have done since is seen a second later
    assert claims.tally()[1] == 1 and not any(map(claims.take, names))
    assert records_of(shared_path) == {}
    comm.Barrier()
    if comm.rank == 0:
        claims.end()
        Claims(shared_path)  # of a study that was killed
        tidy(shared_path)
        assert not os.listdir(shared_path / "journal")


def test_a_claim_that_cannot_be_written_is_an_error_and_an_input_is_waited_for(tmp_path):
    (tmp_path / "journal").mkdir()
    claims = Claims(tmp_path)
    later = Timer(0.05, claims.settle, ("a", True))
    later.start()
    assert claims.done("a")
    later.join()
    assert claims.tally() == (1, 0)
    claims.end()
    with pytest.raises(InputError, match="b: not writable"):
        claims.take("b")


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_what_fits_on_a_machine_is_shared_by_its_ranks(session, monkeypatch):
    assert study_run.max_disks_alone(session, 2) <= study_run.MIN_SHARED_DISKS
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 10**18)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert study_run.max_disks_alone(session, 2) == memory // 2 // session.size // study_run.BYTES_PER_DISK
    spheres = study_run.max_disks_alone(session, 3)
    assert 3 * factor_bytes(3, 6 * spheres) == pytest.approx(memory / 2 / session.size, rel=1e-3)
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 100 + session.rank)
    assert study_run.max_disks_alone(session, 3) == 100  # the least that any rank may


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.least_ranks(2)
def test_what_reads_a_large_task_that_failed_fails_too(session, shared_path, monkeypatch, capsys):
    monkeypatch.setattr(journal, "TALLY_INTERVAL", -1.0)  # each look at what the others have done is new
    losing(monkeypatch, {"sweep": InputError("lost")})
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 15)
    text = SMALL.replace("1:2", "1:1").replace("[quasistatic]", '[sweep]\nomega = "1"\n[spectrum]')
    table = study(shared_path / "study", text, status=3)
    states = dict(zip(table["command"], table["state"], strict=True))
    assert states["sweep"] == "failed: lost" and states["pack"] == "done"
    assert states["spectrum"].startswith("failed: sweep-n16-") and states["spectrum"].endswith(".h5 failed")
    lines = session.comm.allgather(told(capsys))
    said = sorted(line for some in lines for line in some)
    assert [count for count, _ in said] == ["1/3", "2/3", "3/3"]
    assert said[1][1].endswith(": lost; 1 failed") and said[2][1].endswith("2 failed")
    assert said[1] in lines[0]  # of what all do together one tells
    monkeypatch.undo()
    losing(monkeypatch, {"sweep": InputError("lost")}, rank=1)  # all go on as rank 0 says
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 15)
    assert set(study(shared_path / "other", text)["state"]) == {"done"}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.least_ranks(2)
def test_a_bug_in_what_all_do_together_is_no_row(session, shared_path, monkeypatch):
    """One rank alone may have met it: the others would wait for it in the next task."""
    losing(monkeypatch, {"quasistatic": ZeroDivisionError("a bug")})
    monkeypatch.setattr(study_run, "MIN_SHARED_DISKS", 15)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        study(shared_path / "study", SMALL.replace("1:2", "1:1"))
    session.comm.Barrier()
    if session.rank == 0:  # the folder is free, and what was finished is kept
        lock = Lock(shared_path / "study")
        lock.take()
        lock.release()
        assert [record["state"] for record in records_of(shared_path / "study").values()] == ["done"]


# Killed


def test_killed_at_any_moment_the_same_command_continues(tmp_path):
    path, folder = tmp_path / "study.toml", tmp_path / "study"
    ladder = LADDER.replace(", 1e-4", "").replace("1:2", "1:1")
    path.write_text(ladder + '[quasistatic]\n[sweep]\nomega = "1e-2,1"\n')
    words = ("study", path, "--out", folder)
    kept = {}
    for ranks, count, moment in ((0, 2, "before"), (2, 2, "within"), (0, 1, "after")):
        done = launch.run(ranks, "run_with_disk_faults.py", moment, count, *words)
        assert done.returncode != 0
        assert kept.items() <= times(folder).items(), "what was made is not made again"
        kept = times(folder)
        interrupted = jampetsc.load(folder)  # the table is there from the first task on
        assert interrupted.rows >= 1 and set(interrupted["state"]) == {"done"}
        assert set(interrupted["file"]) <= set(kept)
    done = launch.run(2, "run_with_disk_faults.py", "after", 99, *words)
    assert done.returncode == 0, done.stderr
    table = jampetsc.load(folder)
    assert set(table["state"]) == {"done"} and table.rows == 6
    assert kept.items() <= times(folder).items()
    assert len(list((folder / "journal").iterdir())) == len(records_of(folder)) == 6
    assert not list(folder.glob(".*")) and (folder / "study.toml").read_text() == path.read_text()


@pytest.mark.parametrize("ranks", [2, 3])
def test_a_rank_that_fails_alone_ends_all(tmp_path, ranks):
    """With one line, while the others have tasks or wait for it, and what they have finished is kept."""
    path, folder = tmp_path / "study.toml", tmp_path / "study"
    path.write_text(f'[pack]\nn = 16\npressure = 1e-2\nseeds = "1:{ranks}"\n')
    done = launch.run(ranks, "run_with_disk_faults.py", "full", 1, "study", path, "--out", folder)
    assert done.returncode != 0 and f"error: rank 1: {folder}: disk full\n" in done.stderr
    assert done.stderr.count("error: ") == 1 and len(records_of(folder)) < ranks


CHAIN = '[pack]\nn = 16\npressure = 1e-2\n[sweep]\nomega = "1e-2,1"\n[spectrum]\n'


def truncated(path):
    os.truncate(path, path.stat().st_size - 200)


def with_another_byte(path):
    """As a disk may change it: the line of checksums is the one that was written."""
    content = path.read_bytes()
    path.write_bytes(content[:3000] + bytes([content[3000] ^ 1]) + content[3001:])


def replaced(path):
    write_packing(path, samples.published("hertzian").with_record(n=24))


CHANGES = {  # what happens to a file -> of which command, what is made again, whether one run more finds it out
    "another packing": (replaced, "pack", {"pack"}, False),
    "a packing cut off": (truncated, "pack", {"pack"}, False),
    "a sweep that is gone": (os.remove, "sweep", {"sweep", "spectrum"}, False),
    "a sweep cut off": (truncated, "sweep", {"sweep", "spectrum"}, False),
    "a byte of a sweep": (with_another_byte, "sweep", {"sweep", "spectrum"}, True),
}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_what_is_not_what_was_made_is_made_again_and_said(session, shared_path, capsys, monkeypatch):
    """A packing comes out as it was, to the last bit, so that what was computed from it stays."""
    folder, rows = shared_path / "study", []
    first = study(folder, CHAIN)
    write = study_run.write_table
    monkeypatch.setattr(study_run, "write_table", lambda *it: rows.append(write(*it)) or rows[-1])
    monkeypatch.setattr(study_run, "REFRESH_INTERVAL", -1.0)  # the table is written all the time
    for how, (change, command, again, later) in CHANGES.items():
        before = times(folder)
        name = first.where(command=command)["file"][0]
        session.comm.Barrier()
        if session.rank == 0:
            change(folder / name)
            if later:  # found out where something reads it
                (folder / first.where(command="spectrum")["file"][0]).unlink()
        session.comm.Barrier()
        capsys.readouterr()
        if later:
            study(folder, CHAIN, status=3)
        rows.clear()
        table = study(folder, CHAIN)
        told_meanwhile = {"pack": [1, 1, 1, 3], "sweep": [2, 3, 3]}[command]  # what is known to hold by then
        assert later or [len(some) for some in rows] == told_meanwhile
        told = capsys.readouterr().err
        assert set(table["state"]) == {"done"} and table.rows == first.rows, how
        made = {name.split("-")[0] for name, time in times(folder).items() if time != before[name]}
        assert made == again, how
        if session.rank == 0:
            (line,) = [line for line in told.splitlines() if line.startswith("made again") and name in line]
            assert line == f"{study_run.changed_note([name])}", how
        require_same(first, table)
    assert sorted(path.name.split("-")[0] for path in folder.glob("*.replaced")) == ["pack", "sweep"]


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_rows_that_are_asked_for_no_more_go_with_their_files(session, shared_path):
    folder, less = shared_path / "study", CHAIN[: CHAIN.index("[sweep]")]
    assert study(folder, CHAIN).rows == study(folder, less).rows == 3
    truncated(folder / study(folder, less).where(command="sweep")["file"][0])
    assert study(folder, less)["command"].tolist() == ["pack"]


@pytest.mark.parametrize("name", ["table.csv", "study.toml"])
def test_what_no_study_has_made_is_not_replaced(tmp_path, name):
    folder, path = tmp_path / "study", tmp_path / "asked.toml"
    folder.mkdir()
    path.write_text(SMALL)
    (folder / name).write_text(SMALL)
    with pytest.raises(InputError, match=f"study/{name}: exists, but no study ran"):
        cli.dispatch(["study", str(path), "--out", str(folder)])
    assert [one.name for one in folder.iterdir()] == [name] and (folder / name).read_text() == SMALL
    study_run.check_folder(folder, folder / name)  # a study may lie in its folder
    (folder / "journal").mkdir()
    study_run.check_folder(folder, path)


def test_a_record_that_is_torn_or_changed_does_not_count(tmp_path):
    (tmp_path / "journal").mkdir()
    for name in ("a", "b/b", "c", "a"):
        keep_record(tmp_path, {"task": name, "row": {}, "seconds": 1.0})
    assert list(records_of(tmp_path)) == ["a", "b/b", "c"]
    files = sorted((tmp_path / "journal").iterdir())
    files[1].write_bytes(files[1].read_bytes().replace(b"1.0", b"2.0"))
    files[2].write_bytes(files[2].read_bytes()[:-3])
    (tmp_path / "journal" / "rank-0000").write_text('12345678 {"task": "d"}\n')  # as older versions kept them
    assert list(records_of(tmp_path)) == ["a"]


def test_a_dry_run_tells_the_tasks_and_makes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SMALL)
    assert cli.dispatch(["study", "s.toml", "--out", "new", "--dry-run"]) == 0
    told = capsys.readouterr().out
    assert told.count("to do  jampetsc ") == 4 and "made again" not in told
    assert told.endswith("\n4 of 4 tasks to do\n") and not (tmp_path / "new").exists()

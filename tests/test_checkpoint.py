"""Checkpoints of a sweep: what is saved survives a kill, what is torn or another job's is ignored."""

import hashlib
import os
import re
import resource
import socket
import subprocess
import sys
import time
from pathlib import Path

import launch
import numpy as np
import pytest
from run_checkpoint import fields, record

from jampetsc.errors import InputError, JampetscError
from jampetsc.storage import checkpoint as checkpoint_module
from jampetsc.storage.checkpoint import Checkpoint

KEY = {
    "packing": "ab" * 32,
    "omega": np.logspace(-3, 3, 5),
    "law": {"law": "contact", "beta": 1.0},
    "fields": [],
}


@pytest.fixture
def out(tmp_path):
    return tmp_path / "s.h5"


def saved(out, count, key=KEY, with_fields=False, ordered=False):
    checkpoint = Checkpoint(out, key, ordered=ordered)
    for index in range(count):
        checkpoint.save(index, record(index), fields(index, 0) if with_fields else None)
    return checkpoint


IN_ANOTHER_PROCESS = """
import sys
from jampetsc.storage.checkpoint import Checkpoint
checkpoint = Checkpoint(sys.argv[1], sys.argv[2])
checkpoint.save(0, {})
print("saved", flush=True)
sys.stdin.read()
"""


def test_two_processes_do_not_write_one_output(out):
    """Whichever job they have, also where both began before there was a checkpoint; one goes on when the other ends."""
    early = Checkpoint(out, KEY)
    line = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(out), "a"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(line, env=launch.environment(), **pipes) as other:
        assert other.stdout.readline() == "saved\n"
        message = (
            r"s\.h5: another run is writing it \(and s\.h5\.resume\): wait for it, or choose another --out"
        )
        for key in (KEY, "a"):
            with pytest.raises(InputError, match=message):
                Checkpoint(out, key)
        with pytest.raises(InputError, match=message):
            early.save(0, record(0))
        other.kill()
    assert Checkpoint(out, "a").done == {0: {}}
    early.save(0, record(0))
    assert Checkpoint(out, KEY).done == {0: record(0)}
    early.remove()
    assert not list(out.parent.iterdir()) and not checkpoint_module._locks


def test_records_come_back_exactly(out):
    checkpoint = saved(out, 4)
    again = Checkpoint(out, dict(KEY))
    assert again.done == checkpoint.done == {index: record(index) for index in range(4)}
    assert isinstance(again.done[0]["G"], complex)


def test_a_job_is_the_same_in_whatever_order_it_is_told(out):
    saved(out, 2)
    assert Checkpoint(out, dict(reversed(KEY.items()))).done.keys() == {0, 1}


def test_only_what_was_a_complex_number_becomes_one(out):
    checkpoint = Checkpoint(out, KEY)
    told = {"G": 1 - 2j, "parts": {"real": 1.0, "imag": 2.0, "kind": "x"}, "n": np.int64(3), "a": np.ones(2)}
    checkpoint.save(0, told)
    assert Checkpoint(out, KEY).done[0] == told | {"n": 3, "a": [1.0, 1.0]}


@pytest.mark.parametrize("place", ["journal", "folder"])
def test_where_no_checkpoint_can_be_is_one_line(out, place):
    checkpoint = Checkpoint(out, KEY)
    if place == "journal":
        checkpoint.journal.symlink_to(checkpoint.journal)  # a link to itself leads nowhere
        with pytest.raises(JampetscError, match=r"s\.h5\.resume: writing failed: Too many levels"):
            Checkpoint(out, KEY)
    else:
        checkpoint.folder.touch()
        with pytest.raises(JampetscError, match=r"s\.h5\.resume\.d: writing failed: File exists"):
            checkpoint.save(0, record(0), fields(0, 0))
        assert checkpoint.done == {} == Checkpoint(out, KEY).done


def test_nothing_is_written_before_something_is_saved(out):
    assert Checkpoint(out, KEY).done == {}
    assert list(out.parent.iterdir()) == []


def test_fields_come_back_exactly(out):
    saved(out, 3, with_fields=True)
    again = Checkpoint(out, KEY)
    assert again.done == {index: record(index) for index in range(3)}
    for name, array in again.fields(2).items():
        assert np.array_equal(array, fields(2, 0)[name])
    again.remove()
    assert list(out.parent.iterdir()) == []


def test_a_journal_cut_anywhere_keeps_the_whole_lines_and_can_go_on(out):
    saved(out, 3)
    journal = out.with_name("s.h5.resume")
    whole = journal.read_bytes()
    lines = whole.splitlines(keepends=True)
    for length in range(len(lines[0]), len(whole) + 1, 7):
        journal.write_bytes(whole[:length])
        checkpoint = Checkpoint(out, KEY)
        count = whole[:length].count(b"\n") - 1
        assert checkpoint.done == {index: record(index) for index in range(count)}
        checkpoint.save(9, record(9))
        assert Checkpoint(out, KEY).done.keys() == {*range(count), 9}


def test_a_damaged_line_and_what_follows_are_solved_again(out):
    saved(out, 3)
    journal = out.with_name("s.h5.resume")
    lines = journal.read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b"0.5", b"0.6")
    journal.write_bytes(b"".join(lines))
    assert Checkpoint(out, KEY).done.keys() == {0}


@pytest.mark.parametrize(
    "change",
    [
        {"packing": "cd"},
        {"law": {"law": "stokes"}},
        {"omega": [1.0]},
        {"fields": [1]},
        {"ranks": 2},
        {"accuracy": 1e-9},
    ],
)
def test_another_job_is_ignored_with_a_notice_and_replaced(out, capsys, change):
    saved(out, 2, with_fields=True)
    other = Checkpoint(out, KEY | change)
    notice = f"{out}.resume: belongs to another job: ignored, starting from the beginning\n"
    assert capsys.readouterr().err == notice
    assert other.done == {}
    other.remove()
    assert Checkpoint(out, KEY).done.keys() == {0, 1}  # not removed by a job it does not belong to
    capsys.readouterr()
    other = Checkpoint(out, KEY | change)
    other.save(0, record(0), fields(0, 0))
    assert len(list(out.with_name("s.h5.resume.d").iterdir())) == 1
    assert Checkpoint(out, KEY | change).done.keys() == {0}


def test_every_line_of_the_journal_begins_with_a_hash_that_cannot_be_met_by_chance(out):
    saved(out, 3)
    lines = out.with_name("s.h5.resume").read_bytes().splitlines(keepends=True)
    hashes = [re.fullmatch(rb"([0-9a-f]{32}) \{.*\}\n", line)[1] for line in lines]
    assert len(set(hashes)) == 4
    link = b""
    for found, line in zip(hashes, lines, strict=True):
        assert hashlib.sha256(link + line[33:-1]).hexdigest().encode().startswith(found)
        link = found


def test_what_another_version_saved_is_not_taken_for_its_own(out, monkeypatch):
    saved(out, 2)
    monkeypatch.setattr(checkpoint_module, "VERSION", "0.0.1")
    assert Checkpoint(out, KEY).done == {}


def test_fields_that_are_missing_or_torn_are_solved_again(out):
    saved(out, 3, with_fields=True)
    files = sorted(out.with_name("s.h5.resume.d").iterdir())
    files[0].unlink()
    os.truncate(files[1], files[1].stat().st_size - 10)
    assert Checkpoint(out, KEY).done.keys() == {2}


def steps_of(out):
    """Lines of the journal, and the files of fields, both in the order of the steps."""
    lines = out.with_name("s.h5.resume").read_bytes().splitlines(keepends=True)
    return lines, sorted(out.with_name("s.h5.resume.d").iterdir())


def swap(one, other):
    content = one.read_bytes(), other.read_bytes()
    for path, bytes_ in zip((other, one), content, strict=True):
        path.write_bytes(bytes_)


def flip(path, place):
    content = bytearray(path.read_bytes())
    content[place] ^= 4
    path.write_bytes(content)


LINES = {  # what happens to the five steps' lines -> how many are left
    "the first lost": (lambda steps: steps[1:], 0),
    "one lost": (lambda steps: steps[:2] + steps[3:], 2),
    "two swapped": (lambda steps: [steps[0], steps[2], steps[1], *steps[3:]], 1),
    "one twice": (lambda steps: [*steps[:3], *steps[2:]], 3),
    "one cut": (lambda steps: [*steps[:3], steps[3][:50], steps[4]], 3),
    "a digit changed": (lambda steps: [steps[0], steps[1].replace(b"0.5", b"0.6"), *steps[2:]], 1),
    "an index changed": (lambda steps: [*steps[:3], steps[3].replace(b'"index": 3', b'"index": 4')], 3),
    "a line of another job": (lambda steps: [*steps[:4], foreign_line()], 4),
}


def foreign_line():
    text = b'{"index": 4, "record": {}}'
    return b"%s %s\n" % (hashlib.sha256(text).hexdigest()[:32].encode(), text)


@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("change", LINES)
def test_what_follows_a_gap_in_the_journal_does_not_count(out, change, ordered):
    saved(out, 5, with_fields=True, ordered=ordered)
    edit, count = LINES[change]
    lines, _ = steps_of(out)
    out.with_name("s.h5.resume").write_bytes(b"".join([lines[0], *edit(lines[1:])]))
    again = Checkpoint(out, KEY, ordered=ordered)
    assert again.done == {index: record(index) for index in range(count)}
    assert again.next == count
    again.save(count, record(9), fields(9, 0))
    again = Checkpoint(out, KEY, ordered=ordered)
    assert again.done == {index: record(index) for index in range(count)} | {count: record(9)}
    assert np.array_equal(again.fields(count)["rotation"], fields(9, 0)["rotation"])


FILES = {
    "lost": lambda files: files[1].unlink(),
    "cut": lambda files: os.truncate(files[1], 100),
    "changed": lambda files: flip(files[1], -400),
    "of another step": lambda files: files[1].write_bytes(files[3].read_bytes()),
    "a folder": lambda files: (files[1].unlink(), files[1].mkdir()),
}


@pytest.mark.parametrize("change", FILES)
def test_a_step_without_its_fields_does_not_count(out, change):
    saved(out, 5, with_fields=True)
    FILES[change](steps_of(out)[1])
    assert Checkpoint(out, KEY).done.keys() == {0, 2, 3, 4}


@pytest.mark.parametrize("change", FILES)
def test_nor_do_those_that_build_on_it(out, change):
    if change == "a folder":
        pytest.skip("stays in the way")
    saved(out, 5, with_fields=True, ordered=True)
    FILES[change](steps_of(out)[1])
    again = Checkpoint(out, KEY, ordered=True)
    assert again.done.keys() == {0}
    again.save(again.next, record(1), fields(1, 0))
    assert Checkpoint(out, KEY, ordered=True).done.keys() == {0, 1}  # and not the old steps 2, 3, 4


def test_fields_that_changed_places_do_not_count(out):
    saved(out, 4, with_fields=True)
    swap(*steps_of(out)[1][1:3])
    assert Checkpoint(out, KEY).done.keys() == {0, 3}


def test_steps_of_an_ordered_job_follow_each_other(out):
    checkpoint = saved(out, 2, ordered=True)
    assert checkpoint.next == 2
    for index in (1, 3):
        with pytest.raises(ValueError, match="cannot follow step 1"):
            checkpoint.save(index, record(index))


def test_fields_that_change_while_a_job_runs_are_noticed(out):
    checkpoint = saved(out, 2, with_fields=True)
    flip(steps_of(out)[1][1], 200)
    checkpoint.fields(0)
    with pytest.raises(JampetscError, match="changed during the run: run the same command again"):
        checkpoint.fields(1)


def test_what_is_saved_is_on_the_disk(out, monkeypatch):
    """Bytes before a file gets its name, the name before the journal says so, and that before `save` returns."""
    checkpoint = saved(out, 1, with_fields=True)
    events = []

    def note(name):
        original = getattr(os, name)

        def noted(target, *more):
            path = os.readlink(f"/proc/self/fd/{target}") if isinstance(target, int) else str(target)
            events.append((name, Path(path).name.partition(".npz")[0].lstrip(".")))
            return original(target, *more)

        monkeypatch.setattr(os, name, noted)

    note("fsync")
    note("replace")
    checkpoint.save(1, record(1), fields(1, 0))
    stem = steps_of(out)[1][1].stem
    assert events == [
        ("fsync", stem),
        ("replace", stem),
        ("fsync", "s.h5.resume.d"),
        ("fsync", "s.h5.resume"),
    ]


def test_a_full_disk_is_one_line_and_keeps_what_there_was(out):
    checkpoint = saved(out, 2)
    size = out.with_name("s.h5.resume").stat().st_size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 20, limits[1]))
    try:
        with pytest.raises(JampetscError, match=r"s\.h5\.resume: file size limit reached: make room"):
            checkpoint.save(2, record(2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert 2 not in checkpoint.done
    assert Checkpoint(out, KEY).done.keys() == {0, 1}
    checkpoint.save(3, record(3))
    assert Checkpoint(out, KEY).done.keys() == {0, 1, 3}


def test_what_a_killed_run_left_goes_with_the_checkpoint(out):
    def abandon(folder, name):
        (folder / f".{name}.{socket.gethostname()}.1-abcdef01.partial").touch()

    abandon(out.parent, "s.h5.resume")
    checkpoint = saved(out, 1, with_fields=True)
    assert sorted(path.name for path in out.parent.iterdir()) == ["s.h5.resume", "s.h5.resume.d"]
    abandon(out.with_name("s.h5.resume.d"), "x.npz")
    checkpoint.remove()
    assert list(out.parent.iterdir()) == []
    checkpoint.save(2, record(2))  # a new journal
    assert Checkpoint(out, KEY).done.keys() == {2}


def test_what_is_not_its_own_stays_in_the_folder_of_a_checkpoint(out):
    checkpoint = saved(out, 1, with_fields=True)
    (checkpoint.folder / "notes.txt").touch()
    checkpoint.remove()
    assert sorted(path.name for path in out.parent.rglob("*")) == ["notes.txt", "s.h5.resume.d"]


def test_a_step_beyond_a_gap_ends_what_counts_of_an_ordered_job_for_good(out):
    checkpoint = Checkpoint(out, KEY)
    for index in (0, 1, 3, 2):
        checkpoint.save(index, record(index))
    assert Checkpoint(out, KEY, ordered=True).done.keys() == {0, 1}
    assert Checkpoint(out, KEY).done.keys() == {0, 1, 2, 3}


def test_a_checkpoint_lies_beside_the_file_that_a_link_stands_for(tmp_path):
    (tmp_path / "scratch").mkdir()
    (tmp_path / "s.h5").symlink_to(tmp_path / "scratch" / "big.h5")
    saved(tmp_path / "s.h5", 1)
    assert [path.name for path in (tmp_path / "scratch").iterdir()] == ["big.h5.resume"]
    assert Checkpoint(tmp_path / "scratch" / "big.h5", KEY).done.keys() == {0}


def test_files_of_fields_are_named_after_their_job(out):
    saved(out, 1, with_fields=True)
    mine = steps_of(out)[1]
    saved(out, 1, KEY | {"packing": "cd"}, with_fields=True)
    assert mine[0].name != steps_of(out)[1][0].name


def test_a_step_saved_twice_counts_as_it_was_last(out):
    checkpoint = saved(out, 2, with_fields=True)
    checkpoint.save(0, record(7), fields(7, 0))
    again = Checkpoint(out, KEY)
    assert again.done == checkpoint.done == {0: record(7), 1: record(1)}
    assert np.array_equal(again.fields(0)["rotation"], fields(7, 0)["rotation"])
    os.truncate(steps_of(out)[1][0], 10)
    assert Checkpoint(out, KEY).done.keys() == {1}  # not what it was before: its file is gone


def test_a_step_that_was_saved_again_with_fields_needs_them(out):
    checkpoint = saved(out, 2)
    checkpoint.save(0, record(7), fields(7, 0))
    assert Checkpoint(out, KEY).done == {0: record(7), 1: record(1)}
    steps_of(out)[1][0].unlink()
    assert Checkpoint(out, KEY).done == {1: record(1)}


def test_a_gap_in_the_numbers_ends_what_counts_of_an_ordered_job(out):
    checkpoint = saved(out, 2)
    checkpoint.save(3, record(3))
    assert Checkpoint(out, KEY).done.keys() == {0, 1, 3}
    assert Checkpoint(out, KEY, ordered=True).done.keys() == {0, 1}


# On several ranks, of which one fails


@pytest.fixture
def shared_out(shared_path):
    return shared_path / "s.h5"


def blocked(path, session, rank):
    """Put a folder where a rank is to write its file."""
    if session.rank == rank:
        path.unlink(missing_ok=True)
        path.mkdir()
    session.comm.Barrier()


@pytest.mark.scalar("real")
@pytest.mark.parametrize("what", ["journal", "fields", "line"])
def test_what_one_rank_cannot_write_all_are_told(session, shared_out, what):
    checkpoint = Checkpoint(shared_out, KEY, session.comm)
    last = session.size - 1
    if what == "journal":
        blocked(checkpoint.journal, session, 0)
    else:
        checkpoint.save(0, record(0), fields(0, session.rank))
        blocked(
            *(checkpoint._fields_path(1), session, last)
            if what == "fields"
            else (checkpoint.journal, session, 0)
        )
    with pytest.raises(InputError, match=r"is a folder|Is a directory"):
        checkpoint.save(1, record(1), fields(1, session.rank))
    assert 1 not in checkpoint.done
    if what == "fields":
        assert Checkpoint(shared_out, KEY, session.comm).done.keys() == {0}


@pytest.mark.scalar("real")
def test_a_journal_that_rank_0_cannot_read_stops_all(session, shared_out):
    blocked(shared_out.with_name("s.h5.resume"), session, 0)
    with pytest.raises(InputError, match=r"s\.h5\.resume: is a folder"):
        Checkpoint(shared_out, KEY, session.comm)


@pytest.mark.scalar("real")
def test_fields_of_one_rank_that_change_stop_all(session, shared_out):
    checkpoint = Checkpoint(shared_out, KEY, session.comm)
    for index in range(2):
        checkpoint.save(index, record(index), fields(index, session.rank))
    if session.rank == session.size - 1:
        flip(checkpoint._fields_path(1), 200)
    session.comm.Barrier()
    assert checkpoint.fields(0)["rotation"] is not None
    with pytest.raises(JampetscError, match="changed during the run"):
        checkpoint.fields(1)
    again = Checkpoint(shared_out, KEY, session.comm)
    assert again.done == {0: record(0)}
    for name, array in again.fields(0).items():
        assert np.array_equal(array, fields(0, session.rank)[name])


@pytest.mark.scalar("real")
def test_fields_of_other_numbers_of_ranks_do_not_count(session, shared_out):
    checkpoint = Checkpoint(shared_out, KEY, session.comm)
    checkpoint.save(0, record(0), fields(0, session.rank))
    checkpoint.save(1, record(1))
    if session.rank == 0:  # whose process has it locked
        assert Checkpoint(shared_out, KEY).done.keys() == ({0, 1} if session.size == 1 else {1})


@pytest.mark.scalar("real")
def test_no_rank_loses_its_fields_before_it_is_done_with_them(session, shared_out):
    checkpoint = Checkpoint(shared_out, KEY, session.comm)
    checkpoint.save(0, record(0), fields(0, session.rank))
    if session.rank == session.size - 1:
        time.sleep(0.1)
        assert checkpoint._fields_path(0).exists()
    checkpoint.remove()
    session.comm.Barrier()
    assert list(shared_out.parent.iterdir()) == []


def test_values_that_cannot_be_kept_are_refused(out):
    with pytest.raises(TypeError, match="cannot be kept in a checkpoint"):
        Checkpoint(out, {"packing": object()})


def test_a_change_on_one_rank_counts_on_all(out):
    launch.run(3, "run_checkpoint.py", out, 4, -1, "a", "ordered")
    flip(next(out.with_name("s.h5.resume.d").glob("*-00001-rank-0002.npz")), 150)
    done = launch.run(3, "run_checkpoint.py", out, 4, -1, "a", "ordered")
    assert sorted(done.stdout.splitlines()) == [f"rank {rank} solved [1, 2, 3]" for rank in range(3)], (
        done.stderr
    )


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_the_same_command_continues_after_a_kill(out, ranks):
    for stop_at in (2, 5):
        assert launch.run(ranks, "run_checkpoint.py", out, 6, stop_at).returncode != 0
    done = launch.run(ranks, "run_checkpoint.py", out, 6)
    assert done.returncode == 0, done.stderr
    assert sorted(done.stdout.splitlines()) == [f"rank {rank} solved [5]" for rank in range(ranks)]


def test_fields_lost_on_one_rank_are_solved_again_on_all(out):
    launch.run(3, "run_checkpoint.py", out, 4)
    next(out.with_name("s.h5.resume.d").glob("*-00002-rank-0001.npz")).unlink()
    done = launch.run(3, "run_checkpoint.py", out, 4)
    assert sorted(done.stdout.splitlines()) == [f"rank {rank} solved [2]" for rank in range(3)]


def test_another_job_under_mpirun_gives_one_notice(out):
    launch.run(2, "run_checkpoint.py", out, 2)
    done = launch.run(2, "run_checkpoint.py", out, 2, -1, "b")
    assert done.stderr.count("belongs to another job") == 1
    assert sorted(done.stdout.splitlines()) == [f"rank {rank} solved [0, 1]" for rank in range(2)]


@pytest.mark.parametrize("delay", [0.5, 0.9, 1.3])
def test_a_kill_at_any_moment_leaves_a_usable_state(out, delay):
    """SIGKILL to all ranks at an arbitrary moment of 400 saves."""
    process = launch.start(0, "run_checkpoint.py", out, 400)
    try:
        process.wait(delay)
    except launch.subprocess.TimeoutExpired:
        process.kill()
    process.communicate()
    journal = out.with_name("s.h5.resume")
    kept = journal.read_bytes().count(b"\n") - 1 if journal.exists() else 0
    done = launch.run(0, "run_checkpoint.py", out, 400)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"rank 0 solved {list(range(kept, 400))}\n"

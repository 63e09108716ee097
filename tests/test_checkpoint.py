"""Checkpoints of a sweep: what is saved survives a kill, what is torn or another job's is ignored."""

import os
import resource

import launch
import numpy as np
import pytest
from run_checkpoint import fields, record

from jampetsc.errors import JampetscError
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


def saved(out, count, key=KEY, with_fields=False):
    checkpoint = Checkpoint(out, key)
    for index in range(count):
        checkpoint.save(index, record(index), fields(index, 0) if with_fields else None)
    return checkpoint


def test_records_come_back_exactly(out):
    checkpoint = saved(out, 4)
    again = Checkpoint(out, dict(KEY))
    assert again.done == checkpoint.done == {index: record(index) for index in range(4)}
    assert isinstance(again.done[0]["G"], complex)


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
    "change", [{"packing": "cd"}, {"law": {"law": "stokes"}}, {"omega": [1.0]}, {"fields": [1]}]
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


def test_fields_that_are_missing_or_torn_are_solved_again(out):
    saved(out, 3, with_fields=True)
    files = sorted(out.with_name("s.h5.resume.d").iterdir())
    files[0].unlink()
    os.truncate(files[1], files[1].stat().st_size - 10)
    assert Checkpoint(out, KEY).done.keys() == {2}


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


def test_values_that_cannot_be_kept_are_refused(out):
    with pytest.raises(TypeError, match="cannot be kept in a checkpoint"):
        Checkpoint(out, {"packing": object()})


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

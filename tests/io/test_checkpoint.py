"""Checkpoints: what is saved survives a kill, what is torn, lost, changed or another job's does not count."""

import fcntl
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from itertools import count

import launch
import numpy as np
import pytest
from disk_faults import killed

from jampetsc.errors import InputError, JampetscError
from jampetsc.io import checkpoint as checkpoint_module
from jampetsc.io.checkpoint import Checkpoint, write_entry

DIGEST, ANOTHER = "ab" * 32, "cd" * 32


def record(index):
    return {
        "omega": 10.0**-index / 3,
        "G": complex(1 / (index + 1), np.pi),
        "error_bound": np.float64(1e-9) / 7,
    }


def fields(index, rank):
    rng = np.random.default_rng([index, rank])
    return {"displacement": rng.random((4, 2)) * 1j, "rotation": rng.random(4)}


@pytest.fixture
def out(tmp_path):
    return tmp_path / "s.h5"


def saved(out, seeds, digest=DIGEST, ordered=False):
    """A checkpoint with a step of each of these seeds."""
    checkpoint = Checkpoint(out, digest, ordered=ordered)
    for index, seed in enumerate(seeds):
        checkpoint.save(index, record(seed), fields(seed, 0))
    return checkpoint


def flip(path, place):
    content = bytearray(path.read_bytes())
    content[place % len(content)] ^= 4
    path.write_bytes(content)


def assert_holds(checkpoint, version=None):
    """Whatever counts is what was saved, record and arrays, of version[index] where a step was saved again."""
    for index, found in checkpoint.done.items():
        seed = (version or {}).get(index, index)
        assert found == record(seed)
        arrays = checkpoint.fields(index)
        assert arrays.keys() == fields(seed, 0).keys()
        assert all(np.array_equal(arrays[name], array) for name, array in fields(seed, 0).items())


DAMAGES = {
    "lost": lambda one, other, dice: one.unlink(),
    "cut": lambda one, other, dice: os.truncate(one, dice.randrange(one.stat().st_size)),
    "changed": lambda one, other, dice: flip(one, dice.randrange(10**6)),
    "longer": lambda one, other, dice: one.write_bytes(one.read_bytes() + b"x"),
    "of another step": lambda one, other, dice: shutil.copy(other, one),
    "of another job": lambda one, other, dice: write_entry(
        one, {"job": {"digest": "x"}, "index": int(one.name[:5])}
    ),
    "of an earlier run": lambda one, other, dice: shutil.copy(one.parent / "earlier" / one.name, one),
    "a folder": lambda one, other, dice: (one.unlink(), one.mkdir()),
}


@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("damage", DAMAGES)
def test_whatever_happens_to_a_step_only_what_was_saved_counts(out, damage, ordered):
    """In an ordered job nothing that is built on it, either, also not when it is made anew."""
    dice = random.Random(damage)
    for number in range(2):
        here = out.parent / str(number) / "s.h5"
        for path, seeds in ((here.parent / "earlier" / "s.h5", range(5, 10)), (here, range(5))):
            path.parent.mkdir(exist_ok=True, parents=True)
            saved(path, seeds, ordered=ordered)
        shutil.copytree(path.parent / "earlier" / "s.h5.resume", path.parent / "s.h5.resume" / "earlier")
        one, other = dice.sample(sorted(here.with_name("s.h5.resume").glob("*-rank-*")), 2)
        DAMAGES[damage](one, other, dice)
        victim = int(one.name[:5])
        again = Checkpoint(here, DIGEST, ordered=ordered)
        counts = set(range(victim)) if ordered else set(range(5)) - {victim}
        # sound, and of this job: another one's only where steps build on it
        earlier = damage == "of an earlier run"
        if earlier and not (ordered and victim):
            counts |= {victim}
        assert again.done.keys() == counts
        version = {victim: victim + 5} if earlier else {}
        assert_holds(again, version)
        if damage == "a folder":
            with pytest.raises(InputError, match=r"a folder\. Give"):
                again.save(victim, record(victim), fields(victim, 0))
            continue
        new = again.next if ordered else victim
        again.save(new, record(11), fields(11, 0))
        again = Checkpoint(here, DIGEST, ordered=ordered)
        assert again.done.keys() == (set(range(new + 1)) if ordered else set(range(5)))
        assert_holds(again, version | {new: 11})


@pytest.mark.parametrize("ordered", [True, False])
def test_a_kill_at_any_moment_leaves_what_was_saved(out, ordered):
    """And what goes on from there, killed again two calls later, ends as if nothing had been."""

    def run():
        checkpoint = Checkpoint(out, DIGEST, ordered=ordered)
        for index in range(3):
            if index not in checkpoint.done:
                checkpoint.save(index, record(index), fields(index, 0))
        checkpoint.remove()

    most = 0
    for call in count():
        if not killed(call, run):
            break
        for again in (2, 10**6):
            checkpoint = Checkpoint(out, DIGEST, ordered=ordered)
            assert checkpoint.done.keys() <= set(range(3))
            assert not ordered or list(checkpoint.done) == list(range(checkpoint.next))
            most = max(most, len(checkpoint.done))
            assert_holds(checkpoint)
            del checkpoint
            killed(again, run)
        assert list(out.parent.iterdir()) == []
    assert most == 3 and call > 15


IN_ANOTHER_PROCESS = """
import sys
from jampetsc.io.checkpoint import Checkpoint
checkpoint = Checkpoint(sys.argv[1], sys.argv[2])
checkpoint.save(0, {})
print("saved", flush=True)
sys.stdin.read()
"""


def test_two_processes_do_not_write_one_output(out):
    """Whichever job they have, also where both began before there was a checkpoint; one goes on when the other ends."""
    files = len(os.listdir("/proc/self/fd"))
    early = Checkpoint(out, DIGEST)
    line = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(out), "a"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(line, env=launch.environment(), **pipes) as other:
        assert other.stdout.readline() == "saved\n"
        message = r"s\.h5: another run writes it and s\.h5\.resume\. Wait for it"
        for digest in (DIGEST, "a"):
            with pytest.raises(InputError, match=message):
                Checkpoint(out, digest)
        with pytest.raises(InputError, match=message):
            early.save(0, record(0))
        other.kill()
    assert Checkpoint(out, "a").done == {0: {}}
    early.save(0, record(0))
    assert Checkpoint(out, DIGEST).done == {0: record(0)}
    early.remove()
    assert not list(out.parent.iterdir())
    assert len(os.listdir("/proc/self/fd")) == files


@pytest.mark.parametrize("remove", [shutil.rmtree, lambda folder: (folder / "lock").unlink()])
def test_what_a_run_that_is_just_ending_removes_is_no_error(out, monkeypatch, remove):
    """Between the opening of the lock and its locking."""
    saved(out, range(1))
    flock, removed = fcntl.flock, []

    def late(file, how):
        if not removed:
            removed.append(remove(out.with_name("s.h5.resume")))
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", late)
    assert len(Checkpoint(out, DIGEST).done) == (remove is not shutil.rmtree) and removed


def test_records_come_back_exactly(out):
    checkpoint = saved(out, range(4))
    again = Checkpoint(out, DIGEST)
    assert again.done == checkpoint.done == {index: record(index) for index in range(4)}
    assert isinstance(again.done[0]["G"], complex)
    told = {"G": 1 - 2j, "parts": {"real": 1.0, "imag": 2.0, "kind": "x"}, "n": np.int64(3), "a": np.ones(2)}
    again.save(4, told)
    assert Checkpoint(out, DIGEST).done[4] == told | {"n": 3, "a": [1.0, 1.0]}
    with pytest.raises(TypeError, match="cannot be kept in a checkpoint"):
        again.save(5, {"packing": object()})


def test_in_memory_it_ends_with_the_run(out):
    checkpoint = saved(None, range(3), ordered=True)
    assert checkpoint.next == 3 and not list(out.parent.iterdir())
    assert_holds(checkpoint)
    checkpoint.remove()
    assert not Checkpoint(None, DIGEST).done
    assert Checkpoint(out, DIGEST).done == {} and not list(out.parent.iterdir()), "nothing is saved as yet"


def test_another_job_is_ignored_with_a_notice_and_replaced(out, capsys):
    saved(out, range(2))
    for how in ({"digest": ANOTHER}, {"ordered": True}):
        other = Checkpoint(out, **{"digest": DIGEST} | how)
        notice = f"{out}.resume: was saved by another job: ignored, starting from the beginning\n"
        assert capsys.readouterr().err == notice and other.done == {}
        other.remove()
        assert Checkpoint(out, DIGEST).done.keys() == {0, 1}  # not removed by a job it does not belong to
        capsys.readouterr()
    other.save(0, record(0), fields(0, 0))
    assert len(list(out.with_name("s.h5.resume").glob("*-rank-*"))) == 1
    assert Checkpoint(out, DIGEST, ordered=True).done.keys() == {0}


def test_what_another_version_saved_is_not_taken_for_its_own(out, monkeypatch, capsys):
    saved(out, range(1))
    monkeypatch.setattr(checkpoint_module, "VERSION", "0.0.1")
    assert not Checkpoint(out, DIGEST).done
    assert capsys.readouterr().err.count("was saved by another job: ignored") == 1
    saved(out, range(1))
    assert Checkpoint(out, DIGEST).done.keys() == {0}


def test_what_goes_with_a_checkpoint_and_what_stays(tmp_path, out):
    """It lies beside the file that a link stands for."""
    (tmp_path / "scratch").mkdir()
    link, out = out, tmp_path / "scratch" / "s.h5"
    link.symlink_to(out)
    checkpoint = saved(link, range(1))
    assert sorted(path.name for path in out.parent.rglob("*")) == ["00000-rank-0000", "lock", "s.h5.resume"]
    (checkpoint.journal / f".x.{socket.gethostname()}.1-abcdef01.partial").touch()  # of a run that was killed
    checkpoint.remove()
    assert list(out.parent.iterdir()) == []
    checkpoint.save(2, record(2))
    assert Checkpoint(out, DIGEST).done.keys() == {2}
    (checkpoint.journal / "notes.txt").touch()
    checkpoint.remove()
    assert sorted(path.name for path in out.parent.rglob("*")) == ["notes.txt", "s.h5.resume"]


# On several ranks, of which one fails


@pytest.fixture
def shared_out(shared_path):
    return shared_path / "s.h5"


@pytest.mark.scalar("real")
def test_what_one_rank_cannot_write_all_are_told(session, shared_out):
    """Where the folder cannot be, and where the last rank's file cannot."""
    if session.rank == 0:
        shared_out.with_name("s.h5.resume").symlink_to(shared_out.parent)
    session.comm.Barrier()
    with pytest.raises(InputError, match=r"s\.h5\.resume: a symbolic link"):
        Checkpoint(shared_out, DIGEST, session.comm)
    session.comm.Barrier()
    if session.rank == 0:
        shared_out.with_name("s.h5.resume").unlink()
        os.mkfifo(shared_out.with_name("s.h5.resume"))
    session.comm.Barrier()
    checkpoint = Checkpoint(shared_out, DIGEST, session.comm)
    with pytest.raises(JampetscError, match=r"s\.h5\.resume: "):
        checkpoint.save(0, record(0), fields(0, session.rank))
    session.comm.Barrier()
    if session.rank == 0:
        shared_out.with_name("s.h5.resume").unlink()
    checkpoint = Checkpoint(shared_out, DIGEST, session.comm)
    checkpoint.save(0, record(0), fields(0, session.rank))
    if session.rank == session.size - 1:
        checkpoint.path_of(1).mkdir()
    session.comm.Barrier()
    with pytest.raises(InputError, match=r"a folder\. Give"):
        checkpoint.save(1, record(1), fields(1, session.rank))
    assert Checkpoint(shared_out, DIGEST, session.comm).done.keys() == checkpoint.done.keys() == {0}


@pytest.mark.scalar("real")
@pytest.mark.parametrize(("ordered", "left"), [(False, {0, 2}), (True, {0})])
def test_fields_of_one_rank_that_change_stop_all(session, shared_out, capsys, ordered, left):
    checkpoint = Checkpoint(shared_out, DIGEST, session.comm, ordered)
    for index in range(3):
        checkpoint.save(index, record(index), fields(index, session.rank))
    if session.rank == session.size - 1:
        flip(checkpoint.path_of(1), 200)
    session.comm.Barrier()
    assert checkpoint.fields(0)["rotation"] is not None
    with pytest.raises(JampetscError, match="changed during the run"):
        checkpoint.fields(1)
    again = Checkpoint(shared_out, DIGEST, session.comm, ordered)
    assert again.done == {index: record(index) for index in left}
    for name, array in again.fields(0).items():
        assert np.array_equal(array, fields(0, session.rank)[name])
    assert not Checkpoint(shared_out, ANOTHER, session.comm, ordered).done
    assert capsys.readouterr().err.count("was saved by another job") == (session.rank == 0), "one notice"


@pytest.mark.scalar("real")
def test_fields_belong_to_a_number_of_ranks_which_keep_them_until_all_are_done(session, shared_out, capsys):
    checkpoint = Checkpoint(shared_out, DIGEST, session.comm)
    checkpoint.save(0, record(0), fields(0, session.rank))
    checkpoint.save(1, record(1))
    if session.rank == 0:  # whose process has it locked
        assert Checkpoint(shared_out, DIGEST).done.keys() == ({0, 1} if session.size == 1 else {1})
        assert "was saved" not in capsys.readouterr().err
        checkpoint.path_of(1).rename(shared_out)
        assert Checkpoint(shared_out, DIGEST).done.keys() == ({0} if session.size == 1 else set())
        told = (
            f"{shared_out}.resume: was saved on {session.size} ranks: ignored, starting from the beginning\n"
        )
        assert capsys.readouterr().err == ("" if session.size == 1 else told)
        shared_out.rename(checkpoint.path_of(1))
    if session.rank == session.size - 1:
        time.sleep(0.1)
        assert checkpoint.path_of(0).exists()
    checkpoint.remove()
    session.comm.Barrier()
    assert list(shared_out.parent.iterdir()) == []

"""Files that are complete or absent: on the disk before they have their name, and nothing of them left otherwise."""

import errno
import fcntl
import os
import resource
import socket
import stat
import tempfile
import threading
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from jampetsc.errors import InputError, JampetscError
from jampetsc.io.atomic import NewFile, check_writable, remove_abandoned, write_error, write_whole
from jampetsc.io.hdf5 import OutputFile
from jampetsc.io.result_file import ResultWriter


def test_bytes_are_on_the_disk_before_the_name(tmp_path, monkeypatch):
    """And the name before the writing ends: what is done to which inode."""
    done, fsync, replace = [], os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda handle: done.append(os.fstat(handle).st_ino) or fsync(handle))
    monkeypatch.setattr(os, "replace", lambda old, new: done.append("replace") or replace(old, new))
    write_whole(tmp_path / "a.csv", b"1,2\n")
    with OutputFile(tmp_path / "b.h5") as h5:
        h5["x"] = np.ones(3)
    of_a, of_b, of_folder = (path.stat().st_ino for path in (tmp_path / "a.csv", tmp_path / "b.h5", tmp_path))
    assert done == [of_a, "replace", of_folder, of_b, "replace", of_folder]


def test_an_open_file_is_spared_and_an_abandoned_one_is_not(tmp_path):
    """Of the same output alone, also where its name looks like a pattern; elsewhere a lock need not be seen here.

    Of a pipe of such a name opening would wait, and following a link would lead elsewhere.
    """

    def abandoned(name, host=""):
        return tmp_path / f".{name}.{socket.gethostname()}{host}.123-abcdef01.partial"

    alive, link, pipe = NewFile(tmp_path / "s[1].h5"), abandoned("link"), abandoned("pipe")
    elsewhere, other, mine = abandoned("s[1].h5", "x"), abandoned("s1.h5"), abandoned("s[1].h5")
    link.symlink_to(elsewhere.name)
    os.mkfifo(pipe)
    for path in (elsewhere, other):
        path.touch()
    for action in (check_writable, lambda path: OutputFile(path).discard()):
        mine.touch()
        action(tmp_path / "s[1].h5")
        assert set(tmp_path.iterdir()) == {alive.temporary, elsewhere, other, link, pipe}
    remove_abandoned(tmp_path)
    assert set(tmp_path.iterdir()) == {alive.temporary, elsewhere, link}
    with alive:
        alive.stream.write(b"all of it")
    assert (tmp_path / "s[1].h5").read_bytes() == b"all of it" and not alive.temporary.exists()


def test_a_new_file_that_was_taken_for_an_abandoned_one_is_made_again(tmp_path, monkeypatch):
    """Between its birth and its lock another process may have it locked, and then remove it."""
    flock, removed = fcntl.flock, []

    def remove(name, handle):
        os.unlink(name)
        os.close(handle)

    def late(stream, how):
        if not removed:
            removed.append(os.readlink(f"/proc/self/fd/{stream.fileno()}"))
            handle = os.open(removed[0], os.O_RDONLY)
            flock(handle, fcntl.LOCK_EX)
            threading.Timer(0.02, remove, (removed[0], handle)).start()
        flock(stream, how)

    monkeypatch.setattr(fcntl, "flock", late)
    file = NewFile(tmp_path / "a.csv")
    time.sleep(0.05)
    with file:
        file.stream.write(b"1,2\n")
    assert (tmp_path / "a.csv").read_bytes() == b"1,2\n" and len(removed) == 1


def test_a_file_system_without_locks_will_do(tmp_path, monkeypatch):
    def refuse(stream, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    write_whole(tmp_path / "a.csv", b"1,2\n")
    left = NewFile(tmp_path / "a.csv")
    left.stream.close()
    remove_abandoned(tmp_path)  # nobody can tell whether its writer lives
    assert sorted(tmp_path.iterdir()) == [left.temporary, tmp_path / "a.csv"]


def test_a_folder_that_cannot_be_made_durable_will_do(tmp_path, monkeypatch):
    fsync = os.fsync

    def of_files(handle):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", of_files)
    before = len(os.listdir("/proc/self/fd"))
    write_whole(tmp_path / "a.csv", b"1,2\n")
    assert (tmp_path / "a.csv").read_bytes() == b"1,2\n"
    assert len(os.listdir("/proc/self/fd")) == before  # the folder is closed again


PLACES = {  # where no file can be -> what is said
    "folder": "folder: a folder. Give another file with out",
    "pipe": "pipe: not a regular file. Give another file with out",
    "link": "pipe: not a regular file. Give another",
    "none/a.csv": "no folder .*none. Create it first|No such file",
    "file/a.csv": "folder|not writable",
    "lost": "no folder .*none. Create it first|No such file",
    "n" * 300: "not writable .File name too long.. Choose another out",
}


@pytest.mark.parametrize("action", [check_writable, lambda path: write_whole(path, b"1"), NewFile])
@pytest.mark.parametrize("name", PLACES)
def test_where_no_file_can_be(tmp_path, action, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    (tmp_path / "lost").symlink_to("none/a.csv")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match=PLACES[name]):
        action(tmp_path / name)
    assert sorted(tmp_path.iterdir()) == before


def test_folders_and_files_without_permission_are_refused():
    """A rename would not ask for a file that is write-protected."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:  # pytest's own folders are closed to other users
        folder, user = Path(name), os.getuid()
        (folder / "held.csv").touch(mode=0o444)
        for mode, file, message in (
            (0o555, "a.csv", "not writable .Permission denied."),
            (0o777, "held.csv", "write-protected"),
            (0o777, "a.csv", None),
        ):
            folder.chmod(mode)
            os.setresuid(user or 65534, user or 65534, user)  # root may everything
            try:
                refused = pytest.raises(InputError, match=rf"{folder / file}: {message}. Choose another out")
                with refused if message else nullcontext():
                    check_writable(folder / file)
            finally:
                os.setresuid(user, user, user)
        assert [path.name for path in folder.iterdir()] == ["held.csv"]


@pytest.mark.parametrize(
    ("number", "kind", "message"),
    [
        (errno.ENOSPC, JampetscError, "disk full. Make room, then run the same command again"),
        (errno.EDQUOT, JampetscError, "disk quota used up. Make room"),
        (errno.EFBIG, JampetscError, "file size limit reached. Make room"),
        (errno.EACCES, InputError, "not writable (Permission denied). Choose another out"),
        (errno.EROFS, InputError, "not writable (Read-only file system). Choose another out"),
        (errno.ENOTDIR, InputError, "not writable (Not a directory). Choose another out"),
        (errno.ENAMETOOLONG, InputError, "not writable (File name too long). Choose another out"),
        (errno.EIO, JampetscError, "writing failed (Input/output error)"),
    ],
)
def test_what_a_failed_write_says(tmp_path, monkeypatch, number, kind, message):
    """Of whatever the system refuses: to make the file, to get it to the disk, to give it its name."""
    path = tmp_path / "a.csv"

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    assert type(write_error(path, OSError(number, os.strerror(number)))) is kind
    assert (
        str(write_error("a.h5", OSError("Can't\n  write")))
        == "a.h5: writing failed (Can't write). Run the same command again."
    )
    for name in ("fsync", "replace"):
        with monkeypatch.context() as patch:
            patch.setattr(os, name, refuse)
            with pytest.raises(kind) as caught:
                write_whole(path, b"1,2\n")
        assert str(caught.value).startswith(f"{path}: {message}")
        assert list(tmp_path.iterdir()) == []


def write_result(path):
    with ResultWriter(path, "jampetsc-sweep") as writer:
        writer.attributes(words="x" * 3000)
        writer.dataset("omega", np.ones(100))
        for _ in range(3):
            writer.append("fields/displacement", np.ones((1000, 2), complex))
        writer.distributed("particles", np.arange(1000))


@pytest.mark.parametrize("write", [write_result, lambda path: write_whole(path, bytes(100_000))])
def test_a_disk_that_is_full_at_any_moment(tmp_path, write):
    """One line, the earlier file unharmed, and nothing left of the new one, whenever it happens."""
    path = tmp_path / "s.h5"
    write(path)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in np.linspace(0, len(before) - 1, 25).astype(int):
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(size), limits[1]))
        try:
            with pytest.raises(JampetscError, match=r"s\.h5: file size limit reached\. Make room") as caught:
                write(path)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert "\n" not in str(caught.value)
        assert path.read_bytes() == before
        assert list(tmp_path.iterdir()) == [path]


def test_what_comes_after_the_end_of_a_file_is_no_error(tmp_path):
    """libhdf5 may look at a file once more when its last object goes."""
    for end in (OutputFile.finish, OutputFile.discard):
        output = OutputFile(tmp_path / "x.h5")
        data = output.h5.create_dataset("x", data=np.ones(10))
        end(output)
        assert not data
        assert output.stream.seek(5) == 5
        assert output.stream.write(b"abc") == 3
        assert output.stream.truncate(7) == 7
        output.discard()
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", [NewFile, OutputFile])
def test_an_interrupt_of_a_write_is_raised_in_the_end(tmp_path, monkeypatch, kind):
    """libhdf5 would not survive it."""
    file = kind(tmp_path / "x.h5")

    def interrupted(view):
        raise KeyboardInterrupt

    monkeypatch.setattr(file.stream, "write_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        with file as target:
            if kind is NewFile:
                assert target.stream.write(b"12") == 2
            else:
                target["x"] = np.ones(100_000)
    assert list(tmp_path.iterdir()) == []

"""Files that are complete or absent: on the disk before they have their name, and nothing of them left otherwise."""

import errno
import fcntl
import os
import resource
import socket
import stat
from pathlib import Path

import numpy as np
import pytest

from jampetsc.errors import InputError, JampetscError
from jampetsc.io.atomic import NewFile, check_writable, remove_abandoned, write_error, write_whole
from jampetsc.io.hdf5 import OutputFile
from jampetsc.io.result_file import ResultWriter


@pytest.fixture
def events(monkeypatch):
    """What was done to the disk, in order: (fsync | replace, name)."""
    seen = []

    def note(name):
        original = getattr(os, name)

        def noted(target, *more):
            path = os.readlink(f"/proc/self/fd/{target}") if isinstance(target, int) else str(target)
            seen.append((name, Path(path).name.split(".partial")[0].lstrip(".").split(".")[0]))
            return original(target, *more)

        monkeypatch.setattr(os, name, noted)

    note("fsync")
    note("replace")
    return seen


def test_bytes_are_on_the_disk_before_the_name(tmp_path, events):
    write_whole(tmp_path / "a.csv", b"1,2\n")
    with OutputFile(tmp_path / "b.h5") as h5:
        h5["x"] = np.ones(3)
    folder = tmp_path.name
    assert events == [
        *[("fsync", "a"), ("replace", "a"), ("fsync", folder)],
        *[("fsync", "b"), ("replace", "b"), ("fsync", folder)],
    ]


def test_an_open_file_is_spared_and_an_abandoned_one_is_not(tmp_path):
    alive, dead = NewFile(tmp_path / "x.h5"), NewFile(tmp_path / "x.h5")
    os.close(os.dup(dead.stream.fileno()))
    dead.stream.close()
    assert len(list(tmp_path.iterdir())) == 2
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == [alive.temporary]
    alive.stream.write(b"all of it")
    alive.finish()
    alive.publish()
    assert (tmp_path / "x.h5").read_bytes() == b"all of it"


def test_what_only_looks_abandoned_is_left(tmp_path):
    """A pipe of such a name, and a link: opening the one would wait, following the other lead elsewhere."""
    name = NewFile(tmp_path / "x.h5").temporary.name
    (tmp_path / name).unlink()
    os.mkfifo(tmp_path / name)
    (tmp_path / "precious").write_text("kept")
    (tmp_path / name.replace("-", "-a")).symlink_to("precious")
    remove_abandoned(tmp_path)
    assert (tmp_path / "precious").read_text() == "kept"
    assert (tmp_path / name.replace("-", "-a")).is_symlink()


def abandoned(folder, name, host=None):
    """What a killed process of a machine, of this one unless told, leaves of a file of this name."""
    leftover = folder / f".{name}.{host or socket.gethostname()}.123-abcdef01.partial"
    leftover.touch()
    return leftover


def test_what_a_process_elsewhere_writes_is_spared(tmp_path):
    """Its lock need not be seen here."""
    left, elsewhere = abandoned(tmp_path, "x.h5"), abandoned(tmp_path, "x.h5", f"{socket.gethostname()}x")
    remove_abandoned(tmp_path, "x.h5")
    assert (left.exists(), elsewhere.exists()) == (False, True)


def test_only_leftovers_of_the_same_output_are_removed(tmp_path):
    """Also where the name looks like a pattern."""
    for action in (check_writable, lambda path: OutputFile(path).discard()):
        mine, other = abandoned(tmp_path, "s[1].h5"), abandoned(tmp_path, "s1.h5")
        action(tmp_path / "s[1].h5")
        assert (mine.exists(), other.exists()) == (False, True)


def test_a_new_file_that_was_taken_for_an_abandoned_one_is_made_again(tmp_path, monkeypatch):
    """Between its birth and its lock another process may remove it."""
    flock, removed = fcntl.flock, []

    def late(stream, how):
        if not removed:
            removed.append(os.readlink(f"/proc/self/fd/{stream.fileno()}"))
            os.unlink(removed[0])
        flock(stream, how)

    monkeypatch.setattr(fcntl, "flock", late)
    write_whole(tmp_path / "a.csv", b"1,2\n")
    assert (tmp_path / "a.csv").read_bytes() == b"1,2\n" and len(removed) == 1


def test_a_file_system_without_locks_will_do(tmp_path, monkeypatch):
    def refuse(stream, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    write_whole(tmp_path / "a.csv", b"1,2\n")
    left = abandoned(tmp_path, "a.csv")
    remove_abandoned(tmp_path)  # nobody can tell whether its writer lives
    assert sorted(tmp_path.iterdir()) == [left, tmp_path / "a.csv"]


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


@pytest.mark.parametrize("action", [check_writable, lambda path: write_whole(path, b"1"), NewFile])
def test_what_no_file_may_replace(tmp_path, action):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    for name, message in (
        ("folder", "folder: is a folder: give a file name with out"),
        ("pipe", "pipe: is a pipe, which a file would replace: give the name of a file with out"),
        ("link", "pipe: is a pipe, which"),
    ):
        with pytest.raises(InputError, match=message):
            action(tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_file_that_is_write_protected_is_not_replaced(tmp_path, monkeypatch):
    """A rename would not ask; root, who may everything, is played by anybody."""
    path = tmp_path / "a.csv"
    path.touch()
    access = os.access
    monkeypatch.setattr(os, "access", lambda file, how: how != os.W_OK and access(file, how))
    with pytest.raises(InputError, match=r"a\.csv: exists and is write-protected: choose another out"):
        check_writable(path)
    check_writable(tmp_path / "b.csv")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("number", "kind", "message"),
    [
        (errno.ENOSPC, JampetscError, "disk full: make room, then run the same command again"),
        (errno.EDQUOT, JampetscError, "disk quota used up: make room"),
        (errno.EFBIG, JampetscError, "file size limit reached: make room"),
        (errno.EACCES, InputError, "cannot be written (Permission denied): choose another out"),
        (errno.EROFS, InputError, "cannot be written (Read-only file system): choose another out"),
        (errno.ENOTDIR, InputError, "cannot be written (Not a directory): choose another out"),
        (errno.ENAMETOOLONG, InputError, "cannot be written (File name too long): choose another out"),
        (errno.EIO, JampetscError, "writing failed: Input/output error"),
    ],
)
def test_what_a_failed_write_says(tmp_path, monkeypatch, number, kind, message):
    """Of whatever the system refuses: to make the file, to get it to the disk, to give it its name."""
    path = tmp_path / "a.csv"

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    assert type(write_error(path, OSError(number, os.strerror(number)))) is kind
    for name in ("fsync", "replace"):
        with monkeypatch.context() as patch:
            patch.setattr(os, name, refuse)
            with pytest.raises(kind) as caught:
                write_whole(path, b"1,2\n")
        assert str(caught.value).startswith(f"{path}: {message}")
        assert list(tmp_path.iterdir()) == []


def test_a_failed_write_without_a_number_is_told_in_its_own_words(tmp_path):
    said = write_error("a.h5", OSError("Can't\n  write"))
    assert str(said) == "a.h5: writing failed: Can't write"


def test_places_where_no_file_can_be(tmp_path):
    (tmp_path / "file").touch()
    for path, message in (
        (tmp_path / "none" / "a.csv", "none does not exist: create it first|No such file"),
        (tmp_path / "file" / "a.csv", "(folder|cannot be written)"),
        (tmp_path / ("n" * 300), "cannot be written .File name too long.: choose another out"),
    ):
        for action in (check_writable, NewFile):
            with pytest.raises(InputError, match=message):
                action(path)


def test_the_file_that_a_link_stands_for_is_what_is_written(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("there", "none"):
        (tmp_path / f"{name}.csv").symlink_to(tmp_path / name / "a.csv")
    check_writable(tmp_path / "there.csv")
    write_whole(tmp_path / "there.csv", b"1,2")
    assert (tmp_path / "there.csv").is_symlink() and (tmp_path / "there" / "a.csv").read_bytes() == b"1,2"
    with pytest.raises(InputError, match=r"none/a\.csv: folder .*none does not exist: create it first"):
        check_writable(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"cannot be written \(No such file or directory\)"):
        write_whole(tmp_path / "none.csv", b"1,2")


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
            with pytest.raises(JampetscError, match=r"s\.h5: file size limit reached: make room") as caught:
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


def test_an_interrupt_of_a_write_is_kept_for_later(tmp_path, monkeypatch):
    file = NewFile(tmp_path / "a.csv")

    def interrupted(view):
        raise KeyboardInterrupt

    monkeypatch.setattr(file.stream, "_write_all", interrupted)
    assert file.stream.write(b"12") == 2
    with pytest.raises(KeyboardInterrupt):
        file.finish()
    file.discard()
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_hdf5_writes_is_raised_in_the_end(tmp_path, monkeypatch):
    output = OutputFile(tmp_path / "x.h5")

    def interrupted(view):
        raise KeyboardInterrupt

    monkeypatch.setattr(output.stream, "_write_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        with output as h5:
            h5["x"] = np.ones(100_000)
    assert list(tmp_path.iterdir()) == []


def test_permissions_are_those_that_the_user_wants(tmp_path):
    mask = os.umask(0o027)
    try:
        write_whole(tmp_path / "a.csv", b"1,2\n")
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o640


def test_nobody_writes_into_the_new_file_of_another(tmp_path, monkeypatch):
    """Not even where both are given the same mark."""
    monkeypatch.setattr("secrets.token_hex", lambda count: "ab" * count)
    one = NewFile(tmp_path / "a.csv")
    one.stream.write(b"1,2")
    with pytest.raises(JampetscError, match=r"a\.csv: writing failed: File exists"):
        NewFile(tmp_path / "a.csv")
    assert one.temporary.read_bytes() == b"1,2"
    one.discard()


def test_nothing_is_written_behind_what_is_missing(tmp_path):
    """After the first failure a file takes no more, and the first failure is the one that is told."""
    file = NewFile(tmp_path / "a.csv")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4, limits[1]))
    try:
        assert file.stream.write(b"123456") == 6
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.stream.write(b"789") == 3
    assert file.temporary.read_bytes() == b"1234"
    file.stream.error.errno = errno.EFBIG
    with pytest.raises(JampetscError, match="file size limit reached"):
        file.finish()
    file.discard()
    assert list(tmp_path.iterdir()) == []

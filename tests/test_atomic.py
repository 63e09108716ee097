"""Files that are complete or absent: on the disk before they have their name, and nothing of them left otherwise."""

import os
import resource
import stat
from pathlib import Path

import numpy as np
import pytest

from jampetsc.errors import JampetscError
from jampetsc.storage.atomic import NewFile, remove_abandoned, write_whole
from jampetsc.storage.hdf5 import OutputFile
from jampetsc.storage.result_file import ResultWriter


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

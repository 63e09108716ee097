"""`merge`: one plain file with the same contents, and nothing lost whatever goes wrong."""

import os
import resource
import shutil
import signal

import h5py
import numpy as np
import pytest
from test_result_file import assert_holds, names, parts

from jampetsc.cli import main as cli
from jampetsc.errors import InputError, JampetscError
from jampetsc.io import merge as merging
from jampetsc.io.merge import merge


def test_in_place(joint):
    assert merge(joint) == 3
    assert names(joint.parent) == ["s.h5"]
    assert_holds(joint)
    with h5py.File(joint) as h5:
        assert "part_files" not in h5
        assert not any(h5[name].is_virtual for name in ("fields/displacement", "nonaffine", "particles"))
    assert merge(joint) == 0
    assert_holds(joint)


def test_to_another_file(joint, tmp_path):
    before = names(joint.parent)
    assert merge(joint, tmp_path / "one.h5") == 3
    assert names(joint.parent) == before
    shutil.rmtree(joint.parent)
    assert_holds(tmp_path / "one.h5")
    assert merge(tmp_path / "one.h5", tmp_path / "two.h5") == 0
    assert_holds(tmp_path / "two.h5")


def test_out_that_is_the_file_itself_means_in_place(joint, tmp_path):
    (tmp_path / "link.h5").symlink_to(joint)
    assert merge(joint, tmp_path / "link.h5") == 3
    assert names(joint.parent) == ["s.h5"]
    assert_holds(joint)


def test_block_by_block(joint, monkeypatch):
    monkeypatch.setattr(merging, "_BLOCK_BYTES", 100)  # smaller than one frequency, a few rows of the others
    merge(joint)
    assert_holds(joint)


def test_attributes_of_groups_and_datasets_are_kept(joint):
    with h5py.File(joint, "r+") as h5:
        h5["fields"].attrs["unit"] = "d"
        h5["omega"].attrs["unit"] = "1/tau1"
        h5.create_group("empty")
    merge(joint)
    with h5py.File(joint) as h5:
        assert (h5["fields"].attrs["unit"], h5["omega"].attrs["unit"]) == ("d", "1/tau1")
        assert "empty" in h5


def test_a_missing_part_stops_it(joint):
    part = parts(joint)[1]
    part.unlink()
    before = names(joint.parent)
    with pytest.raises(InputError, match=f"part s.parts/{part.name} is missing"):
        merge(joint)
    assert names(joint.parent) == before


@pytest.mark.parametrize("name, message", [("none.h5", "no such file"), ("text.h5", "not an HDF5 file")])
def test_files_that_cannot_be_merged(tmp_path, name, message):
    (tmp_path / "text.h5").write_text("omega,G\n")
    with pytest.raises(InputError, match=message):
        merge(tmp_path / name)


def in_child(action):
    """Exit status or signal of a child process that does `action`; 1 for a JampetscError."""
    child = os.fork()
    if child == 0:
        try:
            action()
            os._exit(0)
        except JampetscError:
            os._exit(1)
        finally:
            os._exit(99)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_a_full_disk_leaves_everything(joint):
    before = names(joint.parent)

    def action():
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
        merge(joint)

    assert in_child(action) == 1
    assert names(joint.parent) == before
    assert_holds(joint)


@pytest.mark.parametrize("moment", ["_copy_dataset", "PartList.check_present", "PartList.remove"])
def test_a_kill_loses_nothing(joint, monkeypatch, moment):
    """Killed while copying, before the file gets its name, and after that with the parts still there."""
    target, name = (merging, moment) if "." not in moment else (merging.PartList, moment.split(".")[1])
    original = getattr(target, name)
    calls = []

    def kill(*args):
        calls.append(args)
        if moment != "PartList.check_present" or len(calls) == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return original(*args)

    def action():
        monkeypatch.setattr(target, name, kill)
        merge(joint)

    assert in_child(action) == -signal.SIGKILL
    assert_holds(joint)
    merge(joint)
    assert_holds(joint)
    assert [file for file in names(joint.parent) if file.endswith(".partial")] == []


def test_what_was_merged_copied_or_left_is_told(joint, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(joint.parent)

    def said(*words):
        assert cli.main(["merge", *words]) == 0
        return capsys.readouterr().out

    assert said("s.h5", "--out", "one.h5") == "one.h5: 3 parts in one file\n"
    assert (
        said("s.h5") == "s.h5: 3 parts in one file\n"
        and said("s.h5") == "s.h5: one file already, nothing to do\n"
    )
    assert said("s.h5", "--out", "./s.h5") == "s.h5: one file already, nothing to do\n"
    assert said("s.h5", "--out", "two.h5") == "two.h5: copy of s.h5, which was one file already\n"
    assert np.array_equal(*(h5py.File(name)["G"][...] for name in ("one.h5", "two.h5")))

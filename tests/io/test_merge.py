"""`merge`: one plain file with the same contents, and nothing lost whatever goes wrong."""

import errno
import shutil
from itertools import count
from pathlib import Path

import h5py
import pytest
from disk_faults import WRITES, disturb, killed
from test_result_file import assert_holds, names

from jampetsc import main as cli
from jampetsc.errors import JampetscError
from jampetsc.io.parts import parts_of
from jampetsc.io.result_file import merge


def test_what_was_merged_copied_or_left_is_told_and_holds_the_same(joint, tmp_path, monkeypatch, capsys):
    """In place also where the output is the file itself by another name."""
    monkeypatch.chdir(joint.parent)
    (tmp_path / "link.h5").symlink_to(joint)
    before = names(joint.parent)
    for words, told, more in (
        ("s.h5 --out one.h5", "one.h5: 3 parts in one file", before),
        (f"s.h5 --out {tmp_path}/link.h5", f"{tmp_path}/link.h5: 3 parts in one file", ["s.h5"]),
        ("s.h5", "s.h5: one file already, nothing to do", ["s.h5"]),
        ("s.h5 --out ./s.h5", "s.h5: one file already, nothing to do", ["s.h5"]),
        ("s.h5 --out two.h5", "two.h5: copy of s.h5, which was one file already", ["s.h5", "two.h5"]),
    ):
        assert cli.main(["merge", *words.split()]) == 0
        assert capsys.readouterr().out == f"{told}\n"
        assert names(joint.parent) == sorted({"one.h5", *more})
        assert_holds(Path(told.partition(":")[0]))
    with h5py.File("s.h5") as h5:
        assert "part_files" not in h5
        assert not any(h5[name].is_virtual for name in ("fields/displacement", "nonaffine", "particles"))
    assert cli.main(["merge", "s.h5", "--out", "one.h5"]) == 2  # made of another file: what that was before
    assert "one.h5: exists and has other inputs" in capsys.readouterr().err


def test_attributes_of_groups_and_datasets_are_kept(joint):
    with h5py.File(joint, "r+") as h5:
        h5["fields"].attrs["unit"] = "d"
        h5["omega"].attrs["unit"] = "1/tau1"
        h5.create_group("empty")
    assert merge(joint) == 3
    assert_holds(joint)
    with h5py.File(joint) as h5:
        assert (h5["fields"].attrs["unit"], h5["omega"].attrs["unit"]) == ("d", "1/tau1")
        assert "empty" in h5
    assert merge(joint) == 0


def test_a_full_disk_leaves_everything(joint, monkeypatch):
    def fail():
        raise OSError(errno.ENOSPC, "full")

    before = names(joint.parent)
    for number in (0, 7):  # as it begins, and while data are written
        with monkeypatch.context() as patch:
            disturb(patch.setattr, number, fail, WRITES)
            with pytest.raises(JampetscError, match=r"disk full\. Make room"):
                merge(joint)
        assert names(joint.parent) == before
        assert_holds(joint)


def test_a_kill_at_any_moment_loses_nothing(made, tmp_path):
    """While copying, before the file gets its name, and after that with parts still there."""
    found = set()
    for number in count():
        joint = shutil.copytree(made / "3-1", tmp_path / str(number)) / "s.h5"
        if not killed(number, lambda joint=joint: merge(joint)):
            break
        found.add(len(parts_of(joint).sizes))
        assert_holds(joint)
        merge(joint)
        assert_holds(joint)
        assert not list(joint.parent.glob("*.partial"))
    assert found == {0, 3} and names(joint.parent) == ["s.h5"]

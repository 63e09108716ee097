"""Parts of a joint file put together: any selection as numpy has it, and only what was written together."""

import os
import shutil

import h5py
import numpy as np
import pytest

from jampetsc.errors import InputError
from jampetsc.io import parts as parts_module
from jampetsc.io.hdf5 import OutputFile, open_file, store, values
from jampetsc.io.parts import PartList, part_name, parts_of
from jampetsc.io.results import StoredArray

RUN = "0123456789ab"
COUNTS = (3, 0, 4, 1)  # rows of each rank
WHOLE = np.arange(2 * 8 * 3).reshape(2, 8, 3)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A dataset (2, 8, 3) whose second axis lies on four ranks, written with checksums."""
    path, names, finished, start = tmp_path_factory.mktemp("made") / "s.h5", [], [], 0
    layout = h5py.VirtualLayout(WHOLE.shape, WHOLE.dtype)
    (path.parent / "s.parts").mkdir()
    for rank, count in enumerate(COUNTS):
        names.append(part_name(path, RUN, rank))
        part = OutputFile(path.parent / names[-1])
        part.h5.attrs.update(run_id=RUN, rank=rank)
        if count:
            rows = slice(start, start + count)
            store(part.h5, "x", WHOLE[:, rows])
            layout[:, rows] = h5py.VirtualSource(names[-1], "x", (2, count, 3), WHOLE.dtype)
            start += count
        finished.append(part.finish())
        part.publish()
    sizes, seals = zip(*finished, strict=True)
    with OutputFile(path) as h5:
        h5.attrs["run_id"] = RUN
        h5.create_virtual_dataset("x", layout)
        store(h5, "part_files/names", np.char.encode(names))
        store(h5, "part_files/sizes", sizes)
        store(h5, "part_files/seals", np.array(seals, "S"))
    return path


@pytest.fixture
def joint(made, tmp_path):
    """A copy to be changed."""
    return shutil.copytree(made.parent, tmp_path / "copy") / "s.h5"


EVERY = slice(None)
SELECTIONS = [
    *(..., (), (EVERY, slice(2, 7)), (0, slice(None, None, 2)), (1, slice(1, None, 3), 2), (..., 1)),
    *((slice(1, 2), ...), (0, 3), (1, -1, -1), -1, (EVERY, 2), (EVERY, slice(3, 4)), (EVERY, slice(7, None))),
    *(
        (0, slice(5, 5)),
        (EVERY, slice(-6, -1, 5)),
        (EVERY, slice(None, None, -1)),
        (EVERY, [0, 3, 7]),
        np.int64(1),
    ),
    *((EVERY, slice(1, 8, 4), slice(0, 3, 2)), (0, slice(2, 3)), (EVERY, slice(0, 3)), (EVERY, slice(6, 7))),
]


@pytest.mark.parametrize("selection", SELECTIONS, ids=str)
def test_a_selection_is_what_numpy_makes_of_it(made, selection):
    with open_file(made) as h5:
        found = PartList(h5, made).read(h5["x"], selection)
    assert np.array_equal(found, WHOLE[selection]) and np.shape(found) == WHOLE[selection].shape


@pytest.mark.parametrize("selection", [2, -3, (0, 8), (0, -9)])
def test_an_index_beyond_the_rows_is_none(made, selection):
    with open_file(made) as h5, pytest.raises(IndexError, match=r"out of (range|bounds)"):
        PartList(h5, made).read(h5["x"], selection)


def test_what_numpy_refuses_is_refused(made):
    for selection in ((..., 0, ...), (0, 0, 0, 0), (0, 1.5)):
        with pytest.raises(IndexError):
            WHOLE[selection]
        with open_file(made) as h5, pytest.raises(IndexError):
            PartList(h5, made).read(h5["x"], selection)


def test_a_stored_array_tells_what_it_is(made):
    with open_file(made) as h5:
        stored = StoredArray(made, "x", h5)
    assert (len(stored), stored.shape, stored.dtype) == (2, (2, 8, 3), WHOLE.dtype)
    assert repr(stored) == "<x (2, 8, 3) int64 in s.h5>"
    assert np.array_equal(np.asarray(stored, float), WHOLE) and np.asarray(stored, float).dtype == float


def test_a_stored_array_is_read_from_where_it_was_found(made, tmp_path, monkeypatch):
    """Though the program has gone elsewhere since."""
    monkeypatch.chdir(made.parent)
    with open_file("s.h5") as h5:
        stored = StoredArray("s.h5", "x", h5)
    monkeypatch.chdir(tmp_path)
    assert np.array_equal(stored[0, 1], WHOLE[0, 1])


def test_entries_that_are_not_asked_for_are_not_read(joint, monkeypatch):
    read = []
    monkeypatch.setattr(parts_module, "values", lambda data, rows=...: read.append(rows) or data[rows])
    with open_file(joint) as h5:
        PartList(h5, joint).read(h5["x"], (1, slice(3, 7)))
        assert read[-3:] == [slice(1, 2)] * 3 and read[:-3] == [...] * 3
    with open_file(joint) as h5, pytest.raises(ValueError, match="lies in other files"):
        values(h5["x"])


def edited(joint, edit):
    """What is said of the joint file after `edit(h5)` of its list of parts; one that nothing protects."""
    copy = joint.with_name("edited.h5")
    copy.write_bytes(joint.read_bytes())
    with h5py.File(copy, "r+") as h5:
        edit(h5)
    with h5py.File(copy) as h5, pytest.raises(InputError) as refused:
        parts = PartList(h5, copy)
        parts.check()
        parts.read(h5["x"])
    return str(refused.value)


def rename(old, new):
    def edit(h5):
        names = [name.decode().replace(old, new) for name in h5["part_files/names"]]
        del h5["part_files/names"]
        h5["part_files/names"] = np.char.encode(names)

    return edit


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("s.parts/", "../s.parts/"),
        ("s.parts/", "a/s.parts/"),
        ("s.parts/", "s.other/"),
        (f"{RUN}-", "ba9876543210-"),
        (".h5", ".h5x"),
        ("-rank-", "-rank"),
    ],
)
def test_only_names_of_parts_of_this_run_are_followed(joint, old, new):
    (joint.parent / "a").mkdir()
    (joint.parent / "s.parts").rename(joint.parent / "a" / "s.parts")
    assert "cannot be a part of run 0123456789ab" in edited(joint, rename(old, new))


def test_parts_that_do_not_make_up_the_whole(joint):
    def forget(h5):
        for name in ("names", "sizes", "seals"):
            rows = h5[f"part_files/{name}"][:-1]
            del h5[f"part_files/{name}"]
            h5[f"part_files/{name}"] = rows

    assert edited(joint, forget).endswith("x: its parts do not make up the whole: damaged")

    def gap(h5):
        del h5["x"]
        layout = h5py.VirtualLayout(WHOLE.shape, WHOLE.dtype)
        name = h5["part_files/names"][0].decode()
        layout[:, :3] = h5py.VirtualSource(name, "x", (2, 3, 3), WHOLE.dtype)
        h5.create_virtual_dataset("x", layout)

    assert edited(joint, gap).endswith("x: its parts do not make up the whole: damaged")

    def other_rows(h5):
        del h5["x"]
        layout = h5py.VirtualLayout((2, 4, 3), WHOLE.dtype)
        name = h5["part_files/names"][0].decode()
        layout[:] = h5py.VirtualSource(name, "x", (2, 4, 3), WHOLE.dtype)
        h5.create_virtual_dataset("x", layout)

    assert "holds other rows: damaged" in edited(joint, other_rows)


def test_a_file_in_the_place_of_the_folder_of_parts(joint):
    (joint.parent / "s.parts").rename(joint.parent / "kept")
    (joint.parent / "s.parts").touch()
    with open_file(joint) as h5, pytest.raises(InputError, match=r"is missing: keep the folder s\.parts"):
        PartList(h5, joint).check()


@pytest.mark.parametrize(("attribute", "value"), [("run_id", "ba9876543210"), ("rank", 1)])
def test_a_part_of_another_run_or_rank_is_named(joint, attribute, value):
    """Sealed, of the same size, but not the one that was joined."""
    part = joint.parent / part_name(joint, RUN, 0)
    size = part.stat().st_size
    other = OutputFile(part)
    other.h5.attrs.update({"run_id": RUN, "rank": 0, attribute: value})
    store(other.h5, "x", WHOLE[:, :3])
    assert other.finish()[0] == size
    other.publish()
    with (
        open_file(joint) as h5,
        pytest.raises(InputError, match=r"is rank . of run .*: put the right one back"),
    ):
        PartList(h5, joint).check()


def test_parts_go_and_their_folder_with_them(joint):
    (joint.parent / "s.parts" / "other").touch()
    parts = parts_of(joint)
    assert parts and len(parts.sizes) == 4
    parts.remove()
    assert [path.name for path in (joint.parent / "s.parts").iterdir()] == ["other"]
    (joint.parent / "s.parts" / "other").unlink()
    parts.remove()
    assert not (joint.parent / "s.parts").exists()
    assert parts_of(joint.parent / "none.h5") is None


def test_the_name_of_a_part_is_text():
    assert part_name("a/s.h5", RUN, 3) == f"s.parts/{RUN}-rank-0003.h5"
    assert part_name(os.fsdecode(b"a/\xff.h5"), RUN, 12345) == f"_.parts/{RUN}-rank-12345.h5"

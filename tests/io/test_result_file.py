"""Results of one rank or many: the same to a reader, complete or absent, and no mixture of two runs."""

import errno
import os
import platform
import shutil
import subprocess
from datetime import datetime
from itertools import count

import h5py
import launch
import numpy as np
import pytest
from disk_faults import WRITES, disturb, killed
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import basic_indices
from mpi4py import MPI
from samples import stored
from write_results import LAW, N, arrays, write

from jampetsc.errors import InputError, JampetscError
from jampetsc.io import parts as parts_module
from jampetsc.io.checksums import append_seal
from jampetsc.io.parts import part_name, parts_of
from jampetsc.io.provenance import git_commit, law_of, provenance
from jampetsc.io.reader import load
from jampetsc.io.result_file import ArrayInMemory, ResultWriter, merge
from jampetsc.version import VERSION


def written(path, ranks, seed=1):
    """A result at `path`, written by so many ranks, or by this process."""
    if ranks == 1:
        write(MPI.COMM_SELF, "whole", path, seed)
        return path
    done = launch.run(ranks, "write_results.py", "whole", path, seed)
    assert done.returncode == 0, done.stdout + done.stderr
    return path


def names(folder):
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


def parts(path):
    with h5py.File(path) as h5:
        return [path.parent / name.decode() for name in h5["part_files/names"]]


def assert_holds(path, seed=1):
    """The result at `path` is what write_results.py makes with that seed."""
    shared, displacement, rows = arrays(seed)
    result = load(path)
    expected = (
        shared | {name: array for name, (array, _) in rows.items()} | {"fields/displacement": displacement}
    )
    assert set(result) == set(expected)
    for name, array in expected.items():
        assert np.array_equal(result[name], array), name
        assert result[name].dtype == array.dtype
    assert result.law == LAW
    assert result.attributes["seed"] == seed
    assert "missing" not in result.attributes


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_any_number_of_ranks_reads_the_same(made, tmp_path, ranks):
    """Wherever the folder goes, and whatever the joint file is then called."""
    folder = shutil.copytree(made / f"{ranks}-1", tmp_path / "moved")
    files = names(folder)
    assert len(files) == 1 + (ranks if ranks > 1 else 0)
    assert all(file == "s.h5" or file.startswith("s.parts/") for file in files)
    for rank, part in enumerate(parts(folder / "s.h5") if ranks > 1 else []):
        with h5py.File(part) as h5:  # what tells them apart where nobody has their seals
            run = part.name.partition("-")[0]
            assert dict(h5.attrs) == {"format": "jampetsc-part", "run_id": run, "rank": rank}
            assert ("particles" in h5) == ("fields/displacement" in h5) == ((ranks, rank) != (4, 1))
            assert "none" not in h5
    (folder / "s.h5").rename(folder / "t.h5")
    assert_holds(folder / "t.h5")


def test_other_programs_read_the_joint_file_with_plain_hdf5(joint, tmp_path, monkeypatch):
    _, displacement, _ = arrays(1)
    (tmp_path / "link.h5").symlink_to(joint)
    shutil.copytree(joint.parent / "s.parts", tmp_path / "elsewhere" / "s.parts")
    for part in (tmp_path / "elsewhere" / "s.parts").iterdir():  # what a reader in that folder must not find
        with h5py.File(part, "r+") as h5:
            h5["fields/displacement"][...] = 0
    monkeypatch.chdir(tmp_path / "elsewhere")
    for path in (joint, os.path.relpath(joint)):
        with h5py.File(path) as h5:
            assert np.array_equal(h5["fields/displacement"], displacement)
        result = load(path)
        with monkeypatch.context() as patch:  # a file is read from where it was found
            patch.chdir(tmp_path)
            assert np.array_equal(result.fields.displacement, displacement)
    assert_holds(tmp_path / "link.h5")


# Arrays that lie on several ranks


@pytest.fixture(scope="module")
def spread(made):
    """Of four ranks, of which one has no rows: arrays that lie on them along one axis or the other, and as they are."""
    result, (_, displacement, rows) = load(made / "4-1" / "s.h5"), arrays(1)
    wholes = {"fields/displacement": displacement, "nonaffine": rows["nonaffine"][0]}
    return [(result.stored(name), whole) for name, whole in wholes.items()]


@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_a_selection_is_what_numpy_makes_of_it(spread, data):
    for array, whole in spread:
        selection = data.draw(basic_indices(whole.shape, allow_newaxis=False))
        found = array[selection]
        assert np.array_equal(found, whole[selection]) and np.shape(found) == whole[selection].shape


def test_rows_that_are_listed_and_those_that_there_are_not(spread):
    array, whole = spread[0]
    for selection in ((slice(None), [0, 3, 14]), np.int64(1)):
        assert np.array_equal(array[selection], whole[selection])
    for selection in (2, -3, (0, N), (0, -N - 1), (..., 0, ...), (0, 0, 0, 0), (0, 1.5)):
        with pytest.raises(IndexError):
            array[selection]
    assert (len(array), array.shape, array.dtype) == (2, (2, N, 2), whole.dtype)
    assert repr(array) == "<fields/displacement (2, 15, 2) complex128 in s.h5>"
    assert np.array_equal(np.asarray(array, np.complex64), whole.astype(np.complex64))


def test_entries_that_are_not_asked_for_are_not_read(joint, monkeypatch):
    read, field = [], load(joint).fields.displacement
    values = parts_module.values
    monkeypatch.setattr(
        parts_module, "values", lambda data, rows=...: read.append(rows) or values(data, rows)
    )
    assert field[1, 3:7].shape == (4, 2)
    assert read == [...] * 3 + [slice(1, 2)] * 3  # the list of parts, and of each part one entry


# Parts that are not those that were written


def edit(path, change):
    """A file changed by `change(h5)`, and sealed as if it had been written so."""
    with h5py.File(path, "r+") as h5:
        change(h5)
    with open(path, "r+b") as file:
        append_seal(file)


def flip(path):
    """One bit of the rows of a part."""
    with h5py.File(path) as h5:
        place = h5["nonaffine"].id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[place + 3] ^= 16
    path.write_bytes(content)


def replaced(name, column):
    """A change of the list of parts: what `column` makes of one of its columns."""

    def change(h5):
        values = column(h5[f"part_files/{name}"][...])
        del h5[f"part_files/{name}"]
        h5[f"part_files/{name}"] = values

    return change


def renamed(old, new):
    return replaced("names", lambda column: np.char.replace(column.astype("S"), old.encode(), new.encode()))


def shown(shape, rows, of):
    """A change of the array `nonaffine`: one of this shape, in which rows are shown as if a part had them."""

    def change(h5):
        part = h5["part_files/names"][0].decode()
        layout = h5py.VirtualLayout(shape, float)
        layout[rows] = h5py.VirtualSource(part, "nonaffine", of, float)
        del h5["nonaffine"]
        h5.create_virtual_dataset("nonaffine", layout)

    return change


def forget_last(h5):
    for name in ("names", "sizes", "seals"):
        replaced(name, lambda column: column[:-1])(h5)


def of_a_file(joint):
    """In the place of the folder of parts."""
    (joint.parent / "s.parts").rename(joint.parent / "kept")
    (joint.parent / "s.parts").touch()


def sized(path, change):
    os.truncate(path, path.stat().st_size + change)


SPOILED = {  # what happens to a joint file, its own parts and those of another run -> what is said
    "missing": (lambda joint, own, _: own[1].unlink(), "part s.parts/.*1.h5: missing. Keep the folder s.parts"),
    "no folder": (lambda joint, own, _: of_a_file(joint), "missing. Keep the folder s.parts"),
    "shorter": (lambda joint, own, _: sized(own[2], -1), "bytes instead of .*truncated"),
    "longer": (lambda joint, own, _: sized(own[2], 1), "bytes instead of .*truncated"),
    "another run": (lambda _, own, other: shutil.copy(other[1], own[1]), "is rank 1 of run .*Put the right one back"),
    "written anew": (
        lambda joint, own, _: edit(own[0], lambda h5: h5["particles"].__setitem__(0, 5)),
        "damaged, not as it was written",
    ),
    "one bit": (lambda joint, own, _: flip(own[1]), "damaged .its bytes are not those that were written"),
    "changed places": (
        lambda joint, *_: edit(joint, lambda h5: [replaced(name, np.flip)(h5) for name in ("names", "sizes")]),
        "is rank 2 of run .*, not rank 0 of run",
    ),
    "one forgotten": (lambda joint, *_: edit(joint, forget_last), "its parts do not make up the whole"),
    "a gap": (
        lambda joint, *_: edit(joint, shown((N, 2), slice(0, 6), (6, 2))),
        "nonaffine: its parts do not make up the whole",
    ),
    "other rows": (lambda joint, *_: edit(joint, shown((9, 2), slice(0, 9), (9, 2))), "holds other rows"),
} | {
    f"named {new}": (lambda joint, *_, put=(old, new): edit(joint, renamed(*put)), "not a part of run")
    for old, new in [("s.parts/", "../s.parts/"), ("s.parts/", "a/s.parts/"), ("s.parts/", "s.other/"),
                     ("-rank-", "x-rank-"), (".h5", ".h5x"), ("-rank-", "-rank")]
}  # fmt: skip


@pytest.mark.parametrize("spoiled", SPOILED)
def test_only_what_was_written_together_is_read_and_merged(joint, made, spoiled):
    """Also by a result that was opened before."""
    spoil, message = SPOILED[spoiled]
    result = load(joint)
    spoil(joint, parts(joint), parts(made / "3-2" / "s.h5"))
    before = names(joint.parent)

    def read(result):
        return [result[name] for name in result]

    for action in (lambda: read(load(joint)), lambda: merge(joint)):
        with pytest.raises(InputError, match=message) as refused:
            action()
        assert f"{joint.parent}/s." in str(refused.value) and "\n" not in str(refused.value)
    with pytest.raises(InputError):
        read(result)
    assert names(joint.parent) == before
    written(joint, 1)
    assert_holds(joint)


def test_the_name_of_a_part_is_text():
    run = "0123456789ab"
    assert part_name("a/s.h5", run, 3) == f"s.parts/{run}-rank-0003.h5"
    assert part_name(os.fsdecode(b"a/\xff.h5"), run, 12345) == f"_.parts/{run}-rank-12345.h5"


def test_parts_go_and_their_folder_with_them(joint):
    (joint.parent / "s.parts" / "other").touch()
    found = parts_of(joint)
    assert found and len(found.sizes) == 3
    found.remove()
    assert names(joint.parent) == ["s.h5", "s.parts/other"]
    (joint.parent / "s.parts" / "other").unlink()
    found.remove()
    assert not (joint.parent / "s.parts").exists()
    assert parts_of(joint.parent / "none.h5") is None


# A result in the place of another


def test_a_rewrite_replaces_everything_but_a_renamed_result(joint):
    kept, result = joint.with_name("kept.h5"), load(joint)
    joint.rename(kept)
    for ranks, files in ((2, 2 + 3 + 2), (1, 2 + 3)):
        written(joint, ranks, seed=2)
        assert_holds(kept, 1)
        assert_holds(joint, 2)
        assert len(names(joint.parent)) == files
    with pytest.raises(InputError, match=r"replaced by another run since it was loaded\. Load it again"):
        result["particles"]


def test_a_kill_leaves_the_earlier_result_and_the_next_run_tidies_up(joint):
    before = names(joint.parent)
    assert launch.run(2, "write_results.py", "killed", joint, 2).returncode != 0
    assert set(before) < set(names(joint.parent))
    assert_holds(joint, 1)
    assert_holds(written(joint, 1, seed=3), 3)
    assert names(joint.parent) == ["s.h5"]


def test_a_kill_at_any_moment_leaves_one_result_or_the_other(tmp_path):
    path = sweep(tmp_path / "s.h5", seed=1)
    for number in count():
        if not killed(number, lambda: sweep(path, seed=2), WRITES):
            break
        assert load(path).attributes["seed"] in (1, 2)
        assert sweep(path, seed=1) and names(tmp_path) == ["s.h5"]
    assert load(path).attributes["seed"] == 2 and number > 10


def test_readers_never_see_a_mixture_of_runs(joint):
    process = launch.start(2, "write_results.py", "forever", joint, 2)
    seen = set()
    try:
        while len(seen) < 4:
            result = load(joint)
            seed = result.attributes["seed"]
            try:
                rotation = result["fields/rotation"]
            except InputError as error:
                assert "replaced by another run" in str(error)
                continue
            assert np.array_equal(rotation, arrays(seed)[2]["fields/rotation"][0])
            seen.add(seed)
    finally:
        process.terminate()
        process.communicate()
    assert_holds(joint, load(joint).attributes["seed"])


def sweep(path, **attributes):
    """A small sweep file of one process."""
    arrays = {
        "omega": [1e-3, 0.1, 10.0],
        "G": np.array([1 + 1e-3j, 1 + 0.1j, 2 + 10j]),
        "error_bound": [1e-9] * 3,
    }
    return stored(path, "sweep", arrays, **attributes)


def test_provenance_round_trip(tmp_path):
    told = {
        "versions": {"petsc": "3.18.5", "slepc": "3.18.2", "mumps": None},
        "law": {"law": "stokes", "eta_f": 1.0, "prestress": True, "beta": None},
        "packing": ("p.h5", "ab" * 32),
    }
    told |= {
        "scalar_type": "complex",
        "petsc_options": "-freq_ksp_type preonly",
        "ranks": 3,
        "wall_seconds": 1.5,
    }
    entries = provenance(**told)
    found = load(sweep(tmp_path / "s.h5", **entries)).attributes
    for name, value in entries.items():
        assert found.get(name) == value
    said = [found[name] for name in ("petsc_version", "packing", "packing_sha256", "ranks", "wall_seconds")]
    assert said == ["3.18.5", "p.h5", "ab" * 32, 3, 1.5] and "mumps_version" not in found
    assert datetime.fromisoformat(found["date"]).utcoffset() is not None
    assert (found["python_version"], found["jampetsc_version"]) == (platform.python_version(), VERSION)
    assert law_of(found) == {"law": "stokes", "eta_f": 1.0, "prestress": True}
    with pytest.raises(ValueError, match="gamma"):
        provenance(**told | {"law": {"law": "contact", "gamma": 1.0}})


@pytest.mark.skipif(not shutil.which("git"), reason="needs git")
def test_git_commit_in_and_outside_of_a_checkout(tmp_path):
    def git(*words, folder=tmp_path / "repo"):
        who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        command = ["git", "-C", str(folder), *who, *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    (tmp_path / "repo").mkdir()
    (tmp_path / "odd" / ".git").mkdir(parents=True)
    (tmp_path / "odd" / ".git" / "HEAD").write_bytes(b"\xff")
    assert git_commit(tmp_path / "repo") is None and git_commit(tmp_path / "odd") is None
    git("init", "-q", "-b", "trunk")
    assert git_commit(tmp_path / "repo") is None  # no commit yet
    git("commit", "-q", "--allow-empty", "-m", "first")
    first = git("rev-parse", "HEAD")
    assert git_commit(tmp_path / "repo") == first
    git("worktree", "add", "-q", "-b", "side", str(tmp_path / "tree"))
    git("commit", "-q", "--allow-empty", "-m", "second")
    for branch, commit in (("a-b", first), ("x/a.b", first), ("a.b", "HEAD")):  # names that look alike
        git("branch", branch, commit)
    second = git("rev-parse", "HEAD")
    for words in (["checkout", "-q", "trunk"], ["pack-refs", "--all"], ["checkout", "-q", "a.b"],
                  ["checkout", "-q", "--detach"]):  # fmt: skip
        git(*words)
        assert (git_commit(tmp_path / "repo"), git_commit(tmp_path / "tree")) == (second, first)


# Within the ranks of a run


def rows_of(session):
    """This rank's rows of an array (2, n, 3): of several ranks the first has none, the others two each."""
    count = 2 if session.rank or session.size == 1 else 0
    return np.random.default_rng(session.rank).random((2, count, 3))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("failing", [0, 1])
def test_a_disk_that_fails_at_any_moment_on_any_rank_leaves_what_was_there(
    session, shared_path, monkeypatch, failing
):
    """All are told; nothing of the new result is left, nor of the old one once the new one is there."""
    if failing >= session.size:
        return
    path, files = shared_path / "link.h5", 1 + (session.size if session.size > 1 else 0)
    if session.rank == 0:
        path.symlink_to(shared_path / "s.h5")
    session.comm.Barrier()

    def put(number):
        with ResultWriter(path, "jampetsc-modes", session.comm) as writer:
            writer.distributed("rows", rows_of(session) + number, axis=1)
            writer.append("grown", rows_of(session)[0])
            writer.dataset("same", np.full(9, number))

    def fail():
        raise OSError(errno.ENOSPC, "full")

    put(0)
    for moment in count(1):
        with monkeypatch.context() as patch:
            left, told = [1], None
            if session.rank == failing:
                left = disturb(patch.setattr, moment, fail, WRITES)
            try:
                put(moment)
            except JampetscError as error:
                told = str(error)
            outcomes = session.comm.allgather((told, left[0] < 0))
        holds = moment if told is None else 0
        assert len({told for told, _ in outcomes}) == 1, "one line, and the same on all ranks"
        assert told is None or "disk full. Make room" in told
        assert np.array_equal(load(path)["same"], np.full(9, holds))
        assert load(path).gathered()["rows"].shape == (2, 2 * max(1, session.size - 1), 3)
        assert len(names(shared_path)) == files + 1  # the link
        session.comm.Barrier()
        if not any(happened for _, happened in outcomes):
            break
        put(0)
    assert path.is_symlink() and moment > 8


@pytest.mark.scalar("real")
def test_what_is_raised_between_or_refused_on_rank_0_leaves_what_was_there(session, shared_path):
    def put(name, count=1, error=None):
        with ResultWriter(shared_path / name, "jampetsc-modes", session.comm) as writer:
            writer.dataset("same", np.ones(count))
            if error:
                raise error

    put("s.h5")
    with pytest.raises(InputError, match=r"^between$"):
        put("s.h5", 2, InputError("between"))
    session.comm.Barrier()
    assert len(load(shared_path / "s.h5")["same"]) == 1
    session.comm.Barrier()
    if session.rank == 0:
        (shared_path / "folder.h5").mkdir()
    for name, message in (
        ("folder.h5", "a folder. Give"),
        ("none/s.h5", r"no folder .*/none\. Create it"),
    ):
        with pytest.raises(InputError, match=f"h5: {message}"):
            put(name)


def test_one_process_holds_all_rows():
    assert ArrayInMemory(np.zeros((2, 3)), axis=1).rows == slice(0, 3)

"""Results of one rank or many: the same to a reader, complete or absent, and no mixture of two runs."""

import errno
import os
import platform
import shutil
import subprocess
from contextlib import nullcontext
from datetime import datetime

import h5py
import launch
import numpy as np
import pytest
from mpi4py import MPI
from write_results import LAW, N, arrays, write

from jampetsc.errors import InputError, JampetscError
from jampetsc.io.checksums import seal
from jampetsc.io.provenance import git_commit, law_of, provenance
from jampetsc.io.reader import load
from jampetsc.io.result_file import ResultWriter
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
    return result


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_any_number_of_ranks_reads_the_same(made, ranks):
    folder = made / f"{ranks}-1"
    assert_holds(folder / "s.h5")
    files = names(folder)
    assert len(files) == 1 + (ranks if ranks > 1 else 0)
    assert all(file == "s.h5" or file.startswith("s.parts/") for file in files)


def test_fields_are_read_on_demand(joint):
    fields = load(joint).fields
    _, displacement, rows = arrays(1)
    assert fields.displacement.shape == (2, N, 2)
    assert np.array_equal(fields.displacement[1, 3:9], displacement[1, 3:9])
    assert np.array_equal(np.asarray(fields.rotation), rows["fields/rotation"][0])
    assert np.array_equal(fields.omega, [1e-3, 0.1])


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
        assert_holds(path)
    assert_holds(tmp_path / "link.h5")


def test_moving_the_file_with_its_folder(joint, tmp_path):
    shutil.move(joint.parent, tmp_path / "moved")
    assert_holds(tmp_path / "moved" / "s.h5")
    (tmp_path / "moved" / "s.h5").rename(tmp_path / "moved" / "t.h5")
    assert_holds(tmp_path / "moved" / "t.h5")


def test_a_missing_part_is_named(joint):
    part = parts(joint)[1]
    part.unlink()
    with pytest.raises(
        InputError, match=rf"s\.h5: part s\.parts/{part.name} is missing: keep the folder s\.parts"
    ):
        load(joint)


@pytest.mark.parametrize("change", [-1, 1])
def test_a_part_of_another_length_is_named(joint, change):
    part = parts(joint)[2]
    os.truncate(part, part.stat().st_size + change)
    with pytest.raises(
        InputError, match=rf"part s\.parts/{part.name} has \d+ bytes instead of \d+: truncated"
    ):
        load(joint)


def test_a_foreign_part_is_named(joint, made):
    own, other = parts(joint)[1], parts(made / "3-2" / "s.h5")[1]
    shutil.copy(other, own)
    with pytest.raises(
        InputError, match=rf"part s\.parts/{own.name} is rank 1 of run .*put the right one back"
    ):
        load(joint)


def test_parts_that_changed_places_are_noticed(joint):
    with h5py.File(joint, "r+") as h5:
        h5["part_files/names"][...] = h5["part_files/names"][...][::-1]
        h5["part_files/sizes"][...] = h5["part_files/sizes"][...][::-1]
    with pytest.raises(InputError, match=r"is rank 2 of run .*, not rank 0 of run"):
        load(joint)


def test_the_list_of_parts_cannot_point_elsewhere(joint, tmp_path):
    (tmp_path / "precious.h5").touch()
    with h5py.File(joint, "r+") as h5:
        h5["part_files/names"][1] = "../precious.h5"
    with pytest.raises(InputError, match="cannot be a part of run"):
        load(joint)
    written(joint, 1)
    assert (tmp_path / "precious.h5").exists()


def test_a_rewrite_replaces_everything(joint):
    for ranks, seed in ((2, 2), (1, 3)):
        assert_holds(written(joint, ranks, seed=seed), seed)
        assert len(names(joint.parent)) == 1 + (ranks if ranks > 1 else 0)


def test_a_rewrite_leaves_a_renamed_result_alone(joint):
    kept = joint.with_name("kept.h5")
    joint.rename(kept)
    written(joint, 2, seed=2)
    assert_holds(kept, 1)
    assert_holds(joint, 2)


def test_a_symbolic_link_as_output_is_followed(tmp_path):
    (tmp_path / "scratch").mkdir()
    (tmp_path / "s.h5").symlink_to(tmp_path / "scratch" / "big.h5")
    assert_holds(written(tmp_path / "s.h5", 2))
    assert (tmp_path / "s.h5").is_symlink()
    assert len(names(tmp_path / "scratch")) == 3


def test_an_open_result_never_mixes_with_its_successor(joint):
    result = load(joint)
    written(joint, 1, seed=2)
    with pytest.raises(InputError, match="was replaced by another run since it was loaded: load it again"):
        result["particles"]
    assert_holds(joint, 2)


def test_a_part_that_goes_while_a_result_is_open_is_noticed(joint):
    result = load(joint)
    parts(joint)[0].unlink()
    with pytest.raises(InputError, match="is missing"):
        result.fields.displacement[0]


def test_a_part_that_changes_while_a_result_is_open_is_noticed(joint):
    """The same length, sound in itself, but of another run: what is read is what was joined, or nothing."""
    result, part = load(joint), parts(joint)[0]
    with h5py.File(part, "r+") as h5:
        h5["particles"][0] = 5
    with open(part, "r+b") as file:
        seal(file)
    with pytest.raises(InputError, match="is damaged: not the one that was written"):
        result.fields.displacement[0]


def test_a_full_disk_on_one_rank_ends_all_and_leaves_the_earlier_result(joint):
    before = names(joint.parent)
    done = launch.run(3, "write_results.py", "limited", joint)
    assert done.returncode == 1, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 3
    assert len(set(lines)) == 1
    assert lines[0].startswith(f"JampetscError: {joint.parent}/s.")
    assert lines[0].endswith(": file size limit reached: make room, then run the same command again")
    assert names(joint.parent) == before
    assert_holds(joint)


def test_a_kill_leaves_the_earlier_result_and_the_next_run_tidies_up(joint):
    before = names(joint.parent)
    assert launch.run(2, "write_results.py", "killed", joint, 2).returncode != 0
    assert set(before) < set(names(joint.parent))
    assert_holds(joint, 1)
    assert_holds(written(joint, 2, seed=3), 3)
    assert len(names(joint.parent)) == 3


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
                assert "was replaced by another run" in str(error)
                continue
            assert np.array_equal(rotation, arrays(seed)[2]["fields/rotation"][0])
            seen.add(seed)
    finally:
        process.terminate()
        process.communicate()
    assert_holds(joint, load(joint).attributes["seed"])


def sweep(path, **changes):
    """A small sweep file of one process; attributes may be changed."""
    with ResultWriter(path, "jampetsc-sweep") as writer:
        writer.dataset("omega", [1e-3, 0.1, 10.0])
        writer.dataset("G", np.array([1 + 1e-3j, 1 + 0.1j, 2 + 10j]))
        writer.dataset("error_bound", [1e-9] * 3)
        writer.attributes(**changes)
    return path


def test_stored_frequencies_return_stored_values(tmp_path):
    result = load(sweep(tmp_path / "s.h5"))
    assert result.modulus(0.1) == 1 + 0.1j
    assert np.array_equal(result.modulus([[10.0], [0.1 * (1 + 1e-15)]]), [[2 + 10j], [1 + 0.1j]])
    assert np.array_equal(result.G_storage, [1, 1, 2])
    assert np.array_equal(result.G_loss, [1e-3, 0.1, 10])


def test_other_frequencies_need_a_rational_sweep(tmp_path):
    with pytest.raises(
        InputError, match=r"omega = 3 is not one of its 3 frequencies, 0.001 to 10: .*rational"
    ):
        load(sweep(tmp_path / "s.h5")).modulus([0.1, 3.0])
    for omega in (np.nan, np.inf):  # which are near to every frequency that is stored, or to none
        with pytest.raises(InputError, match=f"omega = {omega}: must be finite"):
            load(tmp_path / "s.h5").modulus([0.1, omega])


def test_a_relaxation_spectrum_gives_any_frequency(tmp_path):
    with ResultWriter(tmp_path / "s.h5", "jampetsc-sweep") as writer:
        for name, value in {"omega": [1.0], "G": [5.0 + 6j], "error_bound": [0.0]}.items():
            writer.dataset(name, np.array(value))
        for name, value in {"G0": 2.0, "eta_inf": 0.5, "rates": [1.0, 100.0], "weights": [3.0, 4.0]}.items():
            writer.dataset(f"reduced/{name}", value)
    omega = np.array([[0.2, 1.0, 50.0]])
    maxwell = 2 + 0.5j * omega + 3j * omega / (1 + 1j * omega) + 4j * omega / (100 + 1j * omega)
    found = load(tmp_path / "s.h5").modulus(omega)
    assert np.allclose(found[0, ::2], maxwell[0, ::2], rtol=1e-12)
    assert found[0, 1] == 5 + 6j  # the stored value, where there is one


DEFECTS = {
    "newer": (
        {"format_version": "2.0", "jampetsc_version": "3.1"},
        "reads up to 1.x: use jampetsc 3.1 or newer",
    ),
    "unknown": (
        {"format": "jampetsc-later"},
        "format jampetsc-later: this jampetsc reads jampetsc-packing, ",
    ),
    "foreign": ({"format": "NXdata"}, "format = 'NXdata': not a jampetsc file"),
    "a part": ({"format": "jampetsc-part"}, "is one rank's part: open the joint file beside its folder"),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_files_of_another_kind_are_refused(tmp_path, defect):
    changes, message = DEFECTS[defect]
    with pytest.raises(InputError, match=message):
        load(sweep(tmp_path / "s.h5", **changes))


def test_a_dataset_or_fields_that_are_not_there(tmp_path):
    result = load(sweep(tmp_path / "s.h5"))
    with pytest.raises(InputError, match=r"s.h5: no dataset modes: it holds G, error_bound, omega"):
        result["modes"]
    with pytest.raises(InputError, match=r"s.h5: no dataset omga: did you mean omega\?"):
        result["omga"]
    with pytest.raises(InputError, match=r"s.h5: attribute formt is missing: did you mean format\?"):
        result.attributes["formt"]
    assert result.get("foo", 1) == 1 and result.get("omega") is not None
    with pytest.raises(InputError, match="holds no fields: ask the sweep for fields"):
        result.fields  # noqa: B018
    with h5py.File(tmp_path / "s.h5", "r+") as h5:
        del h5["G"]
    with pytest.raises(InputError, match="no dataset G"):
        load(tmp_path / "s.h5")


def test_provenance_round_trip(tmp_path):
    entries = provenance(
        versions={"petsc": "3.18.5", "slepc": "3.18.2", "mumps": None},
        scalar_type="complex",
        petsc_options="-freq_ksp_type preonly",
        ranks=3,
        packing=("p.h5", "ab" * 32),
        law={"law": "stokes", "eta_f": 1.0, "prestress": True, "beta": None},
        wall_seconds=1.5,
    )
    found = load(sweep(tmp_path / "s.h5", **entries)).attributes
    assert {name: found[name] for name in entries if entries[name] is not None} == {
        name: value for name, value in entries.items() if value is not None
    }
    assert found["petsc_version"] == "3.18.5" and found["packing_sha256"] == "ab" * 32
    assert (found["packing"], found["ranks"], found["wall_seconds"]) == ("p.h5", 3, 1.5)
    assert datetime.fromisoformat(found["date"]).utcoffset() is not None
    assert (found["python_version"], found["jampetsc_version"]) == (platform.python_version(), VERSION)
    assert law_of(found) == {"law": "stokes", "eta_f": 1.0, "prestress": True}


def test_a_law_parameter_cannot_get_lost():
    with pytest.raises(ValueError, match="gamma"):
        provenance(
            versions={},
            scalar_type="real",
            petsc_options="",
            ranks=1,
            packing=("p.h5", ""),
            law={"law": "contact", "gamma": 1.0},
            wall_seconds=0,
        )


@pytest.mark.skipif(not shutil.which("git"), reason="needs git")
def test_git_commit_in_and_outside_of_a_checkout(tmp_path):
    def git(*words, folder=tmp_path / "repo"):
        who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        command = ["git", "-C", str(folder), *who, *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    (tmp_path / "repo").mkdir()
    assert git_commit(tmp_path / "repo") is None
    git("init", "-q", "-b", "trunk")
    assert git_commit(tmp_path / "repo") is None  # no commit yet
    git("commit", "-q", "--allow-empty", "-m", "first")
    head = git("rev-parse", "HEAD")
    assert git_commit(tmp_path / "repo") == head
    git("worktree", "add", "-q", "-b", "side", str(tmp_path / "tree"))
    assert git_commit(tmp_path / "tree") == head
    git("commit", "-q", "--allow-empty", "-m", "second")
    for branch, commit in (("a-b", head), ("x/a.b", head), ("a.b", "HEAD")):  # names that look alike
        git("branch", branch, commit)
    head = git("rev-parse", "HEAD")
    git("pack-refs", "--all")
    assert git_commit(tmp_path / "repo") == head
    assert git_commit(tmp_path / "tree") == git("rev-parse", "side") != head
    git("checkout", "-q", "a.b")
    assert git_commit(tmp_path / "repo") == head
    git("checkout", "-q", "--detach")
    assert git_commit(tmp_path / "repo") == head


# Within the ranks of a run


def rows_of(session):
    """This rank's rows of an array (2, n, 3): of several ranks the first has none, the others two each."""
    count = 2 if session.rank or session.size == 1 else 0
    return np.random.default_rng(session.rank).random((2, count, 3))


@pytest.mark.scalar("real")
def test_what_ranks_write_together_is_read_as_one(session, shared_path):
    path, mine = shared_path / "s.h5", rows_of(session)
    with ResultWriter(path, "jampetsc-modes", session.comm) as writer:
        writer.attributes(law="contact", none=None)
        writer.dataset("same", np.arange(3))
        writer.distributed("rows", mine, axis=1)
        writer.distributed("nothing", np.zeros((0, 2)))
        for entry in range(3):
            writer.append("grown", mine[0] + entry)
    writer.abort()  # harmless by now
    session.comm.Barrier()
    found, all_rows = load(path), np.concatenate(session.comm.allgather(mine), axis=1)
    assert np.array_equal(found["rows"], all_rows) and found["nothing"].shape == (0, 2)
    assert np.array_equal(found["grown"], np.stack([all_rows[0] + entry for entry in range(3)]))
    assert found["same"].tolist() == [0, 1, 2] and "none" not in found.attributes
    assert len(set(session.comm.allgather(found.attributes["run_id"]))) == 1
    parts = sorted((shared_path / "s.parts").iterdir()) if session.size > 1 else []
    for rank, part in enumerate(parts):  # what tells them apart where nobody has their seals
        with h5py.File(part) as h5:
            told = dict(h5.attrs)
            assert ("rows" in h5) == ("grown" in h5) == (rank > 0) and "nothing" not in h5
        assert told == {"format": "jampetsc-part", "run_id": found.attributes["run_id"], "rank": rank}
    assert len(parts) == session.size * (session.size > 1)
    assert len(list((shared_path / "s.parts").glob("*"))) == session.size if session.size > 1 else True


@pytest.mark.scalar("real")
@pytest.mark.parametrize("moment", ["dataset", "distributed", "append", "close"])
def test_a_disk_that_is_full_on_the_last_rank_ends_all(session, shared_path, moment):
    path, last = shared_path / "s.h5", session.size - 1
    with pytest.raises(JampetscError, match=r"disk full: make room"):
        with ResultWriter(path, "jampetsc-modes", session.comm) as writer:
            writer.distributed("rows", rows_of(session), axis=1)
            if session.rank == last:
                writer._part.stream.error = OSError(errno.ENOSPC, "full")
            if moment != "close":
                getattr(writer, moment)("more", np.ones((2, 2)))
                raise AssertionError("nobody has noticed")
    session.comm.Barrier()
    assert list(shared_path.iterdir()) == []


def require_nothing_left(session, shared_path, rank, file, moment):
    """All ranks are told, and no file stays, where one of this rank cannot be finished or published."""

    def refuse():
        raise JampetscError("no room for a name")

    with pytest.raises(JampetscError, match="no room for a name"):
        with ResultWriter(shared_path / "s.h5", "jampetsc-modes", session.comm) as writer:
            writer.distributed("rows", rows_of(session), axis=1)
            if session.rank == rank:
                setattr(getattr(writer, file), moment, refuse)
    session.comm.Barrier()
    assert list(shared_path.iterdir()) == []


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("moment", ["finish", "publish"])
def test_a_part_of_one_rank_that_gets_no_name_ends_all(session, shared_path, moment):
    require_nothing_left(session, shared_path, session.size - 1, "_part", moment)


@pytest.mark.scalar("real")
def test_what_is_raised_between_leaves_nothing_and_what_was_there(session, shared_path):
    path = shared_path / "s.h5"
    for number in (1, 2):
        with pytest.raises(InputError, match="between") if number == 2 else nullcontext():
            with ResultWriter(path, "jampetsc-modes", session.comm) as writer:
                writer.distributed("rows", rows_of(session) + number, axis=1)
                if number == 2:
                    raise InputError("between")
        session.comm.Barrier()
    assert np.array_equal(
        load(path)["rows"], np.concatenate(session.comm.allgather(rows_of(session) + 1), axis=1)
    )
    assert len(names(shared_path)) == (1 + session.size if session.size > 1 else 1)
    session.comm.Barrier()
    with ResultWriter(path, "jampetsc-modes", session.comm) as writer:
        writer.dataset("same", np.ones(2))
    session.comm.Barrier()
    assert len(names(shared_path)) == (
        1 + session.size if session.size > 1 else 1
    )  # the parts of before are gone
    assert set(load(path)) == {"same"}


@pytest.mark.scalar("real")
def test_an_output_that_only_rank_0_looks_at_is_refused_on_all(session, shared_path):
    if session.rank == 0:
        (shared_path / "s.h5").mkdir()
    session.comm.Barrier()
    for name, message in (("s.h5", "is a folder"), ("none/s.h5", "folder .*/none does not exist: create it")):
        with pytest.raises(InputError, match=f"s.h5: {message}"):
            ResultWriter(shared_path / name, "jampetsc-modes", session.comm)


@pytest.mark.scalar("real")
@pytest.mark.parametrize("last", ["finish", "publish"])
def test_parts_that_have_their_names_go_where_the_joint_file_gets_none(session, shared_path, last):
    require_nothing_left(session, shared_path, 0, "_joint", last)

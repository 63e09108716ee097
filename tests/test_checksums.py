"""Damaged files: what jampetsc wrote is refused in one line where a byte of it changed, and nothing crashes."""

import hashlib
import io
import os
import random
import shutil
import signal
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples import DATA, published
from test_result_file import assert_holds, parts, written

from jampetsc.contacts.disks import Disks
from jampetsc.errors import InputError
from jampetsc.storage import trial
from jampetsc.storage.checksums import BLOCK, LINE, Damaged, Verified, _check_end, seal, seal_of
from jampetsc.storage.merge import merge
from jampetsc.storage.packing_file import read_packing, write_packing
from jampetsc.storage.reader import load
from jampetsc.storage.result_file import ResultWriter

DAMAGES = 12  # of each kind of file; benchmarks of some thousand are run by hand


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Folders with a packing, a result of one rank, and a result of three with its parts."""
    folder = tmp_path_factory.mktemp("sound")
    for name in ("packing", "plain", "joint"):
        (folder / name).mkdir()
    write_packing(folder / "packing" / "s.h5", published().with_record(pressure=1e-3, protocol="quench"))
    written(folder / "plain" / "s.h5", 1)
    written(folder / "joint" / "s.h5", 3)
    return folder


def contents(path):
    """Everything that readers give of a file, in one string."""
    found = load(path)
    if isinstance(found, Disks):
        return repr([read_packing(path).fingerprint, found.fingerprint, sorted(found.record.items())])
    merge(path, path.parent / "merged.h5")
    arrays = [
        (name, result[name].tobytes())
        for result in (found, load(path.parent / "merged.h5"))
        for name in found
    ]
    return repr([sorted((name, str(value)) for name, value in found.attributes.items()), arrays])


def outcome(path):
    """ "refused", a hash of the contents, or what should not be; found out by a child process of a minute."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            said = hashlib.sha256(contents(path).encode()).hexdigest()
        except InputError as error:
            said = f"two lines: {error}" if "\n" in str(error) else "refused"
        except BaseException as error:
            said = f"traceback: {error!r}"
        os.write(write, said.encode()[:2000])
        os._exit(0)
    os.close(write)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with os.fdopen(read) as pipe:
        return pipe.read() if status == 0 else f"ended by {status}"


def damage(content, dice):
    """The bytes of a file, changed as disks and networks do."""
    content = bytearray(content)
    kind = dice.choice(["bit", "bytes", "header", "end", "zeros", "cut", "garbage"])
    if kind in ("bit", "bytes", "header", "end"):
        low, high = {"header": (0, 600), "end": (len(content) - 400, len(content))}.get(
            kind, (0, len(content))
        )
        for _ in range(1 if kind == "bit" else 8):
            content[dice.randrange(low, high)] ^= 1 << dice.randrange(8)
    elif kind == "zeros":
        start = dice.randrange(len(content))
        content[start : start + 512] = bytes(len(content[start : start + 512]))
    elif kind == "cut":
        del content[dice.randrange(len(content)) :]
    else:
        content += dice.randbytes(dice.randrange(1, 500))
    return kind, bytes(content)


@pytest.mark.parametrize("kind", ["packing", "plain", "joint"])
def test_damage_is_refused_or_harmless(sound, tmp_path, kind):
    dice = random.Random(20)
    right = outcome(shutil.copytree(sound / kind, tmp_path / "right") / "s.h5")
    assert len(right) == 64
    for number in range(DAMAGES):
        folder = shutil.copytree(sound / kind, tmp_path / str(number))
        victim = dice.choice(sorted(folder.rglob("*.h5")))
        how, content = damage(victim.read_bytes(), dice)
        harmless = content == victim.read_bytes()
        victim.write_bytes(content)
        assert outcome(folder / "s.h5") == (right if harmless else "refused"), (number, how, victim.name)


FLIPS = {  # place of one byte of without-checksums.h5 -> how HDF5 1.10 ends
    849: signal.SIGSEGV,
    893: signal.SIGSEGV,
    848: signal.SIGABRT,
    2073: signal.SIGABRT,
    839: signal.SIGXCPU,
}


@pytest.mark.parametrize("place", FLIPS)
def test_what_libhdf5_does_not_survive_is_refused(tmp_path, monkeypatch, place):
    """A file without checksums: another process reads it first."""
    monkeypatch.setattr(trial, "_SECONDS", 1)
    path = shutil.copy(DATA / "without-checksums.h5", tmp_path)
    assert read_packing(path).n == 4
    content = bytearray((DATA / "without-checksums.h5").read_bytes())
    content[place] ^= {848: 1, 839: 128}.get(place, 255)
    Path(path).write_bytes(content)
    assert outcome(Path(path)) == "refused"


def test_a_changed_part_does_not_merge(sound, tmp_path):
    joint = shutil.copytree(sound / "joint", tmp_path / "copy") / "s.h5"
    part = parts(joint)[1]
    with h5py.File(part) as h5:
        place = h5["nonaffine"].id.get_chunk_info(0).byte_offset
    content = bytearray(part.read_bytes())
    content[place + 3] ^= 16
    part.write_bytes(content)
    for action in (merge, lambda path: load(path)["nonaffine"]):
        with pytest.raises(InputError, match=r"damaged .bytes 0 to .* are not those that were written"):
            action(joint)
    assert part.exists()


def test_a_part_written_anew_is_not_taken_for_the_old_one(sound, tmp_path):
    """The same rank of the same run, the same size, sound in itself: but not what was joined."""
    joint = shutil.copytree(sound / "joint", tmp_path / "copy") / "s.h5"
    part = parts(joint)[0]
    with h5py.File(part, "r+") as h5:
        h5["particles"][0] = 5
    with open(part, "r+b") as file:
        seal(file)
    with pytest.raises(
        InputError, match=f"part s.parts/{part.name} is damaged: not the one that was written"
    ):
        load(joint)


def test_other_programs_find_checksums_of_their_own(sound):
    """Those of HDF5: for metadata since the second version of its header, for data where they are in chunks."""
    for name in ("packing", "plain", "joint"):
        with h5py.File(sound / name / "s.h5") as h5:
            assert h5.id.get_create_plist().get_version()[0] >= 2
            items = []
            h5.visititems(lambda _, item, items=items: items.append(item))
            arrays = [item for item in items if isinstance(item, h5py.Dataset) and item.size > 1]
            assert len(arrays) >= 4
            assert all(item.fletcher32 or item.is_virtual for item in arrays)


def test_the_same_content_gives_the_same_bytes(tmp_path):
    write_packing(tmp_path / "a.h5", published())
    time.sleep(1.01)  # HDF5 would note the second
    write_packing(tmp_path / "b.h5", published())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_what_another_program_edits_has_no_checksums_and_is_read(sound, tmp_path):
    path = tmp_path / "p.h5"
    shutil.copy(sound / "packing" / "s.h5", path)
    with open(path, "rb") as file:
        assert seal_of(file)
    with h5py.File(path, "r+") as h5:
        h5["radii"][3] = 0.875
    with open(path, "rb") as file:
        assert seal_of(file) is None
    assert read_packing(path).radii[3] == 0.875


def test_damage_in_one_place_leaves_the_others_readable(tmp_path):
    """Of large fields only those blocks are read and hashed that are asked for."""
    path = tmp_path / "s.h5"
    rows = 16 * BLOCK // 16  # in four chunks
    with ResultWriter(path, "jampetsc-sweep") as writer:
        for name in ("omega", "G", "error_bound"):
            writer.dataset(name, np.ones(1))
        writer.distributed("field", np.arange(rows) * 1j)
    with open(path, "r+b") as file:
        file.seek(14 * BLOCK + 77)
        file.write(b"\0\1\2")
    field = load(path).stored("field")
    assert np.array_equal(field[:100], np.arange(100) * 1j)
    with pytest.raises(InputError, match=f"bytes {14 * BLOCK} to {15 * BLOCK} are not those that"):
        field[:]


def test_bytes_come_out_as_they_went_in(tmp_path):
    content = random.Random(1).randbytes(3 * BLOCK + 1000)
    for size in (0, 1, BLOCK - 1, BLOCK, 2 * BLOCK + 1, len(content)):
        (tmp_path / "f").write_bytes(content[:size])
        with open(tmp_path / "f", "r+b") as file:
            digest = seal(file)
            assert seal_of(file) == digest
        with Verified(open(tmp_path / "f", "rb")) as verified:
            assert verified.sealed
            assert verified.read() == content[:size]
            for start in (0, BLOCK - 5, size - 3):
                verified.seek(max(start, 0))
                assert verified.read(10) == content[:size][max(start, 0) : max(start, 0) + 10]
            assert verified.seek(0, os.SEEK_END) == size
    whole = bytearray((tmp_path / "f").read_bytes())
    whole[5] ^= 1  # and its hash to go with it, but not the line, which stands for both
    whole[len(content) : len(content) + 32] = hashlib.sha256(whole[:BLOCK]).digest()
    (tmp_path / "g").write_bytes(whole)
    with pytest.raises(Damaged, match="list of checksums"):
        Verified(open(tmp_path / "g", "rb"))
    whole = (tmp_path / "f").read_bytes()
    for place in (0, len(content) - 1, len(content), len(whole) - LINE - 1):
        (tmp_path / "g").write_bytes(whole[:place] + whole[place + 1 :])
        with pytest.raises(Damaged, match="its length is not"):
            Verified(open(tmp_path / "g", "rb"))


def sealed(path, content):
    """A file of this content with its checksums; all of its bytes."""
    path.write_bytes(content)
    with open(path, "r+b") as file:
        seal(file)
    return path.read_bytes()


def test_a_list_of_checksums_that_is_not_whole_is_refused(tmp_path):
    path, content = tmp_path / "f", bytes(range(200))
    whole = sealed(path, content)
    line = len(whole) - LINE
    for place in (0, len(content), line):  # a byte more, of the content or of the hashes
        path.write_bytes(whole[:place] + b"x" + whole[place:])
        with pytest.raises(Damaged, match="its length is not"):
            Verified(open(path, "rb"))
    path.write_bytes(whole.replace(b" %d " % BLOCK, b" %d " % (BLOCK + 1)))
    with pytest.raises(Damaged, match="list of checksums is not the one"):
        Verified(open(path, "rb"))
    for changed in (
        whole[:-2] + b"x\n",  # what follows the hash
        whole.replace(b" %d " % BLOCK, b" 0 "),
        whole[:-1],
        whole.replace(b"checksums 1", b"checksums 2"),
        whole[-LINE + 1 :],
    ):
        path.write_bytes(changed)
        with open(path, "rb") as file:
            assert seal_of(file) is None
    zero = whole[:line] + b"jampetsc-checksums 1 200 0 x".ljust(LINE - 1) + b"\n"
    path.write_bytes(zero)
    with open(path, "rb") as file:
        assert seal_of(file) is None  # blocks of nothing


@pytest.mark.parametrize("libver", ["v110", "latest"])
@pytest.mark.parametrize("change", [1, -1])
def test_one_byte_too_many_or_too_few_without_checksums(tmp_path, libver, change):
    """HDF5's own header says where it ends."""
    path = tmp_path / "x.h5"
    with h5py.File(path, "w", libver=libver) as h5:
        h5["x"] = np.arange(5)
        if libver == "latest":  # the third version of the header
            h5.swmr_mode = True
    with Verified(open(path, "rb")) as verified:
        assert not verified.sealed
    os.truncate(path, path.stat().st_size + change)
    with pytest.raises(
        Damaged, match=r"truncated( or changed)?: 1 bytes (of its HDF5 are missing|follow its end)"
    ):
        Verified(open(path, "rb"))


def test_headers_that_say_their_end_elsewhere_are_left_to_libhdf5(tmp_path):
    """Of files with short addresses, and of the older format."""
    path = tmp_path / "x.h5"
    creation, access = (h5py.h5p.create(kind) for kind in (h5py.h5p.FILE_CREATE, h5py.h5p.FILE_ACCESS))
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    creation.set_sizes(4, 4)
    h5py.h5f.create(os.fsencode(path), h5py.h5f.ACC_TRUNC, creation, access).close()
    assert path.read_bytes()[8] in (2, 3) and path.read_bytes()[9] == 4
    with Verified(open(path, "rb")) as verified:
        assert not verified.sealed and verified.read() == path.read_bytes()
    with h5py.File(path, "w", libver="earliest") as h5:
        h5["x"] = np.arange(5)
    os.truncate(path, path.stat().st_size + 1)
    with Verified(open(path, "rb")) as verified:
        assert not verified.sealed


def test_a_file_that_shrinks_while_it_is_read_is_damaged(tmp_path):
    (tmp_path / "f").write_bytes(bytes(100))
    with Verified(open(tmp_path / "f", "rb", buffering=0)) as verified:
        os.truncate(tmp_path / "f", 99)
        with pytest.raises(Damaged, match="ends 1 bytes too early"):
            verified.read(100)


class Counted:
    """A file that tells how often it was read."""

    def __init__(self, path):
        self.file, self.reads = open(path, "rb"), 0

    def read(self, count):
        self.reads += 1
        return self.file.read(count)

    def seek(self, *place):
        return self.file.seek(*place)

    def close(self):
        self.file.close()


def test_blocks_are_read_once_while_they_are_in_use(tmp_path, monkeypatch):
    """The last eight of them are kept, no more: memory does not grow with the file."""
    monkeypatch.setattr("jampetsc.storage.checksums.BLOCK", 64)
    content = random.Random(2).randbytes(64 * 40)
    sealed(tmp_path / "f", content)
    file = Counted(tmp_path / "f")
    verified = Verified(file)
    before = file.reads

    def look(block):
        verified.seek(64 * block + 3)
        assert verified.tell() == 64 * block + 3
        assert verified.read(2) == content[64 * block + 3 : 64 * block + 5]
        return file.reads - before

    assert [look(block) for block in range(8)] == list(range(1, 9))
    assert look(0) == 8  # kept, and used last
    assert look(8) == 9 and look(0) == 9 and look(1) == 10
    for block in range(40):
        look(block)
    assert len(verified._blocks) == 8
    verified.close()
    assert file.file.closed


def test_a_file_that_was_cut_is_refused_before_libhdf5_sees_it(sound, tmp_path):
    content = (sound / "packing" / "s.h5").read_bytes()
    end = int.from_bytes(content[28:36], "little")  # of what HDF5 has written, as its header says
    (tmp_path / "s.h5").write_bytes(content[: end - 100])
    with pytest.raises(Damaged, match="truncated: 100 bytes of its HDF5 are missing"):
        Verified(open(tmp_path / "s.h5", "rb"))


@pytest.mark.parametrize(
    "edit",
    [
        lambda header: header[:47],
        lambda header: b"X" + header[1:],
        lambda header: header[:8] + b"\0" + header[9:],
        lambda header: header[:8] + b"\4" + header[9:],
        lambda header: header[:9] + b"\4" + header[10:],
    ],
)
def test_headers_of_another_kind_tell_no_end(sound, edit):
    """Too short, without a signature, an older or newer version, other sizes of addresses."""
    header = (sound / "packing" / "s.h5").read_bytes()[:48]
    with pytest.raises(Damaged, match="truncated"):
        _check_end(io.BytesIO(header), 48)
    _check_end(io.BytesIO(edit(header)), 48)


def test_sizes_are_checked_before_they_are_allocated(tmp_path):
    path = tmp_path / "p.h5"
    write_packing(path, published())
    with h5py.File(path, "r+") as h5:
        del h5["positions"]
        h5.create_dataset("positions", shape=(10**13, 2), chunks=(1000, 2), dtype=float)
    with pytest.raises(
        InputError, match=r"positions says that it is \(10000000000000, 2\), more than the file"
    ):
        read_packing(path)


def old_layout(path, seed=1):
    """A joint file and its parts as version 0.1 wrote them at first: HDF5's oldest format, no checksums."""
    written(path, 3, seed=seed)
    joint = h5py.File(path)
    names = [name.decode() for name in joint["part_files/names"][...]]
    for name in names:
        plain(path.parent / name)
    sources = {
        name: item.virtual_sources() for name, item in joint.items() if getattr(item, "is_virtual", False)
    }
    for name in ("displacement", "rotation"):
        sources[f"fields/{name}"] = joint[f"fields/{name}"].virtual_sources()
    shapes = {name: (joint[name].shape, joint[name].dtype) for name in sources}
    joint.close()
    plain(path)
    with h5py.File(path, "r+") as h5:
        sizes = [(path.parent / name).stat().st_size for name in names]
        del h5["part_files"]
        h5["part_files/names"] = np.array(names, dtype=h5py.string_dtype())
        h5["part_files/sizes"] = np.array(sizes)
        for name, boxes in sources.items():
            layout = h5py.VirtualLayout(*shapes[name])
            for box in boxes:
                first, last = box.vspace.get_select_bounds()
                rows = tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))
                shape = tuple(b - a + 1 for a, b in zip(first, last, strict=True))
                layout[rows] = h5py.VirtualSource(box.file_name, name, shape=shape, dtype=shapes[name][1])
            h5.create_virtual_dataset(name, layout)
    return path


def plain(path):
    """The file written anew as h5py does by itself."""

    def copy(name, item):
        if isinstance(item, h5py.Dataset) and not item.is_virtual:
            new.create_dataset(name, data=item[...])

    with h5py.File(path) as h5, h5py.File(path.with_suffix(".new"), "w") as new:
        new.attrs.update(h5.attrs)
        h5.visititems(copy)
    path.with_suffix(".new").replace(path)


def test_older_files_are_read(tmp_path):
    path = old_layout(tmp_path / "s.h5")
    assert_holds(path)
    assert merge(path, tmp_path / "merged.h5") == 3
    assert_holds(tmp_path / "merged.h5")
    parts(path)[1].unlink()
    with pytest.raises(InputError, match="is missing"):
        load(path)

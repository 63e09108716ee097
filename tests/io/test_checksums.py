"""Damaged files: what jampetsc wrote is refused in one line where a byte of it changed, and nothing crashes."""

import hashlib
import os
import random
import shutil
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from samples import published
from test_result_file import written

from jampetsc.errors import InputError
from jampetsc.io.checksums import BLOCK, LINE, Damaged, append_seal, identity_of, seal_of, verify
from jampetsc.io.hdf5 import open_file
from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load
from jampetsc.io.result_file import merge
from jampetsc.packing.packing import Packing


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


def everything(path):
    """What readers give of a file."""
    found = load(path)
    return found if isinstance(found, Packing) else dict(found)


@pytest.mark.parametrize("kind", ["packing", "plain", "joint"])
@settings(max_examples=40, deadline=None, derandomize=True)  # benchmarks of some thousand are run by hand
@given(data=st.data())
def test_damage_is_refused(sound, tmp_path_factory, kind, data):
    """Bytes of any of the files are changed, left out, put in or zero, as disks and networks do; or its end is lost."""
    folder = shutil.copytree(sound / kind, tmp_path_factory.mktemp("damaged") / "s")
    victims = sorted(folder.rglob("*.h5"))
    victim = victims[data.draw(st.integers(0, len(victims) - 1))]
    content = victim.read_bytes()
    first = data.draw(st.integers(0, len(content)))
    last = data.draw(st.integers(first, min(len(content), first + 512)) | st.just(len(content)))
    put = data.draw(st.binary(max_size=8) | st.just(bytes(last - first)))
    changed = content[:first] + put + content[last:]
    assume(changed != content)
    victim.write_bytes(changed)
    for action in (everything, lambda path: merge(path, path.with_name("merged.h5"))):
        with pytest.raises(InputError) as refused:
            action(folder / "s.h5")
        assert "\n" not in str(refused.value)


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


def test_what_stands_at_the_end_of_a_file(tmp_path):
    """Whatever is done to the list or the line is told: not whole, not right, or no line at all."""
    path, content = tmp_path / "f", random.Random(1).randbytes(3 * BLOCK + 1000)
    for size in (0, 1, BLOCK - 1, BLOCK, 2 * BLOCK + 1, len(content)):
        path.write_bytes(content[:size])
        with open(path, "r+b") as file:
            assert append_seal(file) == seal_of(file) == identity_of(path, every_byte=True)
            verify(file)
    whole = path.read_bytes()
    for place in (0, len(content) - 1):  # a byte less, and more
        for changed in (whole[:place] + whole[place + 1 :], whole[:place] + b"x" + whole[place:]):
            assert told(path, changed) == "its length is not the one it was written with"
    assert told(path, bytes(9) + whole[9:]) == "its bytes are not those that were written"
    assert identity_of(path) is not None and identity_of(path, every_byte=True) is None
    for changed in (
        whole[:-2] + b"x\n",  # what follows the hash
        whole.replace(b" %d " % len(content), b" x "),
        whole[:-1],
        whole.replace(b"jampetsc-sha256", b"jampetsc-sha512"),
        whole[-LINE + 1 :],
        b"",
    ):
        path.write_bytes(changed)
        with open(path, "rb") as file:
            assert seal_of(file) is None
            verify(file)  # no HDF5 of ours
        assert identity_of(path) == hashlib.sha256(changed).hexdigest()


def told(path, content):
    path.write_bytes(content)
    with open(path, "rb") as file, pytest.raises(Damaged) as error:
        verify(file)
    return str(error.value)


def test_a_file_is_compared_with_its_hash_once(sound, tmp_path):
    """And again when it has changed, by its size and time."""
    path = Path(shutil.copy(sound / "packing" / "s.h5", tmp_path))
    load(path)
    content, time = bytearray(path.read_bytes()), path.stat().st_mtime_ns
    content[2000] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(time, time))
    with open(path, "rb") as file:
        verify(file)
    os.utime(path, ns=(time, time + 1))
    with pytest.raises(InputError, match=r"damaged .its bytes are not those that were written"):
        load(path)


@pytest.mark.parametrize("libver", ["earliest", "v110", "latest"])
@pytest.mark.parametrize("change", [1, -1])
def test_one_byte_too_many_or_too_few_without_checksums(tmp_path, libver, change):
    """HDF5's own header says where it ends; what another program leaves behind an older one is its own affair."""
    path = tmp_path / "x.h5"
    with h5py.File(path, "w", libver=libver) as h5:
        h5["x"] = np.arange(5)
        if libver == "latest":  # the third version of the header
            h5.swmr_mode = True
    os.truncate(path, path.stat().st_size + change)
    if libver == "earliest" and change == 1:
        with open_file(path) as h5:
            assert h5["x"][4] == 4
        return
    with pytest.raises(InputError, match="truncated"), open_file(path):
        pass

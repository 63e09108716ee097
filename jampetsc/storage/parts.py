"""The part files of a joint file: one per rank, named after the run so that two runs never mix.

HDF5 reads a missing part of a virtual dataset as zeros without an error, and a changed one as it is. The joint file
therefore lists its parts in the group `part_files` (names, sizes in bytes, seals: see `checksums`), each part carries
its `run_id` and rank, and rows are put together here rather than by libhdf5.
"""

import math
import os
import re
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py
import numpy as np

from jampetsc.errors import InputError
from jampetsc.storage.checksums import seal_of
from jampetsc.storage.hdf5 import from_stream, open_file, opening, reading, values
from jampetsc.storage.regular import open_regular

GROUP = "part_files"
_NAME = re.compile(r"[^/]+\.parts/[0-9a-f]{12}-rank-\d{4,}\.h5")


def part_name(joint, run_id: str, rank: int) -> str:
    """Path of a rank's part relative to the folder of the joint file; UTF-8, as HDF5 wants it."""
    stem = os.fsencode(Path(joint).stem).decode(errors="replace").replace("\ufffd", "_")
    return f"{stem}.parts/{run_id}-rank-{rank:04d}.h5"


class PartList:
    """The parts that belong to an open joint file; empty for a plain file."""

    def __init__(self, h5, path):
        self.path = Path(path).resolve()
        self.shown = path  # as the user wrote it, for messages
        with reading(path):
            self.run_id = h5.attrs.get("run_id", "")
            group = h5.get(GROUP, {})
            columns = [values(group[name]).tolist() for name in ("names", "sizes", "seals") if name in group]
        names, sizes, seals = columns if len(columns) == 3 else (*(columns or ([], [])), None)
        names = [name.decode(errors="replace") for name in names]
        for name in names:
            if not (_NAME.fullmatch(name) and Path(name).name.startswith(f"{self.run_id}-")):
                raise InputError(
                    f"{path}: part {name!r} cannot be a part of run {self.run_id}: damaged, make it again"
                )
        self.sizes = dict(zip(names, sizes, strict=True))
        self._seals = seals and dict(zip(names, (seal.decode() for seal in seals), strict=True))

    def __bool__(self):
        return bool(self.sizes)

    def check_present(self) -> None:
        """Raise InputError if a part is missing or of another size.

        Called after reading as well: parts never come back under the same name, so what was read was theirs.
        """
        for name, size in self.sizes.items():
            try:  # in one look: the part of a replaced run may go at any moment
                found = (self.path.parent / name).stat().st_size
            except (FileNotFoundError, NotADirectoryError):
                raise InputError(
                    f"{self.shown}: part {name} is missing: keep the folder {Path(name).parent} beside "
                    "the file (`jampetsc merge` makes one file of them)"
                ) from None
            if found != size:
                raise InputError(
                    f"{self.shown}: part {name} has {found} bytes instead of {size}: "
                    "truncated or not copied completely; copy it again"
                )

    def check(self) -> None:
        """Raise InputError if a part is missing, truncated, from another run or not the one that was written."""
        self.check_present()
        for rank, name in enumerate(self.sizes):
            path = self.path.parent / name
            with opening(path), open_regular(path) as file:
                if self._seals and seal_of(file) == self._seals[name]:
                    continue
            with open_file(path) as h5, reading(path):
                found = h5.attrs.get("run_id"), h5.attrs.get("rank")
            if found != (self.run_id, rank):
                raise InputError(
                    f"{self.shown}: part {name} is rank {found[1]} of run {found[0]}, not rank {rank} of run "
                    f"{self.run_id}: put the right one back"
                )
            if self._seals:
                raise self._changed(name)

    @contextmanager
    def open(self, name):
        """The h5py.File of a part, which must be the one that was written with the joint file."""
        path = self.path.parent / name
        with opening(path):
            file = open_regular(path)
            if self._seals and seal_of(file) != self._seals[name]:
                file.close()
                raise self._changed(name)
            h5 = from_stream(file)
        with h5, reading(path):
            yield h5

    def _changed(self, name):
        return InputError(
            f"{self.shown}: part {name} is damaged: not the one that was written; copy it again or run again"
        )

    def read(self, data: h5py.Dataset, selection=...):
        """What a dataset of the joint file holds, or some of it: integers, slices and … as in numpy.

        Raises InputError where the parts do not make up the whole, ValueError as `hdf5.values`.
        """
        if not data.is_virtual:
            return values(data, selection)
        boxes = [_Box(source) for source in data.virtual_sources()]
        if any(box.part not in self.sizes for box in boxes) or sum(box.size for box in boxes) != data.size:
            raise InputError(f"{self.shown}: {data.name}: its parts do not make up the whole: damaged")
        wanted = _ranges(selection, data.shape)
        if wanted is None:
            return self.read(data)[selection]
        whole = np.empty([len(wanted_rows) for wanted_rows, _ in wanted], data.dtype)
        for box in boxes:
            target, source = box.overlap([rows for rows, _ in wanted])
            if target is not None:
                with self.open(box.part) as part:
                    if part[box.name].shape != box.shape:
                        raise InputError(f"{self.shown}: part {box.part} holds other rows: damaged")
                    whole[target] = values(part[box.name], source)
        return whole[tuple(0 if single else slice(None) for _, single in wanted)]

    def remove(self) -> None:
        """Delete the parts, and their folder once it is empty."""
        for name in self.sizes:
            with suppress(OSError):  # such as a folder that is no longer writable: nothing refers to the part
                (self.path.parent / name).unlink(missing_ok=True)
        for folder in {(self.path.parent / name).parent for name in self.sizes}:
            remove_if_empty(folder)


class _Box:
    """Where the rows of one part lie in a virtual dataset."""

    def __init__(self, source):
        first, last = source.vspace.get_select_bounds()
        self.part, self.name = source.file_name, source.dset_name
        self.first = first
        self.shape = tuple(b - a + 1 for a, b in zip(first, last, strict=True))
        self.size = math.prod(self.shape)

    def overlap(self, wanted):
        """(slices of what is wanted, slices of this part) that are the same; (None, None) if there are none."""
        target, source = [], []
        for rows, first, count in zip(wanted, self.first, self.shape, strict=True):
            begin = max(0, -(-(first - rows.start) // rows.step))
            end = min(len(rows), (first + count - 1 - rows.start) // rows.step + 1)
            if begin >= end:
                return None, None
            target.append(slice(begin, end))
            source.append(slice(rows[begin] - first, rows[end - 1] - first + 1, rows.step))
        return tuple(target), tuple(source)


def _ranges(selection, shape):
    """[(range of rows, whether it is a single one)] per axis; None for what only numpy can do."""
    words = list(selection) if isinstance(selection, tuple) else [selection]
    if not all(isinstance(word, int | np.integer | slice) or word is ... for word in words):
        return None
    dots = [n for n, word in enumerate(words) if word is ...] or [len(words)]
    missing = len(shape) - len(words) + (dots[0] < len(words))
    words[dots[0] : dots[0] + 1] = [slice(None)] * missing
    if len(dots) > 1 or len(words) != len(shape):
        return None
    ranges = []
    for word, count in zip(words, shape, strict=True):
        if isinstance(word, slice):
            rows = range(count)[word]
            if rows.step < 0:
                return None
        else:
            rows = range(count)[word : word + 1 or None]
            if not rows:
                raise IndexError(f"index {word} is out of range for {count} rows")
        ranges.append((rows, not isinstance(word, slice)))
    return ranges


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that holds nothing."""
    with suppress(OSError):
        folder.rmdir()


def parts_of(path) -> PartList | None:
    """The parts of the result at `path`, unchecked; None if there is no readable HDF5 file."""
    try:
        with open_file(path) as h5:
            return PartList(h5, path)
    except InputError:
        return None

"""The part files of a joint file, one per rank and named after the run so that two runs never mix.

HDF5 reads a missing part of a virtual dataset as zeros without an error, and a changed one as it is. The joint file
therefore lists its parts in the group `part_files` (names, sizes in bytes, seals: see `checksums`), each part carries
its `run_id` and rank, and rows are put together here rather than by libhdf5.
"""

import math
import os
import re
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

from jampetsc.errors import InputError
from jampetsc.io.atomic import open_regular
from jampetsc.io.checksums import seal_of
from jampetsc.io.formats import PARTS
from jampetsc.io.hdf5 import open_file, opening, values

_PART_NAME = re.compile(r"[^/]+\.parts/[0-9a-f]{12}-rank-\d{4,}\.h5")


def part_name(joint, run_id: str, rank: int) -> str:
    """Path of a rank's part relative to the folder of the joint file; UTF-8, as HDF5 wants it."""
    stem = os.fsencode(Path(joint).stem).decode(errors="replace").replace("\ufffd", "_")
    return f"{stem}.parts/{run_id}-rank-{rank:04d}.h5"


class PartList:
    """The parts that belong to an open joint file; empty for a plain file."""

    def __init__(self, h5, path):
        self.path = Path(path).resolve()
        self.shown = path  # as the user wrote it, for messages
        self.run_id = h5.attrs.get("run_id", "")
        lists = {name: h5[name] for name in PARTS.datasets.rows if isinstance(h5.get(name), h5py.Dataset)}
        PARTS.check(path, lists, {})
        names, sizes, seals = (
            values(lists[name]).tolist() if name in lists else [] for name in PARTS.datasets.rows
        )
        names = [name.decode(errors="replace") for name in names]
        for name in names:
            if not (_PART_NAME.fullmatch(name) and Path(name).name.startswith(f"{self.run_id}-")):
                raise InputError(
                    f"{path}: part {name!r} not a part of run {self.run_id}. Make the file again."
                )
        self.sizes = dict(zip(names, sizes, strict=True))
        self._seals = dict(zip(names, (seal.decode() for seal in seals), strict=True))

    def __bool__(self):
        return bool(self.sizes)

    def check(self) -> None:
        """Raise InputError if a part is missing, truncated, from another run or not the one that was written."""
        for name, size in self.sizes.items():
            try:  # in one system call: the part of a replaced run may be removed at any moment
                size_found = (self.path.parent / name).stat().st_size
            except (FileNotFoundError, NotADirectoryError):
                raise InputError(
                    f"{self.shown}: part {name}: missing. Keep the folder {Path(name).parent} beside "
                    "the file, or make one file of both by `jampetsc merge`."
                ) from None
            if size_found != size:
                raise InputError(
                    f"{self.shown}: part {name} has {size_found} bytes instead of {size}, "
                    "truncated or not copied completely. Copy it again."
                )
        for rank, name in enumerate(self.sizes):
            path = self.path.parent / name
            with opening(path), open_regular(path) as file:
                if seal_of(file) == self._seals[name]:
                    continue
            with open_file(path) as h5:
                run_id, part_rank = h5.attrs.get("run_id"), h5.attrs.get("rank")
            if (run_id, part_rank) != (self.run_id, rank):
                raise InputError(
                    f"{self.shown}: part {name} is rank {part_rank} of run {run_id}, not rank {rank} of run "
                    f"{self.run_id}. Put the right one back."
                )
            raise InputError(
                f"{self.shown}: part {name} damaged, not as it was written. Copy it again, or run again."
            )

    def verify(self) -> None:
        """Raise InputError as `check`, and for a part of which any byte has changed."""
        self.check()
        for name, seal in self._seals.items():
            with open_file(self.path.parent / name, seal):
                pass

    def read(self, data: h5py.Dataset, selection=...):
        """A dataset of the joint file, or a selection of it as numpy takes one. If the parts divide another axis than
        the first, only the selected entries along the first are read from each part.

        Raises InputError where the parts do not make up the whole, ValueError as `hdf5.values`.
        """
        if not data.is_virtual:
            return values(data, selection)
        boxes = sorted(
            (*source.vspace.get_select_bounds(), source.file_name, source.dset_name)
            for source in data.virtual_sources()
        )
        shapes = [tuple(b - a + 1 for a, b in zip(first, last, strict=True)) for first, last, *_ in boxes]
        listed = all(part in self.sizes for *_, part, _ in boxes)
        if not listed or sum(map(math.prod, shapes)) != data.size:
            raise InputError(
                f"{self.shown}: {data.name}: its parts do not make up the whole. Copy or make it again."
            )
        ends = zip(boxes[0][0], boxes[-1][0], strict=True)
        axis = next((n for n, (first, last) in enumerate(ends) if first < last), -1)  # -1: of a single part
        lead, rest = _split(selection, data.shape) if axis else (slice(None), selection)
        pieces = []
        for shape, (*_, part, name) in zip(shapes, boxes, strict=True):
            with open_file(self.path.parent / part, self._seals[part]) as h5:
                if h5[name].shape != shape or h5[name].dtype != data.dtype:
                    raise InputError(f"{self.shown}: part {part} holds other rows. Copy or make it again.")
                pieces.append(values(h5[name], lead))
        return np.concatenate(pieces, axis)[rest]

    def remove(self) -> None:
        """Delete the parts, and their folder once it is empty."""
        for name in self.sizes:
            with suppress(
                OSError
            ):  # such as a folder without permission to write: nothing refers to the part
                (self.path.parent / name).unlink(missing_ok=True)
        for folder in {(self.path.parent / name).parent for name in self.sizes}:
            remove_if_empty(folder)


def _split(selection, shape):
    """(slice along the first axis, selection to apply after it) for a selection of an array of this shape."""
    first, *rest = selection if isinstance(selection, tuple) and selection else (selection,)
    if isinstance(first, int | np.integer):
        row = range(shape[0])[first]
        return slice(row, row + 1), (0, *rest)
    if isinstance(first, slice) and (first.step or 1) > 0:
        return first, (slice(None), *rest)
    return slice(None), selection


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that holds nothing."""
    with suppress(OSError):
        folder.rmdir()


def parts_of(path) -> PartList | None:
    """The parts of the result at `path`, unchecked; None unless it is a readable HDF5 file."""
    try:
        with open_file(path) as h5:
            return PartList(h5, path)
    except InputError:
        return None

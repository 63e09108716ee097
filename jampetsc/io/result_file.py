"""A result, collected in memory by one rank or many and written as one file or as parts beside a joint file.

Every rank writes its rows to its own part; the joint file holds what all ranks share and HDF5 virtual datasets that
name the parts by relative path. One rank writes one plain file. A result appears completely or not at all: the joint
file gets its name last, and the parts of the result it replaces are removed after that.
"""

import os
import uuid
from pathlib import Path

import h5py
import numpy as np

from jampetsc.collective import agreed
from jampetsc.errors import JampetscError
from jampetsc.io.atomic import follow, remove_abandoned, writing
from jampetsc.io.formats import PART_GROUP, check_file
from jampetsc.io.hdf5 import (
    OutputFile,
    as_stored,
    open_file,
    retry_if_replaced,
    set_attributes,
    store,
)
from jampetsc.io.outputs import check_output, check_place
from jampetsc.io.parts import PartList, part_name, parts_of, remove_if_empty
from jampetsc.version import FORMAT_VERSION


class ResultArray:
    """An array of a result: `array[…]` gives a selection, `numpy.asarray(array)` all of it.

    axis     the one along which ranks hold different rows; None: every rank holds all
    counts   numbers of rows of the ranks along `axis`; None with it
    rows     slice of the whole array along `axis` that this rank holds; None with it
    """

    axis = counts = rows = None

    def __len__(self):
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[...], dtype=dtype)


class ArrayInMemory(ResultArray):
    """An array in memory, of which this process holds its own rows."""

    def __init__(self, values, axis=None, comm=None):
        self._values, self.axis = values, axis
        if axis is not None:
            count = np.shape(values)[axis]
            self.counts = [count] if comm is None else comm.allgather(count)
            start = 0 if comm is None else sum(self.counts[: comm.rank])
            self.rows = slice(start, start + count)

    shape = property(lambda self: self._whole().shape)
    dtype = property(lambda self: self._whole().dtype)

    def _whole(self):
        self._values = np.asarray(self._values)  # a list of entries becomes one array when it is first read
        return self._values

    def add(self, entry) -> None:
        """One more entry along axis 0."""
        self._values = [*self._values, entry]

    def gathered(self, comm) -> "ArrayInMemory":
        """With the rows of all ranks. Collective."""
        if comm is None:
            return ArrayInMemory(self[...])
        return ArrayInMemory(np.concatenate(comm.allgather(self[...]), axis=self.axis))

    def __getitem__(self, selection):
        return self._whole()[selection].copy()  # a copy, as reading from a file gives


class ResultWriter:
    """Collects a result of `format`, such as "jampetsc-sweep", and writes it to `path` at the end of its block; path
    None: it stays in memory.

    Every method is collective. `comm` is an mpi4py communicator, or None for one process; `request` has the settings of
    the run. After an exception in the block nothing is written. Its end raises as `write_result`.

    found    attributes by name, as a file gives them
    arrays   dataset name -> ArrayInMemory
    """

    def __init__(self, path, format, comm=None, request=None):
        self.path, self.comm, self.found, self.arrays = path, comm, {}, {}
        recorded = request.recorded if request and (comm is None or comm.rank == 0) else {}
        self.attributes(format=format, format_version=FORMAT_VERSION, run_id=new_run_id(), **recorded)

    def attributes(self, **values) -> None:
        """Collective. Keep scalars, strings and short lists of rank 0 as attributes; None is left out."""
        values = {name: as_stored(value) for name, value in values.items() if value is not None}
        self.found |= values if self.comm is None else self.comm.bcast(values)

    def dataset(self, name, array) -> None:
        """Collective. Keep an array that every rank holds."""
        self.arrays[name] = ArrayInMemory(np.array(array))

    def distributed(self, name, local, axis=0) -> None:
        """Collective. Keep an array whose rows along `axis` are spread over the ranks in rank order.

        `local` holds this rank's rows, maybe none; its other dimensions are the same on all ranks.
        """
        self.arrays[name] = ArrayInMemory(np.array(local), axis, self.comm)

    def append(self, name, local) -> None:
        """Collective. Add rows (n_local, …) as the next entry of an array (F, n, …) distributed along axis 1."""
        if name in self.arrays:
            self.arrays[name].add(np.array(local))
        else:
            self.arrays[name] = ArrayInMemory([np.array(local)], 1, self.comm)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None and self.path is not None:
            write_result(self.path, self.found, self.arrays, self.comm)


def new_run_id() -> str:
    """A random identifier, that tells the parts of one result from all others."""
    return uuid.uuid4().hex[:12]


def write_result(path, attributes: dict, arrays: dict, comm=None) -> None:
    """Collective. Write attributes and arrays, `ResultArray`s, as the result at `path`.

    An earlier result of the same format is replaced; if anything fails it stays, and nothing is left of the new one.
    Raises InputError or JampetscError, on all ranks.
    """
    path, run_id = follow(path), attributes["run_id"]
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    names = [part_name(path, run_id, number) for number in range(size)]
    own_part = path.parent / names[rank]
    joint = part = replaced = None  # the joint file is open on rank 0; one rank is its own part

    def discard():
        for file in (joint, part):
            if file is not None:
                file.discard()
        if size > 1:
            own_part.unlink(missing_ok=True)
            remove_if_empty(own_part.parent)

    try:
        with agreed(comm):
            if rank == 0:  # before the others open theirs
                check_place(path, attributes["format"])
                remove_abandoned(own_part.parent)
                joint = OutputFile(path)
                _store_shared(joint, attributes, arrays)
        with agreed(comm):
            part = joint if size == 1 else _new_part(own_part, run_id, rank)
            _store_rows(part, arrays, rank)
        if size > 1:
            with agreed(comm):
                finished = part.finish()
            finished = comm.gather(finished)
            with agreed(comm):
                if rank == 0:
                    _join(joint, names, *zip(*finished, strict=True), arrays)
            with agreed(comm):
                part.publish()
        with agreed(comm):
            if rank == 0:
                joint.finish()
    except BaseException:
        discard()
        raise
    try:
        with agreed(comm):
            if rank == 0:
                replaced = parts_of(path)
                joint.publish()
    except JampetscError:  # an interrupt leaves the parts: the joint file may have its name already
        discard()
        raise
    if replaced is not None:
        replaced.remove()


def _new_part(path, run_id, rank):
    with writing(path.parent):
        path.parent.mkdir(exist_ok=True)
    part = OutputFile(path)
    part.h5.attrs.update(format="jampetsc-part", run_id=run_id, rank=rank)
    return part


def _store_shared(joint, attributes, arrays):
    """Attributes, arrays that every rank has, and empty ones, of which no rank has a row."""
    set_attributes(joint.h5, attributes)
    for name, array in arrays.items():
        if array.axis is None:
            store(joint.h5, name, array[...])
        elif not sum(array.counts):
            joint.h5.create_dataset(name, shape=array.shape, dtype=array.dtype)
        joint.check()


def _store_rows(part, arrays, rank):
    for name, array in arrays.items():
        if array.axis is not None and array.counts[rank]:
            store(part.h5, name, array, by_entry=array.axis == 1)
        part.check()


def _join(joint, names, sizes, seals, arrays):
    """List the parts, and show their rows as whole arrays."""
    columns = {"names": np.char.encode(names), "sizes": sizes, "seals": np.array(seals, "S")}
    for name, column in columns.items():
        store(joint.h5, f"{PART_GROUP}/{name}", column)
    for name, array in arrays.items():
        if array.axis is None or not sum(array.counts):
            continue
        shape, start = list(array.shape), 0
        shape[array.axis] = sum(array.counts)
        virtual = h5py.VirtualLayout(shape=tuple(shape), dtype=array.dtype)
        for part, count in zip(names, array.counts, strict=True):
            if count:
                shape[array.axis] = count
                rows = (slice(None),) * array.axis + (slice(start, start + count),)
                virtual[rows] = h5py.VirtualSource(part, name, shape=tuple(shape), dtype=array.dtype)
                start += count
        joint.h5.create_virtual_dataset(name, virtual)


@retry_if_replaced
def merge(path, out=None, request=None) -> int:
    """Write the result at `path` as one plain file at `out`, or in place and remove its parts.

    request: settings of the run, which the file at `out` records.

    Returns the number of parts that were joined (0: it was a plain file already). Raises InputError for a
    file or part that is missing or damaged, JampetscError if writing fails; then everything is as it was.
    """
    target = Path(path if out is None else out)
    in_place = os.path.realpath(target) == os.path.realpath(path)
    with open_file(path) as h5:
        kind, _, items = check_file(h5, path)
        parts = PartList(h5, path)
        parts.check()
        if in_place and not parts:
            return 0
        if in_place:
            check_place(target, kind)
        else:
            check_output(target, kind, [path])
        with OutputFile(target) as merged:
            _copy(h5, items, parts, merged)
            if request and not in_place:
                merged.attrs["request"] = request.text
            parts.check()  # gone where a run has replaced the result meanwhile
    if in_place:
        parts.remove()
    return len(parts.sizes)


def _copy(source, items, parts, target):
    target.attrs.update(source.attrs)
    for name, item in items.items():
        if isinstance(item, h5py.Dataset):
            _copy_dataset(item, parts, target, name)
        else:
            target.require_group(name)
        target[name].attrs.update(item.attrs)


def _copy_dataset(item, parts, target, name):
    if not item.is_virtual or item.shape[1:] in ((), (2,), (3,)):  # a row for each disk or contact
        store(target, name, parts.read(item))
        return
    chunks = (1, *item.shape[1:])
    copied = target.create_dataset(name, item.shape, item.dtype, chunks=chunks, fletcher32=True)
    for entry in range(len(item)):  # fields, which may be many
        copied[entry] = parts.read(item, entry)

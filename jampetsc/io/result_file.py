"""Writing a result from one rank or many: part files beside a joint file that shows them as one.

Every rank writes the rows it owns to its own part; the joint file holds what all ranks share and HDF5 virtual
datasets that name the parts by relative path. One rank writes one plain file. A complete result appears or
none: the joint file gets its name last, and the parts of the result it replaces are removed after that.
"""

import uuid
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from jampetsc.collective import agreed
from jampetsc.errors import JampetscError
from jampetsc.io.atomic import follow, remove_abandoned, write_error
from jampetsc.io.hdf5 import OutputFile, set_attributes, store
from jampetsc.io.outputs import check_place
from jampetsc.io.parts import GROUP, part_name, parts_of, remove_if_empty

FORMAT_VERSION = "1.0"


@dataclass
class _Layout:
    """How the rows of a distributed array lie on the ranks."""

    shape: list  # of the whole array
    axis: int
    counts: list  # rows of each rank
    dtype: np.dtype

    def local_shape(self, rank):
        shape = list(self.shape)
        shape[self.axis] = self.counts[rank]
        return tuple(shape)

    def rows(self, rank):
        start = sum(self.counts[:rank])
        return (slice(None),) * self.axis + (slice(start, start + self.counts[rank]),)


class ResultWriter:
    """Writes a result file of `format`, say "jampetsc-sweep". Every method is collective.

    `comm` is an mpi4py communicator, or None for one process; `request` is what was asked for. Use it as a context
    manager: leaving the block closes the file, an exception removes what was written. Raises InputError or
    JampetscError, on all ranks.
    """

    def __init__(self, path, format, comm=None, request=None):
        self.path = follow(path)
        self.comm = comm
        self.rank, self.size = (0, 1) if comm is None else (comm.rank, comm.size)
        self.run_id = uuid.uuid4().hex[:12]
        if comm is not None:
            self.run_id = comm.bcast(self.run_id)
        self._joint = self._part = None  # the joint file is open on rank 0; one rank is its own part
        self._layouts = {}
        self._open = True
        with self._step():
            if self.rank == 0:  # before the others open theirs
                check_place(self.path, format)
                remove_abandoned(self._part_path().parent)
        with self._step():
            if self.rank == 0:
                self._joint = OutputFile(self.path)
            self._part = self._joint if self.size == 1 else self._open_part()
        asked = request.recorded if request else {}
        self.attributes(format=format, format_version=FORMAT_VERSION, run_id=self.run_id, **asked)

    def _part_path(self) -> Path:
        return self.path.parent / part_name(self.path, self.run_id, self.rank)

    def _open_part(self):
        path = self._part_path()
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise write_error(path.parent, error) from None
        part = OutputFile(path)
        part.h5.attrs.update(format="jampetsc-part", run_id=self.run_id, rank=self.rank)
        return part

    @contextmanager
    def _step(self):
        try:
            with agreed(self.comm):
                yield
                for file in (self._joint, self._part):
                    if file is not None:
                        file.check()
        except BaseException:
            self.abort()
            raise

    def attributes(self, **values) -> None:
        """Collective. Store scalars, strings and short lists as attributes; None is left out."""
        with self._step():
            if self.rank == 0:
                set_attributes(self._joint.h5, values)

    def dataset(self, name, array) -> None:
        """Collective. Store an array that every rank holds; rank 0 writes it."""
        with self._step():
            if self.rank == 0:
                store(self._joint.h5, name, array)

    def distributed(self, name, local, axis=0) -> None:
        """Collective. Store an array whose rows along `axis` are spread over the ranks in rank order.

        `local` holds this rank's rows, maybe none; its other dimensions are the same on all ranks.
        """
        local = np.asarray(local)
        layout = self._add_layout(name, local.shape, local.dtype, axis)
        with self._step():
            if layout.counts[self.rank]:
                store(self._part.h5, name, local)

    def append(self, name, local) -> None:
        """Collective. Add rows (n_local, …) as the next entry of an array (F, n, …) distributed along axis 1.

        So a field at many frequencies is never in memory as a whole.
        """
        local = np.asarray(local)
        layout = self._layouts.get(name) or self._add_layout(name, (0, *local.shape), local.dtype, 1)
        layout.shape[0] += 1
        with self._step():
            count = layout.counts[self.rank]
            if count:
                if name not in self._part.h5:
                    self._part.h5.create_dataset(
                        name,
                        shape=(0, *local.shape),
                        dtype=local.dtype,
                        maxshape=(None, *local.shape),
                        chunks=(1, *local.shape),
                        fletcher32=True,
                    )
                data = self._part.h5[name]
                data.resize(layout.shape[0], axis=0)
                data[-1] = local

    def _add_layout(self, name, shape, dtype, axis):
        counts = [shape[axis]] if self.comm is None else self.comm.allgather(shape[axis])
        whole = list(shape)
        whole[axis] = sum(counts)
        self._layouts[name] = _Layout(whole, axis, counts, dtype)
        return self._layouts[name]

    def close(self) -> None:
        """Collective. Make everything durable, then let the joint file appear under its name."""
        for name, layout in self._layouts.items():
            if self.rank == 0 and not sum(layout.counts):  # no part holds any of it
                self._joint.h5.create_dataset(name, shape=tuple(layout.shape), dtype=layout.dtype)
        if self.size > 1:
            with self._step():
                finished = self._part.finish()
            finished = self.comm.gather(finished)
            with self._step():
                if self.rank == 0:
                    self._join(*zip(*finished, strict=True))
            with self._step():
                self._part.publish()
        with self._step():
            if self.rank == 0:
                self._joint.finish()
        try:
            with agreed(self.comm):
                if self.rank == 0:
                    replaced = parts_of(self.path)
                    self._joint.publish()
        except JampetscError:
            self.abort()
            raise
        # an interrupt before this line does not remove the parts: the joint file may have its name already
        self._open = False
        if self.rank == 0 and replaced is not None:
            replaced.remove()

    def _join(self, sizes, seals):
        joint = self._joint.h5
        names = [part_name(self.path, self.run_id, rank) for rank in range(self.size)]
        for name, column in (
            ("names", np.char.encode(names)),
            ("sizes", sizes),
            ("seals", np.array(seals, "S")),
        ):
            store(joint, f"{GROUP}/{name}", column)
        for name, layout in self._layouts.items():
            virtual = h5py.VirtualLayout(shape=tuple(layout.shape), dtype=layout.dtype)
            for rank in range(self.size):
                if layout.counts[rank]:
                    source = h5py.VirtualSource(
                        names[rank], name, shape=layout.local_shape(rank), dtype=layout.dtype
                    )
                    virtual[layout.rows(rank)] = source
            if sum(layout.counts):
                joint.create_virtual_dataset(name, virtual)

    def abort(self) -> None:
        """Remove everything written so far. Not collective; harmless after `close`."""
        if not self._open:
            return
        self._open = False
        for file in (self._joint, self._part):
            if file is not None:
                file.discard()
        if self.size > 1:
            self._part_path().unlink(missing_ok=True)
            remove_if_empty(self._part_path().parent)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            self.close()
        else:
            self.abort()

"""A result that is collected in memory, with the interface of `result_file.ResultWriter`: `reader.collected` reads it.

Rows of distributed arrays stay on their ranks.
"""

import uuid

import numpy as np

from jampetsc.io.hdf5 import as_stored
from jampetsc.io.result_file import FORMAT_VERSION


class MemoryArray:
    """An array of a result in memory, read as `results.StoredArray` is.

    axis   the one along which ranks hold different rows; None: every rank holds all
    rows   slice of the whole array along `axis` that this rank holds; None with it
    grown  whether it was written entry by entry
    """

    def __init__(self, values, axis=None, rows=None, grown=False):
        self._values, self.axis, self.rows, self.grown = values, axis, rows, grown

    shape = property(lambda self: self._whole().shape)
    dtype = property(lambda self: self._whole().dtype)

    def _whole(self):
        self._values = np.asarray(self._values)  # entries become one array once somebody looks
        return self._values

    def add(self, entry) -> None:
        """One more entry along axis 0."""
        self._values = [*self._values, entry]

    def gathered(self, comm) -> "MemoryArray":
        """With the rows of all ranks. Collective."""
        if comm is None:
            return MemoryArray(self[...])
        return MemoryArray(np.concatenate(comm.allgather(self[...]), axis=self.axis))

    def __getitem__(self, selection):
        return self._whole()[selection].copy()  # of its own, as if it were read

    def __len__(self):
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[...], dtype=dtype)


class MemoryWriter:
    """Collects a result of `format`, say "jampetsc-sweep", as `ResultWriter` writes it. Every method is collective.

    `comm` is an mpi4py communicator, or None for one process.

    found    attributes by name, as a file gives them
    arrays   dataset name -> MemoryArray
    """

    def __init__(self, format, comm=None, request=None):
        self.comm, self.found, self.arrays = comm, {}, {}
        asked = request.recorded if request else {}
        self.attributes(format=format, format_version=FORMAT_VERSION, run_id=uuid.uuid4().hex[:12], **asked)

    def attributes(self, **values) -> None:
        """Collective. Keep scalars, strings and short lists of rank 0 as attributes; None is left out."""
        values = {name: as_stored(value) for name, value in values.items() if value is not None}
        self.found |= values if self.comm is None else self.comm.bcast(values)

    def dataset(self, name, array) -> None:
        """Collective. Keep an array that every rank holds."""
        self._add(name, MemoryArray(np.array(array)))

    def distributed(self, name, local, axis=0) -> None:
        """Collective. Keep this rank's rows of an array whose rows along `axis` are spread over the ranks in order."""
        local = np.array(local)
        self._add(name, MemoryArray(local, axis, self._rows(local.shape[axis])))

    def append(self, name, local) -> None:
        """Collective. Add rows (n_local, …) as the next entry of an array (F, n, …) distributed along axis 1."""
        local = np.array(local)
        if name in self.arrays:
            self.arrays[name].add(local)
        else:
            self._add(name, MemoryArray([local], 1, self._rows(len(local)), grown=True))

    def _add(self, name, array):
        if name in self.arrays:
            raise ValueError(f"dataset {name} is there already")
        self.arrays[name] = array

    def _rows(self, count):
        counts = [count] if self.comm is None else self.comm.allgather(count)
        start = sum(counts[: self.comm.rank]) if self.comm else 0
        return slice(start, start + count)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        pass

"""HDF5 as jampetsc writes and reads it.

Every defect of a file becomes one line: which file, what is wrong, what to do. Files are written with HDF5's checksums
of metadata and data, which protect them in other programs, and with a hash of every byte (see `checksums`), which is
checked before libhdf5 reads the file. Files of other programs are read as h5py reads them.
"""

import glob
import io
import os
from contextlib import contextmanager
from functools import wraps

import h5py
import numpy as np

from jampetsc import interrupts
from jampetsc.errors import InputError, python_value
from jampetsc.io.atomic import NewFile, open_regular, remove_abandoned
from jampetsc.io.checksums import Damaged, append_seal, seal_of, verify

MAJOR_VERSION = 2  # that is read
_DAMAGE_ERRORS = (OSError, RuntimeError, LookupError, ValueError, TypeError, ArithmeticError, AttributeError)


class OutputFile(NewFile):
    """An HDF5 file `.h5` under a temporary name, as `NewFile`; as a context manager it yields the h5py.File."""

    def __init__(self, path):
        super().__init__(path)
        remove_abandoned(self.path.parent, glob.escape(self.path.name))
        self.h5 = _create(self.stream)

    def finish(self) -> tuple[int, str]:
        """Close, seal and fsync; returns size in bytes and seal. The temporary name stays."""
        self.h5.close()
        digest = append_seal(self.stream)
        return super().finish(), digest

    def discard(self) -> None:
        """Close and remove the temporary file, if it is still there."""
        self.stream.error = self.stream.error or OSError("discarded")  # no use in flushing
        self.h5.close()
        super().discard()

    def __enter__(self) -> h5py.File:
        return self.h5


def _create(stream) -> h5py.File:
    """An empty HDF5 file of format 1.10, whose metadata have checksums. The same contents give the same bytes."""
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, stream)
    creation = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    return h5py.File(h5py.h5f.create(b"new", h5py.h5f.ACC_TRUNC, creation, access))


def store(h5, name, array, by_entry=False) -> h5py.Dataset:
    """A dataset of this name with the values of `array`, under checksums unless it is a single number or empty.

    by_entry   its entries along the first axis will be read one by one
    """
    array = np.asarray(array)
    filled = bool(array.ndim and array.size)
    chunks = (1, *array.shape[1:]) if by_entry and filled else None
    return h5.create_dataset(name, data=array, chunks=chunks, fletcher32=filled or None)


@contextmanager
def open_file(path, seal=None):
    """Context: the h5py.File, open for reading. Raises InputError as `opening`, and as `reading` in the block.

    seal   hash in the line of checksums that the file has to have (`checksums.seal_of`); None: any

    Virtual datasets must not be read from it as they are: see `PartList.read`. A Ctrl-C is raised before.
    """
    interrupts.check()
    with opening(path):
        h5 = _from_stream(open_regular(path), seal)
    with h5, reading(path):
        yield h5


def _from_stream(file, seal):
    """The h5py.File that reads an open file and takes it over. Raises Damaged, or OSError if it is not HDF5."""
    file = _Source(file.detach())
    try:
        verify(file)
        if seal not in (None, seal_of(file)):
            raise Damaged("not the one that was written")
        return h5py.File(file, "r")
    except BaseException:
        file.close()
        raise


class _Source(io.BufferedReader):
    """A file that is closed with its last reference: libhdf5 does not close the file that it reads from."""

    def __del__(self):
        self.close()


def values(data: h5py.Dataset, selection=...):
    """The values of a dataset, or a selection. Raises ValueError for a virtual dataset, which lies in other files."""
    if data.is_virtual or data.external:
        raise ValueError(f"dataset {data.name} lies in other files")
    return data[selection]


@contextmanager
def opening(path):
    """Context: turns an OSError on opening into InputError: missing, no permission, not HDF5, truncated."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: no such file. Check its name.") from None
    except PermissionError:
        raise InputError(f"{path}: no permission to read it. Change its permissions.") from None
    except OSError as error:
        raise InputError(f"{path}: {_explain(error)}") from None


def _explain(error) -> str:
    if isinstance(error, Damaged):
        return f"damaged ({error}). Copy or make it again."
    if "truncated file" in str(error):
        return "truncated, not written or copied completely. Copy or make it again."
    if "signature not found" in str(error):
        return "not an HDF5 file. Give a file of jampetsc, or read packings of other programs by `jampetsc import`."
    reason = error.strerror or " ".join(str(error).split())
    return f"not readable as HDF5 ({reason}). Copy or make it again."


@contextmanager
def reading(path):
    """Context: turns what h5py and numpy raise on damaged contents into InputError naming `path`."""
    try:
        yield
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(
            f"{path}: larger than the memory ({error}). Use more nodes, or make the file again."
        ) from None
    except _DAMAGE_ERRORS as error:
        text = " ".join(str(error).strip("'\"").split())
        raise InputError(f"{path}: damaged ({text}). Copy or make it again.") from None


def retry_if_replaced(action):
    """Decorator: repeats `action(path, …)` if it failed because a run replaced the file at `path` meanwhile."""

    @wraps(action)
    def again(path, *more):
        while True:
            previous = _identity(path)
            try:
                return action(path, *more)
            except InputError:
                if _identity(path) == previous:
                    raise

    return again


def _identity(path):
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def set_attributes(h5, values: dict) -> None:
    """Store attributes, None left out. Bytes of a file name that are no text are stored as escapes: \\udcff."""
    for name, value in values.items():
        if value is not None:
            h5.attrs[name] = _escaped(value)


def _escaped(value):
    return value.encode(errors="backslashreplace").decode() if isinstance(value, str) else value


def attributes(h5) -> dict:
    """Attributes as Python strings, numbers, booleans or (for lists) numpy arrays."""
    return {_plain(name): _plain(value) for name, value in h5.attrs.items()}


def as_stored(value):
    """An attribute's value as `attributes` gives it once `set_attributes` has stored it."""
    if isinstance(value, str | bytes):
        return _plain(_escaped(value))
    array = np.array(value)
    return _plain((array.astype(object) if array.dtype.kind == "U" else array)[()])


def _plain(value):
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    if isinstance(value, np.generic):
        number = python_value(value)
        return _plain(number) if isinstance(number, bytes) else number
    if isinstance(value, np.ndarray) and value.shape == (1,):  # how many other writers store a scalar
        return _plain(value[0])
    return value


def check_format(path, attrs: dict, expected: str | None = None) -> str:
    """The file's `format`.

    Raises InputError if it is not one of ours, not the `expected` one, or of another major version.
    """
    name = attrs.get("format")
    if not isinstance(name, str) or not name.startswith("jampetsc-"):
        raise InputError(
            f"{path}: attribute format = {name!r}: not a jampetsc file. Read packings of other programs by "
            "`jampetsc import`."
        )
    if expected is not None and name != expected:
        raise InputError(f"{path}: a {name} file. Give a {expected} file.")
    version = str(attrs.get("format_version", MAJOR_VERSION))
    if not version.split(".")[0].isdigit():
        raise InputError(
            f"{path}: attribute format_version = {version!r}: must be a number such as {MAJOR_VERSION}.0"
        )
    if (major := int(version.split(".")[0])) != MAJOR_VERSION:
        writer = attrs.get("jampetsc_version")
        remedy = f"Use jampetsc {writer} or newer." if writer else "Use a newer jampetsc."
        if major < MAJOR_VERSION:
            remedy = "Make the file again."
        raise InputError(
            f"{path}: format_version {version}, but this jampetsc reads {MAJOR_VERSION}.x. {remedy}"
        )
    return name

"""Output files that are complete or absent: temporary name, fsync, rename, fsync of the folder.

HDF5 writes through a Python stream that remembers the first failed write and swallows those after it, so that
the library closes in good order. By itself it crashes the interpreter at exit after a full disk (HDF5 1.10).
"""

import errno
import fcntl
import glob
import io
import os
import socket
from contextlib import suppress
from pathlib import Path

import h5py

from jampetsc.errors import InputError, JampetscError
from jampetsc.storage.regular import kind

_FULL = {
    errno.ENOSPC: "disk full",
    errno.EDQUOT: "disk quota used up",
    errno.EFBIG: "file size limit reached",
}
_REFUSED = (
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.ENAMETOOLONG,
)


def write_whole(path, content: bytes) -> None:
    """Write a small file complete or not at all, in the place of what was there. Raises JampetscError."""
    path = Path(os.path.realpath(path))
    _require_regular(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise write_error(path, error) from None


def write_error(path, error: OSError) -> JampetscError:
    """The one-line error for a failed write to `path`."""
    if error.errno in _FULL:
        return JampetscError(f"{path}: {_FULL[error.errno]}: make room, then run the same command again")
    if error.errno in _REFUSED:
        return InputError(f"{path}: cannot be written ({os.strerror(error.errno)}): choose another --out")
    return JampetscError(f"{path}: writing failed: {' '.join(str(error.strerror or error).split())}")


def check_writable(path) -> None:
    """Raise InputError unless a file could be put at `path` now. Call it before long work."""
    path = follow(path)
    try:
        _require_regular(path)
        if not path.parent.is_dir():
            raise InputError(f"{path}: folder {path.parent} does not exist: create it first")
        if path.exists() and not os.access(path, os.W_OK):
            raise InputError(f"{path}: exists and is write-protected: choose another --out")
        probe = _temporary_name(path)
        probe.touch()
        probe.unlink(missing_ok=True)
    except OSError as error:
        raise write_error(path, error) from None


def _require_regular(path):
    """Raise InputError if there is something at `path`, links followed, that no file may replace."""
    found = kind(os.stat(path).st_mode) if os.path.exists(path) else None
    if found == "a folder":
        raise InputError(f"{path}: is a folder: give a file name with --out")
    if found is not None:
        raise InputError(
            f"{path}: is {found}, which a file would replace: give the name of a file with --out"
        )


def sync_folder(folder) -> None:
    """Make renames and removals in `folder` durable, where its file system can."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:  # some network file systems refuse it; the rename itself has happened
        pass
    finally:
        os.close(handle)


def follow(path) -> Path:
    """The file a symbolic link stands for, so that the link survives; any other path as it is."""
    return Path(os.path.realpath(path)) if Path(path).is_symlink() else Path(path)


def remove_abandoned(folder, name="*") -> None:
    """Remove temporary files of `name` (a glob pattern) that a killed process of this machine left behind."""
    for leftover in Path(folder).glob(f".{name}.{glob.escape(socket.gethostname())}.*.partial"):
        try:
            with open(leftover, "rb") as file:
                fcntl.flock(
                    file, fcntl.LOCK_EX | fcntl.LOCK_NB
                )  # its writer holds this lock as long as it lives
                leftover.unlink()
        except OSError:
            continue


def _temporary_name(path) -> Path:
    path = Path(path)
    return path.with_name(f".{path.name}.{socket.gethostname()}.{os.getpid()}.partial")


def _lock(file) -> None:
    with suppress(OSError):  # a file system without locks: an abandoned file then stays
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class _Stream(io.FileIO):
    """Binary file that keeps the first error of a write, also an interrupt, for `OutputFile.check`."""

    error = None

    def write(self, data):
        if self.error is None:
            try:
                view, done = memoryview(data).cast("B"), 0
                while done < len(view):
                    done += super().write(view[done:])
            except BaseException as error:
                self.error = error
        return len(data)

    def truncate(self, size=None):
        if self.error is None:
            try:
                return super().truncate(size)
            except BaseException as error:
                self.error = error
        return size


class OutputFile:
    """An HDF5 file `.h5` under a temporary name: `finish` makes it durable, `publish` gives it its name.

    As a context manager it yields the h5py.File and does both, or `discard` after an exception.
    Raises InputError or JampetscError where writing fails.
    """

    def __init__(self, path):
        self.path = follow(path)
        _require_regular(self.path)
        self.temporary = _temporary_name(self.path)
        remove_abandoned(self.path.parent, glob.escape(self.path.name))
        try:
            self._stream = _Stream(self.temporary, "w+b")
            _lock(self._stream)
        except OSError as error:
            raise write_error(path, error) from None
        self.h5 = h5py.File(self._stream, "w")

    def check(self) -> None:
        """Raise the error of an earlier write that failed."""
        error = self._stream.error
        if isinstance(error, OSError):
            raise write_error(self.path, error) from None
        if error is not None:
            raise error

    def finish(self) -> int:
        """Close, check and fsync; returns the size in bytes. The temporary name stays."""
        self.h5.close()
        self.check()
        try:
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise write_error(self.path, error) from None
        size = os.fstat(self._stream.fileno()).st_size
        self._stream.close()
        return size

    def publish(self) -> None:
        """Rename onto the final name, replacing an earlier file."""
        try:
            os.replace(self.temporary, self.path)
            sync_folder(self.path.parent)
        except OSError as error:
            raise write_error(self.path, error) from None

    def discard(self) -> None:
        """Close and remove the temporary file, if it is still there."""
        self._stream.error = self._stream.error or OSError(errno.ECANCELED, "discarded")  # no use in flushing
        self.h5.close()
        self._stream.close()
        self.temporary.unlink(missing_ok=True)

    def __enter__(self) -> h5py.File:
        return self.h5

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                self.finish()
                self.publish()
        finally:
            self.discard()

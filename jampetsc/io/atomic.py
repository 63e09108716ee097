"""Files: reading only regular ones, and writing whole ones or none: temporary name, fsync, rename, fsync of the folder.

A temporary file is named `.NAME.HOST.PID-xxxxxxxx.partial` and locked as long as its writer lives. One without a lock
was left behind by a killed process, and the next run with the same output removes it.
"""

import errno
import fcntl
import glob
import io
import os
import secrets
import socket
import stat
from contextlib import contextmanager, suppress
from pathlib import Path

from jampetsc.errors import InputError, JampetscError, named


def open_regular(path):
    """A regular file, links followed, open for reading in binary.

    Raises InputError for anything else, OSError where it cannot be opened. Never waits: a pipe has no end to be
    waited for, and reading a device may change it.
    """
    _require_regular(path, "Give a regular file.")
    return open(path, "rb")


def _require_regular(path, remedy):
    """Raise InputError, which ends with a remedy, unless a regular file is at `path`, links followed."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: {'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}. {remedy}")


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


def write_whole(path, content: bytes, through_link: bool = True) -> None:
    """Write a small file completely or not at all, replacing what was there; parameters and errors of `NewFile`."""
    with NewFile(path, through_link) as file:
        file.stream.write(content)


def refuse_links(*paths) -> None:
    """Raise InputError where one of these is a symbolic link: writing there would change what lies elsewhere."""
    for path in paths:
        if os.path.islink(path):
            raise _link_error(path)


def _link_error(path):
    return InputError(f"{path}: a symbolic link, by which files elsewhere would change. Remove it.")


def write_error(path, error: OSError) -> JampetscError:
    """The one-line error for a failed write to `path`."""
    if error.errno == errno.ELOOP:
        return _link_error(path)
    if error.errno in _FULL:
        return JampetscError(f"{path}: {_FULL[error.errno]}. Make room, then run the same command again.")
    if error.errno in _REFUSED:
        return InputError(
            f"{path}: not writable ({os.strerror(error.errno)}). Choose another {named('out')}."
        )
    return JampetscError(
        f"{path}: writing failed ({' '.join(str(error.strerror or error).split())}). Run the same command again."
    )


@contextmanager
def writing(path):
    """Context: turns an OSError of a failed write to `path` into `write_error`."""
    try:
        yield
    except OSError as error:
        raise write_error(path, error) from None


def check_writable(path) -> None:
    """Raise InputError unless a file could be put at `path` now. Call it before long work."""
    with writing(path):
        path = follow(path)
        _require_replaceable(path)
        if not path.parent.is_dir():
            raise InputError(f"{path}: no folder {path.parent}. Create it first.")
        if path.exists() and not os.access(path, os.W_OK):
            raise InputError(f"{path}: write-protected. Choose another {named('out')}.")
        remove_abandoned(path.parent, glob.escape(path.name))
        NewFile(path).discard()


def _require_replaceable(path):
    """Raise InputError if there is something other than a regular file at `path`, links followed."""
    if os.path.exists(path):
        _require_regular(path, f"Give another file with {named('out')}.")


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
        with suppress(OSError):
            handle = os.open(leftover, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
            try:
                # its writer holds this as long as it lives
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                leftover.unlink()
            finally:
                os.close(handle)


def locked(path):
    """The file at `path`, created if need be and locked by this process until it is closed; None if another process has
    the lock.

    The lock ends with its process, so that a killed run can continue at once. On a file system without locks the file
    is not locked. Raises OSError where it cannot be opened, also where it is a symbolic link.
    """
    while True:
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666), "r+")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                file.close()
                return None
        if os.fstat(file.fileno()).st_nlink:  # else the process that had it has just removed it
            return file
        file.close()


class FileStream(io.FileIO):
    """Binary file that raises no error of a write, also no interrupt, but keeps the first one for `NewFile.check`.

    HDF5 writes through it. HDF5 1.10 crashes the interpreter at exit if a write has failed; through this file it always
    closes normally, even after the file itself was closed.
    """

    error = None

    def _try(self, action, instead):
        if self.error is None and not self.closed:
            try:
                return action()
            except BaseException as error:
                self.error = error
        return instead

    def write(self, data):
        self._try(lambda: self.write_all(memoryview(data).cast("B")), None)
        return len(data)

    def write_all(self, view):
        done = 0
        while done < len(view):
            done += super().write(view[done:])

    def seek(self, offset, whence=os.SEEK_SET):
        return self._try(lambda: super(FileStream, self).seek(offset, whence), offset)

    def truncate(self, size=None):
        return self._try(lambda: super(FileStream, self).truncate(size), size)


class NewFile:
    """A file under a temporary name: `finish` makes it durable, `publish` gives it its name.

    Write through `stream`. As a context manager it is finished and published at the end of the block, and discarded
    after an exception. Raises InputError or JampetscError where writing fails.

    through_link   whether a symbolic link at `path` stays and the file that it stands for is replaced
    """

    def __init__(self, path, through_link: bool = True):
        with writing(path):
            refuse_links(*[] if through_link else [path])
            self.path = follow(path)
            _require_replaceable(self.path)
            self.temporary, self.stream = _new_stream(self.path)

    def check(self) -> None:
        """Raise the error of an earlier write that failed."""
        if self.stream.error is not None:
            with writing(self.path):
                raise self.stream.error

    def finish(self) -> int:
        """Check, fsync and close; returns the size in bytes. The temporary name stays."""
        self.check()
        with writing(self.path):
            os.fsync(self.stream.fileno())
        size = os.fstat(self.stream.fileno()).st_size
        self.stream.close()
        return size

    def publish(self) -> None:
        """Rename onto the final name, replacing an earlier file."""
        with writing(self.path):
            os.replace(self.temporary, self.path)
            sync_folder(self.path.parent)

    def discard(self) -> None:
        """Close and remove the temporary file, if it is still there."""
        self.stream.close()
        self.temporary.unlink(missing_ok=True)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                self.finish()
                self.publish()
        finally:
            self.discard()


def _new_stream(path):
    """(name, stream) of a new temporary file for `path`, locked so that no process takes it for an abandoned one."""
    while True:
        mark = f"{socket.gethostname()}.{os.getpid()}-{secrets.token_hex(4)}"
        name = path.with_name(f".{path.name}.{mark}.partial")
        stream = FileStream(name, "x+b")
        with suppress(OSError):  # a file system without locks: an abandoned file then stays
            fcntl.flock(stream, fcntl.LOCK_EX)  # waits for a process that checks whether it is abandoned
        if os.fstat(stream.fileno()).st_nlink:  # else it was removed as abandoned before it was locked
            return name, stream
        stream.close()

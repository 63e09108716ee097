"""Regular files only: what is read ends, and what is replaced is no pipe and no device."""

import os
import stat

from jampetsc.errors import InputError

_KINDS = {  # type of a file -> in words
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def kind(mode) -> str | None:
    """What `mode` of os.stat says that a file is, in words; None for a regular file."""
    return _KINDS.get(stat.S_IFMT(mode), None if stat.S_ISREG(mode) else "a special file")


def open_regular(path):
    """A regular file, links followed, open for reading in binary.

    Raises InputError for anything else, OSError where it cannot be opened. Never waits: a pipe has no end to be
    waited for, and reading a device may change it.
    """
    _require(path, os.stat(path))
    file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")
    try:
        _require(path, os.fstat(file.fileno()))  # another one may have taken its place
    except InputError:
        file.close()
        raise
    return file


def _require(path, status):
    found = kind(status.st_mode)
    if found == "a folder":
        raise InputError(f"{path}: is a folder: give the file in it")
    if found is not None:
        raise InputError(f"{path}: is {found}: give a regular file, such as a copy of what comes out of it")

"""Only regular files are read or replaced: no pipes, which need not end, and no devices."""

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
_READ = ("give the file in it", "give a regular file, such as a copy of what comes out of it")


def open_regular(path):
    """A regular file, links followed, open for reading in binary.

    Raises InputError for anything else, OSError where it cannot be opened. Never waits: a pipe has no end to be
    waited for, and reading a device may change it.
    """
    require_regular(path, *_READ)
    return open(path, "rb")


def require_regular(path, folder, other) -> None:
    """Raise InputError unless a regular file is at `path`; folder, other: remedies for a folder and for others."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        found = _KINDS.get(stat.S_IFMT(mode), "a special file")
        raise InputError(f"{path}: is {found}: {folder if found == 'a folder' else other}")

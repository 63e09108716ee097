"""A hash over every byte of a file, checked before libhdf5 reads it.

HDF5 has checksums of its own, and jampetsc's files have them. They are not enough: of 2500 files damaged at random 26
gave wrong numbers or words and 37 ended the process (HDF5 1.10: zeros pass fletcher32, texts have no checksum, and
links and virtual datasets are parsed before theirs is checked). What jampetsc writes therefore ends, after the HDF5
content, with

    one line of LINE bytes: jampetsc-sha256 <bytes of content> <sha256 of the content>

A process compares a file with its line once, 1 GB in 0.6 s. The hash in the line identifies the file, and a joint file
keeps the hashes of its parts.

Other programs see plain HDF5, whose header says where the content ends. A program that changes the file cuts off what
follows, as libhdf5 does on closing: an edited file has no checksums, and is read like one of any other program.
Anything else after the content is damage.
"""

import hashlib
import os

from jampetsc.errors import InputError
from jampetsc.io.atomic import open_regular

BLOCK = 1 << 18  # bytes hashed at a time
LINE = 128
_MAGIC = b"jampetsc-sha256 "
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # of HDF5
_verified = set()  # device, inode, size and time of files that this process has compared with their line


class Damaged(OSError):
    """The bytes of a file are not as they were written."""


def append_seal(file) -> str:
    """Append the checksums of all of `file`, open for reading and writing; returns the hash in its line."""
    size = file.seek(0, os.SEEK_END)
    digest = _digest(file, size)
    file.seek(size)
    file.write(_line(size, digest))
    return digest


def seal_of(file) -> str | None:
    """The hash in the line of checksums of an open file, None for a file without it."""
    line = _parse(file)
    return line and line[1]


def verify(file) -> None:
    """Raise Damaged unless an open file is what its checksums say, or one of another program that has none."""
    status, line = os.fstat(file.fileno()), _parse(file)
    if line is None:
        return _check_end(file, status.st_size)
    seen = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
    if seen not in _verified:
        _compare(file, *line)
        _verified.add(seen)


def identity_of(path, every_byte: bool = False) -> str | None:
    """The hash that identifies a file: the one in its line of checksums, or the sha256 of a file without that line.

    None where the file is missing, cannot be read, or does not agree with its checksums.

    Of a file with checksums only the end is read, unless `every_byte` is to be compared with them.
    """
    try:
        with open_regular(path) as file:
            digest = seal_of(file)
            if digest is None:
                file.seek(0)
                return hashlib.file_digest(file, "sha256").hexdigest()
            if every_byte:
                _compare(file, *_parse(file))
            return digest
    except (OSError, InputError):
        return None


def _compare(file, size, digest):
    if file.seek(0, os.SEEK_END) != size + LINE:
        raise Damaged("its length is not the one it was written with")
    if _digest(file, size) != digest:
        raise Damaged("its bytes are not those that were written")


def _digest(file, size):
    """sha256 of the first `size` bytes of a file."""
    digest = hashlib.sha256()
    file.seek(0)
    for start in range(0, size, BLOCK):
        digest.update(file.read(min(BLOCK, size - start)))
    return digest.hexdigest()


def _line(size, digest):
    return (_MAGIC + b"%d %s" % (size, digest.encode())).ljust(LINE - 1) + b"\n"


def _parse(file):
    """(bytes of content, hash) of the line at the end of a file, None without one."""
    file.seek(max(0, file.seek(0, os.SEEK_END) - LINE))
    line = file.read(LINE)
    words = line.split()
    if not line.startswith(_MAGIC) or len(words) != 3 or not words[1].isdigit():
        return None
    fields = int(words[1]), words[2].decode(errors="replace")
    return fields if line == _line(*fields) else None


def _check_end(file, size):
    """Raise Damaged if bytes follow the end that HDF5's own header gives: remains of checksums."""
    file.seek(0)
    start = file.read(48)
    if start.startswith(SIGNATURE) and start[8:10] in (b"\2\10", b"\3\10"):  # as jampetsc's own files
        end = int.from_bytes(start[28:36], "little")
        if size > end:
            raise Damaged(
                f"truncated or changed: {size - end} bytes follow its end and are no checksums of it"
            )

"""A hash over every byte of a file, checked before libhdf5 reads it.

HDF5 has checksums of its own, and jampetsc's files have them. They are not enough: of 2500 files damaged at random 26
gave wrong numbers or words and 37 ended the process (HDF5 1.10: zeros pass fletcher32, texts have no checksum, and
links and virtual datasets are parsed before theirs is checked). What jampetsc writes therefore ends, after the HDF5
content, with

    sha256 of each BLOCK of the content, 32 bytes each
    one line of LINE bytes: jampetsc-checksums 1 <bytes of content> <BLOCK> <sha256 of the numbers and hashes before>

A process compares a file with its line once, 1 GB in 0.6 s. The hash in the line stands for the whole content: it
identifies the file, and a joint file keeps the hashes of its parts.

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
_MAGIC = b"jampetsc-checksums 1 "
_DIGEST = hashlib.sha256().digest_size
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # of HDF5
_verified = set()  # device, inode, size and time of files that this process has compared with their line


class Damaged(OSError):
    """The bytes of a file are not as they were written."""


def append_seal(file) -> str:
    """Append the checksums of all of `file`, open for reading and writing; returns the hash in its line."""
    size = file.seek(0, os.SEEK_END)
    hashes = _hashes(file, size, BLOCK)
    digest = _digest(size, BLOCK, hashes)
    file.seek(size)
    file.write(hashes)
    file.write(_line(size, BLOCK, digest))
    return digest


def seal_of(file) -> str | None:
    """The hash in the line of checksums of an open file, None for a file without it."""
    line = _parse(file)
    return line and line[2]


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


def _compare(file, size, block, digest):
    if file.seek(0, os.SEEK_END) != size + _DIGEST * -(-size // block) + LINE:
        raise Damaged("its length is not the one it was written with")
    if _digest(size, block, _hashes(file, size, block)) != digest:
        raise Damaged("its bytes are not those that were written")


def _hashes(file, size, block):
    file.seek(0)
    return b"".join(
        hashlib.sha256(file.read(min(block, size - start))).digest() for start in range(0, size, block)
    )


def _digest(size, block, hashes):
    return hashlib.sha256(b"%d %d " % (size, block) + hashes).hexdigest()


def _line(size, block, digest):
    return (_MAGIC + b"%d %d %s" % (size, block, digest.encode())).ljust(LINE - 1) + b"\n"


def _parse(file):
    """(bytes of content, bytes of a block, hash) of the line at the end of a file, None without one."""
    file.seek(max(0, file.seek(0, os.SEEK_END) - LINE))
    line = file.read(LINE)
    words = line.split()
    if not line.startswith(_MAGIC) or len(words) != 5 or not all(word.isdigit() for word in words[2:4]):
        return None
    fields = int(words[2]), int(words[3]), words[4].decode(errors="replace")
    return fields if line == _line(*fields) and fields[1] else None


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

"""A hash over every byte of a file, looked at before anything else reads these bytes.

libhdf5 trusts a file: bytes that a disk or a network has changed end it by a signal or an endless loop, or change
numbers in silence. What jampetsc writes therefore ends, after the HDF5 content, with

    sha256 of each BLOCK of the content, 32 bytes each
    one line of LINE bytes: jampetsc-checksums 1 <bytes of content> <BLOCK> <sha256 of the numbers and hashes before>

and HDF5 reads such a file through `Verified`, which hands out nothing but bytes whose hash is right. A block is read
and hashed when something in it is asked for: of 10 GB of fields one field costs its own blocks. The line alone stands
for the whole content; a joint file keeps the lines' hashes of its parts.

Other programs see plain HDF5: its own header says where the content ends. One that changes the file cuts off what
follows, as libhdf5 does on closing: an edited file has no checksums, and is read like one of any other program. What is
left after the content but is no list of checksums is damage.
"""

import hashlib
import io
import os
from collections import OrderedDict

from jampetsc.errors import InputError
from jampetsc.storage.regular import open_regular

BLOCK = 1 << 18  # bytes hashed at a time; 10 GB have 1.3 MB of hashes
LINE = 128
_MAGIC = b"jampetsc-checksums 1 "
_DIGEST = hashlib.sha256().digest_size
_HELD = 8  # blocks kept in memory: HDF5 reads its metadata in small pieces here and there
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # of HDF5


class Damaged(OSError):
    """The bytes of a file are not those that were written."""


def seal(file) -> str:
    """Append the checksums of all of `file`, open for reading and writing; returns the hash in its line."""
    size = file.seek(0, os.SEEK_END)
    hashes = b"".join(
        hashlib.sha256(_read(file, start, min(BLOCK, size - start))).digest()
        for start in range(0, size, BLOCK)
    )
    digest = _digest(size, BLOCK, hashes)
    file.write(hashes)
    file.write(_line(size, BLOCK, digest))
    return digest


def seal_of(file) -> str | None:
    """The hash in the line of checksums of an open file, None where there is no such line."""
    found = _parse(file)
    return found and found[2]


def identity_of(path, every_byte: bool = False) -> str | None:
    """What a file is known by: the hash in its line of checksums, which stands for all that was written, or the
    sha256 of a file without that line. None where it is missing, cannot be read, or is not what its checksums say.

    Looks at the end of a sealed file alone, unless `every_byte` is to be compared with its checksums.
    """
    try:
        with open_regular(path) as file:
            digest = seal_of(file)
            if digest is None:
                file.seek(0)
                return hashlib.file_digest(file, "sha256").hexdigest()
            content = Verified(file)  # looks at the length
            while every_byte and content.read(BLOCK):
                pass
            return digest
    except (OSError, InputError):
        return None


class Verified(io.RawIOBase):
    """The content of a sealed file, open for reading: bytes are compared with their hash before they are handed out.

    `file` is a binary file, closed with this. Raises Damaged, here and on reading. `sealed` is False for a file without
    checksums, of which every byte is handed out as it is.
    """

    def __init__(self, file):
        self._file, self._place, self._blocks = file, 0, OrderedDict()
        self._size = file.seek(0, os.SEEK_END)
        found = _parse(file)
        self.sealed = found is not None
        if not self.sealed:
            _check_end(file, self._size)
            return
        length, self._size = self._size, found[0]
        self._block, digest = found[1:]
        count = -(-self._size // self._block)
        if length != self._size + _DIGEST * count + LINE:
            raise Damaged("its length is not the one it was written with")
        self._hashes = _read(file, self._size, _DIGEST * count)
        if _digest(self._size, self._block, self._hashes) != digest:
            raise Damaged("the list of checksums is not the one it was written with")

    def readinto(self, buffer):
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self._size - self._place))
        done = 0
        while done < count:
            piece = self._piece(count - done)
            view[done : done + len(piece)] = piece
            done += len(piece)
            self._place += len(piece)
        return count

    def _piece(self, wanted):
        """Some bytes from `_place` on, at most `wanted`."""
        if not self.sealed:
            return _read(self._file, self._place, wanted)
        number, start = divmod(self._place, self._block)
        if number not in self._blocks:
            begin = number * self._block
            block = _read(self._file, begin, min(self._block, self._size - begin))
            if hashlib.sha256(block).digest() != self._hashes[_DIGEST * number : _DIGEST * (number + 1)]:
                raise Damaged(f"bytes {begin} to {begin + len(block)} are not those that were written")
            self._blocks[number] = block
            if len(self._blocks) > _HELD:
                self._blocks.popitem(last=False)
        self._blocks.move_to_end(number)
        return memoryview(self._blocks[number])[start : start + wanted]

    def seek(self, offset, whence=os.SEEK_SET):
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = base + offset
        return self._place

    def tell(self):
        return self._place

    def readable(self):
        return True

    def seekable(self):
        return True

    def close(self):
        if not self.closed:
            self._file.close()
        super().close()


def _read(file, start, count):
    """Exactly `count` bytes from `start` on. Raises Damaged where the file ends before."""
    file.seek(start)
    content = file.read(count)
    if len(content) != count:
        raise Damaged(f"truncated: it ends {count - len(content)} bytes too early")
    return content


def _digest(size, block, hashes):
    return hashlib.sha256(b"%d %d " % (size, block) + hashes).hexdigest()


def _line(size, block, digest):
    return (_MAGIC + b"%d %d %s" % (size, block, digest.encode())).ljust(LINE - 1) + b"\n"


def _parse(file):
    """(bytes of content, bytes of a block, hash) of the line at the end of a file, None without one."""
    size = file.seek(0, os.SEEK_END)
    if size < LINE:
        return None
    line = _read(file, size - LINE, LINE)
    words = line.split()
    if not line.startswith(_MAGIC) or len(words) != 5 or not all(word.isdigit() for word in words[2:4]):
        return None
    found = int(words[2]), int(words[3]), words[4].decode(errors="replace")
    return found if line == _line(found[0], found[1], found[2]) and found[1] else None


def _check_end(file, size):
    """Raise Damaged if a file does not end where HDF5's own header says: cut, or with what is left of checksums."""
    file.seek(0)
    start = file.read(48)
    if len(start) < 48 or not start.startswith(SIGNATURE) or start[8] not in (2, 3) or start[9] != 8:
        return  # an older header, which jampetsc's sealed files do not have
    end = int.from_bytes(start[28:36], "little")
    if size < end:
        raise Damaged(f"truncated: {end - size} bytes of its HDF5 are missing")
    if size > end:
        raise Damaged(f"truncated or changed: {size - end} bytes follow its end and are no checksums of it")

"""What a sweep has finished, kept on disk so that the same command continues after a kill.

The journal `<out>.resume` has one line per step, and each line begins with a hash of its text and of the line before:
what follows a line that is torn, lost, moved or changed does not count. Its first line says which job it belongs to.
Fields lie in `<out>.resume.d`, one file per step and rank, named after the job. They are there before the journal
mentions them, and it names the sha256 of each: one that is lost, cut, changed or another step's does not count.
"""

import errno
import fcntl
import glob
import hashlib
import io
import json
import sys
import weakref
from pathlib import Path

import numpy as np

from jampetsc.collective import agreed
from jampetsc.errors import InputError, JampetscError
from jampetsc.storage.atomic import append_durably, follow, remove_abandoned, write_error, write_whole
from jampetsc.storage.parts import remove_if_empty
from jampetsc.storage.regular import open_regular
from jampetsc.version import VERSION

_VERSION = 2
_locks = weakref.WeakValueDictionary()  # journal -> its open file: what this process may take up anew
_LINK = 32  # characters of the hash that a line begins with


class Checkpoint:
    """Finished steps of one job with output `path`. Every method is collective.

    `key` identifies the job: a dictionary of scalars, strings and lists (packing sha256, law, frequencies, method,
    accuracy, fields, ranks). `done` maps the index of a finished step to its record.

    ordered: each step builds on those before it, so that only an unbroken sequence 0, 1, 2, … counts and the next step
    is `next`. Otherwise steps are independent, such as frequencies solved one by one.

    A journal of another job is left alone, with a line on stderr, until this job finishes a step. One that another
    process goes on with is locked: InputError, then or at the first step, so that no two write one output.
    """

    def __init__(self, path, key, comm=None, ordered=False):
        self.path = follow(path)
        self.journal = self.path.with_name(f"{self.path.name}.resume")
        self.folder = self.path.with_name(f"{self.path.name}.resume.d")
        self.comm = comm
        self.rank, self.size = (0, 1) if comm is None else (comm.rank, comm.size)
        self.ordered = ordered
        text = json.dumps(
            {"version": _VERSION, "program": VERSION, "key": key}, default=_encode, sort_keys=True
        ).encode()
        self._header = _line(b"", text)
        self._job = hashlib.sha256(self._header).hexdigest()[:12]
        self._end = 0  # on rank 0: length of the part of this job's journal that counts, in bytes
        self._link = b""  # on rank 0: hash that the last line of that part begins with
        steps = None
        self._lock = None  # on rank 0: the journal, locked as long as this object or another one of it lives
        with agreed(comm):
            if self.rank == 0:
                self._hold()
                steps = self._read()
        if comm is not None:
            steps = comm.bcast(steps)
        self._digests = {}  # index -> sha256 of the fields' files, by rank
        self.done = {}
        self._take(steps)

    def _read(self):
        """The steps in the journal that stand in an unbroken chain: [(index, record, digests or None, end, link)]."""
        try:
            with open_regular(self.journal) as file:
                content = file.read()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise write_error(self.journal, error) from None
        if not content.startswith(self._header):
            print(
                f"{self.journal}: belongs to another job: ignored, starting from the beginning",
                file=sys.stderr,
            )
            return []
        self._end, self._link = len(self._header), self._header[:_LINK]
        steps, end, link = [], self._end, self._link
        for line in content[end:].splitlines(keepends=True):
            text = line[_LINK + 1 : -1]
            if line != _line(link, text):
                break
            end, link = end + len(line), line[:_LINK]
            entry = json.loads(text, object_hook=_decode)
            steps.append((entry["index"], entry["record"], entry.get("fields"), end, link))
        return steps

    def _hold(self):
        """Lock the journal, if there is one. Raises InputError where another process has it."""
        place = str(self.journal)
        self._lock = _locks.get(place)
        if self._lock is not None:
            return
        try:
            file = open_regular(self.journal)
        except OSError:  # which reading it will tell
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                file.close()
                raise InputError(
                    f"{self.path}: another run is writing it (and {self.journal.name}): wait for it, or choose another "
                    "--out"
                ) from None
            # a file system without locks
        self._lock = _locks[place] = file

    def _take(self, steps):
        """Keep of these steps what counts: all files there, and in an ordered job nothing missing before them."""
        sound = [fields is None or self._sound(index, fields) for index, _, fields, _, _ in steps]
        if self.comm is not None:
            sound = [all(ranks) for ranks in zip(*self.comm.allgather(sound), strict=True)]
        for (index, record, fields, end, link), whole in zip(steps, sound, strict=True):
            if self.ordered and index != self.next:
                break
            self._end, self._link = end, link
            self.done.pop(index, None)  # a later line about a step replaces an earlier one
            if whole:
                self.done[index], self._digests[index] = record, fields

    @property
    def next(self) -> int:
        """Index of the step after the last one."""
        return max(self.done, default=-1) + 1

    def save(self, index, record, local_fields=None) -> None:
        """Keep a finished step: `record`, numbers all ranks have, and this rank's fields.

        `local_fields` is a dictionary of arrays, or None on all ranks. On return they survive a kill.
        Raises JampetscError on all ranks if it cannot be written.
        """
        index, digests = int(index), None
        if self.ordered and index != self.next:
            raise ValueError(f"step {index} of an ordered job cannot follow step {self.next - 1}")
        with agreed(self.comm):
            if self.rank == 0 and self._end == 0:
                self._start()
        if local_fields is not None:
            with agreed(self.comm):
                digest = self._write_fields(index, local_fields)
            digests = [digest] if self.comm is None else self.comm.allgather(digest)
        entry = {"index": index, "record": record} | ({} if digests is None else {"fields": digests})
        with agreed(self.comm):
            if self.rank == 0:
                self._append(json.dumps(entry, default=_encode, sort_keys=True).encode())
        self.done[index], self._digests[index] = dict(record), digests

    def _start(self):
        """A fresh journal, in the place of another job's."""
        self._hold()
        self._remove_fields("*-rank-*")
        remove_abandoned(self.journal.parent, glob.escape(self.journal.name))
        write_whole(self.journal, self._header)
        _locks.pop(str(self.journal), None)
        self._hold()
        self._end, self._link = len(self._header), self._header[:_LINK]

    def _append(self, text):
        line = _line(self._link, text)
        append_durably(self.journal, self._end, line)
        self._end, self._link = self._end + len(line), line[:_LINK]

    def _fields_path(self, index) -> Path:
        return self.folder / f"{self._job}-{index:05d}-rank-{self.rank:04d}.npz"

    def _write_fields(self, index, arrays):
        """Write this rank's file; returns its sha256."""
        content = io.BytesIO()
        np.savez(content, **arrays)
        path = self._fields_path(index)
        try:
            self.folder.mkdir(exist_ok=True)
        except OSError as error:
            raise write_error(self.folder, error) from None
        write_whole(path, content.getvalue())
        return hashlib.sha256(content.getvalue()).hexdigest()

    def _content(self, index, digests):
        """The bytes of this rank's file if it is the one that the journal names, else None."""
        try:
            with open_regular(self._fields_path(index)) as file:
                content = file.read()
        except (OSError, InputError):
            return None
        named = len(digests) == self.size and digests[self.rank]
        return content if hashlib.sha256(content).hexdigest() == named else None

    def _sound(self, index, digests) -> bool:
        return self._content(index, digests) is not None

    def fields(self, index) -> dict:
        """This rank's rows of the fields of a finished step, as given to `save`.

        Raises JampetscError on all ranks if a file was changed since the checkpoint was opened.
        """
        with agreed(self.comm):
            content = self._content(index, self._digests[index])
            if content is None:
                raise JampetscError(
                    f"{self._fields_path(index)}: changed during the run: run the same command again"
                )
        with np.load(io.BytesIO(content)) as stored:
            return {name: stored[name] for name in stored.files}

    def remove(self) -> None:
        """Delete the checkpoint, once the result is in place."""
        if self.comm is not None:
            self.comm.Barrier()
        if self.rank == 0 and self._end:  # otherwise the journal is not ours
            self.journal.unlink(missing_ok=True)
            self._remove_fields(f"{self._job}-*")
            self._end = 0
            _locks.pop(str(self.journal), None)
        self._lock = None

    def _remove_fields(self, pattern):
        remove_abandoned(self.folder)
        for file in self.folder.glob(pattern):
            file.unlink(missing_ok=True)
        remove_if_empty(self.folder)


def _line(link: bytes, text: bytes) -> bytes:
    """A line of the journal: the hash that chains it to the line before, which begins with `link`, and its text."""
    return b"%s %s\n" % (hashlib.sha256(link + text).hexdigest()[:_LINK].encode(), text)


def _encode(value):
    if isinstance(value, complex):
        return {"real": value.real, "imag": value.imag}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be kept in a checkpoint")


def _decode(entry):
    return complex(entry["real"], entry["imag"]) if entry.keys() == {"real", "imag"} else entry

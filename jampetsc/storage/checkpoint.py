"""What a sweep has finished, kept on disk so that the same command continues after a kill.

The journal `<out>.resume` has one line per frequency with a checksum: a line that a kill tore is ignored.
Its first line says which job it belongs to. Fields lie in `<out>.resume.d`, one file per frequency and rank,
named after the job and renamed into place before the journal mentions them.
"""

import hashlib
import json
import os
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np

from jampetsc.collective import agreed
from jampetsc.storage.atomic import follow, sync_folder, write_error
from jampetsc.storage.parts import remove_if_empty

_VERSION = 1


class Checkpoint:
    """Finished frequencies of one job with output `path`. Every method but `fields` is collective.

    `key` identifies the job: a dictionary of scalars, strings and lists (packing sha256, law, frequencies,
    method, fields and, where fields are stored, ranks). `done` maps the index of a finished frequency to its
    record.
    A journal of another job is left alone, with a line on stderr, until this job finishes a frequency.
    """

    def __init__(self, path, key, comm=None):
        self.path = follow(path)
        self.journal = self.path.with_name(f"{self.path.name}.resume")
        self.folder = self.path.with_name(f"{self.path.name}.resume.d")
        self.comm = comm
        self.rank = 0 if comm is None else comm.rank
        self._header = _line({"version": _VERSION, "key": json.loads(json.dumps(key, default=_encode))})
        self._job = hashlib.sha256(self._header).hexdigest()[:12]
        self._end = 0  # on rank 0: length of the sound beginning of this job's journal, in bytes
        with agreed(comm):
            self.done = self._read() if self.rank == 0 else None
        if comm is not None:
            self.done = comm.bcast(self.done)
        incomplete = {
            index for index, record in self.done.items() if "fields" in record and not self._sound(index)
        }
        if comm is not None:
            incomplete = set().union(*comm.allgather(incomplete))
        self.done = {
            index: {name: value for name, value in record.items() if name != "fields"}
            for index, record in self.done.items()
            if index not in incomplete
        }

    def _read(self):
        try:
            content = self.journal.read_bytes()
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise write_error(self.journal, error) from None
        if not content.startswith(self._header):
            print(
                f"{self.journal}: belongs to another job: ignored, starting from the beginning",
                file=sys.stderr,
            )
            return {}
        done = {}
        for line in content.splitlines(keepends=True):
            entry = _parse(line)
            if entry is None:
                break
            self._end += len(line)
            if "index" in entry:
                done[entry["index"]] = entry["record"]
        return done

    def save(self, index, record, local_fields=None) -> None:
        """Collective. Keep a finished frequency: `record`, numbers all ranks have, and this rank's fields.

        `local_fields` is a dictionary of arrays, or None on all ranks. On return they survive a kill.
        Raises JampetscError on all ranks if it cannot be written.
        """
        with agreed(self.comm):
            if self.rank == 0 and self._end == 0:
                self._start()
        if local_fields is not None:
            with agreed(self.comm):
                self._write_fields(index, local_fields)
            record = {**record, "fields": sorted(local_fields)}
        with agreed(self.comm):
            if self.rank == 0:
                self._append(_line({"index": int(index), "record": record}))
        self.done[int(index)] = {name: value for name, value in record.items() if name != "fields"}

    def _start(self):
        """A fresh journal, in the place of another job's."""
        try:
            self._remove_fields("*-rank-*")
            temporary = self.journal.with_name(f".{self.journal.name}.partial")
            temporary.write_bytes(self._header)
            os.replace(temporary, self.journal)
            sync_folder(self.journal.parent)
        except OSError as error:
            raise write_error(self.journal, error) from None
        self._end = len(self._header)

    def _append(self, line):
        try:
            with open(self.journal, "r+b") as file:
                file.truncate(self._end)  # a torn line, if the last write failed or was killed
                file.seek(self._end)
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise write_error(self.journal, error) from None
        self._end += len(line)

    def _fields_path(self, index) -> Path:
        return self.folder / f"{self._job}-{index:05d}-rank-{self.rank:04d}.npz"

    def _write_fields(self, index, arrays):
        path = self._fields_path(index)
        temporary = path.with_suffix(".partial")
        try:
            self.folder.mkdir(exist_ok=True)
            with open(temporary, "wb") as file:
                np.savez(file, **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
            sync_folder(self.folder)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise write_error(path, error) from None

    def _sound(self, index) -> bool:
        try:
            with zipfile.ZipFile(self._fields_path(index)) as stored:
                return stored.testzip() is None
        except (OSError, zipfile.BadZipFile):
            return False

    def fields(self, index) -> dict:
        """This rank's rows of the fields of a finished frequency, as given to `save`."""
        with np.load(self._fields_path(index)) as stored:
            return {name: stored[name] for name in stored.files}

    def remove(self) -> None:
        """Collective. Delete the checkpoint, once the result is in place."""
        if self.comm is not None:
            self.comm.Barrier()
        if self.rank == 0 and self._end:  # otherwise the journal is not ours
            self.journal.unlink(missing_ok=True)
            self._remove_fields(f"{self._job}-*")
            self._end = 0

    def _remove_fields(self, pattern):
        for file in self.folder.glob(pattern):
            file.unlink(missing_ok=True)
        remove_if_empty(self.folder)


def _line(entry) -> bytes:
    text = json.dumps(entry, default=_encode, sort_keys=True).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _parse(line: bytes):
    """The entry of a sound line, else None."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
        return None
    return json.loads(text, object_hook=_decode)


def _encode(value):
    if isinstance(value, complex):
        return {"real": value.real, "imag": value.imag}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be kept in a checkpoint")


def _decode(entry):
    return complex(entry["real"], entry["imag"]) if entry.keys() == {"real", "imag"} else entry

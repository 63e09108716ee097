"""Finished steps of a long run on disk, from which the same job continues after it was killed.

Each step is a file, written completely or not at all: the sha256 of what follows, a line of JSON, arrays in numpy's npz
format. Damaged files and steps of another job are ignored. `Checkpoint` keeps the steps in the folder `<path>.resume`;
studies keep the outcome of each task in the same format (`studies.journal`).
"""

import hashlib
import io
import json
import re
import sys
import weakref
from contextlib import suppress
from pathlib import Path

import numpy as np

from jampetsc.collective import agreed
from jampetsc.errors import InputError, JampetscError
from jampetsc.io.atomic import (
    follow,
    locked,
    open_regular,
    refuse_links,
    remove_abandoned,
    sync_folder,
    write_whole,
    writing,
)
from jampetsc.io.parts import remove_if_empty
from jampetsc.version import VERSION

_VERSION = 6
_STEP = re.compile(r"(\d{5,})-rank-\d{4,}")
_locks = weakref.WeakValueDictionary()  # folder -> its open lock, which this process may use again


def write_entry(path, entry: dict, arrays: dict | None = None) -> str:
    """Write an entry (JSON types and complex numbers) and arrays by name to `path`; on return they survive a kill.

    Returns the hash of the file's content. Raises JampetscError where it cannot be written.
    """
    packed = io.BytesIO()
    if arrays is not None:
        np.savez(packed, **arrays)
    body = json.dumps(entry, default=_encode).encode() + b"\n" + packed.getvalue()
    digest = hashlib.sha256(body).hexdigest()
    write_whole(path, digest.encode() + b"\n" + body, through_link=False)
    return digest


def read_entry(path):
    """(entry, arrays as bytes, hash) of what `write_entry` has written to `path`; None if it is missing or damaged."""
    try:
        with open_regular(path) as file:
            digest, _, body = file.read().partition(b"\n")
    except (OSError, InputError):
        return None
    if hashlib.sha256(body).hexdigest().encode() != digest:
        return None
    entry, _, packed = body.partition(b"\n")
    return json.loads(entry, object_hook=_decode), packed, digest.decode()


class Checkpoint:
    """Finished steps of one job, beside the file `path`; None: in memory. Every method is collective.

    `digest` identifies the job, see `io.request`; None in memory. `done` maps the index of a finished step to its
    record.

    ordered: each step builds on those before it, so that only an unbroken sequence 0, 1, 2, … counts and the next step
    is `next`. Otherwise steps are independent, such as frequencies solved one by one. Steps of one kind are never
    taken for the other.

    Steps of another job stay, with a line on stderr, until this job finishes a step. A checkpoint that another process
    is using is locked: opening it, or saving the first step, raises InputError, so that no two runs write one output.
    """

    def __init__(self, path, digest: str | None, comm=None, ordered=False):
        self.comm = comm
        self.rank, self.size = (0, 1) if comm is None else (comm.rank, comm.size)
        self.journal = None if path is None else folder_of(path)
        self._job = {"version": _VERSION, "program": VERSION, "digest": digest, "ordered": ordered}
        self.done, self._hashes, self._arrays = {}, {}, {}
        self._last = ""  # hash of the last step
        self._lock = None  # on rank 0: open and locked as long as an object of this folder lives
        self._own = False  # whether the steps in the folder are this job's
        steps = []
        with agreed(comm):
            if self.rank == 0 and self.journal is not None:
                self._lock_folder()
                steps = self._read()
        steps = steps if comm is None else comm.bcast(steps)
        sound = [self._sound(*step) for step in steps]
        if comm is not None:
            sound = [all(ranks) for ranks in zip(*comm.allgather(sound), strict=True)]
        for (index, entry, hashes), whole in zip(steps, sound, strict=True):
            if ordered and not (whole and index == self.next and entry["after"] == self._last):
                break
            if whole:
                self.done[index], self._hashes[index] = entry["record"], hashes
                self._last, self._own = hashes[0], True
        sizes = {entry["ranks"] for _, entry, _ in steps} - {None, self.size}
        if sizes and not self.done and self.rank == 0:
            self._note_ignored(f"on {min(sizes)} ranks")

    def _read(self):
        """[(index, rank 0's entry, hashes of the ranks' files)] of this job's steps, in their order."""
        steps, has_other_job = [], False
        for path in self.journal.glob("*-rank-0000"):
            named, step = _STEP.fullmatch(path.name), read_entry(path)
            if named is None or step is None:
                continue
            entry, _, digest = step
            if entry["job"] != self._job:
                has_other_job = True
            elif entry["index"] == int(named[1]):
                steps.append((entry["index"], entry, [digest, *entry["others"]]))
        if has_other_job and not steps:
            self._note_ignored("by another job")
        return sorted(steps, key=lambda step: step[0])

    def _note_ignored(self, how):
        print(f"{self.journal}: was saved {how}: ignored, starting from the beginning", file=sys.stderr)

    def _sound(self, index, entry, hashes) -> bool:
        """Whether this rank's file of a step is intact; a step with arrays needs the number of ranks that saved it."""
        if entry["ranks"] is None or self.rank == 0:
            return entry["ranks"] in (None, self.size)
        content = read_entry(self.path_of(index)) if entry["ranks"] == self.size else None
        return content is not None and content[2] == hashes[self.rank]

    def _lock_folder(self):
        """Lock the folder, if there is one. Raises InputError where another process has it."""
        refuse_links(self.journal)
        self._lock = _locks.get(str(self.journal))
        if self._lock is not None or not self.journal.is_dir():
            return
        with writing(self.journal), suppress(FileNotFoundError):  # a run that was just ending has removed it
            lock = locked(self.journal / "lock")
            if lock is None:
                raise InputError(
                    f"{self.journal.with_suffix('')}: another run writes it and {self.journal.name}. Wait "
                    "for it, or choose another file."
                )
            self._lock = _locks[str(self.journal)] = lock

    @property
    def next(self) -> int:
        """Index of the step after the last one."""
        return max(self.done, default=-1) + 1

    def save(self, index, record, arrays=None) -> None:
        """Keep a finished step: `record`, numbers all ranks have, and this rank's arrays by name.

        All ranks give `arrays`, or none does. On return the step survives a kill.
        Raises JampetscError on all ranks if it cannot be written.
        """
        index = int(index)
        if self.journal is None:
            self.done[index], self._arrays[index] = dict(record), arrays
            return
        entry = {"job": self._job, "index": index}
        with agreed(self.comm):
            if self.rank == 0 and not self._own:
                self._start()
        self._own, digest = True, None
        with agreed(self.comm):
            if self.rank > 0 and arrays is not None:
                digest = write_entry(self.path_of(index), entry, arrays)
        other_digests = [] if self.comm is None else self.comm.allgather(digest)[1:]
        entry |= {"record": record, "after": self._last, "others": other_digests}
        entry["ranks"] = None if arrays is None else self.size
        with agreed(self.comm):
            if self.rank == 0:
                self._last = write_entry(self.path_of(index), entry, arrays)
        self.done[index], self._hashes[index] = dict(record), [self._last, *other_digests]

    def _start(self):
        """Make an empty folder, removing another job's steps."""
        with writing(self.journal):
            if self.journal.is_file():
                self.journal.unlink()
            self.journal.mkdir(exist_ok=True)
            sync_folder(self.journal.parent)
        self._lock_folder()
        _remove_steps(self.journal)

    def path_of(self, index: int) -> Path:
        """The file of a step: of rank 0 with its record, of others with their arrays."""
        return self.journal / f"{index:05d}-rank-{self.rank:04d}"

    def fields(self, index) -> dict | None:
        """This rank's arrays of a finished step, as given to `save`; None where it was given none.

        Raises JampetscError on all ranks if a file was changed since the checkpoint was opened.
        """
        if self.journal is None:
            return self._arrays[index]
        hashes = self._hashes[index]
        saved = (
            hashes[self.rank] if self.rank < len(hashes) else None
        )  # without arrays rank 0 alone has a file
        with agreed(self.comm):
            content = read_entry(self.path_of(index)) if saved else ({}, b"", saved)
            if content is None or content[2] != saved:
                raise JampetscError(
                    f"{self.path_of(index)}: changed during the run. Run the same command again."
                )
        if not content[1]:
            return None
        with np.load(io.BytesIO(content[1])) as stored:
            return {name: stored[name] for name in stored.files}

    def remove(self) -> None:
        """Delete the steps, once the result is in place."""
        if self.comm is not None:
            self.comm.Barrier()
        if self.rank == 0 and self._own:
            discard(self.journal)
        self.done, self._lock, self._own = {}, None, False


def has_steps(path) -> bool:
    """Whether there are steps of any job where `Checkpoint(path, …)` keeps them."""
    return any(folder_of(path).glob("*-rank-*"))


def folder_of(path) -> Path:
    """Where `Checkpoint(path, …)` keeps its steps."""
    path = follow(path)
    return path.with_name(f"{path.name}.resume")


def discard(folder) -> None:
    """Delete a folder of steps, whichever job they are of."""
    if folder.is_file():  # a checkpoint of an older version
        folder.unlink()
        return
    _remove_steps(folder)
    (folder / "lock").unlink(missing_ok=True)
    _locks.pop(str(folder), None)
    remove_if_empty(folder)


def discard_unused(path) -> None:
    """Delete the steps beside the result at `path` that a run left when it was killed, unless another run uses them."""
    folder = folder_of(path)
    with suppress(OSError):  # such as a folder that is read only
        lock = locked(folder / "lock") if folder.is_dir() else None
        if lock is not None:
            with lock:
                discard(folder)


def _remove_steps(folder):
    remove_abandoned(folder)
    for file in folder.glob("*-rank-*"):
        if _STEP.fullmatch(file.name) and not file.is_dir():
            file.unlink(missing_ok=True)


def _encode(value):
    if isinstance(value, complex):
        return {"real": value.real, "imag": value.imag}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be kept in a checkpoint")


def _decode(entry):
    return complex(entry["real"], entry["imag"]) if entry.keys() == {"real", "imag"} else entry

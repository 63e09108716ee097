"""Which rank does which task of a study, the outcome of each, and the lock of the study's folder.

They are small files in `FOLDER/journal`, which all ranks see. A record is written completely or not at all, with a hash
of its content (`io.checkpoint.write_entry`): a study that is killed loses no finished task. Every rank takes the next
task as soon as it is free. No rank hands out tasks, so that none is spent on waiting for the others, as the manager of
mpi4py.futures is.

One study at a time runs in a folder, on one machine or many that share a disk. `FOLDER/lock` is locked by the system.
On some network file systems such locks hold within one machine only; therefore the file is also touched every
TOUCH_INTERVAL, and a lock that another machine has touched within MAX_TOUCH_AGE counts as held: after the loss of a
node the folder becomes free when they have passed.
"""

import contextlib
import math
import os
import secrets
import shutil
import socket
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import quote

from jampetsc import interrupts
from jampetsc.errors import InputError
from jampetsc.io.atomic import locked, remove_abandoned, write_error
from jampetsc.io.checkpoint import read_entry, write_entry

JOURNAL = "journal"
RECORD_KEYS = {"task", "row", "seconds"}  # what every record has
TALLY_INTERVAL = 1.0  # seconds after which a rank counts the failed tasks of the others again
POLL_INTERVAL = 0.02  # seconds between two looks while a rank waits for a task of another one
DONE, FAILED = ".done", ".failed"  # endings of the files that record the outcome of a task
PLACE = ".place"  # ending of the files that number finished tasks
LOCK = "lock"
TOUCH_INTERVAL = 20.0  # seconds between touches of the file
MAX_SHOWN_CHARACTERS = 200  # characters of its content in a message
MAX_TOUCH_AGE = 120.0  # seconds without a touch after which a study on another machine counts as dead


def keep_record(folder, record: dict) -> None:
    """Keep the record of a task; on return it survives a kill. Raises JampetscError where it cannot be written."""
    write_entry(Path(folder) / JOURNAL / quote(record["task"], safe=""), record)


def records_of(folder) -> dict:
    """{task: its record} of a study."""
    places = sorted((Path(folder) / JOURNAL).glob("[!.]*"))
    entries = [entry[0] for entry in map(read_entry, places) if entry is not None]
    return {
        record["task"]: record
        for record in entries
        if isinstance(record, dict) and record.keys() >= RECORD_KEYS
    }


def tidy(folder) -> None:
    """Remove what killed processes have left behind; only while no study runs in the folder."""
    remove_abandoned(Path(folder) / JOURNAL)
    for left in (Path(folder) / JOURNAL).glob(".claims-*"):
        shutil.rmtree(left, ignore_errors=True)


class Claims:
    """Claims on the tasks of one run of a study, by name: the rank that creates the file of a task does the task.

    The system lets only one process create a file (O_EXCL), also on a disk shared by several machines. The rank that
    holds the lock of the folder makes this object, sends it to the others and calls `end`.
    """

    def __init__(self, folder):
        self.folder = Path(folder) / JOURNAL / f".claims-{secrets.token_hex(6)}"
        try:
            self.folder.mkdir()
        except OSError as error:
            raise write_error(self.folder, error) from None
        self._finished = self._failed = 0
        self._looked = -math.inf

    def _file(self, task, ending=""):
        return self.folder / f"{quote(task, safe='')}{ending}"

    def _create(self, path) -> bool:
        try:
            open(path, "x").close()
        except FileExistsError:
            return False
        except OSError as error:
            raise write_error(path, error) from None
        return True

    def take(self, task) -> bool:
        """Claim a task; False if another rank has it."""
        return self._create(self._file(task))

    def settle(self, task, done: bool) -> None:
        """Announce the outcome of a task, after its record was written."""
        self._create(self._file(task, DONE if done else FAILED))
        self._failed += not done
        self._finished += 1
        # another rank's task has the number of a file that exists
        while not self._create(self.folder / f"{self._finished}{PLACE}"):
            self._finished += 1

    def done(self, task) -> bool:
        """Wait until the rank that has taken a task finishes it; whether it succeeded."""
        while not (done := self._file(task, DONE).exists()) and not self._file(task, FAILED).exists():
            interrupts.check()
            time.sleep(POLL_INTERVAL)
        return done

    def tally(self) -> tuple[int, int]:
        """(place of this rank's last finished task among all ranks, number of failed tasks of all ranks).

        The failed ones of other ranks are counted every TALLY_INTERVAL.
        """
        if time.monotonic() > self._looked + TALLY_INTERVAL:
            ends = [os.path.splitext(name)[1] for name in os.listdir(self.folder)]
            self._looked, self._failed = time.monotonic(), ends.count(FAILED)
        return self._finished, self._failed

    def end(self) -> None:
        """Remove the files of these claims."""
        shutil.rmtree(self.folder, ignore_errors=True)


class Lock:
    """The lock of a folder, held from `take` to `release` by one rank of a study."""

    def __init__(self, folder):
        self.path = Path(folder) / LOCK
        self._file = None
        self._over = threading.Event()

    def take(self) -> None:
        """Lock the folder. Raises InputError where another study has it."""
        try:
            self._file = locked(self.path)
            host, _, process = (
                self.path.read_text(errors="replace").strip()[:MAX_SHOWN_CHARACTERS].partition(" ")
            )
            age = self._age()
        except OSError as error:
            raise write_error(self.path, error) from None
        here, is_locked = socket.gethostname(), self._file is None
        if is_locked or (host not in ("", here) and age < MAX_TOUCH_AGE):
            if not is_locked:
                self._file.close()
            raise InputError(
                f"{self.path.parent}: a study runs there (process {process or '?'} on "
                f"{host or 'another machine'}). Wait for it, or choose another folder."
                + ("" if is_locked else f" {self._end(age)}")
            )
        self._file.truncate(0)
        self._file.write(f"{here} {os.getpid()}\n")
        self._file.flush()
        threading.Thread(target=self._beat, daemon=True).start()

    def _age(self):
        """Seconds since the file was touched, by the clock of its file system."""
        with tempfile.NamedTemporaryFile(dir=self.path.parent, prefix=f".{LOCK}.") as probe:
            return os.fstat(probe.fileno()).st_mtime - os.lstat(self.path).st_mtime

    def _end(self, age):
        """When a lock of another machine expires, in words; age: seconds since it was touched."""
        if age < -MAX_TOUCH_AGE:
            dated = time.strftime("%Y-%m-%d", time.localtime(os.lstat(self.path).st_mtime))
            return f"Its lock has a time in the future ({dated}); if no study runs there, remove {self.path}."
        return f"If it is dead, its lock expires in {MAX_TOUCH_AGE - age:.0f} s."

    def _beat(self):
        while not self._over.wait(TOUCH_INTERVAL):
            with contextlib.suppress(OSError):
                os.utime(self.path, follow_symlinks=False)

    def release(self) -> None:
        """Unlock the folder."""
        self._over.set()
        if self._file is not None and not self._file.closed:
            with contextlib.suppress(OSError):
                self._file.truncate(0)
            self._file.close()

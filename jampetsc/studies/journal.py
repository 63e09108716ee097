"""Which rank does which task of a study, and the outcome of each: small files in `FOLDER/journal`, which all ranks see.

A record is written completely or not at all, with a hash of its content (`io.checkpoint.write_entry`): a study that is
killed loses no finished task. Every rank takes the next task as soon as it is free. No rank hands out tasks, so that
none is spent on waiting for the others, as the manager of mpi4py.futures is.
"""

import os
import secrets
import shutil
import time
from pathlib import Path
from urllib.parse import quote

from jampetsc import interrupts
from jampetsc.io.atomic import remove_abandoned, write_error
from jampetsc.io.checkpoint import read_entry, write_entry

NAME = "journal"
RECORD_KEYS = {"task", "row", "seconds"}  # what every record has
POLL_INTERVAL = 0.02  # seconds between two looks while a rank waits for a task of another one
DONE, FAILED = ".done", ".failed"  # endings of the files that record the outcome of a task
PLACE = ".place"  # ending of the files that number finished tasks


def keep_record(folder, record: dict) -> None:
    """Keep the record of a task; on return it survives a kill. Raises JampetscError where it cannot be written."""
    write_entry(Path(folder) / NAME / quote(record["task"], safe=""), record)


def records_of(folder) -> dict:
    """{task: its record} of a study."""
    places = sorted((Path(folder) / NAME).glob("[!.]*"))
    entries = [entry[0] for entry in map(read_entry, places) if entry is not None]
    return {
        record["task"]: record
        for record in entries
        if isinstance(record, dict) and record.keys() >= RECORD_KEYS
    }


def tidy(folder) -> None:
    """Remove what killed processes have left behind; only while no study runs in the folder."""
    remove_abandoned(Path(folder) / NAME)
    for left in (Path(folder) / NAME).glob(".claims-*"):
        shutil.rmtree(left, ignore_errors=True)


class Claims:
    """Claims on the tasks of one run of a study, by name: the rank that creates the file of a task does the task.

    The system lets only one process create a file (O_EXCL), also on a disk shared by several machines. The rank that
    holds the lock of the folder makes this object, sends it to the others and calls `end`.
    """

    def __init__(self, folder):
        self.folder = Path(folder) / NAME / f".claims-{secrets.token_hex(6)}"
        try:
            self.folder.mkdir()
        except OSError as error:
            raise write_error(self.folder, error) from None
        self._finished = self._failed = 0
        self._looked = -1.0

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

        The failed ones of other ranks are counted once a second.
        """
        if time.monotonic() > self._looked + 1.0:
            ends = [os.path.splitext(name)[1] for name in os.listdir(self.folder)]
            self._looked, self._failed = time.monotonic(), ends.count(FAILED)
        return self._finished, self._failed

    def end(self) -> None:
        """Remove the files of these claims."""
        shutil.rmtree(self.folder, ignore_errors=True)

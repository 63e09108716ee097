"""Who does which task of a study, and what became of each: small files in `FOLDER/journal`, which all ranks see.

A record is put there whole with a hash of its content (`io.checkpoint.keep`): a study that is killed loses no finished
task. Every rank works and takes what is next as soon as it is free; nobody hands out tasks, so no rank only waits for
the others, as the manager of mpi4py.futures does.
"""

import os
import secrets
import shutil
import time
from pathlib import Path
from urllib.parse import quote

from jampetsc.io.atomic import remove_abandoned, write_error
from jampetsc.io.checkpoint import keep, kept

NAME = "journal"
NAP = 0.02  # seconds between two looks while a rank waits for a task of another one
DONE, FAILED = ".done", ".failed"  # endings of the files that say what became of a task


def keep_record(folder, record: dict) -> None:
    """Keep the record of a task; on return it survives a kill. Raises JampetscError where it cannot be written."""
    keep(Path(folder) / NAME / quote(record["task"], safe=""), record)


def records_of(folder) -> dict:
    """{task: its record} of a study."""
    places = sorted((Path(folder) / NAME).glob("[!.]*"))
    return {found[0]["task"]: found[0] for found in map(kept, places) if found is not None}


def tidy(folder) -> None:
    """Remove what killed processes have left, while no study runs there."""
    remove_abandoned(Path(folder) / NAME)
    for left in (Path(folder) / NAME).glob(".claims-*"):
        shutil.rmtree(left, ignore_errors=True)


class Claims:
    """The tasks of one run of a study, by name: whoever makes the file of a task has it.

    The system makes a file once (O_EXCL), also on a disk of several machines. Made by one rank, which has the lock of
    the folder, and given to the others; `end` it there, too.
    """

    def __init__(self, folder):
        self.folder = Path(folder) / NAME / f".claims-{secrets.token_hex(6)}"
        try:
            self.folder.mkdir()
        except OSError as error:
            raise write_error(self.folder, error) from None
        self._finished = self._failed = 0
        self._looked = -1.0
        self._taken = set()  # names of files that there were, once another rank was found to be ahead

    def _file(self, task, ending=""):
        return self.folder / f"{quote(task, safe='')}{ending}"

    def _made(self, path) -> bool:
        try:
            open(path, "x").close()
        except FileExistsError:
            return False
        except OSError as error:
            raise write_error(path, error) from None
        return True

    def take(self, task) -> bool:
        """Whether the task is this rank's to do, and no other's."""
        path = self._file(task)
        if path.name in self._taken:
            return False
        if self._made(path):
            return True
        # of all that others have: one look instead of one for each
        self._taken = set(os.listdir(self.folder))
        return False

    def settle(self, task, done: bool) -> None:
        """Say what became of a task, once its record is kept."""
        self._made(self._file(task, DONE if done else FAILED))
        self._finished += 1
        self._failed += not done

    def done(self, task) -> bool:
        """Whether a task that some rank has taken came out, once that has finished it."""
        while not (done := self._file(task, DONE).exists()) and not self._file(task, FAILED).exists():
            time.sleep(NAP)
        return done

    def tally(self) -> tuple[int, int]:
        """(finished, failed) tasks of all ranks; of the others as of a second ago."""
        if time.monotonic() > self._looked + 1.0:
            ends = [os.path.splitext(name)[1] for name in os.listdir(self.folder)]
            self._looked, self._failed = time.monotonic(), ends.count(FAILED)
            self._finished = ends.count(DONE) + self._failed
        return self._finished, self._failed

    def end(self) -> None:
        """Remove the files, which are of this run alone."""
        shutil.rmtree(self.folder, ignore_errors=True)

"""One task of a study: the command's own work, with what it says kept back, and a record of what became of it."""

import contextlib
import glob
import io
import os
import shutil
import time

from jampetsc import session
from jampetsc.collective import by_rank_0
from jampetsc.errors import InputError, JampetscError
from jampetsc.storage.provenance import command_line, recorded_as
from jampetsc.storage.reader import load
from jampetsc.studies.kinds import KINDS, SEEDS
from jampetsc.studies.numbers import numbers_of
from jampetsc.studies.options import positional_of


class Runner:
    """Runs tasks in a folder and tells what became of them; knows what earlier runs have left.

    cores   what threads of a task may use while other ranks have tasks of their own
    """

    def __init__(self, folder, parsers, records: dict, cores: int = 1):
        self.folder, self.parsers, self.records, self.cores = folder, parsers, records, cores

    def finished(self, task) -> bool:
        """Whether there is nothing to do for a task, as far as can be told before what it reads is done."""
        record = self.records.get(task.name)
        return (
            record is not None
            and record["state"] == "done"
            and os.path.exists(self.folder / task.file)
            and set(record["inputs"]) <= {one.name for one in task.inputs}
            and (KINDS[task.command].on is not SEEDS or len(record["inputs"]) == len(task.inputs))
        )

    def run(self, task, there, together=False) -> dict:
        """Do a task with those of its inputs that are `there`; its record.

        together   collective, and what only one rank may have met is raised: the others wait for it. Else nothing is
                   raised but interrupts.
        """
        began = time.perf_counter()
        record = {"task": task.name, "inputs": [one.name for one in there], "time": time.time(), "row": {}}
        try:
            if not there and task.inputs:
                raise InputError(f"{task.inputs[0].file} failed")
            if self._unchanged(task, record["inputs"]):
                return self.records[task.name]
            self._work(task, there)
            found = numbers_of(self.folder / task.file)
            state, why = "done", ""
        except JampetscError as error:
            state, why, found = "failed", str(error), {}
        except Exception as error:
            if together:
                raise
            said = session.petsc_message(error) if session.petsc_error(error) else str(error)
            state, why, found = "failed", f"{type(error).__name__}: {said}", {}
        seconds = time.perf_counter() - began
        why = " ".join(why.replace(f"{self.folder}{os.sep}", "").split()).removeprefix(f"{task.file}: ")
        return record | {"state": state, "why": why, "seconds": seconds, "row": row_of(task, found)}

    def _unchanged(self, task, inputs):
        """Whether the files of all seeds are those that there were when their file was made."""
        record = self.records.get(task.name)
        several = KINDS[task.command].on is SEEDS and record and record["state"] == "done"
        return several and record["inputs"] == inputs and os.path.exists(self.folder / task.file)

    def _work(self, task, there):
        """Make the file, unless a run that was killed has made it just before it could say so."""
        out = self.folder / task.file
        words = task.line([one.file for one in there], task.file)
        if by_rank_0(session.current().comm, lambda: _made_by(words, out) and _tidied(out)):
            return
        positional = positional_of(self.parsers[task.command])
        args = task.choice.arguments(positional, [str(self.folder / one.file) for one in there], str(out))
        if vars(args).get("threads", 0) is None:
            args.threads = self.cores
        heard = io.StringIO()
        with recorded_as(words), contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
            status = args.run(args, [])
        if status:
            raise JampetscError(f"{task.command} ended with status {status}: {heard.getvalue().strip()}")


def row_of(task, found) -> dict:
    """The row of a task: what it is, what it was asked for, and the numbers that were found."""
    asked = {name: value for name, value in task.columns.items() if not name.startswith("no_")}
    packing = {"packing": task.file} if task.command == "pack" else {}
    return {"command": task.command, "file": task.file} | {**found, **packing, **asked}


def _tidied(path):
    """Remove the checkpoint that a run leaves when it is killed with its file just made; True."""
    for left in path.parent.glob(f"{glob.escape(path.name)}.resume*"):
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    return True


def _made_by(words, path):
    """Whether a file is the result of this command line; a packing is left to `pack`, which looks for itself."""
    try:
        return load(path).attributes["argv"] == command_line(words)
    except (InputError, AttributeError, KeyError):
        return False

"""One task of a study: its job, and a record of what became of it."""

import contextlib
import dataclasses
import functools
import os
import time

from jampetsc import progress
from jampetsc.collective import on_root
from jampetsc.errors import InputError, JampetscError
from jampetsc.io.checkpoint import discard, folder_of
from jampetsc.io.checksums import identity_of
from jampetsc.io.outlet import Outlet
from jampetsc.io.outputs import unlike
from jampetsc.io.parts import parts_of
from jampetsc.io.reader import load
from jampetsc.petsc import session
from jampetsc.studies.numbers import numbers_of

ASIDE = ".replaced"  # behind the name of a file that was put in the place of one that the study made


class Runner:
    """Runs tasks in a folder and tells what became of them; knows what earlier runs have left.

    cores   what threads of a task may use while other ranks have tasks of their own
    """

    def __init__(self, folder, records: dict, cores: int = 1):
        self.folder, self.records, self.cores = folder, records, cores

    def left(self, tasks):
        """What there is to do before any task is done: two lists.

        Names of tasks that are left: all that is not done, or whose files are not what they were, and what reads these.
        What a task reads may be the same when it is made anew: `run` looks once more. Then files that are not what was
        made.
        """
        left, changed = {}, []
        failed = [task for task in tasks if self.records.get(task.name, {}).get("state") == "failed"]
        suspects = {one.file for task in failed for one in task.inputs}  # may be what it failed by
        identity = functools.cache(lambda name: identity_of(self.folder / name, every_byte=name in suspects))
        for task in tasks:
            record = self.records.get(task.name)
            if _done(record):
                read = {f"{name}.h5" for name in record["inputs"]}
                if any(identity(name) != one for name, one in record["files"].items() if name not in read):
                    changed.append(task.file)
            current = _current(record, task.inputs, identity)
            if not current or any(one.name in left for one in task.inputs):
                left[task.name] = None
        return list(left), changed

    def _files(self, names):
        """{file: identity} of what these tasks have left, the parts of the last one's file included."""
        files = [f"{name}.h5" for name in names]
        parts = names and parts_of(self.folder / files[-1])
        return {name: identity_of(self.folder / name) for name in [*files, *(parts.sizes if parts else ())]}

    def stands(self, record) -> bool:
        """Whether the files that a record tells of are still what they were, as far as it knows."""
        return all(identity_of(self.folder / name) == one for name, one in record.get("files", {}).items())

    def run(self, task, there, together=False) -> dict:
        """Do a task with those of its inputs that are `there`; its record.

        together   collective, and what only one rank may have met is raised: the others wait for it. Else nothing is
                   raised but interrupts.
        """
        began = time.perf_counter()
        known, names = self.records.get(task.name), [one.name for one in there]
        record = {"task": task.name, "inputs": names, "row": {}}
        try:
            if not there and task.inputs:
                raise InputError(f"{task.inputs[0].file} failed")
            comm = session.current().comm
            if on_root(
                comm, lambda: _current(known, there, lambda name: identity_of(self.folder / name, True))
            ):
                return known
            record["files"] = on_root(comm, lambda: self._files(names))  # before they are read
            self._work(task, there)
            record["files"] |= on_root(comm, lambda: self._files([task.name]))
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

    def _work(self, task, there):
        """Make the file, unless a run that was killed has made it just before it could say so."""
        out = self.folder / task.file
        job = task.choice.job_of([str(self.folder / one.file) for one in there])
        if on_root(session.current().comm, lambda: self._is_there(task, job)):
            return
        words = task.line([one.file for one in there], task.file)
        if getattr(job, "threads", 0) is None:
            job = dataclasses.replace(job, threads=self.cores)
        overwrite = task.name in self.records  # what the study itself has made
        with progress.telling(False):
            job.perform(Outlet(out, out), argv=words, overwrite=overwrite)

    def _is_there(self, task, job) -> bool:
        """Whether the file is the result of this job; a packing is left to `pack`, which looks for itself. What the
        study has made and somebody has changed makes way, under another name.
        """
        path, known = self.folder / task.file, self.records.get(task.name)
        if _done(known) and identity_of(path, every_byte=True) != known.get("files", {}).get(task.file):
            with contextlib.suppress(FileNotFoundError):
                os.replace(path, f"{path}{ASIDE}")
        if task.command == "pack" or not path.exists():
            return False
        try:
            load(path)  # all of its parts are there
            asked = job.request(())
            asked.read(job.paths)
            if unlike(path, asked):
                return False
        except InputError:
            return False
        discard(folder_of(path))  # the checkpoint of a run that is killed with its file just made
        return True


def row_of(task, found) -> dict:
    """The row of a task: what it is, what it was asked for, and the numbers that were found."""
    asked = {name: value for name, value in task.columns.items() if not name.startswith("no_")}
    packing = {"packing": task.file} if task.command == "pack" else {}
    return {"command": task.command, "file": task.file} | {**found, **packing, **asked}


def _done(record) -> bool:
    return record is not None and record["state"] == "done"


def _current(record, inputs, identity) -> bool:
    """Whether a record tells of a file made from these tasks' files, all of them being what they were."""
    return (
        _done(record)
        and {one.name for one in inputs} == set(record["inputs"])
        and all(identity(name) == one for name, one in record["files"].items())
    )

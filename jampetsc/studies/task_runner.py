"""One task of a study: its job, and the record of its outcome."""

import contextlib
import dataclasses
import os
import time

from jampetsc import progress
from jampetsc.collective import on_root
from jampetsc.errors import InputError, JampetscError
from jampetsc.io.atomic import refuse_links
from jampetsc.io.checkpoint import discard_unused, folder_of
from jampetsc.io.checksums import identity_of
from jampetsc.io.ensemble import SETTINGS
from jampetsc.io.outputs import is_finished
from jampetsc.io.parts import parts_of
from jampetsc.io.request import Request
from jampetsc.options.execution import run_job
from jampetsc.options.job import NETWORKS
from jampetsc.petsc import session
from jampetsc.studies.study_table import numbers_of

# appended to the name of a file that somebody put in the place of the study's own
REPLACED_SUFFIX = ".replaced"


class TaskRunner:
    """Runs tasks in a folder and returns their records.

    records   {task: record} of earlier runs
    cores     number of threads for a task while other ranks have tasks of their own; None: as the task chooses
    execute   function (job, out, argv, overwrite) that makes the file `out`; see `execute_here`
    """

    def __init__(self, folder, records: dict, cores: int | None = 1, execute=None):
        self.folder, self.records, self.cores = folder, records, cores
        self.execute = execute or execute_here

    def unfinished(self, tasks):
        """(names of unfinished tasks, names of files that are missing or not what was made).

        Unfinished are tasks that are not done, tasks with a changed input or result, and all that read from these. An
        input that is made again may turn out the same: `run` checks once more.
        """
        unfinished, changed = {}, []
        failed = [task for task in tasks if self.records.get(task.name, {}).get("state") == "failed"]
        suspects = {source.file for task in failed for source in task.inputs}  # may be why it failed
        damaged = {file for file in suspects if identity_of(self.folder / file, every_byte=True) is None}
        for task in tasks:
            record, is_whole = self.records.get(task.name), False
            if _done(record):
                is_whole = task.file not in damaged and self._are_unchanged(record["files"])
                changed += [] if is_whole else [task.file]
            if (
                not is_whole
                or any(source.name in unfinished for source in task.inputs)
                or record.get("digest") != self._digest(task, task.inputs)
            ):
                unfinished[task.name] = None
        return list(unfinished), changed

    def _digest(self, task, inputs, every_byte=False) -> str:
        """The digest of the job of a task with the files of these inputs, see `io.request`."""
        return task.settings.digest(
            map(str, self._identities([source.file for source in inputs], every_byte).values())
        )

    def _identities(self, files, every_byte=False) -> dict:
        """{file: identity}, None for one that is missing or damaged."""
        return {name: identity_of(self.folder / name, every_byte) for name in files}

    def _files(self, task) -> dict:
        """{file: identity} of the result of a task and of its parts."""
        parts = parts_of(self.folder / task.file)
        return self._identities([task.file, *(parts.sizes if parts else ())])

    def _are_unchanged(self, files, every_byte=False) -> bool:
        """Whether files still have these identities."""
        return self._identities(files, every_byte) == files

    def files_unchanged(self, record) -> bool:
        """Whether the files of a task and of its inputs have the identities in its record."""
        return self._are_unchanged(record.get("files", {}) | record.get("inputs", {}))

    def run(self, task, available, shared=False) -> dict:
        """Run a task with its `available` inputs; returns its record.

        shared   whether all ranks share the task: then it is collective, and unexpected errors, which only one rank may
                 meet, are raised. Else nothing but an interrupt is raised.
        """
        start_time, previous = time.perf_counter(), self.records.get(task.name)
        record = {"task": task.name, "row": {}}
        try:
            if not available and task.inputs:
                raise InputError(f"{task.inputs[0].file} failed")
            comm = session.communicator()
            record["digest"] = on_root(comm, lambda: self._digest(task, available, every_byte=True))
            if on_root(comm, lambda: self._is_current(previous, record["digest"])):
                return previous
            record["inputs"] = on_root(comm, lambda: self._identities([source.file for source in available]))
            self._work(task, available)
            record["files"] = on_root(comm, lambda: self._files(task))
            numbers = numbers_of(self.folder / task.file)
            state, why = "done", ""
        except JampetscError as error:
            state, why, numbers = "failed", str(error), {}
        except Exception as error:
            if shared:
                raise
            message = session.petsc_message(error) if session.petsc_error(error) else str(error)
            state, why, numbers = "failed", f"{type(error).__name__}: {message}", {}
        seconds = time.perf_counter() - start_time
        why = " ".join(why.replace(f"{self.folder}{os.sep}", "").split()).removeprefix(f"{task.file}: ")
        return record | {"state": state, "why": why, "seconds": seconds, "row": row_of(task, numbers)}

    def _is_current(self, record, digest) -> bool:
        """Whether a record is of a done task with this digest, and every byte of its files is as it was made."""
        return _done(record) and record.get("digest") == digest and self._are_unchanged(record["files"], True)

    def _work(self, task, available):
        """Make the file, unless a run made it and was killed before it could write the record."""
        out = self.folder / task.file
        refuse_links(out, folder_of(out), out.with_suffix(".parts"))
        job = task.settings.job_of([str(self.folder / source.file) for source in available])
        if on_root(session.communicator(), lambda: self._is_there(task, job)):
            return
        words = task.line([source.file for source in available], task.file)
        if getattr(job, "threads", 0) is None:
            job = dataclasses.replace(job, threads=self.cores)
        overwrite = task.name in self.records  # a file that the study itself has made
        self.execute(job, out, words, overwrite)

    def _is_there(self, task, job) -> bool:
        """Whether the file is the result of this job.

        A file of the study that somebody has changed is renamed first.
        """
        path, previous = self.folder / task.file, self.records.get(task.name)
        if _done(previous) and identity_of(path, every_byte=True) != previous.get("files", {}).get(task.file):
            with contextlib.suppress(FileNotFoundError):
                os.replace(path, f"{path}{REPLACED_SUFFIX}")
        try:
            finished = is_finished(path, Request(job))
        except InputError:
            return False
        if finished:
            discard_unused(path)  # the checkpoint of a run that was killed just after it made the file
        return finished


def execute_here(job, out, argv, overwrite) -> None:
    """Run a job in this process, without progress lines; its file records the command line `argv`."""
    with progress.reporting(False):
        run_job(job, out, out, argv=argv, overwrite=overwrite)


def row_of(task, numbers) -> dict:
    """The row of a task: its command and file, its settings and their names, and the `numbers` of its result."""
    settings = {name: value for name, value in task.columns.items() if not name.startswith("no_")}
    packing = {"packing": task.file} if task.command in NETWORKS else {}
    row = {"command": task.command, "file": task.file} | {**numbers, **packing, **settings}
    return row | {SETTINGS: " ".join(settings)}


def _done(record) -> bool:
    return record is not None and record["state"] == "done"

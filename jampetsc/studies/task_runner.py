"""One task of a study: its job, and the record of its outcome."""

import contextlib
import dataclasses
import functools
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
        identity = functools.cache(lambda name: identity_of(self.folder / name, every_byte=name in suspects))
        for task in tasks:
            record = self.records.get(task.name)
            if _done(record):
                read = {f"{name}.h5" for name in record["inputs"]}
                if any(
                    identity(name) != recorded
                    for name, recorded in record["files"].items()
                    if name not in read
                ):
                    changed.append(task.file)
            current = _current(record, task.inputs, identity)
            if not current or any(source.name in unfinished for source in task.inputs):
                unfinished[task.name] = None
        return list(unfinished), changed

    def _files(self, names):
        """{file: identity} of the results of these tasks, and of the parts of the last one."""
        files = [f"{name}.h5" for name in names]
        parts = names and parts_of(self.folder / files[-1])
        return {name: identity_of(self.folder / name) for name in [*files, *(parts.sizes if parts else ())]}

    def files_unchanged(self, record) -> bool:
        """Whether the files that a record names are unchanged."""
        return all(
            identity_of(self.folder / name) == recorded for name, recorded in record.get("files", {}).items()
        )

    def run(self, task, available, shared=False) -> dict:
        """Run a task with its `available` inputs; returns its record.

        shared   whether all ranks share the task: then it is collective, and unexpected errors, which only one rank may
                 meet, are raised. Else nothing but an interrupt is raised.
        """
        start_time = time.perf_counter()
        previous, names = self.records.get(task.name), [source.name for source in available]
        record = {"task": task.name, "inputs": names, "row": {}}
        try:
            if not available and task.inputs:
                raise InputError(f"{task.inputs[0].file} failed")
            comm = session.communicator()
            if on_root(
                comm,
                lambda: _current(previous, available, lambda name: identity_of(self.folder / name, True)),
            ):
                return previous
            record["files"] = on_root(comm, lambda: self._files(names))  # before they are read
            self._work(task, available)
            record["files"] |= on_root(comm, lambda: self._files([task.name]))
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
        request = Request(job)
        request.read(job.paths)
        try:
            finished = is_finished(path, request)
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


def _current(record, inputs, identity) -> bool:
    """Whether a record is of a done task with these inputs, and all its files are unchanged."""
    return (
        _done(record)
        and {source.name for source in inputs} == set(record["inputs"])
        and all(identity(name) == recorded for name, recorded in record["files"].items())
    )

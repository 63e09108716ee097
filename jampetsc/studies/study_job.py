"""The job `study`: an ensemble of packings and the jobs that run on each."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.io.results import count_notes
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, ValueType, parameter
from jampetsc.petsc.solver_options import SOLVERS
from jampetsc.progress import duration_text

MAX_LISTED_FAILURES = 10  # failures that the summary lists
FAILURE_STATUS = 3  # exit status where some tasks failed


def _description(study):
    """Tables by name as they are, or the path of a TOML file."""
    if isinstance(study, Mapping):
        return dict(study)
    if not isinstance(study, str | Path):
        raise ValueError("must be the name of a TOML file or a dictionary of tables")
    return str(study)


@dataclass(frozen=True, eq=False)
class Study(Job):
    """An ensemble: packings, responses and their table.

    Runs every task of STUDY.toml that is not done yet. A table is a command and its keys are options; lists give a
    task for every combination of their values, and every response runs on every packing. Under mpirun each rank takes
    the next task as soon as it is free. The same command resumes a study that was stopped, on any number of ranks; a
    changed STUDY.toml adds tasks. FOLDER/table.csv has one row per task; jampetsc.load(FOLDER) reads it.
    """

    FORMAT: ClassVar = "table"
    OUT_HELP: ClassVar = "folder of the files and of table.csv"
    AGAIN: ClassVar = True
    SOLVERS: ClassVar = tuple(SOLVERS)
    EPILOG: ClassVar = """STUDY.toml, for instance:

  [pack]
  n = [256, 1024]
  pressure = [1e-2, 1e-3]
  seeds = "1:20"
  [[sweep]]
  beta = [1.0, 1e-3]
  omega = "1e-8:1e2:61"
  [quasistatic]

With `ladder = true` in [pack] each pressure starts from the packing at the preceding one, not from random particles.
A study of [pack] alone makes packings, one on each rank at a time.

examples:
  jampetsc study STUDY.toml --out ensemble --dry-run        # the list of tasks
  mpirun -n 4 jampetsc study STUDY.toml --out ensemble

A failed task is a row with its reason, and the next run tries it again; the exit status is then 3."""

    study: str | dict = parameter(
        help="description of the study: a TOML file, in python also its tables by name",
        value_type=ValueType(_description, metavar="STUDY", python="dict or the name of a TOML file"),
        place=FILE,
    )
    dry_run: bool = parameter(False, "print the tasks without running them")

    @property
    def scalar(self):
        """A dry run needs no PETSc."""
        return None if self.dry_run else "real"

    def check_outputs(self, to):
        """Refuse a folder with a table that no study has written."""
        from jampetsc.studies.study_run import check_folder

        if to.path is None:
            raise InputError(f"{named('out')}: missing. Give the folder of the study.")
        check_folder(to.path, self._named)

    @property
    def _named(self):
        return self.study if isinstance(self.study, str) else "study"

    def _content(self):
        from jampetsc.studies.plan import read

        return read(self.study) if isinstance(self.study, str) else self.study

    def kept_text(self, to):
        """See `Job`; tasks that are done stay."""
        from jampetsc.studies.journal import records_of

        done = sum(record["state"] == "done" for record in records_of(to.path).values())
        return (
            f"{done} tasks are done in {to.path}. The same command resumes."
            if done
            else super().kept_text(to)
        )

    def work(self, to):
        from jampetsc.studies.plan import plan

        if self.dry_run:
            return _task_list(plan(self._named, self._content()), to.path)

        from jampetsc.collective import on_root
        from jampetsc.io.ensemble import TABLE
        from jampetsc.petsc import session
        from jampetsc.studies import study_run

        start_time, running = time.perf_counter(), session.current()
        content = on_root(running.comm, self._content)  # of one rank for all: it may be edited meanwhile
        tasks = plan(self._named, content)
        rows = study_run.run_study(tasks, to.path, self._named, content, running)
        failures = [row for row in rows if row["state"] != "done"]
        to.status = FAILURE_STATUS if failures else 0
        return _summary(to.path / TABLE, rows, failures, duration_text(time.perf_counter() - start_time))


def _summary(table, rows, failures, elapsed) -> str:
    """The summary of a study."""
    lines = [f"{table}: {len(rows)} tasks, {len(failures)} failed, {elapsed}"]
    for row in failures[:MAX_LISTED_FAILURES]:
        lines.append(f"  {row['file']}: {row['state']}")
    if len(failures) > MAX_LISTED_FAILURES:
        lines.append(f"  … and {len(failures) - MAX_LISTED_FAILURES} more, see the table")
    return "\n".join(lines + count_notes(rows))


def _task_list(tasks, folder) -> str:
    """The tasks, each as a command line with whether it is done, and the number of unfinished ones."""
    from jampetsc.studies.journal import records_of
    from jampetsc.studies.study_run import changed_note
    from jampetsc.studies.task_runner import TaskRunner

    unfinished, changed = TaskRunner(folder, records_of(folder)).unfinished(tasks)
    unfinished = set(unfinished)
    lines = [f"{'to do' if task.name in unfinished else 'done '}  {' '.join(task.words)}" for task in tasks]
    lines += [changed_note(changed)] if changed else []
    return "\n".join([*lines, f"{len(unfinished)} of {len(tasks)} tasks to do"])

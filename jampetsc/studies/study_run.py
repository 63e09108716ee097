"""A run of a study: the ranks take the unfinished tasks one by one, and write its table from the first of them on."""

import itertools
import math
import statistics
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

from jampetsc import interrupts
from jampetsc.collective import on_root, own_cores
from jampetsc.commands import study_inputs
from jampetsc.errors import InputError, JampetscError
from jampetsc.io.atomic import refuse_links, write_error, write_whole
from jampetsc.io.ensemble import TABLE
from jampetsc.io.outputs import is_same
from jampetsc.progress import Progress, duration_text
from jampetsc.response.factor_memory import max_unknowns
from jampetsc.studies.journal import JOURNAL, LOCK, POLL_INTERVAL, Claims, Lock, keep_record, records_of, tidy
from jampetsc.studies.study_table import rows_of, table_text
from jampetsc.studies.task_runner import TaskRunner

STUDY_COPY = "study.toml"
MAX_LISTED_FILES = 10  # in a note
MIN_SHARED_DISKS = 50_000  # disks from which all ranks work on one task together
REFRESH_INTERVAL = 1.0  # seconds after which a rank writes the table again while the study runs
ESTIMATE_INTERVAL = 1.0  # seconds for which an estimate of the remaining time is kept
REFRESH_COST = 0.02  # share of its time that a rank writes the table for at most, as of very many tasks
BYTES_PER_DISK = 30_000  # of a sweep on one rank
FACTORS, UNKNOWNS = 3, 6  # of a sweep of spheres: factors that it keeps, unknowns of a sphere


def run_study(tasks, folder, path, source: bytes | dict, session) -> list[dict]:
    """Do the unfinished tasks of a study and write its table; returns the rows. Collective.

    path, source   STUDY.toml, and its content when the tasks were read, which is kept beside the table

    Raises InputError where another study runs in the folder, or where its files would be lost. A task that fails is a
    row of the table.
    """
    folder, comm = Path(folder), session.comm
    lock = Lock(folder)
    claims = on_root(comm, lambda: _open(folder, path, lock))
    try:
        records = on_root(comm, lambda: records_of(folder))
        runner = TaskRunner(folder, records, own_cores(comm))
        names, changed = on_root(comm, lambda: runner.unfinished(tasks))
        outdated = {name: records.get(name) for name in names}
        unfinished = [task for task in tasks if task.name in outdated]

        def refresh():
            current = records_of(folder).items()
            valid = {name: record for name, record in current if record != outdated.get(name)}
            write_table(folder, tasks, valid, runner)

        work = StudyRanks(session, runner, claims, unfinished, refresh)
        with work.progress:
            if changed:
                work.progress.note(changed_note(changed))
            for is_shared, group in task_groups(unfinished, sharing_limits(session)):
                (work.run_shared if is_shared else work.run_separately)(group)
        new_records = comm.gather(work.new_records)

        def finish():
            claims.end()
            added = {record["task"]: record for group in new_records for record in group}
            rows = write_table(folder, tasks, records | added, runner)
            # it may have been edited meanwhile
            if isinstance(source, bytes) and not is_same(path, folder / STUDY_COPY):
                write_whole(folder / STUDY_COPY, source, through_link=False)
            return rows

        return on_root(comm, finish)
    finally:
        lock.release()


def changed_note(changed) -> str:
    """The note about files that are missing or not what the study made."""
    more = f" and {len(changed) - MAX_LISTED_FILES} more" if len(changed) > MAX_LISTED_FILES else ""
    return (
        f"made again, with all that was computed from it, because it is missing or not what this study made: "
        f"{', '.join(changed[:MAX_LISTED_FILES])}{more}"
    )


def write_table(folder, tasks, records, runner) -> list[dict]:
    """Write the table of finished tasks; returns its rows. Tasks no longer in STUDY.toml stay while their files do."""
    names = {task.name for task in tasks}
    rows = rows_of(
        tasks,
        {name: record for name, record in records.items() if name in names or runner.files_unchanged(record)},
    )
    write_whole(folder / TABLE, table_text(rows).encode(), through_link=False)
    return rows


def check_folder(folder, path) -> None:
    """Raise InputError where a study would replace a table or a STUDY.toml that no study has put in the folder.

    path   STUDY.toml of this study, which may be the one that lies there
    """
    for name in (TABLE, STUDY_COPY):
        existing = folder / name
        if existing.exists() and not (folder / JOURNAL).is_dir() and not is_same(path, existing):
            raise InputError(
                f"{existing}: exists, but no study ran in this folder. Choose another folder, or move the file."
            )


def _open(folder, path, lock) -> Claims:
    """Take the folder for this study; the claims of its run."""
    check_folder(folder, path)
    refuse_links(*(folder / name for name in (TABLE, STUDY_COPY, JOURNAL, LOCK)))
    try:
        # the journal shows that table.csv and study.toml are a study's
        for directory in (folder, folder / JOURNAL):
            directory.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{directory}: not a folder. Choose another folder.") from None
    except OSError as error:
        raise write_error(directory, error) from None
    lock.take()
    tidy(folder)
    return Claims(folder)


def sharing_limits(session) -> dict:
    """The `limits` of `task_groups`; none on one rank, which shares no task. Collective."""
    return {} if session.size == 1 else {D: max_disks_alone(session, D) for D in (2, 3)}


def task_groups(tasks, limits) -> list[tuple]:
    """[(whether all ranks share each task, tasks)]: small ones separately, large ones shared, then their readers.

    limits   {dimension: largest number of particles that a rank works on alone}; without any all tasks are separate
    """
    shared = [task for task in tasks if limits and task.inputs and not study_inputs()[task.command].one_rank]
    large = {
        task.name for task in shared if task.columns.get("n", 0) > limits[task.columns.get("dimension") or 2]
    }
    readers = {task.name for task in tasks if any(source.name in large for source in task.inputs)}
    large -= readers
    first = [task for task in tasks if task.name not in large | readers]
    return [
        (False, sorted(first, key=lambda task: task.level)),  # packings in their order, then what reads them
        (True, [task for task in tasks if task.name in large]),
        (False, [task for task in tasks if task.name in readers]),
    ]


def max_disks_alone(session, dimension) -> int:
    """Largest packing that a rank works on alone while the others of its machine do the same. Collective."""
    half = session.memory() // 2
    fitting = half // BYTES_PER_DISK if dimension == 2 else max_unknowns(half / FACTORS) // UNKNOWNS
    return session.comm.allreduce(min(MIN_SHARED_DISKS, fitting), op=session.MPI.MIN)


class StudyRanks:
    """The unfinished tasks of a study, done by this rank and the others."""

    def __init__(self, session, runner, claims, tasks, refresh):
        self.session, self.runner, self.claims = session, runner, claims
        self.names = {task.name for task in tasks}  # of the unfinished tasks
        self.durations = TaskDurations(runner.records.values())
        self.new_records = []  # records of this rank
        self.has_new_rows = False  # that this rank has not written into the table
        self.progress = Progress(len(tasks), "study", rank=0)
        # when the remaining time was estimated; that time, in words
        self.estimated, self.remaining = -math.inf, ""
        # any rank writes the table while the study runs: others may be busy with one task for hours
        self.refresh, self.next_refresh = refresh, -math.inf

    def _available_inputs(self, task):
        """The inputs of a task whose files were made; waits for inputs that other ranks are making."""
        return [
            source for source in task.inputs if source.name not in self.names or self.claims.done(source.name)
        ]

    def run_separately(self, tasks):
        """Each task on a rank of its own. Collective."""
        # A rank that fails alone enters a barrier on COMM_WORLD (`main`), so waiting needs another communicator.
        waiting = self.session.comm.Dup()
        for place, task in enumerate(tasks):
            if self.claims.take(task.name):
                available = self._available_inputs(task)
                with self.session.alone():
                    record = self.runner.run(task, available)
                self._finish(task, record, tasks[place + 1 :], self.session.size)
                self._refresh_when_due()
        ended = waiting.Ibarrier()
        while not ended.Test():
            interrupts.check()
            if self.has_new_rows:
                self._refresh_when_due()
            time.sleep(POLL_INTERVAL)
        waiting.Free()
        self.session.collect()

    def run_shared(self, tasks):
        """One task after another, on all ranks. Collective."""
        for place, task in enumerate(tasks):
            record = self.session.comm.bcast(self.runner.run(task, self._available_inputs(task), shared=True))
            on_root(self.session.comm, partial(self._finish, task, record, tasks[place + 1 :], 1))
            on_root(self.session.comm, self._refresh_when_due)

    def _refresh_when_due(self):
        """Write the table, at once the first time; more rarely where that takes long.

        A failure stops no rank: the table is written again at the end, where all ranks learn that it fails.
        """
        start = time.monotonic()
        if start < self.next_refresh:
            return
        with suppress(JampetscError):
            self.refresh()
        end = time.monotonic()
        self.next_refresh = end + REFRESH_INTERVAL * max(1.0, (end - start) / REFRESH_COST)
        self.has_new_rows = False

    def _finish(self, task, record, unfinished, ranks):
        """Write the record of a task, announce its outcome and report it."""
        if record is not self.runner.records.get(task.name):
            keep_record(self.runner.folder, record)
            self.new_records.append(record)
            self.durations.add(record)
            self.has_new_rows = True
        self.claims.settle(task.name, record["state"] == "done")
        self._report(task, record, unfinished, ranks)

    def _report(self, task, record, unfinished, ranks):
        finished, failed = self.claims.tally()
        if time.monotonic() > self.estimated + ESTIMATE_INTERVAL:
            self.estimated, seconds = time.monotonic(), self.durations.remaining(unfinished)
            self.remaining = "" if seconds is None else f"{duration_text(seconds / ranks)} left"
        parts = [
            f"{task.file} {record['seconds']:.2g} s"
            if record["state"] == "done"
            else f"{task.file}: {record['why']}",
            f"{failed} failed" if failed else "",
            self.remaining if unfinished else "",
        ]
        self.progress.count = finished - 1
        self.progress.step("; ".join(filter(None, parts)))


class TaskDurations:
    """Seconds of finished tasks, from which the time of unfinished ones is extrapolated."""

    def __init__(self, records=()):
        self._seconds = {}  # command -> seconds of its finished tasks
        for record in records:
            self.add(record)

    def add(self, record: dict) -> None:
        """Add the record of a task; a failed one does not count."""
        if record["state"] == "done":
            self._seconds.setdefault(record["row"]["command"], []).append(record["seconds"])

    def remaining(self, tasks) -> float | None:
        """Seconds of these tasks one after another; None if no task is done.

        Each counts as the mean of the finished tasks of its command, or of all commands if its own has none.
        """
        if not self._seconds:
            return None
        overall = statistics.fmean(itertools.chain(*self._seconds.values()))
        means = {command: statistics.fmean(seconds) for command, seconds in self._seconds.items()}
        return sum(means.get(task.command, overall) for task in tasks)

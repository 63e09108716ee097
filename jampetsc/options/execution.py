"""One run of a job, for the command line, for python and for the tasks of a study."""

import sys

from jampetsc import interrupts
from jampetsc.collective import on_root
from jampetsc.errors import named
from jampetsc.io.outlet import Outlet
from jampetsc.io.request import Request
from jampetsc.options.job import Job
from jampetsc.petsc import launchers, session
from jampetsc.progress import LOG


def run_job(
    job: Job, out=None, checkpoint=None, *, petsc_argv=(), argv=None, overwrite=False, alone=False
) -> Outlet:
    """Check that the result may be written, start PETSc if it is needed, do the work. Collective.

    out         file of the result; None: it stays in memory
    checkpoint  file beside which a long run keeps its finished steps; None: in memory
    petsc_argv  PETSc's own options
    argv        the command line that the result records; None: the one of this process
    overwrite   whether a finished result is computed again and replaced
    alone       whether only this rank calls, for a job without PETSc

    Returns the outlet with the result and, as `summary`, the text for the user; of a finished result, which stays, only
    that it is there.

    Raises InputError before any work for an output that may not be written, as `Job.work` does, and KeyboardInterrupt,
    which says what is kept, after a Ctrl-C (see `interrupts`).
    """
    to, is_done = Outlet(out, checkpoint, Request(job, argv or sys.argv, overwrite)), False
    try:
        with interrupts.deferred():
            to.summary = _run(job, to, petsc_argv, alone)
            is_done = True
        return to
    except KeyboardInterrupt:
        kept = f"{to} is finished." if is_done else job.kept_text(to)
        raise KeyboardInterrupt(f"interrupted: {kept}") from None


def _run(job, to, petsc_argv, alone) -> str:
    """The summary."""
    if job.scalar is None:
        comm = None if alone else session.communicator()
    else:  # one process looks at the files before PETSc starts
        comm = _start(job, petsc_argv).comm if launchers.has_several_ranks() else None
    if on_root(comm, lambda: _is_finished(job, to)):
        to.finished = True
        on_root(comm, lambda: job.complete(to))
        return f"{to}: finished earlier with the same settings and inputs. {named('overwrite')} computes it again."
    if job.scalar is not None:
        running = session.current() if comm else _start(job, petsc_argv)
        running.forget_defaults()
        summary = job.work(to)
        running.free_dropped(running.comm)
        if petsc_argv:
            running.report_unused()
        return summary + to.parts_note
    worker = job if comm is None else job.gathered()
    summary = on_root(comm, lambda: worker.work(to))
    if comm is not None and to.path is None:
        to.share(comm)
    return summary


def _is_finished(job, to) -> bool:
    """Whether the result is there already and stays. Raises InputError for what may not be replaced."""
    job.check_outputs(to)
    return to.finished


def _start(job, petsc_argv):
    """The session with the scalars that the job needs. Collective."""
    running = session.start(None if job.scalar == "any" else job.scalar, petsc_argv)
    if running.rank == 0:
        version = ".".join(map(str, running.PETSc.Sys.getVersion()))
        LOG.debug("PETSc %s, %s scalars, %d ranks: %s", version, running.scalar_type, running.size, job)
    return running

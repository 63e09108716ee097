"""One run of a job: may its result be put there, PETSc where it is needed, the work."""

import contextlib
import sys

from jampetsc import progress
from jampetsc.asking.job import Job
from jampetsc.collective import on_root
from jampetsc.io.outlet import Outlet
from jampetsc.petsc import session
from jampetsc.progress import LOG


def perform(job: Job, to: Outlet, *, petsc_argv=(), argv=None, overwrite=False, alone=False) -> str:
    """Do the job; what a user wants to read. Collective.

    to          outlet of the result
    petsc_argv  PETSc's own options; argv: the command line that the result records
    overwrite   whether a finished result of other settings may be replaced
    alone       whether no other rank is here for a job that one rank does

    Raises InputError before any work for an output that cannot be, and as the job does.
    """
    to.request = job.request(argv or sys.argv, overwrite)
    job.check_outputs(to)
    if job.scalar is not None:
        running = session.start(None if job.scalar == "any" else job.scalar, petsc_argv)
        if running.rank == 0:
            version = ".".join(map(str, running.PETSc.Sys.getVersion()))
            LOG.debug("PETSc %s, %s scalars, %d ranks: %s", version, running.scalar_type, running.size, job)
        return job.work(to)
    comm = None if alone else session.communicator()
    job = job if comm is None else job.gathered()
    told = on_root(comm, lambda: job.work(to))
    if comm is not None and to.path is None:
        to.share(comm)
    return told


def answer(job: Job, out=None, *, checkpoint=None, overwrite=False, told=False):
    """The result of a job, as a python function gives it: in memory, or in the file `out` and loaded. Collective.

    checkpoint  file, beside which a long run keeps what it has finished; default: out
    told        whether progress is told on stderr; else it is what handlers of python's logger `jampetsc` make of it
    """
    to = Outlet(out, out if checkpoint is None else checkpoint)
    with progress.telling(True) if told else contextlib.nullcontext():
        told = perform(job, to, argv=job.line(out), overwrite=overwrite)
    return job.answer(to, told)

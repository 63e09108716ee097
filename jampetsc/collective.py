"""What ranks do as one: a failure of one rank is everybody's, and what one rank finds out all of them know."""

import os
import socket
from contextlib import contextmanager

from jampetsc.errors import JampetscError


@contextmanager
def agreed(comm):
    """Collective. A JampetscError in the block on any rank is raised on every rank: that of the lowest rank.

    `comm` is an mpi4py communicator, or None for one process. Other exceptions stay with their rank.
    """
    failure = None
    try:
        yield
    except JampetscError as error:
        failure = error
    failures = [failure] if comm is None else comm.allgather(failure)
    for error in failures:
        if error is not None:
            raise error from None


def on_root(comm, action):
    """Collective. What `action()` returns on rank 0, on every rank; a JampetscError that it raises there, too.

    For what is to happen once, such as a look at a file. `comm` as in `agreed`.
    """
    found = None
    with agreed(comm):
        if comm is None or comm.rank == 0:
            found = action()
    return found if comm is None else comm.bcast(found)


def own_cores(comm, working: bool = True) -> int:
    """Collective. How many cores this rank may use, shared evenly with those ranks of its node that are `working`.

    What a rank may use is its affinity: what the job gave it, or what mpirun bound it to.
    """
    mine = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
    ranks = comm.allgather((socket.gethostname(), mine if working else set()))
    others = [cores for host, cores in ranks if host == socket.gethostname()]
    return max(1, int(sum(1.0 / max(1, sum(core in cores for cores in others)) for core in mine) + 1e-9))

"""What all ranks do together: an error of one rank is raised on all, and what rank 0 computes is sent to all."""

import os
import socket
from contextlib import contextmanager

from jampetsc.errors import JampetscError


@contextmanager
def agreed(comm):
    """Collective. A JampetscError that any rank raises in the block is raised on every rank, the lowest rank's.

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
    """Collective. Call `action()` on rank 0 alone; return its result, or raise its JampetscError, on every rank.

    For actions that happen once, such as reading a file. `comm` as in `agreed`.
    """
    result = None
    with agreed(comm):
        if comm is None or comm.rank == 0:
            result = action()
    return result if comm is None else comm.bcast(result)


def own_cores(comm, working: bool = True) -> int:
    """Collective. Number of cores for this rank, at least 1: the cores it may run on, shared evenly among the
    ranks of its node that are `working`.

    A rank may run on the cores of its affinity mask, to which the batch job or mpirun bound it.
    """
    own = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
    ranks = comm.allgather((socket.gethostname(), own if working else set()))
    return share_of_cores(own, [cores for host, cores in ranks if host == socket.gethostname()])


def share_of_cores(own: set, node: list[set]) -> int:
    """How many of its `own` cores a rank has, at least 1, when each is shared by the working ranks that may use it.

    node   the cores of each working rank of this node, this one included
    """
    return max(1, int(sum(1.0 / max(1, sum(core in cores for cores in node)) for core in own) + 1e-9))

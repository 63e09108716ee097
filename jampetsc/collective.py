"""One rank's failure as everybody's: after a step in which any rank may fail, all go on or all raise."""

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

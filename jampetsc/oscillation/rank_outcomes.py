"""Points that each rank solves alone: their outcomes, a record or the ConvergenceError that ended one."""

from collections.abc import Callable, Sequence

from jampetsc.errors import ConvergenceError
from jampetsc.petsc.session import current


def outcome_of(solve: Callable, point):
    """solve(point), or the ConvergenceError that it raises."""
    try:
        return solve(point)
    except ConvergenceError as error:
        return error


def solve_alone(solve: Callable, points: Sequence, comm) -> list:
    """The outcome of each of at most as many points as there are ranks, one on each rank. Collective."""
    own = None
    if comm.rank < len(points):
        with current().alone():
            own = outcome_of(solve, points[comm.rank])
    return comm.allgather(own)[: len(points)]

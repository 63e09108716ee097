"""Points that each rank solves alone: their outcomes, a record or the ConvergenceError that ended one."""

from collections.abc import Callable, Sequence

from jampetsc.errors import ConvergenceError, named
from jampetsc.petsc.session import current
from jampetsc.progress import Progress


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


class Outcomes:
    """The finished points of a run by their numbers.

    records     {number: record}, at first of an earlier run
    failures    {number: ConvergenceError}
    """

    def __init__(self, resume: dict | None, save: Callable[[int, dict], None] | None, progress: Progress):
        self.records, self.failures = dict(resume or {}), {}
        self._save, self._progress = save, progress

    def add(self, number: int, outcome, words: str, summary: Callable[[dict], str]) -> None:
        """Keep the outcome of a point, save its record and report it; words: the point."""
        if isinstance(outcome, ConvergenceError):
            self.failures[number] = ConvergenceError(f"{words}: {outcome.message(named)}")
            self._progress.step(f"failed: {words}: {outcome}")
            return
        self.records[number] = outcome
        if self._save is not None:
            self._save(number, outcome)
        self._progress.step(f"{words}  {summary(outcome)}")

"""Who takes the next task, and what became of each: a few numbers that all ranks see, in memory of rank 0.

Every rank works and takes what is next as soon as it is free; nobody hands out tasks, so there is no rank that only
waits for the others, as the manager of mpi4py.futures does. One-sided operations need no answer from a busy rank on
one machine. On several, some networks do: rank 0 then does nothing else (`keeps_books`).
"""

import time

import numpy as np

NEXT, FINISHED, FAILED, FIRST = range(4)  # places: next task, numbers of finished and of failed ones, states
OPEN, DONE, BROKEN = range(3)  # states of a task
NAP = 0.01  # seconds between two looks while a rank waits


class Board:
    """Collective to make and to `close`; everything else each rank does for itself.

    node          communicator of the ranks that share this one's memory; found out by default
    keeps_books   whether this rank is to wait for the others instead of taking tasks
    """

    def __init__(self, session, tasks: int, node=None):
        MPI, comm = session.MPI, session.comm
        self._MPI, self._tasks = MPI, tasks
        self.comm = comm
        self._window = MPI.Win.Allocate((FIRST + tasks) * 8 if comm.rank == 0 else 0, 8, comm=comm)
        if comm.rank == 0:
            self._window.Lock(0)
            np.frombuffer(self._window.tomemory(), dtype=np.int64)[:] = 0
            self._window.Unlock(0)
        comm.Barrier()
        mine = node or comm.Split_type(MPI.COMM_TYPE_SHARED)
        self.keeps_books = comm.rank == 0 and comm.size > mine.size
        if node is None:
            mine.Free()

    def _add(self, place, amount):
        """Add to a number; its value before."""
        before = np.zeros(1, np.int64)
        self._window.Lock(0, self._MPI.LOCK_SHARED)
        self._window.Fetch_and_op(np.array([amount], np.int64), before, 0, place, self._MPI.SUM)
        self._window.Unlock(0)
        return int(before[0])

    def take(self) -> int:
        """Number of the next task; beyond the last one when all are taken."""
        return self._add(NEXT, 1)

    def state(self, task) -> int:
        """OPEN, DONE or BROKEN."""
        return self._add(FIRST + task, 0)

    def settled(self, task) -> int:
        """The state of a task that some rank has taken, once that has finished it."""
        while (state := self.state(task)) == OPEN:
            time.sleep(NAP)
        return state

    def settle(self, task, state) -> tuple[int, int]:
        """Say what became of a task; (finished, failed) now."""
        failed = self._add(FAILED, int(state == BROKEN)) + int(state == BROKEN)
        self._add(FIRST + task, state)
        return self._add(FINISHED, 1) + 1, failed

    def states(self) -> list[int]:
        """The states of all tasks."""
        whole = np.empty(FIRST + self._tasks, np.int64)
        self._window.Lock(0, self._MPI.LOCK_SHARED)
        self._window.Get(whole, 0)
        self._window.Unlock(0)
        return whole[FIRST:].tolist()

    def wait_for(self, tasks: int, meanwhile=lambda: None) -> None:
        """Return when so many are finished; call `meanwhile` again and again until then."""
        while self._add(FINISHED, 0) < tasks:
            meanwhile()
            time.sleep(NAP)

    def close(self) -> None:
        """Collective: memory goes when all have come here."""
        self._window.Free()

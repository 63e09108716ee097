"""Threads that run one compiled function in step, each on its share of the disks.

A minimisation is a few hundred thousand steps of a fraction of a millisecond, so threads may cost a microsecond
per step at most: they are started once, each stays inside one compiled function (without python's global lock)
for many steps, and they meet at barriers on a shared counter. Every thread takes the same decisions from the same
sums: the shares are added in the same order whatever the number of threads.

The system likes to wake a thread on the core that called it. Two that spin at a barrier and offer each other the core
look to it like two programs at work, and it leaves them there, taking turns: so each begins by stepping aside.
"""

import ctypes
import os
import threading
import time
import weakref
from collections import Counter, deque
from queue import SimpleQueue

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from jampetsc.core.compiled import compiled

LOOK = 32  # runs, of which the first is one thread's,
TRIAL = 4  # so many of all: in the first ones they wake up, and find nothing in their caches
HOPELESS = 3.0  # times slower than one alone: then no more of them
SPINS = 2000  # looks at the counter before the core is offered to others: about a microsecond
LISTENS = 4000  # such offers, one to three milliseconds, before a thread that has nothing to do goes to sleep

_yield = types.ExternalFunction("sched_yield", types.int32())


@intrinsic
def _arrive(typing, counter):
    """Add one to counter[0], seen by all threads; what was written before is seen as well. The new value."""

    def generate(context, builder, signature, arguments):
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        one = context.get_constant(types.int64, 1)
        return builder.add(builder.atomic_rmw("add", data, one, "seq_cst"), one)

    return types.int64(counter), generate


@intrinsic
def _look(typing, counter):
    """The value of counter[0] as other threads have left it."""

    def generate(context, builder, signature, arguments):
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.load_atomic(data, "seq_cst", 8)

    return types.int64(counter), generate


@compiled(False, nogil=True)
def meet(counter, threads):
    """Wait until all `threads` are here. counter (1,) int64, zero before the first meeting."""
    if threads == 1:
        return
    mine = _arrive(counter)
    wanted = ((mine + threads - 1) // threads) * threads
    spins = 0
    while _look(counter) < wanted:
        spins += 1
        if spins > SPINS:
            _yield()


@compiled(False, nogil=True)
def _listen(counter):
    """Wait for the first of a new run to arrive, but not for long.

    A core that fell asleep takes half a millisecond to wake, as long as ten steps. The first one to arrive does not
    hold python's lock, for which this thread would fall asleep as well.
    """
    looks = 0
    while _look(counter) == 0 and looks < SPINS + LISTENS:
        looks += 1
        if looks > SPINS:
            _yield()


_LINUX = hasattr(os, "sched_getaffinity")
_libc = ctypes.CDLL(None)


def _core() -> int:
    """The core that this thread runs on; −1 where the system does not tell."""
    return _libc.sched_getcpu() if _LINUX else -1


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if _LINUX else os.cpu_count() or 1


def _step_aside(me, at):
    """Let thread `me` go to another core than those that the ones before it began `at`."""
    taken = set(at[:me])
    if _LINUX and _core() in taken:
        allowed = os.sched_getaffinity(0)
        if free := allowed - taken:
            os.sched_setaffinity(0, free)
            os.sched_setaffinity(0, allowed)  # where it is now, until the system knows better
    at[me] = _core()


def _serve(me, at, tasks):
    """Thread `me` of a team: run what is put into the queue `tasks`, say so, and listen for the next run, until None.

    Queues, as a pool of `concurrent.futures` takes 60 to 110 µs for a run where they take 10 to 30, and a list of 4096
    disks with the steps that it serves for, 4 ms, takes two runs.
    """
    while task := tasks.get():
        function, arguments, done, following = task
        error = None
        try:
            _step_aside(me, at)
            function(*arguments)
        except BaseException as raised:
            error = raised
        del task, function, arguments  # they may hold the team
        done.put(error)
        _listen(following)


class Team:
    """`size` threads at most, this one among them, that run compiled functions together.

    function(me, threads, counter, …) is to release the global lock, to meet on `counter` and to return
    (status, steps, …), the same however many threads take part. So as many take part as get on faster: threads that
    share their cores with other programs wait for each other longer than one alone would work.
    """

    def __init__(self, size: int = 1):
        self.size = size
        self._at = [-1] * size  # the cores on which threads began
        self._tasks = [SimpleQueue() for _ in range(1, size)]
        for me, tasks in enumerate(self._tasks, 1):
            threading.Thread(target=_serve, args=(me, self._at, tasks), daemon=True).start()
            weakref.finalize(self, tasks.put, None)
        self._counter = np.zeros(1, np.int64)  # of the next run
        self._paces = {}  # (function, most threads) -> {threads: seconds per step, the last few times}
        self._runs = Counter()

    def run(self, function, shares: int, *arguments):
        """What `function` returns on this thread, once all have returned; at most `shares` threads take part."""
        most = min(self.size, shares)
        threads = self._fastest(function, most)
        counter, self._counter = self._counter, np.zeros(1, np.int64)
        compiled, done = bool(function.overloads), SimpleQueue()
        began = time.perf_counter()
        self._at[0] = _core()
        for me in range(1, threads):
            self._tasks[me - 1].put((function, (me, threads, counter, *arguments), done, self._counter))
        mine = function(0, threads, counter, *arguments)
        for _ in range(1, threads):
            if error := done.get():
                raise error
        if compiled and most > 1:
            pace = (time.perf_counter() - began) / max(mine[1], 1)
            self._paces[function, most][threads].append(pace)
        return mine

    def _fastest(self, function, most):
        """All of `most` threads or one alone: what was faster of late, both tried again and again."""
        if most == 1:
            return 1
        key = function, most
        paces = self._paces.setdefault(key, {n: deque(maxlen=TRIAL) for n in (most, 1)})
        turn = self._runs[key] % LOOK
        self._runs[key] += 1
        if turn == 0 or not paces[1]:
            return 1
        alone, together = min(paces[1]), paces[most]
        if turn <= TRIAL and (turn == 1 or not together or together[-1] < HOPELESS * alone):
            return most
        return most if min(together) < alone else 1

"""Threads that run one compiled function in step, each on a part of the disks.

A minimisation is a few hundred thousand steps of a fraction of a millisecond, so threads may cost a microsecond
per step at most: they are started once, each stays inside one compiled function (without python's global lock)
for many steps, and they meet at barriers on a shared counter. Every thread takes the same decisions from the same
sums: partial sums are added in the same order whatever the number of threads.

Linux tends to wake a thread on the core of the thread that woke it. Two threads that wait for each other there,
spinning and yielding, both look busy and are left to share the core: so each begins by moving to a core of its own.
"""

import ctypes
import os
import threading
import time
import weakref
from collections import deque
from queue import SimpleQueue

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from jampetsc import interrupts
from jampetsc.packing.compiled import compiled, nested

PERIOD = 32  # runs after which both numbers of threads are tried again: one run of one thread,
TRIAL = 4  # then this many of all: the first ones are slow, as threads wake up and their caches are empty;
MAX_SLOWDOWN = 3.0  # but no more once all take this many times as long as one
SPINS = 2000  # reads of the counter before the thread yields its core: about a microsecond
YIELDS = 4000  # yields, one to three milliseconds, before a thread without a task goes to sleep

_yield = types.ExternalFunction("sched_yield", types.int32())


@intrinsic
def _arrive(typing, counter):
    """Add one to counter[0] atomically, with earlier writes visible to all threads, and return the new value."""

    def generate(context, builder, signature, arguments):
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        unit = context.get_constant(types.int64, 1)
        return builder.add(builder.atomic_rmw("add", data, unit, "seq_cst"), unit)

    return types.int64(counter), generate


@intrinsic
def _read(typing, counter):
    """The value of counter[0] as other threads have left it."""

    def generate(context, builder, signature, arguments):
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.load_atomic(data, "seq_cst", 8)

    return types.int64(counter), generate


@nested(False, nogil=True)
def meet(counter, threads):
    """Wait until all `threads` are here. counter (1,) int64, zero before the first meeting."""
    if threads == 1:
        return
    arrival = _arrive(counter)
    expected = ((arrival + threads - 1) // threads) * threads
    spins = 0
    while _read(counter) < expected:
        spins += 1
        if spins > SPINS:
            _yield()


@compiled(False, nogil=True)
def _listen(counter):
    """Wait up to a few milliseconds for the first thread of the next run to arrive.

    A core that fell asleep takes half a millisecond to wake, as long as ten steps. A thread that has arrived does not
    hold python's global lock, for which this thread would fall asleep as well.
    """
    reads = 0
    while _read(counter) == 0 and reads < SPINS + YIELDS:
        reads += 1
        if reads > SPINS:
            _yield()


_LINUX = hasattr(os, "sched_getaffinity")
_libc = ctypes.CDLL(None)


def _core() -> int:
    """The core that this thread runs on; −1 where the system does not say."""
    return _libc.sched_getcpu() if _LINUX else -1


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if _LINUX else os.cpu_count() or 1


def _take_own_core(me, start_cores):
    """Move thread `me` off the cores on which threads before it began, if it may use others; note its core."""
    taken = set(start_cores[:me])
    if _LINUX and _core() in taken:
        allowed = os.sched_getaffinity(0)
        if free := allowed - taken:
            os.sched_setaffinity(0, free)
            os.sched_setaffinity(0, allowed)  # it stays there until the scheduler moves it
    start_cores[me] = _core()


def _serve(me, start_cores, tasks):
    """Thread `me` of a team: run each task of the queue `tasks`, put its error or None into `done`; end at a task None.

    Queues cost 10 to 30 µs per run, a pool of concurrent.futures 60 to 110; a list of 4096 disks and the steps that
    it serves for, 4 ms, take two runs.
    """
    while task := tasks.get():
        function, arguments, done, following = task
        error = None
        try:
            _take_own_core(me, start_cores)
            function(*arguments)
        except BaseException as raised:
            error = raised
        del task, function, arguments  # references to the team among them would keep it alive
        done.put(error)
        _listen(following)


class ThreadChoice:
    """How many threads take part in the next run: `most` or 1, whichever was faster recently.

    Both are tried again in every PERIOD of runs.
    """

    def __init__(self, most: int):
        self.most = most
        self._paces = {n: deque(maxlen=TRIAL) for n in (most, 1)}  # seconds per step, the last few times
        self._runs = 0

    def next_number(self) -> int:
        """The number of threads of the next run."""
        if self.most == 1:
            return 1
        turn = self._runs % PERIOD
        self._runs += 1
        alone, together = self._paces[1], self._paces[self.most]
        if turn == 0 or not alone:
            return 1
        if turn <= TRIAL and (turn == 1 or not together or together[-1] < MAX_SLOWDOWN * min(alone)):
            return self.most
        return self.most if min(together) < min(alone) else 1

    def note_pace(self, threads: int, pace: float) -> None:
        """Note the seconds per step of a run with this number of threads."""
        self._paces[threads].append(pace)


class Team:
    """`size` threads at most, this one among them, that run compiled functions together.

    function(me, threads, counter, …) is to release the global lock, to meet on `counter` and to return
    (status, steps, …), the same however many threads take part. All take part or this one alone, whichever is faster:
    threads that share their cores with other programs may wait for each other longer than one alone would work.
    """

    def __init__(self, size: int = 1):
        self.size = size
        self._start_cores = [-1] * size  # the cores on which threads began their last runs
        self._tasks = [SimpleQueue() for _ in range(1, size)]
        for me, tasks in enumerate(self._tasks, 1):
            threading.Thread(target=_serve, args=(me, self._start_cores, tasks), daemon=True).start()
            weakref.finalize(self, tasks.put, None)
        self._counter = np.zeros(1, np.int64)  # of the next run
        self._choices = {}  # (function, most threads) -> ThreadChoice

    def run(self, function, shares: int, *arguments):
        """Run `function` on at most `shares` threads; return its result on this one, or raise an error of another.

        A Ctrl-C is raised before, see `interrupts`.
        """
        interrupts.check()
        most = min(self.size, shares)
        if (function, most) not in self._choices:
            self._choices[function, most] = ThreadChoice(most)
        choice = self._choices[function, most]
        threads = choice.next_number()
        counter, self._counter = self._counter, np.zeros(1, np.int64)
        compiled, done = bool(function.overloads), SimpleQueue()
        start_time = time.perf_counter()
        self._start_cores[0] = _core()
        for me in range(1, threads):
            self._tasks[me - 1].put((function, (me, threads, counter, *arguments), done, self._counter))
        own_result = function(0, threads, counter, *arguments)
        for _ in range(1, threads):
            if error := done.get():
                raise error
        if compiled and most > 1:
            choice.note_pace(threads, (time.perf_counter() - start_time) / max(own_result[1], 1))
        return own_result

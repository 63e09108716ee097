"""Threads that run one compiled function in step, each on its share of the disks.

A minimisation is a few hundred thousand steps of a fraction of a millisecond, so threads may cost a microsecond
per step at most: they are started once, each stays inside one compiled function (without python's global lock)
for many steps, and they meet at barriers on a shared counter. Every thread takes the same decisions from the same
sums: the shares are added in the same order whatever the number of threads.
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from jampetsc.core.compiled import compiled

LOOK = 16  # runs after which the slower number of threads is tried again
SPINS = 2000  # looks at the counter before the core is offered to others: about a microsecond

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


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Team:
    """`size` threads at most, this one among them, that run compiled functions together.

    function(me, threads, counter, …) is to release the global lock, to meet on `counter` and to return
    (status, steps, …), the same however many threads take part. So as many take part as get on faster: threads that
    share their cores with other programs wait for each other longer than one alone would work.
    """

    def __init__(self, size: int = 1):
        self.size = size
        self._others = ThreadPoolExecutor(size - 1) if size > 1 else None
        self._paces = {}  # (function, threads) -> seconds per step, the last time
        self._runs = 0

    def run(self, function, shares: int, *arguments):
        """What `function` returns on this thread, once all have returned; at most `shares` threads take part."""
        threads = self._fastest(function, min(self.size, shares))
        counter = np.zeros(1, np.int64)
        compiled = bool(function.signatures)
        began = time.perf_counter()
        others = [self._others.submit(function, me, threads, counter, *arguments) for me in range(1, threads)]
        mine = function(0, threads, counter, *arguments)
        for other in others:
            other.result()
        if compiled:
            self._paces[function, threads] = (time.perf_counter() - began) / max(mine[1], 1)
        return mine

    def _fastest(self, function, most):
        """All of `most` threads or one alone: what was faster, or in every LOOK-th run the other."""
        if most == 1:
            return 1
        self._runs += 1
        fastest, other = sorted((most, 1), key=lambda threads: self._paces.get((function, threads), 0.0))
        return other if self._runs % LOOK == 0 else fastest

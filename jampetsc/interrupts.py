"""Ctrl-C while a job runs: the handler notes the signal, and `check` raises KeyboardInterrupt between two steps.

Python's own handler raises wherever python code runs, also where compiled code, PETSc or HDF5 have called it: numba
crashes then. What computes for long calls `check`, or what does so: `Team.run`, `Progress.step`, factorisations and
solves of PETSc, `open_file`.
"""

import signal
import sys
import threading

_noted = False  # whether there was a signal that nothing has raised yet
_outside = None  # handler outside the job; None: no job runs


def _note(number, frame):
    global _noted
    _noted = True
    signal.signal(signal.SIGINT, _outside)  # a second Ctrl-C acts as without a job


def check() -> None:
    """Raise KeyboardInterrupt after a Ctrl-C, in the main thread."""
    global _noted
    if _noted and threading.current_thread() is threading.main_thread():
        _noted = False
        raise KeyboardInterrupt


class deferred:
    """Context of a job: the first Ctrl-C is raised by `check`, or at the end of the context.

    Outside the main thread, within another such context, and where Ctrl-C is ignored or has a handler of the user's,
    nothing changes. A class, see `errors.about`.
    """

    def __enter__(self):
        global _outside, _noted
        usual = (signal.default_int_handler, signal.SIG_DFL)
        self._handles = (
            threading.current_thread() is threading.main_thread()
            and _outside is None
            and signal.getsignal(signal.SIGINT) in usual
        )
        if self._handles:
            _noted, _outside = False, signal.getsignal(signal.SIGINT)
            signal.signal(signal.SIGINT, _note)

    def __exit__(self, kind, error, trace):
        global _outside
        if self._handles:
            signal.signal(signal.SIGINT, _outside)
            _outside = None
            check()


class waiting:
    """Context in which python waits for another process: Ctrl-C raises at once, and SIGTERM raises SystemExit.

    Handlers of the user's stay, and outside the main thread nothing changes.
    """

    def __enter__(self):
        self._before = {}
        if threading.current_thread() is threading.main_thread():
            for number, previous, during in (
                (signal.SIGINT, _note, signal.default_int_handler),
                (signal.SIGTERM, signal.SIG_DFL, lambda number, frame: sys.exit(128 + number)),
            ):
                if signal.getsignal(number) == previous:
                    self._before[number] = previous
                    signal.signal(number, during)

    def __exit__(self, kind, error, trace):
        for number, handler in self._before.items():
            signal.signal(number, handler)

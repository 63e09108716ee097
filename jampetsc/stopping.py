"""SIGTERM: what cleans up runs, and the process ends within seconds whatever it is doing.

Python runs a handler between two of its own instructions, so not during a long factorisation, nor while the rank
waits for others in MPI: nothing inside this process can then be relied on. `watched` starts a second process that
waits on a pipe, into which python's C handler writes at once, and ends this one after PATIENCE seconds. That loses
no more than SIGKILL would: what was finished is on disk. When one rank has ended, mpirun ends the others.
"""

import contextlib
import ctypes
import os
import select
import signal
import sys
import threading

from jampetsc import streams

MESSAGE = "stopped by SIGTERM; what was finished is on disk"
PATIENCE = 2.0  # seconds that the main thread gets to notice; mpirun, stopping a job, kills after one
CLEANING = 10.0  # seconds that it then gets to clean up
_NOTICED = b"\0"  # no signal has this number

_pipe = None  # to the process that watches
_noticed = False


class Terminated(SystemExit):
    """SIGTERM arrived. `finally` blocks run on the way out; exit status 143 as from the shell."""

    def __init__(self):
        super().__init__(128 + signal.SIGTERM)


def stop_on_sigterm() -> None:
    """From now on SIGTERM raises Terminated, at the next python instruction; a second one kills at once."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)
        _only_once(signal.SIGTERM)
        sys.unraisablehook = _unraisable


def noticed() -> bool:
    """Whether Terminated was raised. What is raised afterwards may be due to code that cannot pass exceptions on."""
    return _noticed


@contextlib.contextmanager
def watched():
    """While the context lasts, this process does not outlive a SIGTERM by more than PATIENCE, or CLEANING seconds."""
    global _pipe
    ear, _pipe = os.pipe()
    os.set_blocking(_pipe, False)
    watched_pid = os.getpid()
    watcher = os.fork()
    if watcher == 0:
        with contextlib.suppress(BaseException):
            os.close(_pipe)
            _watch(watched_pid, ear)
        os._exit(0)
    os.close(ear)
    signal.set_wakeup_fd(_pipe, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(-1)
        os.close(_pipe)  # ends the watcher
        _pipe = None
        os.waitpid(watcher, 0)


def _unraisable(arguments):
    """sys.unraisablehook: Terminated, raised in what C calls back, as LLVM does in numba, ends there: no word of it."""
    if not isinstance(arguments.exc_value, Terminated):
        sys.__unraisablehook__(arguments)


def _terminate(number, frame):
    global _noticed
    _noticed = True
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if _pipe is not None:
        os.write(_pipe, _NOTICED)
    raise Terminated


def _watch(watched_pid, ear):
    """In the second process: wait for SIGTERM in the first, and end it when it does not end by itself."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # what is sent to both is for the first
    heard, patience = b"", None
    while select.select([ear], [], [], patience)[0]:
        word = os.read(ear, 64)
        if not word:
            return  # the first has ended
        heard += word
        if signal.SIGTERM in heard:
            patience = CLEANING if _NOTICED in heard else PATIENCE
    streams.say(f"{streams.ERROR}{MESSAGE}\n")
    for number in (signal.SIGTERM, signal.SIGKILL):
        if os.getppid() == watched_pid:
            os.kill(watched_pid, number)
        if select.select([ear], [], [], 1.0)[0]:
            return


_SA_RESETHAND = -0x80000000


class _Sigaction(ctypes.Structure):
    """struct sigaction of Linux's C libraries."""

    _fields_ = (
        ("handler", ctypes.c_void_p),
        ("mask", ctypes.c_ubyte * 128),
        ("flags", ctypes.c_int),
        ("restorer", ctypes.c_void_p),
    )


def _only_once(number):
    """Have the system forget the handler of a signal when it is called: python has no word for SA_RESETHAND."""
    if not sys.platform.startswith("linux"):
        return
    libc, action = ctypes.CDLL(None), _Sigaction()
    libc.sigaction(int(number), None, ctypes.byref(action))
    action.flags |= _SA_RESETHAND
    libc.sigaction(int(number), ctypes.byref(action), None)

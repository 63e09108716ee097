"""Disks on which something happens: at one of the calls that change them a process is killed, or the call fails."""

import os

from jampetsc.io import atomic

NAMES = [(os, name) for name in ("fsync", "replace", "mkdir")]
WRITES = [*NAMES, (atomic.FileStream, "write_all")]
CHANGES = [*NAMES, (os, "unlink"), (os, "rmdir")]


def disturb(put, number, happen, calls=CHANGES):
    """Call `happen` before call `number`, from 0, of `calls`, which change the disk; `put` does what setattr does.

    Returns a list of one number, below zero once it has happened.
    """
    left = [number]

    def counted(original):
        def counts(*args, **kwargs):
            left[0] -= 1
            if left[0] == -1:
                happen()
            return original(*args, **kwargs)

        return counts

    for owner, name in calls:
        put(owner, name, counted(getattr(owner, name)))
    return left


def killed(number, action, calls=CHANGES) -> bool:
    """Whether a child process that does `action` was killed at that call; else it has come to its end."""
    child = os.fork()
    if child == 0:
        try:
            disturb(setattr, number, lambda: os._exit(9), calls)
            action()
            os._exit(0)
        finally:
            os._exit(1)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, 9)
    return status == 9

"""The errors a user can meet, each a single clear line: what, which value, what to do.

`cli.main` turns them into that line and `exit_code`; in scripts they are ordinary exceptions. A message names a
parameter by `named`, and whoever shows it says how users write that: `eta_f` in python, `--eta-f` on a command line.
"""

import math
import re
from contextlib import contextmanager

_NAMED = re.compile("\ue000(\\w*)\ue001")  # two characters that no text has


def named(parameter: str) -> str:
    """The name of a parameter as a message of these errors takes it."""
    return f"\ue000{parameter}\ue001"


def option(parameter: str) -> str:
    """A parameter as a command line has it."""
    return f"--{parameter.removesuffix('_').replace('_', '-')}"


def as_float(value) -> float:
    """A number as ranges compare it and messages show it: infinite where no double can hold it."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


class JampetscError(Exception):
    """Base of all errors raised on purpose; `str(error)` is one line meant for the user."""

    exit_code = 1

    def __str__(self):
        return self.told(lambda parameter: parameter)

    def told(self, how) -> str:
        """The message with names of parameters as `how` writes them, a function of one."""
        return _NAMED.sub(lambda found: how(found[1]), super().__str__())


class InputError(JampetscError, ValueError):
    """A file, a value or an option that cannot be used. Names it and the remedy."""

    exit_code = 2


class ConvergenceError(JampetscError, RuntimeError):
    """A quench, a factorisation or a solve that did not reach what was asked of it."""

    exit_code = 3


@contextmanager
def about(what):
    """Of an InputError that is raised inside, the message begins with what it is about, such as a file."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error.told(named)}") from None

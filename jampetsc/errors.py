"""The errors a user can meet, each a single clear line: what, which value, what to do.

`main` prints that line and exits with `exit_code`; in scripts they are ordinary exceptions. A message marks the
names of parameters by `named`, so that they can be shown as the user writes them: `eta_f` in python, `--eta-f` on a
command line.
"""

import math
import re
import sys

from jampetsc.streams import visible

_NAMED = re.compile("\ue000(\\w*)\ue001")  # two characters that no text has


def named(parameter: str) -> str:
    """The name of a parameter, marked in a message so that `JampetscError.message` can replace it."""
    return f"\ue000{parameter}\ue001"


def option_word(parameter: str) -> str:
    """The option of the command line for a parameter: --eta-f for eta_f."""
    return f"--{parameter.removesuffix('_').replace('_', '-')}"


def in_words(text: str, how) -> str:
    """A text with each parameter's name that `named` has marked replaced by `how(name)`."""
    return _NAMED.sub(lambda match: how(match[1]), text)


def as_float(value) -> float:
    """The number as a float; ±infinity where it is too large for a double."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def python_value(value):
    """A number of numpy as python's own, also within lists and tuples; anything else as it is.

    numpy 2 writes np.float64(1.0) where messages, records and code for python have 1.0.
    """
    if type(value) in (list, tuple):
        return type(value)(map(python_value, value))
    if type(value).__module__ != "numpy" or getattr(value, "ndim", 1) > 0:
        return value
    number = value.item()  # of a long double the same again
    return float(number) if type(number) is type(value) else number


class JampetscError(Exception):
    """Base of all errors raised on purpose; `str(error)` is one line meant for the user."""

    exit_code = 1

    def __str__(self):
        return self.message(lambda parameter: parameter)

    def message(self, how) -> str:
        """The message in one line, with each parameter's name replaced by `how(name)`."""
        return visible(in_words(super().__str__(), how))


class InputError(JampetscError, ValueError):
    """A file, a value or an option that cannot be used. The message names it and the remedy."""

    exit_code = 2


class MissingPackage(InputError):
    """An optional package that is not installed. The message has the command that installs it for this python."""

    def __init__(self, what, package):
        super().__init__(
            f"{what}: requires the package {package}. Run: {sys.executable} -m pip install {package}"
        )


class ConvergenceError(JampetscError, RuntimeError):
    """A quench, a factorisation or a solve that did not converge to the requested accuracy."""

    exit_code = 3


class about:
    """Context: puts `what`, such as the name of a file, before the message of an InputError raised inside.

    It is a class as python 3.13 keeps the objects an error has passed, factors as well, until its garbage collection,
    where the context is a generator.
    """

    def __init__(self, what):
        self.what = what

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if isinstance(error, InputError):
            raise InputError(f"{self.what}: {error.message(named)}") from None

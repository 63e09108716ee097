"""The errors a user can meet, each a single clear line: what, which value, what to do.

`cli.main` turns them into that line and `exit_code`; in scripts they are ordinary exceptions.
"""


class JampetscError(Exception):
    """Base of all errors raised on purpose; `str(error)` is one line meant for the user."""

    exit_code = 1


class InputError(JampetscError, ValueError):
    """A file, a value or an option that cannot be used. Names it and the remedy."""

    exit_code = 2


class ConvergenceError(JampetscError, RuntimeError):
    """A quench, a factorisation or a solve that did not reach what was asked of it."""

    exit_code = 3

"""How far a long run has come: python's logger `jampetsc`, from rank 0 alone; a bar where standard error is a terminal.

A library says nothing unless it is asked: `tell` does so for the command line and for `progress=True`. Notes that a
user must not miss are warnings of the logger, which python shows anyway.
"""

import logging
import sys
from contextlib import contextmanager
from contextvars import ContextVar

from tqdm import tqdm

from jampetsc import streams

LOG = logging.getLogger("jampetsc")

_silent = ContextVar("whether what runs tells nothing", default=False)


class _Lines(logging.Handler):
    """Writes messages as they are, on standard error."""

    def emit(self, record):
        streams.say(f"{record.getMessage()}\n")


_lines = _Lines()


def tell(level: int = 0) -> None:
    """Write on standard error how far runs have come: 1 more than usual, 0 as usual, -1 warnings alone."""
    LOG.setLevel({1: logging.DEBUG, 0: logging.INFO, -1: logging.WARNING}[level])
    LOG.propagate = False
    if _lines not in LOG.handlers:
        LOG.addHandler(_lines)


@contextmanager
def telling(so: bool):
    """What runs inside tells how far it has come, or is silent but for warnings."""
    before, token = (LOG.level, LOG.propagate, list(LOG.handlers)), _silent.set(not so)
    if so:
        tell()
    try:
        yield
    finally:
        _silent.reset(token)
        LOG.setLevel(before[0])
        LOG.propagate, LOG.handlers[:] = before[1:]


class Progress:
    """Counts `total` steps of a run (None: not known before), `done` of them finished earlier; a context manager."""

    def __init__(self, total: int | None, what: str, rank: int = 0, done: int = 0):
        self.total, self.count = total, done
        self.told = rank == 0 and not _silent.get()
        terminal = (
            self.told and sys.stderr.isatty() and _lines in LOG.handlers and LOG.isEnabledFor(logging.INFO)
        )
        self.bar = (
            tqdm(total=total, initial=done, desc=what, leave=False, file=sys.stderr) if terminal else None
        )

    def step(self, line: str) -> None:
        """One step is finished; `line` says what came out."""
        self.count += 1
        if self.bar is not None:
            self.bar.set_postfix_str(line, refresh=False)
            self.bar.update()
        elif self.told:
            LOG.info("[%d%s] %s", self.count, f"/{self.total}" if self.total else "", line)

    def show(self, line: str) -> None:
        """What the step is at that is under way; on a terminal alone."""
        if self.bar is not None:
            self.bar.set_postfix_str(line)

    def note(self, line: str) -> None:
        """Say something beside the count."""
        if self.bar is not None:
            self.bar.write(line, file=sys.stderr)
        elif self.told:
            LOG.info("%s", line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

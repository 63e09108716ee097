"""How far a long run has come: python's logger `jampetsc`, from rank 0 alone; a bar where standard error is a terminal.

A library says nothing by default: `report` does so for the command line and for `progress=True`. Notes that a
user must not miss are warnings of the logger, which python shows anyway.
"""

import logging
import sys
from contextlib import contextmanager
from contextvars import ContextVar

from jampetsc import interrupts, streams

LOG = logging.getLogger("jampetsc")

_silent = ContextVar("whether progress is not reported", default=False)


class _Lines(logging.Handler):
    """Writes messages as they are, on standard error."""

    def emit(self, record):
        streams.say(f"{record.getMessage()}\n")


_lines = _Lines()


def report(level: int = 0) -> None:
    """Write progress to standard error: level 1 with details, 0 as usual, -1 warnings only."""
    LOG.setLevel({1: logging.DEBUG, 0: logging.INFO, -1: logging.WARNING}[level])
    LOG.propagate = False
    if _lines not in LOG.handlers:
        LOG.addHandler(_lines)


@contextmanager
def reporting(shown: bool):
    """Context: runs inside report their progress, or nothing but warnings."""
    previous, token = (LOG.level, LOG.propagate, list(LOG.handlers)), _silent.set(not shown)
    if shown:
        report()
    try:
        yield
    finally:
        _silent.reset(token)
        LOG.setLevel(previous[0])
        LOG.propagate, LOG.handlers[:] = previous[1:]


def note(line: str) -> None:
    """Write a line that is about a run as a whole, unless progress is not reported."""
    if not _silent.get():
        LOG.info("%s", line)


def warn(line: str) -> None:
    """Write a line that a user must not miss, also where progress is not reported."""
    LOG.warning("%s", line)


class Progress:
    """Counts the `total` steps of a run (None: unknown), `done` of them finished earlier; a context manager."""

    def __init__(self, total: int | None, what: str, rank: int = 0, done: int = 0):
        self.total, self.count = total, done
        self.reports = rank == 0 and not _silent.get()
        terminal = (
            self.reports and sys.stderr.isatty() and _lines in LOG.handlers and LOG.isEnabledFor(logging.INFO)
        )
        self.bar = None
        if terminal:
            from tqdm import tqdm  # which most runs do without

            self.bar = tqdm(total=total, initial=done, desc=what, leave=False, file=sys.stderr)

    def step(self, line: str) -> None:
        """One step is finished; `line` says what came out. A Ctrl-C is raised here, see `interrupts`."""
        self.count += 1
        if self.bar is not None:
            self.bar.set_postfix_str(streams.visible(line), refresh=False)
            self.bar.update()
        elif self.reports:
            LOG.info("[%d%s] %s", self.count, f"/{self.total}" if self.total else "", line)
        interrupts.check()

    def show(self, line: str) -> None:
        """Show how far the current step has come; on a terminal only."""
        if self.bar is not None:
            self.bar.set_postfix_str(streams.visible(line))

    def note(self, line: str) -> None:
        """Write a line that is not a step."""
        if self.bar is not None:
            self.bar.write(streams.visible(line), file=sys.stderr)
        elif self.reports:
            LOG.info("%s", line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()


def duration_text(seconds: float) -> str:
    """42 s, 3.2 min, 5.1 h."""
    for limit, unit, name in ((90, 1, "s"), (5400, 60, "min")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    hours = seconds / 3600
    return f"{hours:.2g} h" if hours < 99.5 else f"{hours:.0f} h"

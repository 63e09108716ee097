"""How far a long run has come: a bar on a terminal, one line per step in a log. On stderr, from rank 0 alone."""

import sys
from contextlib import contextmanager
from contextvars import ContextVar

from tqdm import tqdm

from jampetsc import streams

quiet = ContextVar("whether progress is not told", default=False)


@contextmanager
def silent(so: bool = True):
    """What runs inside tells no progress, or does again."""
    token = quiet.set(so)
    try:
        yield
    finally:
        quiet.reset(token)


class Progress:
    """Counts `total` steps of a run (None: not known before), `done` of them finished earlier; a context manager."""

    def __init__(self, total: int | None, what: str, rank: int = 0, done: int = 0):
        self.total, self.count, self.silent = total, done, rank != 0 or quiet.get()
        terminal = sys.stderr.isatty() and not self.silent
        self.bar = (
            tqdm(total=total, initial=done, desc=what, leave=False, file=sys.stderr) if terminal else None
        )

    def step(self, line: str) -> None:
        """One step is finished; `line` says what came out."""
        self.count += 1
        if self.bar is not None:
            self.bar.set_postfix_str(line, refresh=False)
            self.bar.update()
        elif not self.silent:
            streams.say(f"[{self.count}{f'/{self.total}' if self.total else ''}] {line}\n")

    def note(self, line: str) -> None:
        """Say something beside the count."""
        if self.bar is not None:
            self.bar.write(line, file=sys.stderr)
        elif not self.silent:
            streams.say(f"{line}\n")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

"""Standard output and error of a program that must not fail because of them, nor lose an error of theirs."""

import contextlib
import os
import sys

ERROR = "jampetsc: error: "  # before every line that says what is wrong


def prepare() -> None:
    """Make what is closed lead nowhere, and everything printable.

    A file opened later would otherwise get the number 1 or 2, and be written to by whoever reports something.
    Characters that the locale has not are written as escapes, and so are bytes of a file name that are no text.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    sys.stdout = sys.stdout or open(os.devnull, "w")
    sys.stderr = sys.stderr or open(os.devnull, "w")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # not so under pytest
            stream.reconfigure(errors="backslashreplace")


def say(text) -> None:
    """Write lines to standard error; where they cannot be written the work goes on without."""
    with contextlib.suppress(OSError):
        sys.stderr.write(text)
    forsake(sys.stderr)


def forsake(stream) -> None:
    """Let go what a stream cannot write: python, which tries once more at its end, would complain."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())

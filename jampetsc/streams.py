"""Standard output and error: the program must not fail because they are closed, full or not UTF-8."""

import contextlib
import os
import re
import sys

ERROR = "jampetsc: error: "  # begins every line of an error
# what moves the cursor, sets colours or turns the direction of text; a file may bring it along
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def visible(text: str, keep: str = "") -> str:
    """Text for a terminal: control characters, except those in `keep`, as escapes such as \\x1b."""
    return _CONTROLS.sub(lambda match: match[0] if match[0] in keep else ascii(match[0])[1:-1], text)


def prepare() -> None:
    """Open closed standard streams on /dev/null, and write characters that the locale cannot encode as escapes.

    A file opened later would otherwise get the descriptor 1 or 2, and messages would be written into it. Escaped are
    characters that the locale does not have and bytes of file names that are not text.
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
    """Write lines to standard error; a failure to write them is ignored."""
    with contextlib.suppress(OSError):
        sys.stderr.write(visible(text, "\n\t"))
    flush_or_drop(sys.stderr)


def flush_or_drop(stream) -> None:
    """Flush a stream, and if that fails send it to /dev/null: python flushes again at its exit, and would complain."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())

"""Compiled code is kept on disk, and must not outlive any source that went into it.

numba compiles a function again when the file that it stands in has changed; what it calls or takes from other files is
compiled into it, and changes there go unnoticed: after an update of `core.potentials` alone the loop over pairs
would go on with the old potential, in silence.
"""

import hashlib
from contextlib import suppress
from pathlib import Path

PACKAGE = Path(__file__).parent
WORD = (
    b"numba"  # in every module that is compiled or that compiled code takes something from; a test sees to it
)


def sources(package: Path = PACKAGE) -> dict[Path, bytes]:
    """The modules that compiled code is made of, and what they hold."""
    held = {path: path.read_bytes() for path in sorted(package.rglob("*.py"))}
    return {path: content for path, content in held.items() if WORD in content}


def forget_outdated(package: Path = PACKAGE) -> None:
    """Remove what numba has kept beside the modules if any of `sources` is not what it was made from.

    Where that folder is not ours to write, numba keeps its files elsewhere; there an installation replaces all modules
    at once.
    """
    digest = hashlib.sha256(b"\0".join(sources(package).values())).hexdigest()
    stamp = package / "__pycache__" / "compiled-from"
    with suppress(OSError):
        if stamp.exists() and stamp.read_text() == digest:
            return
        for kept in package.rglob("__pycache__/*.nb[ic]"):
            kept.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest)

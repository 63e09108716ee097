"""How loops are compiled: `@compiled(FAST)` makes numba compile a function when it is first called.

numba keeps machine code on disk, and compiles a function again only if the file that defines it has changed. Functions
and constants of other files are compiled into it, and changes there go unnoticed: after an update of `core.potentials`
alone the loop over pairs would silently use the old potential. `forget_outdated` prevents that.
"""

import hashlib
import os
import re
from contextlib import suppress
from pathlib import Path

import numba
import numpy as np
from numba.core.typing.typeof import typeof_impl

from jampetsc.errors import InputError

# Sums may be reordered and multiplications fused: that lets the compiler use its widest vectors.
# A function with such flags that others call must be inlined by force: otherwise its callers have differently optimised
# copies, numba's cache decides which of them runs, and the last digits of results vary.
# Every compiled function states its fastmath, False included: numba lets one that does not inherit its first caller's.
FAST = {"reassoc", "contract", "nsz", "arcp", "nnan", "ninf"}
NUMBERS = FAST - {"nnan", "ninf"}  # for loops that must detect NaN

PACKAGE = Path(__file__).parents[1]
# found in every module with compiled functions, and in those that they use; a test checks it
MARKERS = re.compile(rb"numba|core\.compiled")


def compiled(fastmath, **options):
    """Decorator: compile this function with these fastmath flags, and keep the result on disk.

    options are numba's. Division by zero gives inf or NaN. No function is passed to C as a pointer: the wrapper for
    that, which takes time to compile, is left out.
    """
    settings = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    return numba.njit(fastmath=fastmath, **settings)


def _type_key(value):
    """Key that determines numba's type of a tuple, an array or a number; None for anything else."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, *(value.flags[name] for name in ("C", "F", "A", "W"))
    if isinstance(value, tuple):
        keys = [_type_key(one) for one in value]
        return None if None in keys else (type(value), *keys)
    return type(value) if value is None or type(value) in (bool, int, float) else None


_types = {}
_type_of_tuple = typeof_impl.dispatch(tuple)


@typeof_impl.register(tuple)
def _cached_type(value, context):
    """Numba's type of a tuple, computed once for each `_type_key`.

    The fingerprint by which numba 0.56 recognises a tuple of many arrays loses its first 40 bytes when its buffer
    grows: numba would determine the type of ours again, for 0.3 ms, in most of the first hundreds of calls.
    """
    key = _type_key(value)
    if key is None:
        return _type_of_tuple(value, context)
    if (context, key) not in _types:
        _types[context, key] = _type_of_tuple(value, context)
    return _types[context, key]


def sources(package: Path = PACKAGE) -> dict[Path, bytes]:
    """The modules that compiled code is made of: {path: content}."""
    contents = {path: path.read_bytes() for path in sorted(package.rglob("*.py"))}
    return {path: content for path, content in contents.items() if MARKERS.search(content)}


def forget_outdated(package: Path = PACKAGE) -> None:
    """Remove the machine code that numba keeps beside the modules if any of `sources` has changed since it was made.

    Where that folder cannot be written, numba keeps its files elsewhere; there an installation replaces all modules at
    once.
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


if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):  # without numba, uint64 + int64 is a float
    raise InputError(
        f"NUMBA_DISABLE_JIT={os.environ['NUMBA_DISABLE_JIT']}: loops over contacts have to be compiled: unset it"
    )
forget_outdated()  # before anything compiled is loaded: every module with compiled functions imports this one

"""How loops are compiled: `@compiled(FAST)` makes numba compile a function when it is first called.

What numba makes is kept on disk and must not outlive any source that went into it. numba compiles a function again when
the file that it stands in has changed; what it calls or takes from other files is compiled into it, and changes there
go unnoticed: after an update of `core.potentials` alone the loop over pairs would go on with the old potential, in
silence.
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
# What sums so has to be inlined by force: of copies in several modules, each optimised in its own way, it would depend
# on numba's cache which one is run, and so the last digit of a result.
# Every compiled function says which it is, False too: one that does not say is as fast as the first that calls it.
FAST = {"reassoc", "contract", "nsz", "arcp", "nnan", "ninf"}
NUMBERS = FAST - {"nnan", "ninf"}  # where NaN must be seen

PACKAGE = Path(__file__).parents[1]
# in every module that is compiled or that compiled code takes something from; a test sees to it
WORDS = re.compile(rb"numba|core\.compiled")


def compiled(fastmath, **options):
    """Decorator: compile this function, with these liberties in its mathematics, and keep the result on disk.

    options are numba's. Division by zero gives inf or NaN. No function here is handed to C as a pointer: none has an
    entry for that, which takes its time to compile.
    """
    settings = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    return numba.njit(fastmath=fastmath, **settings)


def _kind(value):
    """What a tuple's, an array's or a number's type for numba follows from; None of anything else."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, *(value.flags[name] for name in ("C", "F", "A", "W"))
    if isinstance(value, tuple):
        kinds = [_kind(one) for one in value]
        return None if None in kinds else (type(value), *kinds)
    return type(value) if value is None or type(value) in (bool, int, float) else None


_types = {}
_type_of_tuple = typeof_impl.dispatch(tuple)


@typeof_impl.register(tuple)
def _remembered_type(value, context):
    """Numba's type of a tuple, once.

    What numba 0.56 knows a tuple of many arrays by loses its first 40 bytes when it grows longer: it would look at each
    of ours anew, for 0.3 ms, in most of the first hundreds of calls.
    """
    kind = _kind(value)
    if kind is None:
        return _type_of_tuple(value, context)
    if (context, kind) not in _types:
        _types[context, kind] = _type_of_tuple(value, context)
    return _types[context, kind]


def sources(package: Path = PACKAGE) -> dict[Path, bytes]:
    """The modules that compiled code is made of, and what they hold."""
    held = {path: path.read_bytes() for path in sorted(package.rglob("*.py"))}
    return {path: content for path, content in held.items() if WORDS.search(content)}


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


if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):  # integers that stay so are python's floats
    raise InputError(
        f"NUMBA_DISABLE_JIT={os.environ['NUMBA_DISABLE_JIT']}: loops over contacts have to be compiled: unset it"
    )
forget_outdated()  # before anything compiled is loaded: every module with compiled functions imports this one

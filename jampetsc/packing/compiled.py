"""How loops are compiled: `@compiled(FAST)` makes numba compile a function when it is first called.

numba keeps machine code on disk, and compiles a function again only if the file that defines it has changed. Functions
and constants of other files are compiled into it, and changes there go unnoticed: after an update of `potentials`
alone the loop over pairs would silently use the old potential. `forget_outdated` prevents that.

Vectors of another width sum in another order, and last digits decide which minimum a quench ends in, so all x86
processors get the same code: `fix_instruction_set`.
"""

import hashlib
import os
import platform
import re
import warnings
from contextlib import suppress
from pathlib import Path

import numba
import numpy as np
from llvmlite import binding as llvm
from numba.core import config
from numba.core.registry import cpu_target
from numba.core.typing.typeof import typeof_impl

from jampetsc.errors import InputError

# Sums may be reordered and multiplications fused: that lets the compiler use its widest vectors.
# A function with such flags that others call must be inlined by force: otherwise its callers have differently optimised
# copies, numba's cache decides which of them runs, and the last digits of results vary.
# Every compiled function states its fastmath, False included: numba lets one that does not inherit its first caller's.
FAST = {"reassoc", "contract", "nsz", "arcp", "nnan", "ninf"}
NUMBERS = FAST - {"nnan", "ninf"}  # for loops that must detect NaN

BASELINE = "x86-64-v3"  # processors of Intel since Haswell, 2013, and of AMD since Zen, 2017
BASELINE_FEATURES = {"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "popcnt"}
# LLVM's names of the processor and of features beyond it. Code for "x86-64-v3" itself is up to 4 % slower.
BASELINE_TARGET = "haswell", ""
VARIABLE = "JAMPETSC_CPU"

PACKAGE = Path(__file__).parents[1]
# found in every module with compiled functions, and in those that they use; a test checks it
MARKERS = re.compile(rb"numba|packing\.compiled")


def compiled(fastmath, **options):
    """Decorator: compile this function with these fastmath flags, and keep the result on disk.

    options are numba's. Division by zero gives inf or NaN. No function is passed to C as a pointer: the wrapper for
    that, which takes time to compile, is left out.
    """
    settings = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    return numba.njit(fastmath=fastmath, **settings)


def nested(fastmath, **options):
    """Decorator: `compiled`, for a function that only compiled functions call.

    It has no wrapper for calls from Python: a tenth of all compilation. Such a call would end the process; a test
    checks that there is none.
    """
    return compiled(fastmath, no_cpython_wrapper=True, **options)


def instruction_set() -> str:
    """BASELINE, or LLVM's name of another processor for which loops are compiled."""
    if (config.CPU_NAME, config.CPU_FEATURES) == BASELINE_TARGET:
        return BASELINE
    return config.CPU_NAME or llvm.get_host_cpu_name()


def fits_baseline(machine: str, features: dict) -> bool:
    """Whether a processor of this architecture with LLVM's `features` {name: bool} runs code for BASELINE."""
    return machine in ("x86_64", "AMD64") and all(features.get(name) for name in BASELINE_FEATURES)


def fix_instruction_set() -> None:
    """Make numba compile for BASELINE on every processor that has it, whatever NUMBA_CPU_NAME says.

    Elsewhere, and with JAMPETSC_CPU=native, numba chooses. numba's cache on disk has both names, so that machines that
    share a home folder do not run each other's code. Raises InputError for another value of JAMPETSC_CPU.
    """
    request = os.environ.get(VARIABLE, "")
    if request not in ("", "native"):
        raise InputError(f"{VARIABLE}={request}: unknown. Set it to native, or unset it.")
    if request or not fits_baseline(platform.machine(), dict(llvm.get_host_cpu_features())):
        return
    if "_toplevel_target_context" not in vars(cpu_target):  # nothing has been compiled in this process
        config.CPU_NAME, config.CPU_FEATURES = BASELINE_TARGET
    elif instruction_set() != BASELINE:
        name, features = BASELINE_TARGET
        warnings.warn(
            f"numba has compiled for {instruction_set()} in this process already: a seed gives another packing than "
            f"elsewhere. Set NUMBA_CPU_NAME={name} and NUMBA_CPU_FEATURES={features} before python starts.",
            stacklevel=2,
        )


def _type_key(value):
    """Key that determines numba's type of a tuple, an array or a number; None for anything else."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, *(value.flags[name] for name in ("C", "F", "A", "W"))
    if isinstance(value, tuple):
        keys = [_type_key(item) for item in value]
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

    In NUMBA_CACHE_DIR, which others may use at the same time, all sources together have a folder of their own. Where
    neither can be written, numba keeps its files elsewhere; there an installation replaces all modules at once.
    """
    digest = hashlib.sha256(b"\0".join(sources(package).values())).hexdigest()
    if config.CACHE_DIR:
        config.CACHE_DIR = os.path.join(config.CACHE_DIR, f"jampetsc-{digest[:16]}")
        return
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
        f"NUMBA_DISABLE_JIT={os.environ['NUMBA_DISABLE_JIT']}: loops over contacts have to be compiled. Unset it."
    )
fix_instruction_set()
forget_outdated()  # before anything compiled is loaded: every module with compiled functions imports this one

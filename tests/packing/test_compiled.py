"""Types of arguments as numba gets them, fastmath flags of compiled functions, and for which processors they are."""

import importlib
import pkgutil
import subprocess
import sys
from typing import NamedTuple

import launch
import numpy as np
import pytest
from numba import typeof
from numba.core.dispatcher import Dispatcher
from numba.core.typing.typeof import Purpose, _TypeofContext

import jampetsc
from jampetsc.packing import compiled


class Two(NamedTuple):
    """A pair of anything."""

    first: object
    second: object


class Other(NamedTuple):
    """The same under another name."""

    first: object
    second: object


def fixed(array):
    array.flags.writeable = False
    return array


VALUES = {
    "numbers": (1, 2.0, True, None),
    "columns": np.zeros((4, 2))[:, 0],
    "rows": np.zeros((4, 2)),
    "fortran": np.zeros((4, 2), order="F"),
    "single": np.zeros(4, np.float32),
    "unsigned": np.zeros(4, np.uint32),
    "read only": fixed(np.zeros(4)),
    "empty": np.zeros((0, 6, 2)),
    "word": "a word",
    "scalar": np.float32(1.0),
    "seconds": np.timedelta64(1, "s"),
    "record": np.zeros(2, [("x", float)]),
    "other record": np.zeros(2, [("x", int)]),
}


@pytest.mark.parametrize("kind", [Two, Other, lambda a, b: (a, b)], ids=["two", "other", "tuple"])
def test_cached_types_are_those_of_numba(kind):
    """For tuples of all pairs of values, and again when they are in the cache."""
    context = _TypeofContext(Purpose.argument)
    for _ in range(2):
        for first in VALUES.values():
            for second in VALUES.values():
                value = kind(first, (second, first))
                with pytest.MonkeyPatch.context() as patch:
                    patch.setattr(compiled, "_type_key", lambda _: None)
                    wanted = compiled._cached_type(value, context)
                assert typeof(value) == wanted


def test_what_may_reorder_sums_is_compiled_into_its_callers():
    """Otherwise numba's cache would decide which of several differently optimised copies runs."""
    functions = set()
    for module in pkgutil.walk_packages(jampetsc.__path__, "jampetsc."):
        if not module.name.endswith("__main__"):
            members = vars(importlib.import_module(module.name)).values()
            functions |= {one for one in members if isinstance(one, Dispatcher)}
    assert len(functions) > 50
    for function in functions:
        code, names = function.py_func.__code__, function.py_func.__globals__
        for name in code.co_names:
            called = names.get(name)
            if isinstance(called, Dispatcher) and called.targetoptions["fastmath"]:
                assert called.targetoptions.get("forceinline"), f"{function.__name__} calls {name}"


@pytest.mark.parametrize(
    ("machine", "without", "fits"),
    [
        ("x86_64", (), True),
        ("AMD64", ("avx512f",), True),
        ("x86_64", ("avx2",), False),
        ("x86_64", ("fma", "movbe"), False),
        ("arm64", (), False),
        ("aarch64", (), False),
    ],
)
def test_which_processors_get_the_same_code(machine, without, fits):
    features = dict.fromkeys((*compiled.BASELINE_FEATURES, "avx512f"), True) | dict.fromkeys(without, False)
    assert compiled.fits_baseline(machine, features) is fits


PRINT = "from jampetsc.packing import compiled; print(compiled.instruction_set())"
COMPILE = "import numba; numba.njit(lambda x: x)(1)"


@pytest.mark.skipif(
    compiled.instruction_set() != compiled.BASELINE, reason="needs a processor with x86-64-v3"
)
@pytest.mark.parametrize(
    ("program", "variables", "told", "warning"),
    [
        (PRINT, {"NUMBA_CPU_NAME": "skylake-avx512"}, compiled.BASELINE, ""),
        (PRINT, {"NUMBA_CPU_NAME": "generic", "JAMPETSC_CPU": "native"}, "generic", ""),
        (f"{COMPILE}; {PRINT}", {"NUMBA_CPU_NAME": "nehalem"}, "nehalem", "has compiled for nehalem"),
        (PRINT, {"JAMPETSC_CPU": "zen"}, "", "JAMPETSC_CPU=zen: unknown. Set it to native, or unset it."),
    ],
    ids=["always", "native", "numba came first", "unknown"],
)
def test_numba_compiles_for_one_instruction_set(program, variables, told, warning):
    """Whatever NUMBA_CPU_NAME says; code for another one is admitted to."""
    environment = launch.environment() | {"NUMBA_CPU_FEATURES": ""} | variables
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.stdout.strip() == told
    assert warning in done.stderr and bool(warning) == bool(done.stderr)

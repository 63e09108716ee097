"""Types of arguments as numba gets them, fastmath flags of compiled functions, and for which processors they are."""

import ast
import importlib
import pkgutil
import re
import subprocess
import sys
from typing import NamedTuple

import launch
import numpy as np
import pytest
from numba import typeof, types
from numba.core.dispatcher import Dispatcher

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


def type_from_parts(value):
    """Numba's type of a tuple, put together from the types of what is in it."""
    if not isinstance(value, tuple):
        return typeof(value)
    return types.BaseTuple.from_types([type_from_parts(part) for part in value], type(value))


@pytest.mark.parametrize("kind", [Two, Other, lambda a, b: (a, b)], ids=["two", "other", "tuple"])
def test_cached_types_are_those_of_numba(kind):
    """For tuples of all pairs of values, and again when they are in the cache."""
    for _ in range(2):
        for first in VALUES.values():
            for second in VALUES.values():
                value = kind(first, (second, first))
                assert typeof(value) == type_from_parts(value)


@pytest.fixture(scope="module")
def functions():
    """{(module, name): compiled function} of the package, under every name that modules give it."""
    members = {}
    for module in pkgutil.walk_packages(jampetsc.__path__, "jampetsc."):
        if not module.name.endswith("__main__"):
            members |= {
                (module.name, name): member
                for name, member in vars(importlib.import_module(module.name)).items()
                if isinstance(member, Dispatcher)
            }
    assert len(members) > 50
    return members


def uncompiled_uses(path, functions, chosen):
    """Lines of a file where a function that is not compiled, or no function, uses one of the chosen ones."""
    module = ".".join(path.relative_to(launch.ROOT).with_suffix("").parts)
    tree = ast.parse(path.read_text())
    known = {name: function for (place, name), function in functions.items() if place == module}
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = alias.asname or alias.name
                known[name] = functions.get((node.module, alias.name))
                modules[name] = f"{node.module}.{alias.name}"
    compiled_lines = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            decorators = " ".join(ast.unparse(decorator) for decorator in node.decorator_list)
            if re.search("compiled|nested|inlined|njit", decorators):
                compiled_lines.update(range(node.lineno, node.end_lineno + 1))
    uses = []
    for node in ast.walk(tree):
        function = None
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            function = known.get(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            function = functions.get((modules.get(node.value.id), node.attr))
        if function in chosen and node.lineno not in compiled_lines:
            uses.append(f"{path.name}:{node.lineno}")
    return uses


def test_what_has_no_wrapper_for_python_is_called_by_compiled_functions_alone(functions):
    """Such a call from Python would end the process."""
    nested = {one for one in functions.values() if one.targetoptions.get("no_cpython_wrapper")}
    assert len(nested) > 50
    modules = {
        name.removeprefix("jampetsc.") for (name, _), function in functions.items() if function in nested
    }
    mention = re.compile("|".join(name.rpartition(".")[2] for name in modules))
    for folder in ("jampetsc", "tests", "benchmarks", "papers", "examples"):
        for path in (launch.ROOT / folder).rglob("*.py"):
            if re.search(
                r"^\s*(from|import) jampetsc.*\b(" + mention.pattern + ")", path.read_text(), re.MULTILINE
            ):
                assert uncompiled_uses(path, functions, nested) == []
    caller = launch.ROOT / "jampetsc" / "flows" / "steady_shear.py"
    assert len(uncompiled_uses(caller, functions, set(functions.values()))) > 5  # calls are found


def test_what_may_reorder_sums_is_compiled_into_its_callers(functions):
    """Otherwise numba's cache would decide which of several differently optimised copies runs."""
    for function in functions.values():
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

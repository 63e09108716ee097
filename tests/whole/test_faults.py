"""Faults that benchmarks/faults puts into the package: each one is a change, of code that python takes."""

import ast
import sys

import launch

sys.path.insert(0, str(launch.ROOT / "benchmarks" / "faults"))
import touched
from sites import drawn, faults

SOURCE = '''"""No fault 1 + 1 in words."""
def f(x: int = 2, *, θ=-1.5) -> float:
    if x < 3 and not θ:
        raise ValueError(f"{x + 1}")
    x += max(x, θ)
    return g(x, θ, key=True)
'''


def test_every_fault_is_a_change_of_its_line():
    found = faults(SOURCE)
    kinds = {fault.kind for fault in found}
    assert kinds == {"operator", "comparison", "and, or", "sign", "constant", "name", "condition", "arguments",
                     "argument left out", "statement"}  # fmt: skip
    changed = {ast.dump(ast.parse(fault.applied(SOURCE))) for fault in found}
    assert len(changed) == len(found) and ast.dump(ast.parse(SOURCE)) not in changed
    left_out = next(fault for fault in found if fault.kind == "argument left out")
    assert left_out.applied(SOURCE) == SOURCE.replace("g(x, θ, key=True)", "(g(x, θ))")


def test_a_seed_gives_the_same_faults():
    sources = {"a": SOURCE, "b": SOURCE.replace("x", "y")}
    assert drawn(sources, 6, 1) == drawn(sources, 6, 1) != drawn(sources, 6, 2)
    assert len({(name, fault.first) for name, fault in drawn(sources, 6, 1)}) == 6


def test_who_runs_a_compiled_loop():
    text = "@compiled(FAST)\ndef a(): pass\n@compiled(FAST)\ndef b(): a()\ndef c():\n    b()\n"
    assert touched.callers({"m": ast.parse(text)}) == {("m", name): {("m", 6)} for name in "ab"}

"""The rooms of the package: imports go downwards only, one door to PETSc, and laws are data."""

import ast
from functools import cache
from pathlib import Path

import pytest

import jampetsc
from jampetsc.contacts.laws import FAMILIES

PACKAGE = Path(jampetsc.__file__).parent
ROOMS = (  # from the ground up; a module may import its own room and those before it
    "ground",
    "contacts",
    "analysis",
    "storage",
    "packing",
    "session",
    "solvers",
    "mechanics",
    "response",
    "flow",
    "oscillate",
    "plots",
    "words",
    "speed_accuracy",
    "study",
    "commands",
    "cli",
)
TOP = {
    "session": "session",
    "builds": "session",
    "loading": "session",
    "cli": "cli",
    "functions": "cli",
    "__main__": "cli",
}  # other modules: ground
WITHOUT_PETSC = ("ground", "contacts", "analysis", "storage", "packing", "plots", "words")
PETSC = ("petsc4py", "slepc4py", "mpi4py")
DOORS = (
    "session",
    "builds",
    "loading",
    "cli",
)  # cli only to end a job that fails before the session has begun
MODULES = sorted(PACKAGE.rglob("*.py"))


@cache
def nodes(path):
    return list(ast.walk(ast.parse(path.read_text(), str(path))))


def room_of(module):
    """The room of a module given as words: ("plots", "style"), ("session",), …"""
    first = module[0] if module else "__init__"
    return first if (PACKAGE / first).is_dir() else TOP.get(first, "ground")


def imported(path):
    """Modules that a file imports anywhere in it, as words: ("jampetsc", "plots", "style"), ("numpy",), …"""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are written in full"
            for alias in node.names:
                yield (*node.module.split("."), alias.name)


def name(path):
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def test_every_room_is_known():
    found = {room_of(path.relative_to(PACKAGE).with_suffix("").parts) for path in MODULES}
    assert found <= set(ROOMS), "say in ROOMS, and in CONTRIBUTING.md, where the new room is"


@pytest.mark.parametrize("room", ROOMS)
def test_imports_go_downwards(room):
    wrong = []
    for path in MODULES:
        here = path.relative_to(PACKAGE).with_suffix("").parts
        if room_of(here) != room or here == ("__init__",):  # the package's door to `load` and `Disks`
            continue
        for words in imported(path):
            if words[0] != "jampetsc":
                continue
            there = room_of(words[1:])
            if ROOMS.index(there) > ROOMS.index(room) or (there == "session" and room in WITHOUT_PETSC):
                wrong.append(f"{name(path)} imports {'.'.join(words[1:])}, in a room above it")
    assert not wrong, "\n".join(wrong)


def test_one_door_to_petsc():
    wrong = []
    for path in MODULES:
        loaded = {words[0] for words in imported(path)}
        loaded |= {  # import_module("mpi4py.MPI")
            node.args[0].value.split(".")[0]
            for node in nodes(path)
            if isinstance(node, ast.Call)
            and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("import_module", "__import__")
            and isinstance(node.args[0], ast.Constant)
        }
        if loaded & set(PETSC) and name(path) not in DOORS:
            wrong.append(f"{name(path)}: {', '.join(loaded & set(PETSC))}")
    assert not wrong, wrong


def test_no_module_knows_a_law_by_its_name():
    """A law is a row of FAMILIES: what depends on it follows from its weights and options."""
    wrong = [
        f"{name(path)}:{node.lineno}: {node.value!r}"
        for path in MODULES
        for node in nodes(path)
        if name(path) != "contacts.laws" and isinstance(node, ast.Constant) and node.value in FAMILIES
    ]
    assert not wrong, wrong


def defined(path):
    """Names that a module defines or imports at its top, in if and try too."""
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.alias):
            found.add(node.asname or node.name.split(".")[0])
    return found


def test_what_is_imported_is_there():
    """Imports inside functions too: those fail only when a command runs."""
    wrong = []
    for path in MODULES:
        for words in imported(path):
            if words[0] != "jampetsc" or len(words) < 2:
                continue
            target = PACKAGE.joinpath(*words[1:])
            if target.is_dir() or target.with_suffix(".py").is_file():
                continue
            module = target.parent.with_suffix(".py")
            module = module if module.is_file() else target.parent / "__init__.py"
            if not module.is_file() or words[-1] not in defined(module):
                wrong.append(f"{name(path)} imports {'.'.join(words)}")
    assert not wrong, "\n".join(wrong)

"""The rooms of the package: imports go downwards only, one door to PETSc, and laws are data."""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import jampetsc
from jampetsc.commands import JOBS
from jampetsc.laws.damping import FAMILIES
from jampetsc.packing import compiled

PACKAGE = Path(jampetsc.__file__).parent
# rooms from the ground up; a module may import its own room and those before it
ROOMS = (
    "ground packing laws analysis io minimisation petsc response flows jamming oscillation options".split()
)
ROOMS += ["plots", "commands", "studies", "main"]
TOP = {"__main__": "main", "main": "main"}  # other modules: ground
WITHOUT_PETSC = ("ground", "packing", "laws", "analysis", "io", "minimisation", "plots")
PETSC = ("petsc4py", "slepc4py", "mpi4py")
# main only to end a job that fails before the session has begun
DOORS = ("petsc.session", "petsc.builds", "main")
# rooms that take packings, laws and numbers, and return results in memory
COMPUTING = "packing laws analysis minimisation petsc response flows jamming oscillation".split()
FILES = "checkpoint hdf5 outlet outputs packing_file reader request result_file results".split()
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
    assert found <= set(ROOMS), "say in ROOMS, and in docs/developer/architecture.md, where the new room is"
    page = (PACKAGE.parent / "docs" / "developer" / "architecture.md").read_text()
    assert re.findall(r"^\| `(\w+)/` \|", page, re.MULTILINE) == [
        room for room in ROOMS if room not in ("ground", "main")
    ]


@pytest.mark.parametrize("room", ROOMS)
def test_imports_go_downwards(room):
    wrong = []
    for path in MODULES:
        here = path.relative_to(PACKAGE).with_suffix("").parts
        if room_of(here) != room or here == ("__init__",):  # the package's door to `load` and `Packing`
            continue
        for words in imported(path):
            if words[0] != "jampetsc":
                continue
            there = room_of(words[1:])
            if ROOMS.index(there) > ROOMS.index(room) or (there == "petsc" and room in WITHOUT_PETSC):
                wrong.append(f"{name(path)} imports {'.'.join(words[1:])}, in a room above it")
    assert not wrong, "\n".join(wrong)


def runs(tree):
    """Imports of a module, anywhere in it."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
            yield node.module
        yield from runs(node)


@cache
def graph():
    """{module: modules of the package that it imports as it runs}."""
    known = {f"jampetsc.{name(path)}".removesuffix(".__init__"): path for path in MODULES}
    return {one: {*runs(ast.parse(path.read_text()))} & known.keys() - {one} for one, path in known.items()}


# whose last digits differ between C libraries and between the processors that one of them finds
BY_C_LIBRARY = (
    "exp expm1 exp2 log log2 log1p pow sin cos tan asin acos atan atan2 sinh cosh tanh cbrt hypot".split()
)
BY_C_LIBRARY += "power arcsin arccos arctan arctan2 float_power geomspace logspace".split()


@pytest.mark.parametrize("room", ["packing", "minimisation", "jamming"])
def test_what_makes_a_packing_has_no_functions_of_the_c_library(room):
    """Last digits decide which minimum a quench ends in; math.hypot is python's own, from roots."""
    wrong = [
        f"{name(path)}:{node.lineno} {ast.unparse(node)}"
        for path in MODULES
        if room_of(path.relative_to(PACKAGE).with_suffix("").parts) == room
        for node in nodes(path)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in ("np", "math")
        and node.attr in BY_C_LIBRARY
        and ast.unparse(node) != "math.hypot"
    ]
    assert not wrong, "\n".join(wrong)


def test_no_modules_import_each_other():
    """Inside a room neither, nor round three corners, nor inside functions."""
    left = {one: others for one, others in graph().items() if one != "jampetsc"}  # the package's door
    while ends := {one for one, others in left.items() if not others & left.keys()}:
        left = {one: others for one, others in left.items() if one not in ends}
    while tops := left.keys() - {other for others in left.values() for other in others}:
        left = {one: others for one, others in left.items() if one not in tops}
    assert not left, "circles among these"


def test_jobs_that_load_compiled_code():
    """The others start in half the time."""
    needing = {"jampetsc.packing.compiled"}
    while more := {one for one, others in graph().items() if others & needing} - needing:
        needing |= more
    jobs = {module.split(".")[-1] for module in needing if module.startswith("jampetsc.commands.")}
    assert jobs & JOBS.keys() == {"pack", "flow", "shear", "jam", "oscillate", "relax", "modes"}


@pytest.mark.parametrize("room", COMPUTING)
def test_only_commands_know_jobs_and_files(room):
    """A function that computes takes a packing or network, a law and numbers, and returns a result in memory.

    A long one knows of checkpoints what `save=` and `resume=` tell it.
    """
    wrong = []
    for path in (PACKAGE / room).glob("*.py"):
        parameters = {node.arg for node in nodes(path) if isinstance(node, ast.arg)}
        wrong += [f"{name(path)}: parameter {parameter}" for parameter in parameters & {"job", "to"}]
        files = {words[2] for words in imported(path) if words[:2] == ("jampetsc", "io")}
        wrong += [f"{name(path)} imports io.{module}" for module in files & set(FILES)]
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


def holding(kind, wanted):
    """Names of modules with a node of syntax of this kind that is `wanted`."""
    return {name(path) for path in MODULES for node in nodes(path) if isinstance(node, kind) and wanted(node)}


def test_one_door_to_hdf5():
    """What is read has been looked at by `io.hdf5`."""
    assert holding(ast.Call, lambda node: ast.unparse(node.func) in ("h5py.File", "File")) == {"io.hdf5"}


def test_no_module_knows_a_law_by_its_name():
    """A law is a row of FAMILIES: what depends on it follows from its weights and options."""
    assert holding(ast.Constant, lambda node: node.value in FAMILIES) == {"laws.damping"}


def test_one_module_has_numba_compile():
    """A function that does not say how fast its mathematics is inherits it from whatever calls it first."""
    words = ast.Attribute | ast.Name
    named = holding(words, lambda node: ast.unparse(node).split(".")[-1] in ("njit", "jit"))
    assert named == {"packing.compiled"}


def taken(path):
    """Names that a module's compiled functions use, or that it has compiled."""
    for node in nodes(path):
        marks = node.decorator_list if isinstance(node, ast.FunctionDef) else [getattr(node, "func", None)]
        if any("compiled(" in ast.unparse(mark) for mark in marks if mark):
            yield from (part.id for part in ast.walk(node) if isinstance(part, ast.Name))


def test_compiled_code_is_made_of_known_sources():
    """What numba keeps is thrown away when one of these changes: see `packing.compiled`."""
    known, wrong, found = set(compiled.sources()), [], 0
    for path in MODULES:
        names = set(taken(path))
        for words in imported(path):
            if words[0] == "jampetsc" and words[-1] in names:
                found += 1
                if PACKAGE.joinpath(*words[1:-1]).with_suffix(".py") not in known:
                    wrong.append(f"{name(path)} compiles {'.'.join(words)}, a module without the word")
    assert found > 5
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("variables", [{}, {"NUMBA_CACHE_DIR": "elsewhere"}], ids=["beside", "elsewhere"])
def test_compiled_code_does_not_outlive_its_sources(variables, tmp_path):
    """f in b calls g in a: after a change of a alone f is compiled again, and not when nothing has changed."""
    package = tmp_path / "sample"
    package.mkdir()
    g = "import numba\n@numba.njit(cache=True)\ndef g():\n    return 1\n"
    f = "import numba\nfrom sample.a import g\n@numba.njit(cache=True)\ndef f():\n    return g()\n"
    forget = "from pathlib import Path\nfrom jampetsc.packing import compiled\n"
    forget += "compiled.forget_outdated(Path(__file__).parent)\n"
    for name, text in (("a", g), ("b", f), ("__init__", forget)):
        (package / f"{name}.py").write_text(text)
    program = [sys.executable, "-c", "from sample.b import f; print(f(), sum(f.stats.cache_hits.values()))"]
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"} | variables
    settings = {"cwd": tmp_path, "env": environment, "capture_output": True, "text": True, "check": True}

    def run():
        return subprocess.run(program, **settings).stdout.split()

    assert [run(), run()] == [["1", "0"], ["1", "1"]]
    # of another length: python itself tells a module of the same second and length from no other
    (package / "a.py").write_text(g.replace("1", "1 + 1"))
    assert [run(), run()] == [["2", "0"], ["2", "1"]]


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


@pytest.mark.parametrize("room", ["response", "oscillation", "jamming"])
def test_what_computes_takes_the_communicator_of_its_network(room):
    """The session's is of the whole job."""
    text = {path: path.read_text() for path in (PACKAGE / room).glob("*.py")}
    wrong = [
        name(path)
        for path, code in text.items()
        if re.search(r"(current\(\)|session)\.(comm|rank|size)\b", code)
    ]
    assert not wrong, wrong

"""Which test runs which lines of the package, in its own process and in those that it starts, and what it takes.

A plugin of pytest: `pytest -p touched` with the environment of `following`; needs `pip install coverage`. What a
fixture runs belongs to all tests that use it. Compiled loops have no lines: `callers` says who comes to run them.
"""

import ast
import json
import os
import sys
from collections import defaultdict
from pathlib import Path

import pytest

LABEL = "JAMPETSC_TOUCHED_BY"  # test or fixture, also of the processes that it starts
FOLDER = "JAMPETSC_TOUCHED"
SETTINGS = """[run]
include = {root}/jampetsc/*
context = ${{{label}}}
data_file = {folder}/lines
parallel = true
sigterm = true
disable_warnings = no-data-collected,module-not-measured
"""


def following(root: Path, folder: Path) -> dict[str, str]:
    """Environment under which all processes put the lines of root/jampetsc that they run into files of this folder."""
    folder.mkdir(parents=True)
    settings = folder / "settings"
    settings.write_text(SETTINGS.format(root=root, label=LABEL, folder=folder))
    (folder / "sitecustomize.py").write_text("import coverage\n\ncoverage.process_startup()\n")
    paths = os.pathsep.join([str(folder), str(Path(__file__).parent)])
    return {FOLDER: str(folder), "COVERAGE_PROCESS_START": str(settings), LABEL: "", "PYTHONPATH": paths}


def stage() -> str:
    return os.environ.get("JAMPETSC_TEST_SCALAR", "plain")


def label_of(item) -> str:
    """ "real tests/response/test_x.py::test_y": all parameters of a test are one."""
    return f"{stage()} {item.nodeid.split('[')[0]}"


def fixture_label(fixture) -> str:
    return f"{stage()} {fixture.baseid}//{fixture.argname}"


def begin(label):
    """What runs from now on, here and in processes that start, belongs to this label."""
    import coverage

    os.environ[LABEL] = label
    if current := coverage.Coverage.current():
        current.switch_context(label)


def spent() -> float:
    return sum(os.times()[:4])


def told(entry: dict):
    with open(Path(os.environ[FOLDER], f"tests-{os.getpid()}"), "a") as file:
        file.write(json.dumps(entry) + "\n")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    before = spent()
    begin(label_of(item))
    yield
    begin("")
    definitions = item._fixtureinfo.name2fixturedefs.values()
    fixtures = [fixture_label(one) for several in definitions for one in several]
    told({"test": label_of(item), "seconds": spent() - before, "fixtures": fixtures})


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef):
    before = os.environ[LABEL]
    begin(fixture_label(fixturedef))
    yield
    begin(before)


def pytest_runtest_logreport(report):
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        told({"failed": f"{stage()} {report.nodeid.split('[')[0]}"})


def gathered(folder: Path, root: Path) -> dict:
    """What the files of this folder say: seconds of every test, those that failed, and {module: {line: tests}}."""
    from coverage import CoverageData

    seconds, users, failed = defaultdict(float), defaultdict(set), set()
    for path in folder.glob("tests-*"):
        for entry in map(json.loads, path.read_text().splitlines()):
            if "failed" in entry:
                failed.add(entry["failed"])
                continue
            seconds[entry["test"]] += entry["seconds"]
            for fixture in entry["fixtures"]:
                users[fixture].add(entry["test"])
    lines = defaultdict(lambda: defaultdict(set))
    for path in folder.glob("lines.*"):
        data = CoverageData(str(path))
        try:
            data.read()
        except Exception as error:  # a process was killed while it wrote
            print(f"{path.name}: {error}", file=sys.stderr)
            continue
        for module in data.measured_files():
            name = str(Path(module).relative_to(root))
            for line, labels in data.contexts_by_lineno(module).items():
                for label in labels:
                    found = users[label] if label in users else {label} & seconds.keys()
                    lines[name][line] |= found
    plain = {name: {line: sorted(tests) for line, tests in held.items()} for name, held in lines.items()}
    return {"seconds": seconds, "failed": sorted(failed), "lines": plain}


def callers(trees: dict[str, ast.Module]) -> dict[tuple[str, str], set[tuple[str, int]]]:
    """{(module, compiled function): lines of plain functions that name it, or one that comes to run it}."""
    functions = [
        (m, node) for m, tree in trees.items() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    loops = {node.name for _, node in functions if is_compiled(node)}
    # of a compiled function: names of those that are compiled, lines of those that are not
    users = defaultdict(set)
    for module, node in functions:
        for one in ast.walk(node):
            name = getattr(one, "id", getattr(one, "attr", None))
            if name in loops:
                users[name].add(node.name if is_compiled(node) else (module, one.lineno))

    def lines(name, seen):
        if name in seen:
            return set()
        seen.add(name)
        return set().union(*({one} if isinstance(one, tuple) else lines(one, seen) for one in users[name]))

    return {(module, node.name): lines(node.name, set()) for module, node in functions if is_compiled(node)}


def is_compiled(node: ast.FunctionDef) -> bool:
    return any("compiled" in ast.unparse(one) or "njit" in ast.unparse(one) for one in node.decorator_list)

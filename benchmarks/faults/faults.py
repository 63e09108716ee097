"""How many small faults the tests notice: puts one after another into a copy of the package, runs what could see it.

    faults.py map                        # once: which test runs which lines; about twice as long as the suite
    faults.py sample --count 100 --seed 1 [--only jampetsc/response …]
    faults.py one jampetsc/response/elastic.py 60        # all faults of one line

Everything happens in a copy, --scratch, with compiled loops of its own. A fault is run by the tests that run its line,
those of the same room and cheap ones first: plain, on one rank, then on two. The first that fails notices it, and so
does one that takes far longer than without it. What nothing notices is shown, to be read: some change nothing that
could be seen. A map serves while the package stays as it is; tests that are written later are not in it.
Needs `pip install coverage`.
"""

import argparse
import ast
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # last: one of them is named coverage
import common
import touched
from sites import drawn, faults

ROOT = Path(__file__).resolve().parents[2]
SLOWER = 20  # times what its tests take without a fault, and
START = 120  # seconds beside: then a fault counts as one that hangs
COMPILING = 600  # more of them where loops are compiled anew
# cannot end while its ranks are followed, by a handler of SIGTERM in python
DEAF = "tests/commands/test_cli.py::test_one_of_two_ranks_takes_the_other_along"
BUDGET = 20  # seconds of processor time of the tests of one fault, without it


class Copy:
    """A copy of the tree in which faults are put; of its compiled loops, too, as they are without any."""

    def __init__(self, folder: Path):
        self.folder, self.root, self.loops = folder, folder / "tree", folder / "loops"
        self.temporary = folder / "temporary"

    def make(self):
        """The files under version control as they are now, .venv, and the compiled loops that there are."""
        shutil.rmtree(self.root, ignore_errors=True)
        self.root.mkdir(parents=True)
        listed = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
        )
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).exists():
                (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, self.root / name, follow_symlinks=False)
        (self.root / ".venv").symlink_to(ROOT / ".venv")
        move_loops(ROOT / "jampetsc", self.root / "jampetsc")

    def sources(self):
        """{name of a module: its text}"""
        paths = sorted((self.root / "jampetsc").rglob("*.py"))
        return {str(path.relative_to(self.root)): path.read_text() for path in paths}

    def has(self, test):
        """Whether there is a test of this label."""
        path, name = test.split(" ", 1)[1].split("::", 1)
        path = self.root / path
        return path.exists() and f"def {name}(" in path.read_text()

    def keep_loops(self):
        """Put aside what numba has made of the sources as they are."""
        shutil.rmtree(self.loops, ignore_errors=True)
        move_loops(self.root / "jampetsc", self.loops)

    def restore_loops(self):
        """Have no compiled loop but those that were put aside."""
        for path in loops_of(self.root / "jampetsc"):
            path.unlink()
        move_loops(self.loops, self.root / "jampetsc")

    def pytest(self, stage, ranks, tests, seconds=None, more=(), environment=None):
        """(exit status, output) of these tests; None for the status if they take longer."""
        env = common.environment() | (environment or {})
        if ranks > 1:
            env["OMPI_MCA_mpi_yield_when_idle"] = "1"  # as run/test does
        env["PYTHONPATH"] = os.pathsep.join(filter(None, [str(self.root), env.get("PYTHONPATH")]))
        env.pop("PYTHONDONTWRITEBYTECODE", None)
        self.temporary.mkdir(exist_ok=True)
        env["PYTEST_DEBUG_TEMPROOT"] = str(self.temporary)
        words = "-m pytest -q --color=no -p no:cacheprovider".split()
        line = [self.root / ".venv/bin/python", *words, *more]
        if stage != "plain":
            env["JAMPETSC_TEST_SCALAR"] = stage
            line = [*common.mpirun(ranks), *line]
        with tempfile.TemporaryFile("w+") as out:
            pipes = {"stdout": out, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
            running = subprocess.Popen(
                [*line, *tests], cwd=self.root, env=env, start_new_session=True, **pipes
            )
            try:
                status = running.wait(seconds)
            except subprocess.TimeoutExpired:
                status = None
            finally:
                if running.poll() is None:
                    os.killpg(running.pid, signal.SIGKILL)
                    running.wait()
            out.seek(0)
            return status, out.read().replace("\0", "")


def loops_of(folder):
    return [*folder.rglob("*.nb[ic]"), *folder.rglob("compiled-from")]


def move_loops(source, target):
    """Copy compiled loops from one folder to the other, with their times."""
    for path in loops_of(source):
        goal = target / path.relative_to(source)
        goal.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, goal)


def made_map(copy: Copy, chosen):
    """Run all tests, or the chosen ones, and write down what they touch."""
    folder = copy.folder / "touched"
    shutil.rmtree(folder, ignore_errors=True)
    following = touched.following(copy.root, folder)

    def run(stage):
        parts = ["-n", "2", "--dist", "loadfile"] if stage == "plain" else []
        words = ["-p", "touched", "--deselect", DEAF, *parts]
        _, said = copy.pytest(stage, 1, chosen or ["tests"], None, words, following)
        print(f"{stage}: {said.strip()[-2000:]}", flush=True)

    with ThreadPoolExecutor() as pool:
        list(pool.map(run, ("plain", "real", "complex")))
    found = touched.gathered(folder, copy.root) | {"package": copy.sources()}
    (copy.folder / "map.json").write_text(json.dumps(found))
    print(f"{len(found['seconds'])} tests, {sum(found['seconds'].values()):.0f} s of processor time")
    if found["failed"]:
        print("left out, as they fail without a fault:", *found["failed"], sep="\n  ")


class Reach:
    """Which tests could see a fault."""

    def __init__(self, copy: Copy):
        held = json.loads((copy.folder / "map.json").read_text())
        if held["package"] != copy.sources():
            raise SystemExit("the package is no longer what the map was made of: run `faults.py map` again")
        known = {test: s for test, s in held["seconds"].items() if test not in held["failed"]}
        self.seconds = {test: s for test, s in known.items() if copy.has(test)}
        self.lines = {
            name: {int(line): set(t) for line, t in at.items()} for name, at in held["lines"].items()
        }
        self.trees = {name: ast.parse(source) for name, source in copy.sources().items()}
        self.callers = touched.callers(self.trees)

    def at(self, module, first, last):
        lines = self.lines.get(module, {})
        return set().union(*(lines.get(line, set()) for line in range(first, last + 1)))

    def tests(self, module, fault):
        """Those that run the line; of one that only imports and numba run, those that run anything of its module."""
        functions = [
            node
            for node in ast.walk(self.trees[module])
            if isinstance(node, ast.FunctionDef)
            and node.body[0].lineno <= fault.last
            and fault.first <= node.end_lineno
        ]
        for node in functions:
            if (module, node.name) in self.callers:
                return set().union(*(self.at(name, n, n) for name, n in self.callers[module, node.name]))
        found = self.at(module, fault.first, fault.last)
        return found if functions and found else self.at(module, 1, 10**6)

    def ordered(self, module, tests):
        """(stage, ranks, tests) to run one after another: of the same room, then others, then on two ranks."""
        room = f"tests/{Path(module).parts[1]}/"
        known = sorted(tests & self.seconds.keys(), key=self.seconds.get)
        for near in (True, False):
            for stage in ("plain", "real", "complex"):
                some = [t for t in known if t.startswith(f"{stage} ") and (room in t) == near]
                if some:
                    yield stage, 1, some
        for stage in ("real", "complex"):
            some = [t for t in known if t.startswith(f"{stage} ")]
            if some:
                yield stage, 2, some


def tried(copy: Copy, reach: Reach, module, fault):
    """(verdict, test or reason) of one fault."""
    path = copy.root / module
    before, content = path.stat(), path.read_bytes()
    left, out, compiled = BUDGET, 0, b"numba" in content or b"packing.compiled" in content
    least = START + COMPILING * compiled
    path.write_text(fault.applied(content.decode()))
    try:
        tests = reach.tests(module, fault)
        if not tests:
            return "not run", "no test comes near"
        for stage, ranks, some in reach.ordered(module, tests):
            chosen, cost = [], 0.0
            for test in some:
                if cost + reach.seconds[test] * ranks <= left or not chosen:
                    cost += reach.seconds[test] * ranks
                    chosen.append(test.split(" ", 1)[1])
            left, out = left - cost, out + len(some) - len(chosen)
            status, said = copy.pytest(stage, ranks, chosen, least + SLOWER * cost, ["-x"])
            if status is None:
                return "noticed", f"{stage} {ranks}: hangs"
            if status == 4 and "not found" in said and "\nERROR tests/" not in said:
                raise SystemExit(said)
            if status not in (0, 5):
                failed = [line for line in said.splitlines() if line.startswith(("FAILED", "ERROR"))]
                return "noticed", f"{stage} {ranks}: {(failed or [said.strip()[-200:]])[0][:160]}"
            if left <= 0:
                break
        return "not noticed", f"{len(tests)} tests reach it" + (", some left out" if out or left <= 0 else "")
    finally:
        shutil.rmtree(copy.temporary, ignore_errors=True)
        path.write_bytes(content)
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
        if compiled:
            copy.restore_loops()


def shown(source, fault):
    """What the fault is, as lines of a difference."""
    content = source.encode()
    old = source.splitlines()[fault.first - 1 : fault.last]
    size = len(content[: fault.start].decode().splitlines(keepends=True)) - 1
    new = fault.applied(source).splitlines()[size : size + 1 + fault.put.count("\n")]
    return "\n".join([f"    - {line.strip()}" for line in old] + [f"    + {line.strip()}" for line in new])


def run(copy: Copy, chosen):
    """Try these faults and say what became of them."""
    reach, sources = Reach(copy), copy.sources()
    copy.keep_loops()
    counts = dict.fromkeys(("noticed", "not noticed", "not run"), 0)
    for number, (module, fault) in enumerate(chosen, 1):
        began = time.monotonic()
        verdict, reason = tried(copy, reach, module, fault)
        counts[verdict] += 1
        took = time.monotonic() - began
        print(
            f"{number:4d} {verdict}: {module}:{fault.first} {fault.kind} ({took:.0f} s) {reason}", flush=True
        )
        print(shown(sources[module], fault), flush=True)
    total = sum(counts.values())
    print(
        f"{counts['noticed']} of {total} noticed; " + ", ".join(f"{n} {word}" for word, n in counts.items())
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--scratch", type=Path, default=Path(tempfile.gettempdir()) / "jampetsc-faults")
    tasks = parser.add_subparsers(dest="task", required=True)
    tasks.add_parser("map").add_argument("tests", nargs="*", help="paths; default: all")
    sample = tasks.add_parser("sample")
    sample.add_argument("--count", type=int, default=100)
    sample.add_argument("--seed", type=int, required=True)
    sample.add_argument("--only", nargs="+", default=["jampetsc"], help="folders or modules")
    one = tasks.add_parser("one")
    one.add_argument("module")
    one.add_argument("line", type=int)
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))  # so that the tests that run are ended, too
    copy = Copy(args.scratch.resolve())
    copy.make()
    if args.task == "map":
        return made_map(copy, args.tests)
    sources = copy.sources()
    if args.task == "one":
        found = [(args.module, fault) for fault in faults(sources[args.module]) if fault.first == args.line]
        return run(copy, found)
    within = {name: text for name, text in sources.items() if name.startswith(tuple(args.only))}
    return run(copy, drawn(within, args.count, args.seed))


if __name__ == "__main__":
    sys.exit(main())

"""What the benchmarks share: packings made once, programs run with time and memory, a line about the machine."""

import json
import os
import platform
import resource
import shlex
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

MAX_LINE = 200  # characters of a command that a message shows whole
FOLDER = Path(__file__).resolve().parent / "packings"  # not in git: made when first needed


def packing(n: int, pressure: str, seed: int = 1) -> Path:
    """A packing file of N disks at a pressure, made by `jampetsc pack` unless it is there."""
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"n{n}-p{pressure}-s{seed}.h5"
    if not path.exists():
        command = ["pack", "--n", n, "--pressure", pressure, "--seed", seed, "--out", path]
        run_program([sys.executable, "-m", "jampetsc", *command], stdout=None)
    return path


def environment() -> dict:
    """Environment of a worker: one thread per rank, and what Open MPI wants of root."""
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    if os.getuid() == 0:
        env |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return env


def run_program(words, **settings) -> subprocess.CompletedProcess:
    """A program run to its end, with its output as text; settings are those of `subprocess.run`.

    Ends this program by one line where the other one does not start or fails.
    """
    program, *_ = words = [str(word) for word in words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "errors": "replace"}
    try:
        done = subprocess.run(words, **{**pipes, "env": environment(), **settings})
    except OSError as error:
        sys.exit(
            f"{program}: does not start ({error.strerror}). Install it, or give the path of one that does."
        )
    if done.returncode:
        how = (
            f"killed by signal {-done.returncode}"
            if done.returncode < 0
            else f"exit status {done.returncode}"
        )
        lines = [
            line.strip() for line in f"{done.stdout or ''}\n{done.stderr or ''}".splitlines() if line.strip()
        ]
        errors = [line for line in lines if "error" in line.lower()]
        shown = shlex.join(words) if len(shlex.join(words)) <= MAX_LINE else program
        sys.exit(f"{shown}: {how}. It says: {(errors or lines or ['nothing'])[-1]}")
    return done


def mpirun(ranks: int) -> list[str]:
    """Words before a program on so many ranks. Ends this program where there is no mpirun."""
    if ranks > 1 and not shutil.which("mpirun"):
        sys.exit(f"mpirun: not in PATH, and {ranks} ranks need it. Install an MPI.")
    return ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)] if ranks > 1 else []


def worker(script, *arguments, ranks: int = 1) -> dict:
    """Run `script arguments…` in processes of its own; returns what it handed to `report`."""
    done = run_program([*mpirun(ranks), sys.executable, script, *arguments])
    return json.loads(done.stdout.splitlines()[-1])


def report(**values) -> None:
    """Hand figures to the program that started this worker, with this process's peak memory in GB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    print(json.dumps(values | {"memory": peak}), flush=True)


def machine() -> str:
    """A line about where the figures come from."""
    model = next(
        (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")),
        platform.processor(),
    )
    return (
        f"{model}, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}, one thread per rank"
    )


def in_turn(rounds: int, runs: dict) -> dict:
    """{name: [what every call of runs[name]() gives]}, all once in each round: a busy machine slows all alike."""
    found = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            found[name].append(run())
    return found


def processor(run, *arguments) -> tuple:
    """(seconds of processor time, what run(*arguments) gives)."""
    began = time.process_time()
    given = run(*arguments)
    return time.process_time() - began, given


def both_included(text: str) -> range:
    """The numbers of A:B, for an option."""
    first, last = map(int, text.split(":"))
    return range(first, last + 1)


@contextmanager
def saved_page(path):
    """A page for a picture in the package's style, which is written to the file `path` in the end."""
    from jampetsc.plots.page import Page
    from jampetsc.plots.style import drawn_in

    with drawn_in():
        page = Page()
        yield page
        page.finish()
        page.save(path)

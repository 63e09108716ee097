"""Starting programs of the test suite, with or without mpirun."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

from jampetsc import main
from jampetsc.options import parser
from jampetsc.petsc.launchers import without_launcher

ROOT = Path(__file__).resolve().parents[1]
MINUTES = 800  # seconds, for what runs many commands


def environment():
    """The environment without what an mpirun above left in it, and with one thread per rank."""
    clean = without_launcher(os.environ)
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    clean |= {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(paths)}
    clean.pop("OMP_THREAD_LIMIT", None)  # a session that this process may have started has set it
    if os.geteuid() == 0:
        clean |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return clean


def command(ranks, program, *args):
    """Command line of tests/`program` on so many ranks; 0 ranks means without mpirun."""
    python = [sys.executable, str(ROOT / "tests" / program), *map(str, args)]
    return [*mpirun(ranks), *python]


def mpirun(ranks):
    """Words before a command for so many ranks, all on one core, where one that waits keeps none busy; none for 0."""
    words = ["env", "OMPI_MCA_mpi_yield_when_idle=1", "mpirun", "--oversubscribe", "--bind-to", "none"]
    if shutil.which("taskset"):  # Linux; processes that share the tests take different cores
        cores = sorted(os.sched_getaffinity(0))
        words = ["taskset", "--cpu-list", str(cores[os.getpid() % len(cores)]), *words]
    return [*words, "-n", str(ranks)] if ranks else []


def command_lines(text):
    """The command lines in the indented and ```bash blocks of a text, as lists of words after `jampetsc`."""
    text = re.sub(
        r"^```bash\n(.*?)^```",
        lambda block: textwrap.indent(block[1], "    "),
        text,
        flags=re.MULTILINE | re.DOTALL,
    )
    found = re.findall(r"^(?:  |    )(?:mpirun -n \d+ )?jampetsc (.*)$", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in found]


def run_lines(folder, items):
    """What tests/run_lines.py says of command lines and pieces of python in a folder, all in one process.

    But for those with options of PETSc, of which a process has one set: each of them in one of its own, afterwards.
    """
    return run_pages({folder: items})


def run_pages(pages):
    """`run_lines` of {folder: items}, all of them in one process."""
    together, alone = [], []
    for folder, items in pages.items():
        together.append({"folder": str(folder)})
        for item in items:
            has_options = not isinstance(item, str) and any(re.match("-[a-z]{2}", word) for word in item)
            if has_options:
                alone.append([{"folder": str(folder)}, item])
            else:
                together.append(item)
    settings = {"env": environment(), "capture_output": True, "text": True, "timeout": MINUTES}
    said = ""
    for items in (together, *alone):
        done = subprocess.run(command(0, "run_lines.py"), input=json.dumps(items), **settings)
        assert done.returncode == 0, f"{done.stderr[-2000:]}\n{items}"
        said += done.stdout
    return said


def asked(words):
    """(job, parsed words) of a command line after `jampetsc`."""
    args = main.command_parser(words)[0].parse_args(words)
    return parser.parse_job(args), args


def here(line):
    """Do a command in this process, which has PETSc: `main.dispatch` would end MPI after one that does not need it."""
    assert parser.run_command(*asked(line.split())) == 0


def start(ranks, program, *args, **options):
    """A running Popen of tests/`program`, its output as text in pipes."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command(ranks, program, *args), env=environment(), **pipes, **options)


def run(ranks, program, *args, **options):
    """tests/`program`, finished within a minute: CompletedProcess with text output."""
    finished = {"capture_output": True, "text": True, "timeout": 60}
    done = subprocess.run(command(ranks, program, *args), env=environment(), **finished, **options)
    done.stdout, done.stderr = (text.replace("\0", "") for text in (done.stdout, done.stderr))  # Open MPI 5
    return done

"""One run of jampetsc in processes of its own: each can load one PETSc build, and has its time and memory."""

import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

from jampetsc import interrupts
from jampetsc.errors import InputError, named
from jampetsc.petsc.launchers import without_launcher

_LAUNCHERS = ("mpirun", "mpiexec")


@dataclass(frozen=True)
class ProcessOutcome:
    """How a run ended."""

    status: int  # exit status
    seconds: float  # of the whole process, imports included
    memory: float  # MB, the largest of its processes
    error: str  # one line; empty if it succeeded
    processor: float = math.nan  # seconds of all its processes


def launcher(ranks: int | None) -> list[str]:
    """Words that start a command on `ranks` ranks, [] for None. Raises InputError without mpirun."""
    if ranks is None:
        return []
    program = next((path for name in _LAUNCHERS if (path := shutil.which(name))), None)
    if program is None:
        raise InputError(f"{named('ranks')} {ranks}: neither mpirun nor mpiexec in PATH. Leave it out.")
    about = subprocess.run([program, "--version"], capture_output=True, text=True).stdout
    # Open MPI would refuse more ranks than cores, and put two runs on the same ones; MPICH does neither
    freely = ["--oversubscribe", "--bind-to", "none"] if re.search(r"Open ?(MPI|RTE)", about) else []
    return [program, *freely, "-n", str(ranks)]


def run(words, ranks: int | None = None) -> ProcessOutcome:
    """Run `jampetsc words` to its end, on `ranks` ranks under mpirun or without it."""
    command = [*launcher(ranks), sys.executable, "-m", "jampetsc", *map(str, words)]
    with tempfile.TemporaryFile() as errors:
        start_time, nothing = time.perf_counter(), subprocess.DEVNULL
        environment = without_launcher(os.environ)
        interrupts.check()
        with interrupts.waiting():
            process = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=errors, env=environment)
            try:
                _, status, usage = os.wait4(process.pid, 0)  # for the memory of this run alone
            except BaseException:
                process.terminate()
                process.wait()
                raise
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - start_time
        errors.seek(0)
        text = errors.read().decode(errors="replace")
    error = failure_reason(text, process.returncode) if process.returncode else ""
    return ProcessOutcome(
        process.returncode, seconds, usage.ru_maxrss / 1024.0, error, usage.ru_utime + usage.ru_stime
    )


def failure_reason(text: str, status: int) -> str:
    """The line of a failed run's standard error that says why; without one what its exit status does."""
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip(" -\t")]
    messages = [
        line.removeprefix("jampetsc: error: ") for line in lines if line.startswith("jampetsc: error: ")
    ]
    if messages:
        return messages[0]
    if status < 0:
        return f"killed by signal {-status}"
    if not lines:
        return f"exit status {status} without a message"
    return lines[-1] if any(line.startswith("Traceback") for line in lines) else lines[0]

"""Ctrl-C at random moments of every long command: does it end with its line and status, does the same command continue?

    .venv/bin/python benchmarks/interrupts.py [--count 10] [--ranks 1,2] [--only shear,modes] [--seed 1]

Each command runs to its end first, then `count` times until a SIGINT at a random moment; a `python` row does so to
a process that calls the functions and catches KeyboardInterrupt. Expected: status 130 and one line "interrupted: …",
or status 0 where the command was faster; -2 before a job begins, where there is nothing to say. After every interrupt
the same command runs again, to its end in every second case; its result must be that of the first run. Several ranks
get the signal each, as from srun, and every third time mpirun gets it, which ends them by SIGTERM.

Checkpoints of flow and shear are written every 0.3 s here, not every 10 s. Exit status 1 if anything else happened.
"""

import argparse
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import environment, machine, mpirun

N = 256
STUDY = """
[pack]
n = 64
pressure = [1e-2, 1e-3]
seeds = "1:6"
[sweep]
omega = "1e-6:1:41"
[modes]
count = 20
"""
MADE = {  # files that the commands read
    "p.h5": f"pack --n {N} --pressure 1e-3 --seed 1 --stabilise shear",
    "large.h5": "pack --n 2048 --pressure 1e-3 --seed 1",
    "f.h5": f"flow --model RD0 --n {N} --phi 0.85 --seed 1 --rate 1e-3 --strain 1 --snapshots 50",
    **{f"jam{n}.h5": f"jam --n {n} --phi 0.78:0.9:13 --seeds 1:20" for n in (16, 24, 32)},
}
SIZES = "jam16.h5 jam24.h5 jam32.h5"
# name -> (words, ending of the result, whether it runs on several ranks)
COMMANDS = {
    "pack": ("pack --n 4096 --pressure 1e-3 --seed 1", ".h5", False),
    "sweep": ("sweep large.h5 --omega 1e-8:1e2:141", ".h5", True),
    "direct": ("sweep p.h5 --method direct --omega 1e-6:1:150", ".h5", True),
    "modes": ("modes large.h5 --count 100", ".h5", True),
    "quasistatic": ("quasistatic large.h5", ".h5", True),
    "flow": (f"flow --model RD0 --n {N} --phi 0.85 --seed 1 --rate 1e-3 --strain 1", ".h5", False),
    "massive": (f"flow --n {N} --phi 0.85 --seed 1 --rate 1e-3 --strain 1 --model CDn --mass 1", ".h5", False),
    "shear": (f"shear --n {N} --phi 0.85 --seed 1 --step 1e-3 --strain 0.3", ".h5", False),
    "jam": ("jam --n 32 --phi 0.83:0.85:3 --seeds 1:60", ".h5", True),
    "compress": ("jam --n 32 --phi 0.84 --seeds 1:3 --protocol compress", ".h5", True),
    "oscillate": ("oscillate p.h5 --alpha 0.7 --omega 1e-3,1e-2,1e-1,1 --stress 1e-5,1e-4", ".h5", True),
    "moving": ("oscillate p.h5 --contacts moving --omega 1e-1 --strain 1e-4,1e-3", ".h5", True),
    "study": ("study study.toml", "", True),
    "trade": ("trade p.h5 --choices accuracy", ".csv", False),
    "correlate": ("correlate f.h5 --lane 1", ".h5", False),
    "collapse": (f"collapse {SIZES} --finite-size --observable jammed --fit phi_J,y=0,nu", ".h5", False),
}  # fmt: skip
LINE = re.compile(r"jampetsc: error: (?:rank \d+: )?interrupted: (.*)")
PYTHON = """
import sys, numpy, jampetsc as jp
jobs = [lambda: jp.shear(n=64, phi=0.85, seed=1, step=1e-3, strain=0.1)["energy"],
        lambda: jp.sweep("p.h5", omega=[1e-3, 1.0]).G, lambda: jp.modes("p.h5", count=100)["eigenvalues"],
        lambda: jp.flow(model="RD0", n=64, phi=0.85, seed=1, rate=1e-3, strain=0.3)["energy"],
        lambda: jp.pack(n=512, pressure=1e-3, seed=1).positions]
first, turn, signals = [job() for job in jobs], 0, int(sys.argv[1])
print("ready", flush=True)
while signals:
    turn += 1
    try:
        for wanted, job in zip(first, jobs):
            numpy.testing.assert_allclose(job(), wanted, rtol=1e-8)
    except KeyboardInterrupt as error:
        signals -= 1
        print(error, flush=True)
"""


def child(words):
    """Run a command with checkpoints of flow and shear written often."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # as `jampetsc.__main__` does
    from jampetsc.__main__ import main
    from jampetsc.options import execution

    run = execution._run

    def run_often(job, *settings):
        if job.NAME in ("flow", "shear"):
            from jampetsc.flows import flow_run
            from jampetsc.jamming import stepwise_shear

            flow_run.SAVE_INTERVAL = stepwise_shear.SAVE_INTERVAL = 0.3
        return run(job, *settings)

    execution._run = run_often

    sys.argv = ["jampetsc", *words]
    main()


def start(folder, words, ranks):
    """The running command, a Popen."""
    line = [*mpirun(ranks), sys.executable, str(Path(__file__).resolve()), "--child", *words]
    return subprocess.Popen(
        line,
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def run(folder, words, ranks):
    """The command to its end: seconds. Ends this program where it fails."""
    began, process = time.monotonic(), start(folder, words, ranks)
    errors = process.communicate()[1]
    if process.returncode:
        sys.exit(f"{shlex.join(words)}: status {process.returncode}\n{errors[-3000:]}")
    return time.monotonic() - began


def interrupt(process, to_launcher):
    """Send SIGINT: to the process, to the ranks below mpirun, or to mpirun."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    for pid in [process.pid] if to_launcher else map(int, children):
        try:
            os.kill(pid, signal.SIGINT)
        except ProcessLookupError:
            pass


def judged(status, errors, ranks, to_launcher) -> str:
    """What happened, in words; with "!" in front where it should not have."""
    found = LINE.findall(errors)
    if "Traceback" in errors or "PETSC ERROR" in errors:
        begun = "PETSC ERROR" in errors or "jampetsc/" in errors  # python starts, or this program does
        return "!traceback" if begun else "before the job"
    if status == 0:
        return "finished"
    if ranks > 1 and to_launcher:
        return "ended by mpirun"
    if not found and (status == -signal.SIGINT or (ranks > 1 and status == 128 + signal.SIGINT)):
        return "before the job"
    if status != 130 or not found or (ranks == 1 and len(found) > 1):
        return f"!status {status}, {len(found)} lines"
    return re.sub(r"^\d+ of|^\d+", "some", re.sub(r"beside \S+\.(?= )", "beside FILE.", found[0]))


def contents(path):
    """{name: values} of a result, a table without times."""
    import csv

    import h5py

    if path.is_dir():
        path = path / "table.csv"
    if path.suffix == ".csv":
        with open(path, newline="") as file:
            rows = [row for row in csv.DictReader(filter(lambda line: not line.startswith("#"), file))]
        return {
            f"{number} {name}": value
            for number, row in enumerate(rows)
            for name, value in row.items()
            if name and not any(word in name for word in ("seconds", "memory", "sha256", "run_id"))
        }
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, one: found.update({name: one[()]} if isinstance(one, h5py.Dataset) else {})
        )
    for name in list(found):  # names and hashes of parts; signs of modes, and what rounding leaves
        if name.startswith(("part_files/", "modes", "residuals", "shear_force")):
            del found[name]
    return found


def compared(first, second) -> str:
    """How two results differ, in words; empty if they do not."""
    if first.keys() != second.keys():
        return f"!other names: {sorted(first.keys() ^ second.keys())[:5]}"
    other = [name for name in first if not _alike(name, first[name], second[name])]
    return f"!differ: {', '.join(other[:5])}" if other else ""


def _alike(name, one, other):
    """But for rounding, in which two sweeps of one packing differ; bounds consist of it."""
    if not np.issubdtype(np.asarray(one).dtype, np.inexact):
        return np.array_equal(one, other)
    if np.shape(one) != np.shape(other):
        return False
    digits = 0.5 if "error" in name else 1e-8
    return np.allclose(
        one, other, rtol=digits, atol=digits * np.max(np.abs(np.nan_to_num(one)), initial=0.0), equal_nan=True
    )


def sample(folder, name, count, ranks, generator):
    """Interrupt one command `count` times: {what happened: how often}."""
    words, ending, _ = COMMANDS[name]
    words = words.split()
    whole, out = (folder / f"{name}-{ranks}-{what}{ending}" for what in ("whole", "parts"))
    seconds = run(folder, [*words, "--out", whole.name, "-q"], ranks)
    happened, slowest = {}, 0.0
    for turn in range(count):
        to_launcher = ranks == 1 or turn % 3 == 2
        process = start(folder, [*words, "--out", out.name, "-q"], ranks)
        time.sleep(generator.uniform(0.0, seconds))
        began = time.monotonic()
        if process.poll() is None:
            interrupt(process, to_launcher)
        errors = process.communicate()[1]
        slowest = max(slowest, time.monotonic() - began)
        what = judged(process.returncode, errors, ranks, to_launcher)
        if turn % 2 and not what.startswith("!"):
            run(folder, [*words, "--out", out.name, "-q"], ranks)
            if name != "trade":  # its table is of times
                what += compared(contents(whole), contents(out))
            for path in folder.glob(f"{out.name}*"):
                subprocess.run(["rm", "-r", str(path)], check=True)
        happened[what] = happened.get(what, 0) + 1
        if "!" in what:
            print(f"{name}: {what}\n{errors[-2000:]}", flush=True)
    for path in folder.glob(f"{out.name}*"):
        subprocess.run(["rm", "-r", str(path)], check=True)
    print(
        f"{name:12} {ranks} ranks, {seconds:5.1f} s, ended after {slowest:.1f} s at most: {happened}",
        flush=True,
    )
    return happened


def sample_python(folder, count, generator):
    """The same for functions in one process."""
    process = start_python(folder, count)
    while process.stdout.readline() != "ready\n":
        if process.poll() is not None:
            print(f"python: {process.stderr.read()[-2000:]}", flush=True)
            return {f"!status {process.returncode}": 1}
    for _ in range(count):
        time.sleep(generator.uniform(0.1, 3.0))
        process.send_signal(signal.SIGINT)
        if not process.stdout.readline():
            break
    errors = process.communicate()[1]
    happened = (
        {"KeyboardInterrupt": count} if process.returncode == 0 else {f"!status {process.returncode}": 1}
    )
    print(f"python: {happened}{errors[-2000:]}", flush=True)
    return happened


def start_python(folder, count):
    """The running program PYTHON."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(
        [sys.executable, "-c", PYTHON, str(count)],
        cwd=folder,
        env=environment(),
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        **pipes,
    )


def main():
    """See the docstring of the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--ranks", default="1,2")
    parser.add_argument("--only", default=",".join([*COMMANDS, "python"]))
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    generator, outcomes = random.Random(asked.seed), {}
    print(machine())
    with tempfile.TemporaryDirectory(prefix="interrupts-") as folder:
        folder = Path(folder)
        (folder / "study.toml").write_text(STUDY)
        for out, words in MADE.items():
            run(folder, [*words.split(), "--out", out, "-q"], 1)
        for name in asked.only.split(","):
            for ranks in map(int, asked.ranks.split(",")):
                if name == "python":
                    found = sample_python(folder, asked.count, generator) if ranks == 1 else {}
                elif ranks > 1 and not COMMANDS[name][2]:
                    continue
                else:
                    found = sample(folder, name, asked.count, ranks, generator)
                for what, times in found.items():
                    outcomes[what] = outcomes.get(what, 0) + times
    print(f"{sum(outcomes.values())} interrupts:")
    for what, times in sorted(outcomes.items(), key=lambda one: -one[1]):
        print(f"  {times:4}  {what}")
    return int(any("!" in what for what in outcomes))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2:])
    sys.exit(main())

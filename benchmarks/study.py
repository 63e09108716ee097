"""An ensemble of 200 small tasks: a study on one rank and on two, against one shell command for each task.

    .venv/bin/python benchmarks/study.py [--n 256] [--seeds 20] [--rounds 2]

Prints elapsed time of the study on 1 and on 2 ranks and the processor time of the busiest rank, alternately and the
least of all rounds, and both of every tenth task as a command of its own, start-up included; then the ratios. On a
machine that others use, that of processor times says what free cores would give: ranks do not wait for each other.
"""

import argparse
import functools
import re
import shutil
import sys
import tempfile
import time
from pathlib import Path

import common

STUDY = """
[pack]
n = {n}
pressure = [1e-2, 1e-3]
seeds = "1:{seeds}"
[sweep]
beta = [1.0, 1e-2]
[quasistatic]
[modes]
count = 10
"""
EACH = ["bash", "-c", 'TIMEFORMAT="processor %U %S"; time "$0" "$@"']  # of every rank, on its standard error
EVERY = 10  # so many tasks for one that is run as a command


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=2)
    args = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="jampetsc-benchmark-"))
    (folder / "study.toml").write_text(STUDY.format(n=args.n, seeds=args.seeds))

    def on(ranks):
        shutil.rmtree(folder / f"on-{ranks}", ignore_errors=True)
        words = jampetsc("study", "study.toml", "--out", f"on-{ranks}")
        spent = timed([*common.mpirun(ranks), *EACH, *words], folder)
        print(f"ranks {ranks}: {spent[0]:.1f} s, busiest rank {spent[1]:.1f} s", flush=True)
        return spent

    times = common.in_turn(args.rounds, {ranks: functools.partial(on, ranks) for ranks in (1, 2)})
    lines = outlook(folder)
    alone = [timed([*EACH, *jampetsc(*line)], folder / "on-1") for line in lines[5::EVERY]]
    count, one, two = len(lines), least(times[1]), least(times[2])
    each = [sum(column) / len(alone) for column in zip(*alone, strict=True)]
    print(f"{count} tasks, N = {args.n}: 1 rank {one[0]:.1f} s, 2 ranks {two[0]:.1f} s elapsed;")
    print(f"ratio {one[0] / two[0]:.2f} elapsed, {one[1] / two[1]:.2f} in processor time of the busiest rank")
    print(f"a task on 1 rank {one[0] / count:.3f} s elapsed, {one[1] / count:.3f} s of processor;")
    print(f"as a command of its own {each[0]:.3f} s elapsed, {each[1]:.3f} s of processor:")
    print(f"{each[0] * count / one[0]:.1f} and {each[1] * count / one[1]:.1f} times as much")
    print(common.machine())
    shutil.rmtree(folder)


def jampetsc(*words):
    return [sys.executable, "-m", "jampetsc", *words]


def outlook(folder):
    """The command line of every task, without the program's name, to be given in the folder of the study."""
    words = jampetsc("study", "study.toml", "--out", "nowhere", "--dry-run")
    told = common.run_program(words, cwd=folder)
    lines = [line.split()[3:] for line in told.stdout.splitlines() if line.startswith("to do  ")]
    for number, line in enumerate(lines):  # what the study has made stays
        line[line.index("--out") + 1] = f"alone-{number}.h5"
    return lines


def timed(words, folder):
    """(elapsed, processor) seconds of a program, the latter of its busiest rank."""
    began = time.perf_counter()
    done = common.run_program(words, cwd=folder)
    elapsed = time.perf_counter() - began
    used = re.findall(r"^processor (\S+) (\S+)$", done.stderr, re.MULTILINE)
    return elapsed, max(float(user) + float(system) for user, system in used)


def least(pairs):
    return tuple(min(column) for column in zip(*pairs, strict=True))


if __name__ == "__main__":
    main()

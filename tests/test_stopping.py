"""SIGTERM: a process that cannot listen ends all the same, one that can cleans up, and no rank stays behind."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import launch

LINE = "jampetsc: error: stopped by SIGTERM; what was finished is on disk"
# Hours inside one instruction of python, the interpreter locked; says first that it is there.
DEAF = "sum(itertools.chain(map(functools.partial(os.write, 1), [b'ready\\n']), range(10**13)))"


def running(code):
    """A process that runs `code` until it prints a line."""
    line = [
        launch.sys.executable,
        "-c",
        f"import functools, itertools, os, time\nfrom jampetsc import stopping\n{code}",
    ]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(line, env=launch.environment(), **pipes)
    assert process.stdout.readline() == "ready\n"
    return process


def ended(process):
    """(status, lines of standard error of ours) of a process that ends within a minute."""
    with process:
        try:
            _, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    return process.returncode, [
        line for line in errors.replace("\0", "").splitlines() if line.startswith("jampetsc")
    ]


def handled(pid, number):
    """Whether a process has a handler for a signal."""
    status = Path("/proc", str(pid), "status").read_text()
    return int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16) >> (number - 1) & 1


WATCHED = "stopping.stop_on_sigterm()\nwith stopping.watched():\n    "
READY = "print('ready', flush=True)"


def test_a_process_that_cannot_listen_is_ended():
    process = running(f"{WATCHED}{DEAF}")
    process.send_signal(signal.SIGTERM)
    assert ended(process) == (-signal.SIGTERM, [LINE])


CALLED_BACK = """import ctypes, sys
from jampetsc import cli

def wait():
    print("ready", flush=True)
    time.sleep(60)

def compiled(*_):
    ctypes.CFUNCTYPE(None)(wait)()
    raise RuntimeError("no compiled object yet")

cli.dispatch = compiled
sys.exit(cli.main([]))"""


def test_what_swallows_the_end_makes_no_traceback():
    """As numba does, which compiles by functions that C calls: no exception gets through, and another comes of it."""
    process = running(CALLED_BACK)
    process.send_signal(signal.SIGTERM)
    with process:
        _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors.replace("\0", "").splitlines()) == (143, [LINE])


def test_a_second_signal_ends_it_at_once():
    process = running(f"stopping.PATIENCE = 1000\n{WATCHED}{DEAF}")
    process.send_signal(signal.SIGTERM)
    while handled(process.pid, signal.SIGTERM):  # the next one would otherwise be the same signal
        time.sleep(0.01)
    process.send_signal(signal.SIGTERM)
    assert ended(process) == (-signal.SIGTERM, [])


def test_cleaning_up_takes_its_time_but_not_for_ever():
    patient = f"try: {READY}; time.sleep(60)\n    finally: "
    clean = "time.sleep(0.6); print('clean', flush=True)"
    process = running(f"stopping.PATIENCE = 0.3\n{WATCHED}{patient}{clean}")
    process.send_signal(signal.SIGTERM)
    assert process.stdout.readline() == "clean\n" and ended(process) == (128 + signal.SIGTERM, [])
    process = running(f"stopping.CLEANING = 0.1\n{WATCHED}{patient}{DEAF}")
    process.send_signal(signal.SIGTERM)
    assert ended(process) == (-signal.SIGTERM, [LINE])


def test_what_ignores_the_signal_is_killed():
    ignore = f"__import__('signal').signal({int(signal.SIGTERM)}, {int(signal.SIG_IGN)})"
    late = f"try: {READY}; time.sleep(60)\n    finally: {ignore}; {DEAF}"
    process = running(f"stopping.CLEANING = 0.1\n{WATCHED}{late}")
    process.send_signal(signal.SIGTERM)
    assert process.stdout.readline() == "ready\n" and ended(process) == (-signal.SIGKILL, [LINE])


def test_nothing_of_it_is_left_when_the_work_is_done():
    done = running(f"{WATCHED}{READY}\nos.wait()")
    assert "ChildProcessError" in done.communicate(timeout=60)[1]


def test_one_of_two_ranks_takes_the_other_along(tmp_path):
    words = ("probe", tmp_path / "pid", "--do", "be_deaf", "--scalar", "real")
    process = launch.start(2, "probe.py", *words)
    heard = ""
    while heard.count("waiting") < 2:  # mpirun may run the lines of two ranks together
        line = process.stdout.readline()
        assert line, heard
        heard += line
    os.kill(int((tmp_path / "pid1").read_text()), signal.SIGTERM)
    assert ended(process) == (128 + signal.SIGTERM, [LINE])

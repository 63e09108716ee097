"""SIGTERM: a process that cannot listen ends all the same, one that can cleans up, and no rank stays behind."""

import contextlib
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import launch
import pytest

from jampetsc import stopping

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


# What a process that is watched has beside it


def children():
    """Processes that this one has started."""
    return {int(pid) for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()}


def ignored(pid):
    """Numbers of the signals that a process ignores."""
    status = Path("/proc", str(pid), "status").read_text()
    mask = int(re.search(r"SigIgn:\s*(\w+)", status)[1], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


@pytest.fixture
def listening():
    """Whatever a test does to the signals is undone."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGUSR1)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_the_watcher_is_deaf_to_what_is_meant_for_the_one_it_watches():
    before = children()
    with stopping.watched():
        (watcher,) = children() - before
        deadline = time.monotonic() + 60
        while not {signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT} <= ignored(watcher):
            assert time.monotonic() < deadline
    assert children() == before


def test_signals_are_heard_by_the_watcher_while_there_is_one():
    before = len(os.listdir("/proc/self/fd"))
    with stopping.watched():
        ear = signal.set_wakeup_fd(-1)
        signal.set_wakeup_fd(ear, warn_on_full_buffer=False)
        assert ear == stopping._pipe and not os.get_blocking(ear)
    assert stopping._pipe is None and signal.set_wakeup_fd(-1) == -1
    assert len(os.listdir("/proc/self/fd")) == before


def test_more_signals_than_a_pipe_holds_are_no_trouble(listening, capfd):
    heard = []
    signal.signal(signal.SIGUSR1, lambda *_: heard.append(1))
    before = children()
    with stopping.watched():
        (watcher,) = children() - before
        os.kill(watcher, signal.SIGSTOP)
        assert not os.get_blocking(stopping._pipe)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(stopping._pipe, bytes([signal.SIGUSR1]) * 4096)
        os.kill(os.getpid(), signal.SIGUSR1)
        os.kill(watcher, signal.SIGCONT)
    assert heard == [1] and capfd.readouterr().err == ""


def watching(pid):
    """(process, end of the pipe to write to, its standard error) of a watcher of a process that is not its parent."""
    ear, mouth = os.pipe()
    read, write = os.pipe()
    watcher = os.fork()
    if watcher == 0:
        with contextlib.suppress(BaseException):
            os.close(mouth)
            sys.stderr = os.fdopen(write, "w")
            stopping.PATIENCE = 0.0
            stopping._watch(pid, ear)
        os._exit(0)
    os.close(ear)
    os.close(write)
    return watcher, mouth, os.fdopen(read)


def test_who_has_taken_the_number_of_the_watched_one_is_spared():
    other = subprocess.Popen(["sleep", "60"])
    watcher, mouth, errors = watching(other.pid)
    os.write(mouth, bytes([signal.SIGTERM]))
    with errors:
        assert errors.readline() == f"{LINE}\n"
    os.close(mouth)
    os.waitpid(watcher, 0)
    assert other.poll() is None
    other.kill()
    other.wait()


def test_other_signals_are_none_of_the_watchers_business():
    watcher, mouth, errors = watching(0)
    os.write(mouth, bytes([signal.SIGUSR1]))
    with errors:
        assert select.select([errors], [], [], 0.05)[0] == []  # nothing is said, and it has not ended
        os.close(mouth)
        os.waitpid(watcher, 0)
        assert errors.read() == ""


def test_only_the_end_itself_is_passed_over_in_silence(monkeypatch):
    """An error in what C calls back is python's to tell."""
    told = []
    monkeypatch.setattr(sys, "__unraisablehook__", told.append)
    for value in (stopping.Terminated(), ZeroDivisionError()):
        stopping._unraisable(SimpleNamespace(exc_value=value))
    assert [type(arguments.exc_value) for arguments in told] == [ZeroDivisionError]


def test_threads_leave_the_signals_alone(listening):
    """Only the main thread may set them: whoever calls from another one works without."""
    handler, failures = signal.getsignal(signal.SIGTERM), []

    def call():
        try:
            stopping.stop_on_sigterm()
        except ValueError as error:
            failures.append(error)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    assert failures == [] and signal.getsignal(signal.SIGTERM) is handler

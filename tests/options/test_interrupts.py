"""Ctrl-C while a job runs: when it is raised, what it says, and whose handler stays."""

import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from typing import ClassVar

import launch
import pytest

from jampetsc import interrupts
from jampetsc.options.execution import run_job
from jampetsc.options.job import Job

# Python is at work while numba makes the tuple that a compiled function returns: a signal there ended the process.
PRESSED = """
import functools, signal, sys
from jampetsc.main import main
from jampetsc.minimisation import fire

made, new = [], fire.Clock.__new__

@functools.wraps(new)
def pressed(kind, *values):
    made.append(kind)
    if len(made) == 2:  # the first is made by python
        signal.raise_signal(signal.SIGINT)
    return new(kind, *values)

fire.Clock.__new__ = pressed
sys.exit(main(sys.argv[1:]))
"""


@dataclass(frozen=True)
class Pressed(Job):
    """Whose work is what the test says."""

    scalar: ClassVar = None
    FORMAT: ClassVar = "no file"

    def work(self, to):
        """Do it."""
        return Pressed.deed()


def perform(deed):
    Pressed.deed = staticmethod(deed)
    return run_job(Pressed(), argv=["jampetsc"], alone=True).summary


def press():
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def handler():
    """Python's own, before and after; under xdist, too."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_is_raised_between_steps():
    said = []

    def deed():
        interrupts.check()
        press()
        said.append("the step ends")
        interrupts.check()
        said.append("never")

    with pytest.raises(KeyboardInterrupt, match=r"^interrupted: nothing is kept\.$"):
        perform(deed)
    assert said == ["the step ends"]
    interrupts.check()  # it was raised once


def test_without_another_step_it_is_raised_at_the_end():
    with pytest.raises(KeyboardInterrupt, match="is finished"):
        perform(press)
    assert perform(lambda: "summary") == "summary"


def test_the_second_signal_does_what_it_does_without_a_job():
    said = []

    def deed():
        press()
        said.append("first")
        press()

    with pytest.raises(KeyboardInterrupt):
        perform(deed)
    assert said == ["first"]


def test_a_job_within_a_job_changes_nothing():
    with pytest.raises(KeyboardInterrupt):
        perform(lambda: (press(), interrupts.deferred().__enter__(), interrupts.check()))


def test_a_handler_of_the_users_stays():
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append("mine"))
    try:
        assert perform(lambda: press() or "done") == "done" and heard == ["mine"]
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_neither_set_nor_raise():
    found = []
    thread = threading.Thread(target=lambda: found.append(perform(lambda: "done")))
    thread.start()
    thread.join()

    def deed():
        press()
        other = threading.Thread(target=lambda: found.append(interrupts.check()))
        other.start()
        other.join()
        interrupts.check()

    with pytest.raises(KeyboardInterrupt):
        perform(deed)
    assert found == ["done", None]


def test_what_waits_for_a_process_is_interrupted_at_once():
    with pytest.raises(KeyboardInterrupt), interrupts.deferred(), interrupts.waiting():
        press()
        pytest.fail("went on")
    with pytest.raises(SystemExit, match="143"), interrupts.waiting():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_signal_while_a_compiled_function_returns(tmp_path):
    words = ("pack", "--n", "16", "--pressure", "1e-2", "--out", tmp_path / "p.h5", "--threads", "1")
    done = subprocess.run(
        [sys.executable, "-c", PRESSED, *map(str, words)],
        env=launch.environment(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (130, "jampetsc: error: interrupted: nothing is kept.\n")
    assert not list(tmp_path.iterdir())

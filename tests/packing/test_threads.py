"""Teams of threads: cores of their own, errors, their end, and the choice of how many take part."""

import os
import threading

import numpy as np
import pytest
from numba import types

from jampetsc.packing import threads
from jampetsc.packing.compiled import compiled
from jampetsc.packing.threads import PERIOD, TRIAL, Team, ThreadChoice, meet

_core = types.ExternalFunction("sched_getcpu", types.int32())


@compiled(False, cache=False, nogil=True)
def note_cores(me, size, counter, cores, steps):
    """Each thread writes its core into `cores`, once all are there."""
    for _ in range(steps):
        meet(counter, size)
    cores[me] = _core()
    return size, steps


@pytest.mark.skipif(not hasattr(threads.os, "sched_getaffinity"), reason="the system does not tell cores")
def test_threads_run_on_cores_of_their_own():
    apart = []
    for _ in range(5):
        team = Team(2)
        for _ in range(1 + TRIAL):
            cores = np.full(2, -1)
            if team.run(note_cores, 2, cores, 1000)[0] == 2:
                apart.append(cores[0] != cores[1])
    assert len(apart) >= 5
    # the system may move one at any time, but seldom does
    assert np.mean(apart) > 0.5 or threads.cores() == 1


def test_a_thread_keeps_its_allowed_cores():
    allowed, before = os.sched_getaffinity(0), os.listdir("/proc/self/task")
    team, others = Team(2), set(os.listdir("/proc/self/task")) - set(before)
    for _ in range(3):
        team.run(note_cores, 2, np.zeros(2, int), 10)
    assert len(others) == 1 and os.sched_getaffinity(int(others.pop())) == allowed


@compiled(False, cache=False, nogil=True)
def fails_elsewhere(me, size, counter):
    """Fails on all threads but the calling one."""
    if me:
        raise OSError("this one")
    return size, 1


def test_an_error_of_any_thread_is_raised_and_the_team_still_works():
    team = Team(3)
    for _ in range(2):  # one compiles, one is of one thread
        assert team.run(fails_elsewhere, 3) == (1, 1)
    for _ in range(2):
        with pytest.raises(OSError, match="this one"):
            team.run(fails_elsewhere, 3)
    assert team.run(note_cores, 3, np.zeros(3, int), 5) == (1, 5)


def test_the_threads_of_a_team_end_with_it():
    before = set(threading.enumerate())  # those of earlier teams may be about to end
    team = Team(4)
    new = set(threading.enumerate()) - before
    assert len(new) == 3 and all(thread.is_alive() for thread in new)
    del team
    for thread in new:
        thread.join(10.0)
    assert not any(thread.is_alive() for thread in new)


def chosen(choice, runs, pace):
    """Numbers of threads of successive runs, where n threads take pace(n) seconds per step."""
    numbers = []
    for _ in range(runs):
        numbers.append(choice.next_number())
        choice.note_pace(numbers[-1], pace(numbers[-1]))
    return numbers


@pytest.mark.parametrize("slower", [1, 2])
def test_the_faster_number_of_threads_is_chosen(slower):
    choice, faster = ThreadChoice(2), 3 - slower
    assert chosen(choice, 1 + TRIAL, lambda n: 1.5 if n == slower else 1.0) == [1] + [2] * TRIAL
    later = chosen(choice, 2 * PERIOD, lambda n: 1.5 if n == slower else 1.0)
    assert later.count(faster) >= 2 * (PERIOD - TRIAL) and later.count(slower) >= 1
    # what has changed is noticed
    changed = chosen(choice, 3 * PERIOD, lambda n: 1.5 if n == faster else 1.0)
    assert changed[-PERIOD:].count(slower) >= PERIOD - TRIAL


def test_slow_first_runs_do_not_decide_but_a_hopeless_trial_ends():
    cold = iter([2.5, 2.0, 1.5, 1.0])
    assert 1 not in chosen(ThreadChoice(2), PERIOD, lambda n: next(cold, 1.0) if n == 2 else 1.2)[1:]
    assert chosen(ThreadChoice(2), 2 * PERIOD, lambda n: 50.0 if n == 2 else 1.0).count(2) == 2

"""What ranks do as one: the failure of one is raised by all, what one finds out all know."""

import os
import socket

import pytest

from jampetsc import collective
from jampetsc.errors import ConvergenceError, InputError, JampetscError

NOTHING = None  # in the place of a communicator: one process


@pytest.mark.scalar("real")
@pytest.mark.parametrize("failing", ["first", "last", "every"])
def test_a_failure_on_one_rank_is_raised_on_all(session, failing):
    here = {"first": session.rank == 0, "last": session.rank == session.size - 1, "every": True}[failing]
    with pytest.raises(ConvergenceError) as caught:
        with collective.agreed(session.comm):
            if here:
                raise ConvergenceError(f"no minimum on rank {session.rank}")
    told = {"first": 0, "last": session.size - 1, "every": 0}[failing]
    assert str(caught.value) == f"no minimum on rank {told}"
    assert session.comm.allreduce(1) == session.size  # nobody is left waiting in the block


@pytest.mark.scalar("real")
def test_what_rank_0_finds_all_know(session):
    asked = []

    def look():
        asked.append(session.rank)
        return {"there": [session.rank, 1.5]}

    assert collective.on_root(session.comm, look) == {"there": [0, 1.5]}
    assert asked == [0] * (session.rank == 0)


@pytest.mark.scalar("real")
def test_what_rank_0_is_refused_all_are(session):
    def look():
        raise InputError(f"p.h5: no such file, says rank {session.rank}")

    with pytest.raises(InputError, match="says rank 0"):
        collective.on_root(session.comm, look)


@pytest.mark.scalar("real")
def test_what_is_not_foreseen_stays_with_its_rank(session):
    with pytest.raises(ZeroDivisionError):
        with collective.agreed(session.comm):
            raise ZeroDivisionError


def test_one_process_needs_no_communicator():
    assert collective.on_root(NOTHING, lambda: 5) == 5
    with pytest.raises(JampetscError, match="no"):
        with collective.agreed(NOTHING):
            raise JampetscError("no")


class Ranks:
    """What the ranks of two nodes say of themselves, as a communicator gathers it."""

    def __init__(self, others):
        self.others = others

    def allgather(self, mine):
        return [mine, *self.others]


@pytest.mark.parametrize(
    ("others", "count"),
    [
        ([], 4),
        ([("here", {0, 1, 2, 3})], 2),  # nobody is bound: half of them each
        ([("here", {2, 3})], 3),  # two cores alone, two shared by two
        ([("here", {4, 5, 6, 7})], 4),  # bound to others
        ([("there", {0, 1, 2, 3})] * 7, 4),  # another node has cores of its own
        ([("here", set())] * 3, 4),  # idle ones need none
        ([("here", {0, 1, 2, 3})] * 2, 1),  # 4/3
        ([("here", {0, 1, 2, 3})] * 7, 1),  # never none
    ],
)
def test_cores_are_shared_with_the_ranks_at_work_on_the_same_node(monkeypatch, others, count):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1, 2, 3}, raising=False)
    monkeypatch.setattr(socket, "gethostname", lambda: "here")
    assert collective.own_cores(Ranks(others)) == count


@pytest.mark.parametrize("ranks", range(1, 33))
def test_shares_of_a_core_make_whole_ones(monkeypatch, ranks):
    """Also where thirds and sevenths add up to a little less."""
    cores = set(range(3 * ranks))
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: cores, raising=False)
    assert collective.own_cores(Ranks([(socket.gethostname(), cores)] * (ranks - 1))) == 3


def test_an_idle_rank_asks_for_no_core_of_the_others(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    told = []

    class Telling(Ranks):
        def allgather(self, mine):
            told.append(mine)
            return super().allgather(mine)

    collective.own_cores(Telling([]), working=False)
    collective.own_cores(Telling([]), working=True)
    assert [cores for _, cores in told] == [set(), {0, 1}]

"""What ranks do as one: the failure of one is raised by all, what one finds out all know."""

import os
import socket

import pytest

from jampetsc import collective
from jampetsc.errors import ConvergenceError, InputError, JampetscError


@pytest.mark.scalar("real")
@pytest.mark.parametrize("failing", ["first", "last", "every"])
def test_a_failure_on_one_rank_is_raised_on_all(session, failing):
    here = {"first": session.rank == 0, "last": session.rank == session.size - 1, "every": True}[failing]
    with pytest.raises(ConvergenceError) as caught, collective.agreed(session.comm):
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

    def refuse():
        raise InputError(f"p.h5: no such file, says rank {session.rank}")

    assert collective.on_root(session.comm, look) == {"there": [0, 1.5]}
    assert asked == [0] * (session.rank == 0)
    with pytest.raises(InputError, match="says rank 0"):
        collective.on_root(session.comm, refuse)
    with pytest.raises(ZeroDivisionError), collective.agreed(session.comm):
        raise ZeroDivisionError("what is not foreseen stays with its rank")


@pytest.mark.scalar("real")
def test_one_process_needs_no_communicator():
    assert collective.on_root(None, lambda: 5) == 5
    with pytest.raises(JampetscError, match="no"), collective.agreed(None):
        raise JampetscError("no")


class Ranks:
    """What the ranks of two nodes say of themselves, as a communicator gathers it."""

    def __init__(self, others):
        self.others = others

    def allgather(self, mine):
        self.mine = mine
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
    affinity, ranks = {0, 1, 2, 3}, Ranks(others)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: affinity, raising=False)
    monkeypatch.setattr(socket, "gethostname", lambda: "here")
    assert collective.own_cores(ranks) == count
    assert ranks.mine == ("here", affinity)
    collective.own_cores(ranks, working=False)
    assert ranks.mine == ("here", set())  # an idle one asks for no core of the others
    for number in range(1, 33):  # thirds and sevenths that add up to a little less make a whole one
        affinity = set(range(3 * number))
        assert collective.own_cores(Ranks([("here", affinity)] * (number - 1))) == 3

"""What ranks do as one: the failure of one is raised by all, what one finds out all know."""

import os

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


@pytest.mark.parametrize(
    ("others", "count"),
    [
        ([], 4),
        ([{0, 1, 2, 3}], 2),  # nobody is bound: half of them each
        ([{2, 3}], 3),  # two cores alone, two shared by two
        ([{4, 5, 6, 7}], 4),  # bound to others
        ([set()] * 3, 4),  # idle ones need none
        ([{0, 1, 2, 3}] * 2, 1),  # 4/3
        ([{0, 1, 2, 3}] * 7, 1),  # never none
    ],
)
def test_cores_are_shared_with_the_ranks_at_work_on_the_same_node(others, count):
    own = {0, 1, 2, 3}
    assert collective.share_of_cores(own, [own, *others]) == count
    for number in range(1, 33):  # thirds and sevenths that add up to a little less make a whole one
        own = set(range(3 * number))
        assert collective.share_of_cores(own, [own] * number) == 3


@pytest.mark.scalar("real")
def test_ranks_share_the_cores_of_this_machine(session):
    """An idle one asks for none of those that the others have."""
    cores = os.sched_getaffinity(0)
    assert collective.own_cores(session.comm) == collective.share_of_cores(cores, [cores] * session.size)
    found = collective.own_cores(session.comm, working=session.rank == 0)
    assert session.rank or found == len(cores)

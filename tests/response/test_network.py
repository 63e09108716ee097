"""The distributed contact network: the same on any number of ranks, and refusals of what cannot bear load."""

from dataclasses import replace

import numpy as np
import pytest
from samples import SAMPLES, honeycomb, physics, published, reference, strips

from jampetsc.errors import InputError
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import Packing
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network, find_pieces

pytestmark = pytest.mark.scalar("real")


def rows_of(network):
    """(first, last) of every rank."""
    return network.comm.allgather((network.first, network.last))


def numbered(network):
    """Contacts of all ranks in particle numbers, sorted rows (i, j, r_x, r_y), each seen from both ends."""
    particles = np.concatenate(network.comm.allgather(network.particles))
    c = network.contacts
    local = np.column_stack((particles[c.i], particles[c.j], c.r))
    return np.array(sorted(np.concatenate(network.comm.allgather(local)).tolist()))


def without_weakest_contact(disks):
    """One of both disks is moved away from the other by their overlap."""
    contacts = measure(disks).contacts
    row = np.argmin(contacts.force)
    i, offset = contacts.i[row], disks.offset.copy()
    overlap = disks.radii[i] + disks.radii[contacts.j[row]] - contacts.distance[row]
    offset[i] -= 1.01 * overlap * contacts.normal[row]
    return disks.replace(offset=offset)


@pytest.mark.parametrize("name", SAMPLES)
def test_contacts_do_not_depend_on_the_ranks(session, name):
    disks, dense = SAMPLES[name](), reference(name, str(physics()))
    network = build_network(disks, session.comm)
    rows = rows_of(network)
    assert [0, *(last for _, last in rows)] == [*(first for first, _ in rows), dense.n]
    assert network.n == dense.n and network.rattlers == disks.n - dense.n
    assert network.contact_count == dense.contacts
    assert network.coordination == 2 * dense.contacts / dense.n
    assert network.pressure == pytest.approx(float(dense.pressure), rel=1e-13)
    number, r = np.array(dense.disks), dense.r.astype(float)
    ends = np.column_stack((number[dense.i], number[dense.j]))
    both = np.vstack((np.hstack((ends, r)), np.hstack((ends[:, ::-1], -r))))
    np.testing.assert_allclose(
        numbered(network), sorted(both.tolist()), rtol=0, atol=1e-15 * disks.cell.max()
    )

    c = network.contacts
    assert (np.diff(c.i) >= 0).all() and ((c.i >= network.first) & (c.i < network.last)).all()
    particles = np.concatenate(session.comm.allgather(network.particles))
    np.testing.assert_array_equal(network.radii, disks.radii[particles])


@pytest.mark.parametrize("name", SAMPLES)
def test_pieces_and_gears(session, name):
    dense = reference(name, str(physics()))
    network = build_network(SAMPLES[name](), session.comm)
    pieces = find_pieces(network)
    particles = np.concatenate(session.comm.allgather(network.particles))
    here = {
        (frozenset(particles[pieces.label == root].tolist()), bool(pieces.bipartite[root]))
        for root in pieces.roots
    }
    there = {
        (frozenset(dense.disks[disk] for disk, _ in piece), piece[0][1] != 0) for piece in dense.pieces()
    }
    assert here == there
    assert len(here) == (2 if name == "strips" else 1)
    assert any(bipartite for _, bipartite in here) == (name == "gears")


def with_dust():
    """The two strips, with 200 tiny disks in one place between them: a rank of three has rattlers only."""
    disks = strips()
    grid = np.argwhere(np.ones((10, 20))) * 0.01 + [3.4, 1.5]
    return Packing.from_positions(
        np.vstack((disks.positions, grid)), np.append(disks.radii, np.full(200, 0.004)), disks.cell
    )


def test_a_rank_may_own_rattlers_only(session):
    disks = with_dust()
    network = build_network(disks, session.comm)
    assert (network.n, network.rattlers) == (48, 201)
    assert network.comm.allreduce(network.last - network.first) == 48
    if session.size == 3:
        assert any(first == last for first, last in rows_of(network))
    pencil = assemble(network, physics().law)
    assert pencil.k_gg == pytest.approx(float(reference("strips", str(physics())).K[-1, -1]), rel=1e-13)
    assert len(pencil.pins) == 4


def test_too_few_contacts_are_below_jamming(session):
    """2n − 2 are enough for rigidity by Maxwell's count; of the last sample there is one more."""
    few = r"12 contacts between 8 particles leave at least 2 floppy modes: below jamming\. "
    with pytest.raises(InputError, match=few + "Raise the pressure, or finish the quench"):
        build_network(honeycomb(), session.comm)
    moved = honeycomb()  # as of a packing with friction: pressure adds no contacts to what does not balance
    moved = moved.replace(offset=moved.offset + 1e-3 * np.eye(8, 2))
    with pytest.raises(
        InputError, match=few + "Finish the quench, as forces are not balanced; .* friction, which is not"
    ):
        build_network(moved, session.comm)
    disks = published()
    loose = Packing.from_positions(disks.positions, 0.5 * disks.radii, disks.cell)
    with pytest.raises(InputError, match=r"no load-bearing contacts among 16 particles: below jamming"):
        build_network(loose, session.comm)
    least = without_weakest_contact(SAMPLES["isostatic"]())
    network = build_network(least, session.comm)
    assert network.contact_count == 2 * network.n - 2
    with pytest.raises(InputError, match=r"41 contacts .* leave at least 1 floppy modes: below jamming"):
        build_network(without_weakest_contact(least), session.comm)


def test_what_network_tells_of_all_ranks(session):
    network = build_network(published(), session.comm)
    assert network.max(np.array([0.5, session.rank])) == max(0.5, session.size - 1.0)
    assert network.max(np.arange(float(session.rank))) == max(0.0, session.size - 2.0)  # of none on rank 0
    assert network.sum(session.rank + 1) == session.size * (session.size + 1) // 2
    none = np.zeros(len(network.contacts), bool)
    assert replace(network, n=0, contacts=network.contacts[none]).coordination == 0.0

"""Particle i of what is made has the radius of line i of a list; orders of the computation stay inside."""

import numpy as np
import pytest

import jampetsc
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbour_list import is_scattered
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import Packing, proved_minimum

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]

RADII = np.random.default_rng(1).uniform(0.4, 0.6, 40)
PHI = {2: 0.88, 3: 0.7}


@pytest.mark.parametrize("dimension", [2, 3])
def test_line_i_is_particle_i_of_a_packing(session, shared_path, dimension):
    """Also where it starts from another, in memory and in a file; the proof is of the particles in this order."""
    if session.rank == 0:
        np.savetxt(shared_path / "r.txt", RADII, fmt="%.17g")
    first = jampetsc.pack(
        radii=shared_path / "r.txt", pressure=1e-2, dimension=dimension, out=shared_path / "p.h5"
    )
    lower = jampetsc.pack(from_=shared_path / "p.h5", pressure=1e-3)
    for disks in (first, lower, jampetsc.pack(radii=RADII, phi=PHI[dimension], dimension=dimension)):
        assert np.array_equal(disks.radii, RADII) and proved_minimum(disks)
        assert measure(disks).max_force == pytest.approx(disks.record["max_force"], abs=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_order_of_a_list_changes_nothing_else(session, dimension):
    """Radii all alike: the packing is that of their number, particle by particle in another order."""
    how = {"phi": PHI[dimension], "seed": 2, "dimension": dimension}
    listed, plain = (
        jampetsc.pack(radii=np.full(24, 0.5), **how),
        jampetsc.pack(n=24, sizes="monodisperse", **how),
    )
    order = np.random.Generator(np.random.PCG64(np.random.SeedSequence(2))).random((24, dimension))
    back = spatial_order(order, np.eye(dimension))
    assert np.array_equal(listed.positions[back], plain.positions)


FLOWS = [
    ("shear", {"step": 1e-3, "strain": 4e-3}),
    ("flow", {"model": "RD0", "rate": 0.1, "strain": 1.2}),
    ("flow", {"model": "CD0", "rate": 0.1, "strain": 0.1}),
]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("command", "how"), FLOWS)
def test_line_i_is_particle_i_under_shear(session, command, how, dimension):
    result = getattr(jampetsc, command)(radii=RADII, phi=PHI[dimension], dimension=dimension, **how)
    assert np.array_equal(result.last.radii, RADII)
    if dimension == 2 and how.get("model") == "RD0":
        walled = jampetsc.flow(radii=RADII, phi=0.8, walls=True, **how | {"strain": 0.05})
        assert np.array_equal(walled.last.radii[-len(RADII) :], RADII)


def test_particles_of_an_imported_packing_keep_their_places(session, shared_path):
    """Imported, quenched and sheared, in any order."""
    disks = jampetsc.pack(n=24, phi=0.9).reordered(np.random.default_rng(3).permutation(24))
    path = shared_path / "own.npz"
    if session.rank == 0:
        np.savez(path, positions=disks.positions, radii=disks.radii, box=disks.cell)
        write_packing(shared_path / "same.h5", disks)
    session.comm.Barrier()
    found = jampetsc.import_packing(path)
    assert np.array_equal(found.positions, disks.positions) and np.array_equal(found.radii, disks.radii)
    assert np.array_equal(read_packing(shared_path / "same.h5").base, disks.base)
    changed = jampetsc.pack(from_=found, phi=0.9)
    sheared = jampetsc.shear(found, step=1e-3, strain=2e-3).last
    for other in (changed, sheared):
        moves = (other.positions - disks.positions) @ np.linalg.inv(disks.cell)
        assert np.array_equal(other.radii, disks.radii)
        assert np.abs(moves - np.round(moves)).max() < 0.02


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_order_that_is_scattered_is_found(dimension):
    """Only where there are several domains to make of it."""
    rng = np.random.default_rng(1)
    for n, is_bad in ((4096, True), (4000, False)):
        side = n ** (1.0 / dimension)
        disks = Packing.from_positions(
            side * rng.random((n, dimension)), np.full(n, 0.1), side * np.eye(dimension)
        )
        assert is_scattered(disks) == is_bad
        assert not is_scattered(disks.reordered(spatial_order(disks.positions, disks.cell)))

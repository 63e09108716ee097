"""Pair search over periodic images, in two and three dimensions, against trying every pair and every image."""

from itertools import product

import numpy as np
import pytest

from jampetsc.packing.neighbours import neighbour_pairs, spatial_order

CELLS = {
    "square": [(9.0, 0.0), (0.0, 9.0)],
    "tilted": [(9.0, 0.0), (3.7, 8.0)],
    "tilted beyond its width": [(6.0, 0.0), (-14.3, 11.0)],
    "narrow": [(2.3, 0.0), (0.4, 30.0)],
    "flat": [(40.0, 0.0), (1.0, 2.3)],
    "cube": [(3.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 3.0)],
    "triclinic": [(3.0, 0.0, 0.0), (1.2, 4.0, 0.0), (-1.0, 1.7, 3.3)],
    "triclinic beyond its width": [(3.0, 0.0, 0.0), (-6.7, 3.5, 0.0), (4.0, 5.1, 4.0)],
}
IMAGES = {2: 12, 3: 6}  # to try in each direction
MAX_NUMBER = {2: 80, 3: 16}
MAX_SIZE = 100_000  # of an array of the search over all images


def every_pair(positions, radii, cell, skin, images):
    """{(i, j, image)} with i < j, from all images up to ±images."""
    found = set()
    between = positions[None] - positions[:, None]
    reach = (radii + radii[:, None] + skin) ** 2
    numbers = np.array(list(product(range(-images, images + 1), repeat=len(cell))))
    for some in np.array_split(numbers, 1 + numbers.size * reach.size // MAX_SIZE):
        near = ((between + (some @ cell)[:, None, None]) ** 2).sum(axis=-1) < reach
        found |= {(int(i), int(j), *some[a].tolist()) for a, i, j in np.argwhere(near) if i < j}
    return found


def as_set(pairs):
    i, j, image = pairs
    listed = [(int(a), int(b), *map(int, numbers)) for a, b, numbers in zip(i, j, image, strict=True)]
    assert len(set(listed)) == len(listed), "a pair appears twice"
    return set(listed)


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("skin", [0.0, 0.3, 1.5])
@pytest.mark.parametrize("n", [1, 2, 16, 80])
def test_finds_every_pair_of_every_image_once(name, n, skin):
    rng = np.random.default_rng(n)
    cell = np.array(CELLS[name])
    n = min(n, MAX_NUMBER[len(cell)])
    # up to one cell outside on every side: coordinates need not be wrapped
    positions = rng.uniform(-1.0, 2.0, (n, len(cell))) @ cell
    radii = rng.uniform(0.3, 0.8, n)
    wanted = every_pair(positions, radii, cell, skin, IMAGES[len(cell)])
    assert as_set(neighbour_pairs(positions, radii, cell, skin)) == wanted


@pytest.mark.parametrize("name", CELLS)
def test_a_disk_a_rounding_error_outside_is_in_the_cell_or_beside_it(name):
    """A coordinate of −1e-17 cell vectors is wrapped to 1 by rounding, where no cell of the grid begins."""
    cell = np.array(CELLS[name])
    rng, edge = np.random.default_rng(3), -1e-17
    positions = rng.uniform(0.0, 1.0, (30, len(cell))) @ cell
    positions[:5, :2] = [[edge, 0.0], [0.3, edge], [edge, edge], [edge, 0.5 * cell[1, 1]], [0.0, edge]]
    positions[:2, 2:] = edge
    radii = rng.uniform(0.3, 0.8, 30)
    wanted = every_pair(positions, radii, cell, 0.1, IMAGES[len(cell)])
    assert as_set(neighbour_pairs(positions, radii, cell, 0.1)) == wanted
    assert np.array_equal(np.sort(spatial_order(positions, cell)), np.arange(30))


@pytest.mark.parametrize("name", CELLS)
def test_ranges_of_rows_see_each_contact_from_both_ends(name, monkeypatch):
    """Also where ranges are longer than CHUNK, the number of disks searched at a time."""
    rng = np.random.default_rng(7)
    cell = np.array(CELLS[name])
    positions, radii = rng.uniform(0, 1, (40, len(cell))) @ cell, rng.uniform(0.4, 0.6, 40)
    once = as_set(neighbour_pairs(positions, radii, cell))
    both = once | {(j, i, *(-number for number in image)) for i, j, *image in once}
    ranges = [(0, 13), (13, 13), (13, 29), (29, 40)]
    parts = [as_set(neighbour_pairs(positions, radii, cell, rows=rows)) for rows in ranges]
    assert set.union(*parts) == both
    assert sum(map(len, parts)) == len(both)
    for (first, last), part in zip(ranges, parts, strict=True):
        assert all(first <= i < last for i, *_ in part)
    at_once = [neighbour_pairs(positions, radii, cell, 0.1, rows) for rows in (None, (3, 29))]
    monkeypatch.setattr("jampetsc.packing.neighbours.CHUNK", 7)
    for rows, wanted in zip((None, (3, 29)), at_once, strict=True):
        for part, whole in zip(neighbour_pairs(positions, radii, cell, 0.1, rows), wanted, strict=True):
            assert np.array_equal(part, whole)


@pytest.mark.parametrize("side", [2, 8])
@pytest.mark.parametrize(
    "cell", [[(1.0, 0.0), (0.3, 1.0)], [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (-0.2, 0.4, 1.0)]]
)
def test_spatial_order_goes_through_a_grid_step_by_step(cell, side):
    """A Hilbert curve: from every square or cube of a sheared cell to one beside it, whatever the images."""
    rng, cell = np.random.default_rng(1), np.array(cell)
    cubes = np.array(list(product(range(side), repeat=len(cell))))
    places = rng.permutation(cubes) + 0.5
    images = side * rng.integers(-2, 3, places.shape)
    steps = np.diff(places[spatial_order((places + images) @ cell, side * cell)], axis=0)
    assert (np.abs(steps).sum(axis=1) == 1.0).all()

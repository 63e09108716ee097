"""Cells in two and three dimensions: shortest vectors of the lattice, forms, packings and networks in them."""

import numpy as np
import pytest
from samples import Box, FlatBox
from spheres import few_spheres

import jampetsc
from jampetsc.errors import InputError
from jampetsc.packing.cell import reduced_basis
from jampetsc.packing.contacts import assigned_volumes, disk_stresses, force_threshold, imbalance, measure
from jampetsc.packing.geometry import geometry_of
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network, nearest_images


def lattice(dimension, tilt, rng):
    """Lower triangular rows with tilts of this size."""
    return np.diag(rng.uniform(1.0, 2.0, dimension)) + np.tril(
        rng.normal(scale=tilt, size=(dimension,) * 2), -1
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_reduced_basis_is_the_shortest_one(dimension):
    """Every vector of a basis is as short as the successive minima, found by trying all small numbers."""
    rng = np.random.default_rng(3)
    steps = np.stack(np.meshgrid(*[np.arange(-4, 5)] * dimension), -1).reshape(-1, dimension)
    steps = steps[steps.any(axis=1)]
    for tilt in (0.3, 1.0, 20.0, 1e6):
        cell = lattice(dimension, tilt, rng)
        vectors, numbers = reduced_basis(cell)
        np.testing.assert_allclose(
            vectors, numbers.astype(float) @ cell, atol=1e-15 * np.abs(numbers).max() * tilt
        )
        assert round(abs(np.linalg.det(vectors) / np.prod(np.diag(cell))), 9) == 1.0
        order = np.argsort(np.linalg.norm(steps @ vectors, axis=1), kind="stable")
        minima = np.zeros((0, dimension))
        for shortest in (steps[order] @ vectors)[:200]:
            if np.linalg.matrix_rank(np.vstack((minima, shortest)), tol=1e-9) > len(minima):
                minima = np.vstack((minima, shortest))
        lengths = np.linalg.norm(vectors, axis=1)
        np.testing.assert_allclose(lengths, np.linalg.norm(minima, axis=1), rtol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.8, 5.0])
def test_nearest_images_in_three_dimensions(tilt):
    rng = np.random.default_rng(4)
    cell = lattice(3, tilt, rng)
    positions = rng.normal(scale=2.0, size=(40, 3))
    bonds = rng.permutation(np.column_stack(np.triu_indices(40, 1)))[:60]
    found = nearest_images(positions, bonds, cell)
    vectors, _ = reduced_basis(cell)
    gap = positions[bonds[:, 1]] - positions[bonds[:, 0]]
    gap -= np.rint(gap @ np.linalg.inv(vectors)) @ vectors
    numbers = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), -1).reshape(-1, 3)
    shortest = np.linalg.norm(gap[:, None] + numbers @ vectors, axis=2).min(axis=1)
    gap = positions[bonds[:, 1]] - positions[bonds[:, 0]]
    np.testing.assert_allclose(np.linalg.norm(gap + found @ cell, axis=1), shortest, rtol=1e-12)


def test_networks_in_tiny_and_oblique_cells():
    """The search for the nearest image ends whatever the cell: squares of its sides may underflow."""
    places, bonds = np.array([(0.0, 0.0), (0.3, 0.1), (0.4, 0.9)]), [(0, 1), (1, 2)]
    expected = Network(places, bonds, (1.0, 1.2)).linear_bonds.distance
    for unit in (1e-150, 1e-100):
        tiny = Network(unit * places, bonds, (unit, 1.2 * unit))
        np.testing.assert_allclose(tiny.linear_bonds.distance, unit * expected, rtol=1e-12)
    oblique = Network(places, bonds, [(1.0, 0.0), (12345678.0, 1.2)])
    np.testing.assert_allclose(oblique.linear_bonds.distance, expected, rtol=1e-7)
    for cell, says in (
        ((1e-200, 1e-200), "has no volume in doubles"),
        ([(1.0, 0.0), (0.3, 1e-200)], "cell: too oblique for nearest images"),
        ([(2.0**28, 0.0), (0.1, 1e-20)], "cell: too oblique for nearest images"),
    ):
        with pytest.raises(InputError, match=says):
            Network(places, bonds, cell)
    with pytest.raises(InputError, match="a particle would touch its own image"):
        Packing.from_positions(places, np.full(3, 1e-9), np.array([(1.0, 0.0), (0.3, 1e-200)]))


def spheres(rng, n=12, side=4.0):
    return rng.uniform(0, side, (n, 3)), rng.uniform(0.4, 0.6, n)


def test_packings_of_spheres_in_the_forms_of_their_cell():
    rng = np.random.default_rng(5)
    x, radii = spheres(rng)
    cube = jampetsc.Packing(x, radii, 4.0)
    assert (cube.dimension, cube.volume, repr(cube)[:12]) == (3, 64.0, "<12 spheres,")
    assert cube.phi == pytest.approx(4 / 3 * np.pi * np.sum(radii**3) / 64.0)
    rows = np.array([(4.0, 0, 0), (0.5 * 5, 5.0, 0), (-0.25 * 6, 0.125 * 6, 6.0)])
    box = Box(4.0, 5.0, 6.0, xy=0.5, xz=-0.25, yz=0.125)
    tilted = [
        jampetsc.Packing(x, radii, cell).cell
        for cell in (rows, box, (4, 5, 6, 0.5 * 5, -0.25 * 6, 0.125 * 6))
    ]
    for cell in tilted:
        np.testing.assert_array_equal(cell, rows)
    np.testing.assert_array_equal(jampetsc.Packing(x, radii, (4, 5, 6)).cell, np.diag([4.0, 5.0, 6.0]))
    for positions, cell, says in (
        (x, (4.0, 5.0), "centres spread by .* in z, but the cell has two axes"),
        (x, np.eye(2), "centres spread by .* in z, but the cell has two axes"),
        (x[:, :2], rows, "the box is tilted out of the plane"),
        (x, rows.T, r"must be rows \(Lx, 0, 0\), \(xy, Ly, 0\) and"),
        (
            x,
            Box(4, 4, 4, periodic=(1, 1, 0)),
            "must be periodic in x, y and z",
        ),
        (x, 0.9, "a particle would touch its own image"),
    ):
        with pytest.raises(InputError, match=says):
            jampetsc.Packing(positions, radii, cell)


FLAT_CELLS = {  # of 12 disks with a third coordinate
    "L": 50.0,
    "two sides": (50, 50),
    "three sides": (50, 50, 7),
    "a depth below the diameter": (50, 50, 0.1),
    "rows in the plane": 50 * np.eye(2),
    "rows in space": np.diag([50.0, 50.0, 7.0]),
    "three sides and tilts": (50, 50, 7, 0, 0, 0),
    "a box with a depth": Box(50, 50, 7, periodic=(True, True, False)),
    "a box of two dimensions": Box(50, 50),
    "a flat box with a depth": FlatBox(50, 50),
}


@pytest.mark.parametrize("form", FLAT_CELLS)
@pytest.mark.parametrize("noise", [0.0, 1e-7])
def test_centres_with_the_same_z_are_disks_whatever_the_cell(form, noise):
    """To single precision of the box, also where z lies at both ends of its depth."""
    rng = np.random.default_rng(7)
    places, radii = 4.0 * np.column_stack(np.unravel_index(np.arange(12), (4, 3))), rng.uniform(0.4, 0.6, 12)
    cell = FLAT_CELLS[form]
    flat = np.column_stack((places, 50.0 * noise * rng.uniform(-1, 1, 12)))
    if form in ("three sides", "rows in space"):
        flat[:, 2] %= 7.0
    packing = jampetsc.Packing(flat, radii, cell)
    np.testing.assert_array_equal(packing.cell, np.diag([50.0, 50.0]))
    np.testing.assert_array_equal(packing.positions, places)
    bonds = [(0, 1), (1, 2)]
    network = Network(flat, bonds, cell, images=np.zeros((2, 3)))
    assert network.dimension == network.images.shape[1] == 2
    if form in ("L", "three sides", "rows in space", "three sides and tilts"):
        spheres = jampetsc.Packing(flat, radii, cell, dimension=3)
        assert spheres.dimension == Network(flat, bonds, cell, dimension=3).dimension == 3
        np.testing.assert_array_equal(spheres.positions, flat)


def test_z_that_differs_is_left_out_on_request_only():
    rng = np.random.default_rng(8)
    x, radii = spheres(rng, side=40.0)
    assert jampetsc.Packing(x, radii, 40.0).dimension == 3
    assert jampetsc.Packing(x, radii, (40, 40, 40), dimension=2).dimension == 2
    for box in (FlatBox(40, 40), Box(40, 40)):
        assert jampetsc.Packing(x, radii, box).dimension == 2
    for dimension, positions, says in (
        (4, x, "dimension 4: must be 2 or 3"),
        (3, x[:, :2], r"dimension 3: positions of shape \(12, 2\), must be \(N, 3\)"),
    ):
        with pytest.raises(InputError, match=says):
            jampetsc.Packing(positions, radii, 40.0, dimension=dimension)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_turned_cell_is_the_same_lattice(dimension):
    """Distances of nearest images, and the handedness, stay; −a₃ spans the lattice of a₃."""
    rng = np.random.default_rng(9)
    for _ in range(20):
        rows = rng.normal(size=(dimension, dimension)) + 3.0 * np.eye(dimension)
        x = rng.normal(size=(5, dimension))
        turned = geometry_of(x, rows, dimension, may_turn=True)
        assert (np.diag(turned.cell) > 0).all() and not np.triu(turned.cell, 1).any()
        np.testing.assert_allclose(abs(np.linalg.det(rows)), np.prod(np.diag(turned.cell)))
        rotation = np.linalg.lstsq(x, turned.positions, rcond=None)[0]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(dimension), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        numbers = rows @ rotation @ np.linalg.inv(turned.cell)
        np.testing.assert_allclose(numbers, np.rint(numbers), atol=1e-10)
        assert abs(np.linalg.det(numbers)) == pytest.approx(1.0)


def test_folding_keeps_all_bonds_of_spheres():
    rng = np.random.default_rng(6)
    x, radii = spheres(rng, n=30)
    rows = np.array([(4.0, 0, 0), (9.0, 5.0, 0), (-11.0, 7.0, 4.5)])
    packing = Packing.from_positions(x + 20.0, radii, rows).replace(images=np.arange(90).reshape(30, 3))
    folded = packing.folded()
    for one, other in zip(packing.stress.ravel(), folded.stress.ravel(), strict=True):
        assert one == pytest.approx(other, rel=1e-12)
    assert (np.abs(np.tril(folded.cell, -1)) <= 0.5 * np.diag(folded.cell) + 1e-12).all()
    np.testing.assert_allclose(folded.unwrapped, packing.unwrapped, rtol=1e-13)
    inside = np.linalg.solve(folded.cell.T, folded.positions.T)
    assert inside.min() >= -1e-12 and inside.max() < 1.0


def test_forces_are_measured_by_the_pressure_on_a_cross_section():
    """In another unit of length thresholds and imbalance belong to the same contacts and forces: p d² in three
    dimensions."""
    disks = few_spheres().replace(offset=few_spheres().offset + 1e-3 * np.eye(14, 3))
    state, unit = measure(disks), 3.0
    large = Packing.from_positions(unit * disks.positions, unit * disks.radii, unit * disks.cell)
    d = 2.0 * disks.radii.mean()
    assert force_threshold(disks, state.pressure) == pytest.approx(1e-6 * state.pressure * d**2, rel=1e-12)
    assert imbalance(disks, state) == pytest.approx(state.max_force / (state.pressure * d**2), rel=1e-12)
    assert imbalance(large, measure(large)) == pytest.approx(imbalance(disks, state), rel=1e-9)
    volumes, stresses = assigned_volumes(disks), disk_stresses(disks, disks.contacts())
    assert volumes.sum() == pytest.approx(disks.volume) and volumes[1] / volumes[0] == pytest.approx(1.2**3)
    np.testing.assert_allclose(
        np.einsum("i,iab->ab", volumes, stresses) / disks.volume, disks.stress, atol=1e-15
    )

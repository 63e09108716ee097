"""Networks as data: what is refused, nearest images, dilution, lattices, contacts of packings."""

import numpy as np
import pytest
from samples import SAMPLES, published
from springs import CELL, random_springs, shuffled

import jampetsc
from jampetsc.errors import InputError
from jampetsc.packing.contacts import measure
from jampetsc.packing.lattices import LATTICES, build_lattice
from jampetsc.packing.spring_network import Network, nearest_images

PLACES = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
BONDS = [(0, 1), (1, 2), (2, 3)]


def made(positions=PLACES, bonds=BONDS, cell=5.0, **more):
    return jampetsc.Network(positions, bonds, cell, **more)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {"bonds": [(0, 1), (2, 2)]},
            "bond 1, of nodes 2 and 2: joins a node to itself or to its image. Leave it out",
        ),
        (
            {"bonds": [(0, 1), (1, 2), (1, 0)]},
            "bond 2, of nodes 1 and 0: is bond 0 again. Give each bond once.",
        ),
        ({"bonds": [(0, 1), (0, 1)]}, "bond 1, of nodes 0 and 1: is bond 0 again"),
        (
            {"bonds": [(0, 4)]},
            "bond 0, of nodes 0 and 4: nodes are numbered from 0 to 3. Correct the number.",
        ),
        ({"bonds": [(0, 1), (-1, 2)]}, "bond 1, of nodes -1 and 2: nodes are numbered from 0 to 3"),
        ({"bonds": [(0, 0.5)]}, "bonds: must be whole numbers."),
        ({"bonds": [(0, np.nan)]}, "bonds[0, 1]: nan, must be finite."),
        ({"bonds": []}, "bonds: shape (0,), must be (M, 2) with at least one bond"),
        ({"bonds": [(0, 1, 2)]}, "bonds: shape (1, 3), must be (M, 2)"),
        ({"bonds": "ab"}, "bonds: must be an array of real numbers"),
        ({"positions": [(0, 0), (np.inf, 0), (1, 1), (0, 1)]}, "positions[1, 0]: inf, must be finite."),
        ({"positions": np.zeros((4, 4))}, "positions: shape (4, 4), must be (N, 2) or (N, 3)."),
        (
            {"positions": [(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)], "cell": (5.0, 4.0)},
            "centres spread by 1 in z, but the cell has two axes. Give a cell that is periodic along z for spheres",
        ),
        ({"positions": np.zeros(4)}, "positions: shape (4,), must be (N, 2) or (N, 3)."),
        ({"positions": 1e10 * np.array(PLACES)}, "positions: beyond 2^28 units of length"),
        (
            {"positions": [(0, 0), (0, 0), (1, 1), (0, 1)]},
            "bond 0, of nodes 0 and 1: has no length. Move one",
        ),
        ({"cell": (0.0, 1.0)}, "cell: [[0.0, 0.0], [0.0, 1.0]], must be rows"),
        ({"cell": [[1.0, 0.5], [0.0, 1.0]]}, "cell: [[1.0, 0.5], [0.0, 1.0]], must be rows"),
        ({"cell": [[1.0, 0.0], [0.0, np.nan]]}, "cell[1, 1]: nan, must be finite."),
        ({"stiffness": -1.0}, "stiffness[0]: -1, must be positive, from 1e-150 to 1e+150."),
        ({"stiffness": [1.0, 0.0, 1.0]}, "stiffness[1]: 0, must be positive"),
        ({"stiffness": [1.0, np.nan, 1.0]}, "stiffness[1]: nan, must be finite."),
        ({"stiffness": [1.0, 2.0]}, "stiffness: shape (2,), must be one number or (3,), one for each bond."),
        ({"tension": [0.0, np.inf, 0.0]}, "tension[1]: inf, must be finite."),
        ({"tension": 1j}, "tension: must be an array of real numbers"),
        ({"images": [(0, 0)]}, "images: shape (1, 2), must be (3, 2), one row for each bond."),
        ({"images": [(0, 0), (0.5, 0), (0, 0)]}, "images: must be whole numbers."),
        ({"radii": [1.0, 1.0]}, "radii: shape (2,), must be (4,), one for each node."),
        ({"radii": [1.0, 1.0, -1.0, 1.0]}, "radii[2]: -1, must be positive."),
        ({"k": 0.0}, "k[0]: 0, must be positive"),
        ({"k": [1.0, 2.0]}, "k: shape (2,), must be one number."),
        (
            {"cell": 2.0},
            "bond 0, of nodes 0 and 1: two images are equally near (1). Give images, or a larger cell.",
        ),
    ],
)
def test_what_is_refused_in_a_line(given, says):
    with pytest.raises(InputError) as refused:
        made(**given)
    assert str(refused.value).startswith(says.split("shape")[0]) and says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_values_of_all_bonds_or_of_each():
    network = made(stiffness=2.0, tension=[0.1, 0.0, -0.1])
    np.testing.assert_array_equal(network.stiffness, [2.0, 2.0, 2.0])
    bonds = network.linear_bonds
    np.testing.assert_allclose(bonds.force_per_length, [-0.1, 0.0, 0.1])
    assert network.isolated.sum() == 0 and made(bonds=BONDS[:2]).isolated.tolist() == [
        False,
        False,
        False,
        True,
    ]
    assert not network.is_stable_by_construction and made(tension=0.1).is_stable_by_construction
    pulling = made(tension=0.1)  # so its pressure is negative, its stress positive
    assert pulling.pressure == pytest.approx(-0.1 * bonds.distance.sum() / 50.0)
    assert np.trace(pulling.stress) == pytest.approx(-2.0 * pulling.pressure)
    assert repr(network) == "<network of 4 nodes and 3 bonds>"


def test_a_bond_may_join_two_nodes_through_two_images():
    network = made(bonds=[(0, 1), (1, 0)], images=[(0, 0), (1, 0)], cell=2.0)
    np.testing.assert_array_equal(network.linear_bonds.distance, [1.0, 1.0])


@pytest.mark.parametrize("tilt", [0.0, 0.4, -2.3, 7.7])
def test_the_nearest_image_in_any_cell(tilt):
    rng, cell = np.random.default_rng(2), np.array([(1.0, 0.0), (tilt, 1.7)])
    positions = rng.normal(scale=3.0, size=(40, 2))
    bonds = rng.permutation(np.column_stack(np.triu_indices(40, 1)))[:100]
    found = nearest_images(positions, bonds, cell)
    gap = positions[bonds[:, 1]] - positions[bonds[:, 0]]
    numbers = np.stack(np.meshgrid(np.arange(-80, 81), np.arange(-12, 13), indexing="ij"), -1).reshape(-1, 2)
    lengths = np.linalg.norm(gap[:, None] + numbers @ cell, axis=2)
    np.testing.assert_allclose(np.linalg.norm(gap + found @ cell, axis=1), lengths.min(axis=1), rtol=1e-12)


def test_dilution_keeps_a_share_and_is_nested():
    network = random_springs()
    count = len(network.bonds)
    half, most = network.diluted(0.5, 1), network.diluted(0.8, 1)
    assert (len(half.bonds), len(most.bonds)) == (round(0.5 * count), round(0.8 * count))
    rows = [{(*bond, *image) for bond, image in zip(one.bonds.tolist(), one.images.tolist(), strict=True)}
            for one in (half, most, network)]  # fmt: skip
    assert rows[0] < rows[1] < rows[2]
    assert network.diluted(0.5, 2).fingerprint != half.fingerprint == network.diluted(0.5, 1).fingerprint
    assert set(half.stiffness) < set(network.stiffness) and set(half.tension) < set(network.tension)


@pytest.mark.parametrize(("kind", "neighbours", "area"), [
    ("triangular", 6, np.sqrt(0.75)), ("square", 4, 1.0), ("kagome", 4, 2 * np.sqrt(0.75) * 2 / 3),
])  # fmt: skip
@pytest.mark.parametrize("size", [(2, 2), (5, 3), (4, 6)])
def test_lattices(kind, neighbours, area, size):
    network = build_lattice(kind, size)
    assert network.volume / network.n == pytest.approx(area)
    np.testing.assert_array_equal(np.bincount(network.bonds.ravel()), neighbours)
    np.testing.assert_allclose(network.linear_bonds.distance, 1.0, rtol=1e-14)
    assert abs(network.cell[1, 0]) <= network.cell[0, 0] / 2
    angles = np.degrees(np.arctan2(*network.linear_bonds.r.T[::-1])) % 180.0
    assert {*np.rint(angles).astype(int) % 180} == ({0, 90} if kind == "square" else {0, 60, 120})
    assert set(LATTICES) == {"triangular", "square", "kagome", "cubic", "fcc"}


@pytest.mark.parametrize(("kind", "neighbours", "volume"), [("cubic", 6, 1.0), ("fcc", 12, np.sqrt(0.5))])
def test_lattices_in_space(kind, neighbours, volume):
    network = build_lattice(kind, (2, 3, 4))
    assert network.volume / network.n == pytest.approx(volume)
    np.testing.assert_array_equal(np.bincount(network.bonds.ravel()), neighbours)
    np.testing.assert_allclose(network.linear_bonds.distance, 1.0, rtol=1e-14)
    assert network.record["protocol"] == f"{kind} lattice of 2 x 3 x 4 unit cells"


@pytest.mark.parametrize(
    ("make", "given", "says"),
    [
        *((random_springs().diluted, (keep, 1), "must lie in") for keep in (0.0, 1.1, np.nan, -1.0)),
        (build_lattice, ("hexagonal", (4, 4)), "lattice hexagonal: unknown. Choose one of triangular"),
        (build_lattice, ("square", (4, 5000)), "size 4,5000: must lie between 2 and 4096 unit cells"),
        (build_lattice, ("fcc", (4, 4)), "size 4,4: must be 3 numbers of unit cells of this lattice"),
    ],
)
def test_shares_and_lattices_that_are_refused(make, given, says):
    with pytest.raises(InputError, match=says):
        make(*given)


@pytest.mark.parametrize("name", ["published", "polydisperse", "two images"])
def test_contacts_of_a_packing(name):
    packing = SAMPLES[name]()
    network, contacts = Network.of_packing(packing), measure(packing).contacts
    assert network.n == packing.n and network.k == packing.potential.k
    bonds = network.linear_bonds
    for key in ("r", "distance", "stiffness", "force", "force_per_length"):
        np.testing.assert_allclose(getattr(bonds, key), getattr(contacts, key), rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(network.isolated, packing.rattlers)
    assert (network.imbalance < 1e-9) == (name != "two images")


def test_a_fingerprint_is_of_all_that_counts():
    network = random_springs()
    assert (
        network.fingerprint == random_springs().fingerprint == network.with_record(protocol="x").fingerprint
    )
    others = [network.replace(**{name: getattr(network, name) + 1}) for name in
              ("positions", "bonds", "images", "cell", "stiffness", "tension", "radii", "k")]  # fmt: skip
    prints = {one.fingerprint for one in [network, *others, network.replace(radii=None)]}
    assert len(prints) == 10
    other = shuffled(network)
    assert other.pressure == pytest.approx(network.pressure) and other.fingerprint != network.fingerprint


def test_a_packing_is_no_network_and_a_network_no_packing():
    with pytest.raises(InputError, match="must be a packing, a result or the name"):
        jampetsc.flow(random_springs(), model="RD0", rate=1e-2, strain=0.1)
    assert np.array_equal(random_springs().cell, CELL)
    with pytest.raises(InputError, match="lattice: missing, or given with a file"):
        jampetsc.springs(published(), lattice="square")

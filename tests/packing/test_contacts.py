"""Contacts, forces, rattlers and stress against loops over all pairs, finite differences and published values."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from dense import Reference
from samples import ORACLE, POTENTIALS, SAMPLES, physics, polydisperse, published

from jampetsc.errors import InputError
from jampetsc.packing.contacts import (
    assigned_volumes,
    bond_vectors,
    both_ends,
    disk_stresses,
    find_contacts,
    find_rattlers,
    force_threshold,
    imbalance,
    measure,
    net_forces,
)
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.packing.packing import Packing
from jampetsc.packing.particles import GRID, join, split
from jampetsc.packing.potentials import STIFFNESSES, Potential


def test_split_loses_nothing():
    rng = np.random.default_rng(0)
    high, low = rng.uniform(-1e5, 1e5, 1000), rng.uniform(-1e-12, 1e-12, 1000)
    base, offset = split(high, low)
    assert (np.abs(offset) <= GRID / 2).all() and (base / GRID == np.round(base / GRID)).all()
    back = join(base, offset)
    for exact, parts in zip(zip(high, low, strict=True), zip(*back, strict=True), strict=True):
        assert abs(sum(map(Fraction, exact)) - sum(map(Fraction, parts))) < 1e-23


def far_away(low):
    """Two pairs of disks at coordinates ~ 1e5, one across the boundary; `low` scales positions_low."""
    rng = np.random.default_rng(1)
    cell, cell_low = np.array([(1e5 / 3, 0.0), (77.7, 1e5 / 7)]), np.array([(3e-12, 0.0), (1e-13, -7e-13)])
    positions = np.array([(31000.1, 12000.3), (31000.9, 12000.7), (0.2, 0.1), (1e5 / 3 - 0.3, 0.6)])
    fine = rng.uniform(-1e-12, 1e-12, (4, 2))
    return Packing.from_positions(
        positions, np.full(4, 0.5), cell, positions_low=low * fine, cell_low=cell_low
    )


def test_bond_vectors_are_rounded_once_at_coordinates_of_1e5():
    disks = far_away(low=1.0)
    i, j = np.array([0, 2]), np.array([1, 3])
    image = np.array([(0, 0), (-1, 0)])
    r = bond_vectors(disks, i, j, image)
    plain = disks.positions[j] - disks.positions[i] + image @ disks.cell
    exact = np.vectorize(Fraction, otypes=[object])
    places, rows = exact(disks.base) + exact(disks.offset), exact(disks.cell_base) + exact(disks.cell_offset)
    assert np.abs(exact(r) - (places[j] - places[i] + image.astype(object) @ rows)).max() < 1.2e-16
    assert np.abs(plain - r).max() > 1e-13  # what one double per coordinate would give
    assert np.abs(bond_vectors(far_away(low=0.0), i, j, image) - r).max() > 1e-13  # positions_low does count


@pytest.mark.parametrize("exponent", [2.0, 2.25, 2.5, 3.0, 4.0, 10.0])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_the_energy_is_a_power_of_the_overlap(exponent, stiffness):
    sigma, overlap = np.array([0.9, 1.3]), np.array([0.02, 0.1])
    scale = sigma if stiffness == "inverse-square-diameter" else 1.0
    exact = 2.5 / exponent * (overlap / scale) ** exponent
    energy = Potential(None, stiffness, 2.5, exponent).energy(overlap, sigma)
    np.testing.assert_allclose(energy, exact, rtol=1e-13)


@pytest.mark.parametrize("potential", POTENTIALS, ids=repr)
def test_force_and_stiffness_are_derivatives_of_the_energy(potential):
    sigma, overlap, h = np.array([0.9, 1.3]), np.array([0.02, 0.1]), 1e-6

    def slope(f):  # d/dr = −d/dδ
        return -(f(overlap + h, sigma) - f(overlap - h, sigma)) / (2 * h)

    np.testing.assert_allclose(potential.force(overlap, sigma), -slope(potential.energy), rtol=1e-7)
    np.testing.assert_allclose(
        potential.contact_stiffness(overlap, sigma), -slope(potential.force), rtol=1e-7
    )


@pytest.mark.parametrize("name", SAMPLES)
def test_state_against_loops_over_all_images(name):
    disks = SAMPLES[name]()
    state, reference = measure(disks), Reference(disks, physics())
    assert list(np.flatnonzero(~state.rattlers)) == reference.disks
    number = np.array(reference.disks)
    here = sorted(zip(state.contacts.i, state.contacts.j, *state.contacts.r.T, strict=True))
    there = sorted(zip(number[reference.i], number[reference.j], *reference.r.T.astype(float), strict=True))
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-15 * disks.cell.max())
    assert disks.coordination == 2 * reference.contacts / reference.n
    assert state.energy == pytest.approx(float(reference.energy), rel=1e-12)
    assert disks.pressure == pytest.approx(float(reference.pressure), rel=1e-12)
    np.testing.assert_allclose(disks.stress, reference.stress.astype(float), rtol=0, atol=1e-13)
    assert -np.trace(disks.stress) / 2 == pytest.approx(disks.pressure, rel=1e-13)
    np.testing.assert_array_equal(np.flatnonzero(~disks.rattlers), reference.disks)
    bearing = disks.contacts()[state.bears(disks.contacts())]
    np.testing.assert_array_equal(bearing.r, state.contacts.r)
    areas, stresses = assigned_volumes(disks), disk_stresses(disks, disks.contacts())
    assert areas.sum() == pytest.approx(disks.volume, rel=1e-14)
    total = np.einsum("i,iab->ab", areas, stresses) / disks.volume
    np.testing.assert_allclose(total, disks.stress, rtol=1e-12, atol=1e-13 * disks.pressure)


def test_rattlers_are_removed_until_none_is_left():
    square = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]  # three contacts each: stay
    tail = [(3, 4), (3, 5), (4, 5), (4, 6), (5, 6), (6, 7)]  # removed from its end: 7, then 6, then 4 and 5
    assert list(np.flatnonzero(find_rattlers(9, *both_ends(*np.array(square + tail).T), 2))) == [
        4,
        5,
        6,
        7,
        8,
    ]
    assert find_rattlers(8, *both_ends(*np.array(tail).T), 2).all()
    assert find_rattlers(4, *both_ends(*np.array(square).T), 3).all()  # a sphere needs four
    assert not find_rattlers(4, *both_ends(*np.array(square).T), 2).any()


def test_a_contact_that_only_just_touches_does_not_count():
    disks = published()
    i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, skin=0.1)
    gap = np.hypot(*bond_vectors(disks, i, j, image).T) - disks.radii[i] - disks.radii[j]
    narrowest = np.argmin(np.where(gap > 0, gap, np.inf))
    radii = disks.radii.copy()
    radii[i[narrowest]] += gap[narrowest] + 5e-15
    touching = Packing.from_positions(disks.positions, radii, disks.cell)
    new = find_contacts(touching).overlap < 1e-14
    assert np.count_nonzero(new) == 1 and len(new) == 34
    assert (measure(touching).contacts.overlap > 1e-14).all()


def test_force_threshold():
    """A millionth of a typical force p d; at vanishing pressure the rounding of a force."""
    disks = polydisperse()[0]
    d = 2.0 * disks.radii.mean()
    stiff = disks.replace(potential=replace(disks.potential, k=7.0))
    least = 1e-14 / d**2  # stiffnesses are k/σ²
    for pressure, force, force_of_stiff in (
        (1e-3, 1e-9, 1e-9),
        (1e-9, least, 7 * least),
        (0.0, least, 7 * least),
    ):
        assert force_threshold(disks, pressure) == pytest.approx(force * d, rel=1e-12, abs=0.0)
        assert force_threshold(stiff, pressure) == pytest.approx(force_of_stiff * d, rel=1e-12, abs=0.0)


def test_imbalance_is_relative_to_pressure_and_diameter():
    disks, _ = polydisperse()
    moved = disks.replace(offset=disks.offset + np.eye(disks.n, 2, -5) * 1e-3)
    state = measure(moved)
    largest = np.hypot(*net_forces(moved.n, find_contacts(moved)).T).max()
    assert imbalance(moved, state) == pytest.approx(largest / (state.pressure * 2.0 * disks.radii.mean()))
    apart = disks.replace(radii=0.1 * disks.radii)
    assert imbalance(apart, measure(apart)) == np.inf


def square(n=4, side=4.0):
    """Arguments of `Packing.from_positions` for n disks in a row, in a square cell."""
    row = np.column_stack((np.arange(n), np.zeros(n)))
    return {"positions": row, "radii": np.full(n, 0.5), "cell": side * np.eye(2)}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"positions": np.zeros((4, 3))}, r"positions \(4, 3\), radii \(4,\), cell \(2, 2\): need"),
        ({"positions": np.zeros((3, 2))}, r"positions \(3, 2\), radii \(4,\)"),
        ({"cell": np.eye(3)}, r"cell \(3, 3\): need"),
        ({"radii": np.full((4, 1), 0.5)}, r"radii \(4, 1\)"),
        ({"positions": np.zeros((0, 2)), "radii": np.zeros(0)}, r"radii \(0,\)"),
        ({"positions_low": np.zeros((3, 2))}, r"positions_low \(3, 2\), cell_low \(2, 2\): shapes of"),
        ({"cell_low": np.zeros(2)}, r"positions_low \(4, 2\), cell_low \(2,\): shapes of"),
        ({"radii": np.array([0.5, 0.5, np.nan, 0.5])}, r"radii\[2\] = nan: must be finite"),
        ({"cell": np.array([[4.0, 0.0], [np.inf, 4.0]])}, r"cell\[1, 0\]: inf, must be finite"),
        ({"positions_low": np.full((4, 2), np.nan)}, r"positions_low\[0\] = .*must be finite"),
        ({"cell_low": np.full((2, 2), np.nan)}, r"cell_low\[0\] = .*must be finite"),
        ({"radii": np.array([0.5, 0.0, 0.5, 0.5])}, r"radii\[1\] = 0.0: must be positive"),
        ({"cell": np.array([[4.0, 0.1], [0.0, 4.0]])}, r"must be rows \(Lx, 0\) and"),
        ({"cell": np.diag([-4.0, 4.0])}, r"with Lx, Ly > 0"),
        ({"cell": np.diag([0.0, 4.0])}, r"with Lx, Ly > 0"),
        ({"cell": np.diag([4.0, 0.0])}, r"with Lx, Ly > 0"),
        (
            {"cell": np.diag([4.0, np.nextafter(1.0, 0)])},
            r"with a particle of diameter 1: a particle would touch",
        ),
        (
            {"cell": np.array([[0.9, 0.0], [1.2, 1.2]])},
            r"repeats at a distance of 0.9 with a particle of diameter 1",
        ),
        ({"cell": np.array([[8.0, 0.0], [4.01, 0.4]])}, r"a distance of 0.800"),  # a1 − 2 a2
        ({"cell": np.array([[4.0, 0.0], [-(2.0**29), 4.0]])}, r"cell: beyond 2\^28"),
        ({"positions": square()["positions"] + 2.0**29}, r"beyond 2\^28"),
        ({"cell": 2.0**40 * np.eye(2)}, r"beyond 2\^28"),
    ],
    ids=lambda value: value if isinstance(value, str) else next(iter(value)),
)
def test_invalid_packings_are_refused(change, says):
    assert Packing.from_positions(**square()).n == 4
    with pytest.raises(InputError, match=says):
        Packing.from_positions(**square() | change)


def test_limits_of_valid_packings():
    """A disk as wide as its cell meets its image in a point; coordinates up to 2²⁸ keep their digits."""
    assert Packing.from_positions(**square() | {"cell": np.diag([4.0, 1.0])}).period == 1.0
    for turns in (0, 1, -9, 1000):  # the same lattice
        cell = np.array([[1.0, 0.0], [0.5 + turns, 0.9]])
        assert Packing.from_positions(**square() | {"cell": cell}).period == pytest.approx(1.0, rel=1e-12)
    far = square() | {"cell": np.diag([2.0**28, 4.0])}
    far["positions"] = far["positions"] + [2.0**28 - 3, 0]
    assert Packing.from_positions(**far).positions[3, 0] == 2.0**28


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "WCA"}, "potential 'WCA': not supported. Choose one of harmonic, hertzian"),
        (
            {"stiffness": "soft"},
            "stiffness 'soft': not supported. Choose one of constant, inverse-square-diameter",
        ),
        ({"k": 0.0}, "stiffness k = 0.0: must be a positive number"),
        ({"k": np.inf}, "stiffness k = inf: must be a positive number"),
        ({"k": np.nan}, "stiffness k = nan: must be a positive number"),
        ({"k": 1e151}, r"stiffness k = 1e\+151: must be a positive number, from 1e-150 to 1e\+150"),
        ({"kind": ["harmonic"]}, r"potential \['harmonic'\]: not supported. Choose one of"),
        ({"stiffness": None}, "stiffness None: not supported. Choose one of"),
        ({"kind": "power"}, "exponent: missing. Give that of the potential power"),
        ({"exponent": 1.9}, "exponent 1.9: must be a number from 2 to 10"),
        ({"exponent": np.nan}, "exponent nan: must be a number from 2 to 10"),
        ({"exponent": "soft"}, "exponent soft: must be a number from 2 to 10"),
        (
            {"kind": "hertzian", "exponent": 2.25},
            r"exponent 2.25: of the potential power alone \(hertzian has 2.5\)",
        ),
    ],
)
def test_invalid_potentials_are_refused(change, says):
    with pytest.raises(InputError, match=says):
        Potential(**change)


@pytest.mark.parametrize("exponent, words", [(2, "harmonic"), (2.5, "hertzian"), (2.25, "power 2.25")])
def test_a_potential_has_one_name_and_one_record(exponent, words):
    potential = Potential(exponent=exponent, stiffness="inverse-square-diameter", k=2)
    assert str(potential) == words and Potential.of_record(potential.record) == potential
    assert Potential("power", exponent=exponent) == Potential(exponent=exponent)
    assert ("exponent" in potential.record) == (words == "power 2.25")
    assert potential.identity.endswith("inverse-square-diameter 0x1.0000000000000p+1")


def test_the_overlap_of_a_force():
    for exponent in (2.0, 2.25, 2.5, 4.0):
        for stiffness in STIFFNESSES:
            potential = Potential(None, stiffness, 3.0, exponent)
            overlap = potential.overlap_at(1e-4, 1.3)
            assert potential.force(overlap, 1.3) == pytest.approx(1e-4, rel=1e-12)


def test_disks_without_contacts_have_no_coordination_and_no_force():
    disks = Packing.from_positions(**square(side=9.0))
    for loose in (disks, disks.replace(radii=0.4 * disks.radii)):
        state = measure(loose)
        assert (state.coordination, state.max_force, len(state.contacts)) == (0.0, 0.0, 0)
        assert state.rattlers.all()


def test_forces_on_rattlers_are_no_imbalance():
    """A single contact: its force counts in p, its disks are rattlers and do not count in max_force."""
    disks = Packing.from_positions([[0.0, 0.0], [0.9, 0.0]], [0.5, 0.5], 4.0 * np.eye(2))
    state = measure(disks)
    assert state.pressure == pytest.approx(0.1 * 0.9 / 32.0) and state.max_force == 0.0
    assert len(find_contacts(disks)) == 1


def test_published_state_of_jambashbulk():
    disks, stated = published(), ORACLE["published"]
    state = measure(disks)
    assert disks.phi == pytest.approx(stated["phi"], abs=1e-14)
    assert (len(state.contacts), state.rattlers.sum()) == (stated["contacts"], stated["rattlers"])
    assert state.coordination == stated["Z"]
    assert state.energy == pytest.approx(stated["energy"], rel=1e-12)
    assert state.pressure == pytest.approx(stated["pressure"], rel=1e-12)
    assert state.max_force < 1e-14


@pytest.mark.parametrize("index", range(10))
def test_published_state_of_jaxmd(index):
    disks, record = polydisperse(index)
    state = measure(disks)
    assert state.energy == pytest.approx(record["Energy"], rel=1e-8)
    np.testing.assert_allclose(state.stress.ravel(), record["Stress"], rtol=1e-7, atol=1e-9)

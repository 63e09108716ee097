"""The pair list: complete until it is stale, whatever disks and cell do; near pairs, domains, skins, folding."""

from fractions import Fraction

import numpy as np
import pytest

from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import bond_vectors, find_contacts, measure
from jampetsc.packing.neighbour_list import (
    BORDER_GAP,
    REBUILD_COST,
    SKIN_COST,
    SKIN_RANGE,
    NeighbourList,
    borders,
    choose_inner_list,
    domain_order,
    inner_list_is_stale,
    is_stale,
    tuned_skin,
)
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.particles import GRID
from jampetsc.packing.strain import (
    UNSTRAINED,
    Strain,
    bond_vector,
    cell_strain,
    growth_and_shear,
    norms,
    simple_shear,
    strain_between,
)
from jampetsc.packing.threads import Team


def crowd(seed, n=60, phi=0.9, tilt=0.3):
    """Disks at random places in a tilted cell, a little longer than high."""
    rng = np.random.default_rng(seed)
    radii = radii_of("bidisperse", n) * rng.uniform(0.7, 1.3, n)
    height = np.sqrt(np.pi * np.sum(radii**2) / phi / 1.3)
    cell = np.array([[1.3 * height, 0.0], [tilt * height, height]])
    return Packing.from_positions(rng.random((n, 2)) @ cell, radii, cell)


def listed(pairs):
    return set(zip(pairs.i.tolist(), pairs.j.tolist(), strict=True))


def touching(disks):
    i, j, _ = neighbour_pairs(disks.positions, disks.radii, disks.cell)
    return set(zip(i.tolist(), j.tolist(), strict=True))


def far_off(n=40):
    """Disks with coordinates ~ 1e4 of a cell whose vectors, too, are finer than one double."""
    rng = np.random.default_rng(8)
    cell = np.array([[1e4 / 3, 0.0], [123.4, 1e4 / 7]])
    positions = np.array([0.1, 0.2]) + rng.uniform(-2.0, 2.0, (n, 2)) + rng.integers(-3, 4, (n, 2)) @ cell
    fine, cell_low = rng.uniform(-1e-13, 1e-13, (n, 2)), np.array([[3e-13, 0.0], [1e-13, -2e-13]])
    return Packing.from_positions(positions, np.full(n, 0.5), cell, positions_low=fine, cell_low=cell_low)


def test_bonds_of_a_list_are_rounded_once():
    disks = far_off()
    pairs = NeighbourList.build(disks, 0.3)
    i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, skin=0.3)
    assert len(i) > disks.n and np.abs(image).max() >= 3
    exact = bond_vectors(disks, i, j, image)
    assert np.array_equal(pairs.i, i) and np.array_equal(pairs.j, j) and (pairs.sigma == 1.0).all()
    assert np.abs(np.stack(pairs.r0, axis=1) - exact).max() < 5e-16


@pytest.mark.parametrize(("strain", "shear"), [(1e-9, -1e-10), (-0.1, 0.3), (0.0, 0.0), (0.0, 1e-12)])
def test_only_the_change_is_rounded(strain, shear):
    """x → F (x + o) and the rows of the cell likewise, in exact arithmetic; bases stay on their grid."""
    disks = far_off(12)
    o = np.random.default_rng(1).uniform(-0.1, 0.1, (12, 2))
    new = deformed(disks, o, growth_and_shear(strain, shear))
    growth, mixing = Fraction(np.expm1(strain)), Fraction(np.exp(strain) * shear)

    def exact(base, offset, more):
        x, y = (sum(map(Fraction, parts)) for parts in zip(base, offset, more, strict=True))
        return x + growth * x + mixing * y, y + growth * y

    for old, now, moves in (
        ((disks.base, disks.offset), (new.base, new.offset), o),
        ((disks.cell_base, disks.cell_offset), (new.cell_base, new.cell_offset), np.zeros((2, 2))),
    ):
        base, offset = now
        assert (base / GRID == np.round(base / GRID)).all() and np.abs(offset).max() <= GRID / 2
        for *row, found, fine in zip(*old, moves, base, offset, strict=True):
            for wanted, a, b, before in zip(exact(*row), found, fine, row[0], strict=True):
                change = abs(float(wanted) - before)
                assert abs(float(wanted - Fraction(a) - Fraction(b))) <= 1e-15 * change + 1e-23
    assert new.radii is disks.radii and new.potential is disks.potential and new.record is disks.record


@pytest.mark.parametrize("kind", ["moves", "strain", "shear", "all"])
def test_no_touching_pair_is_missing_until_the_list_is_stale(kind):
    """Random walks of disks, of the cell's size and of its shear, each until the list is stale, then one step more."""
    newcomers = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        disks, skin = crowd(seed), rng.uniform(0.05, 0.5)
        pairs, largest = NeighbourList.build(disks, skin), 2 * disks.radii.max()
        known, first = listed(pairs), touching(disks)
        offsets, strain, shear = np.zeros((disks.n, 2)), 0.0, 0.0
        drift = rng.normal(0, 0.02, (disks.n, 2))
        squeeze, turn = -0.03, rng.choice([-0.05, 0.05])
        while True:
            if kind in ("moves", "all"):
                offsets = offsets + drift + rng.normal(0, 0.01, offsets.shape)
            if kind in ("strain", "all"):
                strain += squeeze
            if kind in ("shear", "all"):
                shear += turn
            far = np.hypot(*offsets.T).max()
            moved = deformed(disks, offsets, growth_and_shear(strain, shear))
            if is_stale(far, growth_and_shear(strain, shear), largest, skin):
                break
            now = touching(moved)
            assert now <= known
            newcomers += len(now - first)
    assert newcomers > 50


@pytest.mark.parametrize("skin", [0.0, 0.3, 4.0])
def test_domains_list_each_pair_where_its_disks_are(skin):
    """Once within a domain, in both domains across a border; on any number of threads the same to the last bit."""
    disks = deformed(crowd(3, phi=0.6), np.zeros((60, 2)), simple_shear(0.7))
    borders = np.array([0, 11, 12, 40, 64])
    half, home = NeighbourList.build(disks, skin), np.searchsorted(borders, np.arange(60), "right")
    wanted = {}
    for i, j, x, y, sigma in zip(*(a.tolist() for a in (half.i, half.j, *half.r0, half.sigma)), strict=True):
        assert i < j and sigma == disks.radii[i] + disks.radii[j]
        wanted[i, j, x, y] = home[i] == home[j]
        if home[i] != home[j]:
            wanted[j, i, -x, -y] = False
    assert len(half.i) == len(neighbour_pairs(disks.positions, disks.radii, disks.cell, skin)[0])
    teams = Team(2), Team(3)  # the first run is one thread's
    found = [NeighbourList.build(disks, skin, borders, team) for team in teams for _ in range(3)]
    for one in found[1:]:
        last = one.end[-1]
        arrays = ((*lists[:-2], *lists.r0, lists.sigma) for lists in (found[0], one))
        assert all(np.array_equal(a[:last], b[:last]) for a, b in zip(*arrays, strict=True))
    by_domains = {}
    for d in range(4):
        for first, last, inside in ((one.begin[d], one.across[d], True), (one.across[d], one.end[d], False)):
            some = slice(first, last)
            assert (home[one.i[some]] == d + 1).all()
            by_domains |= dict.fromkeys(
                zip(*(a[some].tolist() for a in (one.i, one.j, *one.r0)), strict=True), inside
            )
    assert by_domains == wanted and len(by_domains) == one.end[-1]


@pytest.mark.parametrize("held", [0, 30, 2100])
def test_the_disks_at_the_border_of_a_domain_are_its_first(held):
    """The first `held` disks stay where they are; the rule is for the others."""
    disks, ends = crowd(4, n=6200, phi=0.8), borders(6200)
    order = domain_order(disks, held)
    assert np.array_equal(np.sort(order), np.arange(6200)) and np.array_equal(order[:held], np.arange(held))
    domains = NeighbourList.build(disks.reordered(order), BORDER_GAP * disks.radii.mean(), ends)
    assert domains.number == 3
    for first, last, *part in zip(ends, ends[1:], domains.across, domains.end, strict=False):
        across = np.unique(domains.i[slice(*part)])
        free = across[across >= held]
        assert len(free) or last <= held
        assert np.array_equal(free, np.arange(max(first, held), max(first, held) + len(free)))


@pytest.mark.parametrize("borders", [(0, 60), (0, 23, 60)], ids=["one domain", "two domains"])
def test_an_inner_list_serves_until_it_is_stale(borders):
    """Disks move on straight lines under shear: every touching pair is among the near ones until then."""
    newcomers = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        disks, skin = crowd(seed, phi=0.6), 0.1
        pairs, largest = NeighbourList.build(disks, 1.5), 2 * disks.radii.max()
        domains = NeighbourList.build(disks, 1.5, np.array(borders))
        near = domains.room()
        offsets, then, moved = rng.normal(0, 0.1, (disks.n, 2)), rng.choice([-0.4, 0.4]), 0.0
        assert inner_list_is_stale(1e300, simple_shear(then), UNSTRAINED, largest, skin)
        for d in range(domains.number):
            choose_inner_list(domains, d, offsets, simple_shear(then), skin, near)
        began = touching(deformed(disks, offsets, simple_shear(then)))
        turn, shear = rng.choice([-1e-3, 1e-3]), then
        known = {
            (min(i, j), max(i, j))
            for first, last in zip(near.begin, near.end, strict=True)
            for i, j in zip(near.i[first:last].tolist(), near.j[first:last].tolist(), strict=True)
        }
        for d in range(domains.number):
            inside = slice(near.begin[d], near.across[d])
            assert (near.j[inside] < borders[d + 1]).all() and (near.j[inside] >= borders[d]).all()
            outside = near.j[near.across[d] : near.end[d]]
            assert ((outside < borders[d]) | (outside >= borders[d + 1])).all()
        assert known < listed(pairs)
        angle, speed = rng.uniform(0, 2 * np.pi, disks.n), 2e-3
        while True:
            offsets = offsets + speed * np.column_stack((np.cos(angle), np.sin(angle)))
            shear, moved = shear + turn, moved + speed
            if inner_list_is_stale(moved, simple_shear(shear), simple_shear(then), largest, skin):
                break
            found = touching(deformed(disks, offsets, simple_shear(shear)))
            assert found <= known
            newcomers += len(found - began)
    assert newcomers > 30


def test_near_pairs_count_moves_and_shear_in_the_frame_they_were_chosen_in():
    sigma, skin, then, shear = 1.0, 0.2, 0.3, 0.35
    now, later = (np.array([[1.0, g], [0.0, 1.0]]) for g in (then, shear))
    growth = np.linalg.norm(now @ np.linalg.inv(later), 2)
    far = (skin - (growth - 1.0) * sigma) / 2 / np.linalg.norm(now, 2)
    for moved, worn in ((far * (1 - 1e-9), False), (far * (1 + 1e-9), True)):
        assert inner_list_is_stale(moved, simple_shear(shear), simple_shear(then), sigma, skin) == worn


def test_strains_of_three_axes():
    rng = np.random.default_rng(4)
    for size in (1e-9, 0.1, 0.5):
        strain, earlier = (Strain(*(size * rng.normal(size=9))) for _ in range(2))
        F, F0 = (np.eye(3) + np.reshape(one, (3, 3)) for one in (strain, earlier))
        singular = np.linalg.svd(F)[1]
        assert norms(strain) == pytest.approx((1.0 / singular[2], singular[0]), rel=1e-12)
        between = np.reshape(strain_between(strain, earlier), (3, 3))
        change = np.reshape(strain, (3, 3)) - np.reshape(earlier, (3, 3))
        np.testing.assert_allclose(between, change @ np.linalg.inv(F0), rtol=0, atol=1e-13 * size)
        r0, moved = rng.normal(size=(2, 3))
        np.testing.assert_allclose(bond_vector(strain, r0, moved), F @ (r0 + moved), rtol=1e-14)
    grown = cell_strain((0.3, 0.2, -0.4, 0.1))
    wanted = np.exp(0.3) * np.array([[1.0, 0.2, -0.4], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(np.reshape(grown, (3, 3)) + np.eye(3), wanted, rtol=1e-15)
    assert norms(grown)[0] == pytest.approx(1.0 / np.linalg.svd(wanted)[1][2], rel=1e-13)


@pytest.mark.parametrize("skin", [0.0, 0.4])
def test_lists_of_spheres_have_each_pair_once_in_domains(skin):
    """Few spheres, which touch several images, in a tilted cell; and many, in a grid of many cells."""
    rng = np.random.default_rng(5)
    for n, side in ((40, 3.4), (900, 9.0)):
        cell = side * np.array([[1.1, 0.0, 0.0], [0.7, 1.0, 0.0], [-0.9, 2.3, 0.8]])
        positions = (rng.random((n, 3)) + rng.integers(-2, 3, (n, 3))) @ cell
        disks = Packing.from_positions(positions, rng.uniform(0.4, 0.6, n), cell)
        pairs = NeighbourList.build(disks, skin)
        i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, skin)
        found, wanted = (
            sorted(zip(*(a.tolist() for a in (first, second, *np.round(r.T, 9))), strict=True))
            for first, second, r in (
                (pairs.i, pairs.j, np.stack(pairs.r0, axis=1)),
                (i, j, bond_vectors(disks, i, j, image)),
            )
        )
        assert found == wanted and len(found) > n
        domains = NeighbourList.build(disks, skin, np.array([0, 13, n])).trimmed()
        across = np.sum((pairs.i < 13) != (pairs.j < 13))
        assert len(domains.i) == len(pairs.i) + across


def test_the_worst_case_is_just_covered():
    """One pair that approaches as fast as the bound allows: it touches when the list becomes stale, not before."""
    skin, largest = 0.3, 1.0
    for strain, shear in [(0.0, 0.2), (0.0, -0.2), (-0.1, 0.0), (-0.05, 0.15)]:
        deform = np.exp(strain) * np.array([[1.0, shear], [0.0, 1.0]])
        outward, stretch, _ = np.linalg.svd(np.linalg.inv(deform))
        apart = stretch[0] * largest  # |r0| of a pair where it is squeezed most, touching at o = 0
        far = (largest + skin - apart) / 2
        assert far > 0
        assert not is_stale(far - 1e-9, growth_and_shear(strain, shear), largest, skin)
        assert is_stale(far + 1e-9, growth_and_shear(strain, shear), largest, skin)
        meets = deform @ outward[:, 0] * apart  # the bond after the deformation
        assert abs(np.hypot(*meets) - largest) < 1e-12
    # a cell that grows never makes a list stale
    assert not is_stale(0.0, growth_and_shear(0.5, 0.0), 1.4, 0.02)
    assert is_stale(0.0, growth_and_shear(-0.5, 0.0), 1.4, 0.02)


def test_skin_follows_how_long_lists_serve():
    assert tuned_skin(0.2, 10, 1.0) > 0.2 > tuned_skin(0.2, 1000, 1.0) >= tuned_skin(0.2, 5000, 1.0)
    assert tuned_skin(0.5, 10, 1.0) == SKIN_RANGE[1] and tuned_skin(0.02, 5000, 1.0) == SKIN_RANGE[0]
    for diameter in (1.0, 3.0):  # at most 1.5 times the last skin, at least half of it, within SKIN_RANGE
        for skin, steps, best in (
            (0.2, 1, 0.3),
            (0.2, 0, 0.3),
            (0.4, 1, 0.5),
            (0.2, 10**6, 0.1),
            (0.03, 10**6, 0.02),
        ):
            assert tuned_skin(diameter * skin, steps, diameter) == pytest.approx(diameter * best)
    # lists that serve v skin evaluations: the skin converges to that of the least cost
    for v in (100.0, 1000.0, 4000.0):
        skin = 0.3
        for _ in range(50):
            skin = tuned_skin(skin, v * skin, 1.0)
        skins = np.linspace(*SKIN_RANGE, 1000)
        cost = (REBUILD_COST + v * skins * (1 + SKIN_COST * skins)) / (v * skins)
        assert skin == pytest.approx(skins[np.argmin(cost)], abs=2e-3)


@pytest.mark.parametrize("tilt", [0.0, 0.49, -0.66, 1.3, -3.2])
def test_folding_leaves_every_bond(tilt):
    disks = crowd(3, n=200, tilt=tilt)
    far = Packing.from_positions(disks.positions + np.array([3, -2]) @ disks.cell, disks.radii, disks.cell)
    far = far.replace(images=np.random.default_rng(3).integers(-3, 4, (200, 2)))
    folded = far.folded()
    assert np.abs(folded.unwrapped - far.unwrapped).max() < 1e-12
    width, height = folded.cell[0, 0], folded.cell[1, 1]
    assert abs(folded.cell[1, 0]) <= width / 2
    inside = folded.positions @ np.linalg.inv(folded.cell)
    assert inside.min() >= -1e-12 and inside.max() <= 1 + 1e-12
    assert (width, height) == (disks.cell[0, 0], disks.cell[1, 1])
    before, after = find_contacts(far), find_contacts(folded)
    assert len(before) == len(after) > disks.n
    for name in ("r", "overlap"):
        rows = [np.sort(getattr(c, name).reshape(len(c), -1), axis=0) for c in (before, after)]
        assert np.abs(rows[0] - rows[1]).max() < 1e-14 * 50
    assert measure(folded).pressure == pytest.approx(measure(disks).pressure, rel=1e-12)

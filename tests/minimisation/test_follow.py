"""The compiled factor of a Hessian against dense numpy, and what following a minimum does where it cannot."""

from types import SimpleNamespace

import numpy as np
import pytest
import samples
from sheared import crowd

from jampetsc.minimisation import warm_start as compiled
from jampetsc.minimisation.hessian import Bonds, Pattern
from jampetsc.minimisation.ldl import blocks_of, diagonal_of, factorise, solve, space_blocks_of
from jampetsc.minimisation.minimise import settle
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.strain import UNSTRAINED, simple_shear

LIKE = (np.zeros(1),) * 2  # a tuple of the types of the loops, for which they are compiled already


@pytest.fixture(scope="module", params=[2.0, 2.25, 2.5])
def listed(request):
    """Disks in a cell so small that some touch through two images, their pairs, and any order of elimination."""
    disks = settle(crowd(n=40, phi=0.9, exponent=request.param), 1e-5)
    pairs = NeighbourList.build(disks, 0.3)
    return disks, pairs, np.random.default_rng(4).permutation(disks.n).astype(np.uint32)


def dense(pairs, n, blocks, shift):
    matrix = np.zeros((n, 2, n, 2))
    for a, b, block in zip(pairs.i, pairs.j, blocks, strict=True):
        for one, other in ((a, b), (b, a)):
            matrix[one, :, one] += block
            matrix[one, :, other] -= block
    return matrix.reshape(2 * n, 2 * n) + np.diag(np.repeat(shift, 2))


def test_the_factor_is_that_of_the_hessian(listed):
    disks, pairs, order = listed
    n, shift = disks.n, np.random.default_rng(1).uniform(0.1, 0.2, disks.n)
    offsets = np.random.default_rng(2).normal(0, 0.01, (n, 2))
    bonds = Bonds.of(pairs, disks.potential, offsets, simple_shear(0.02))
    exact, *_ = bonds.squares()
    blocks, chosen = compiled.springs(pairs, offsets, simple_shear(0.02), disks.potential.constants, 0.0, 1.0)
    assert np.abs(blocks - exact).max() < 1e-14 and np.array_equal(chosen, bonds.overlap > 0)
    matter = pairs.i, pairs.j, blocks, chosen
    definite, factor = factorise(order, *matter, diagonal_of(*matter, shift))
    matrix = dense(pairs, n, exact, shift)
    assert definite and np.linalg.eigvalsh(matrix)[0] > 0
    b = np.random.default_rng(3).normal(size=(n, 2))
    x = np.empty_like(b)
    solve(factor, b, x, np.empty_like(b))
    assert np.abs(matrix @ x.ravel() - b.ravel()).max() < 1e-12
    number, modulus, alike = compiled.contacts_at(pairs, offsets, 0.02, disks.potential.constants)
    assert alike < 0.1
    assert number == np.count_nonzero(bonds.overlap > 0)
    assert modulus == pytest.approx(np.sum(bonds.stiffness * (bonds.normal[0] * bonds.r[1]) ** 2))


def test_the_blocks_of_a_matrix_are_those_it_was_filled_with(listed):
    """Also where disks are left out, and where two touch through two images: the solution is that of dense numpy."""
    disks, pairs, order = listed
    free = np.ones(disks.n, bool)
    free[[3, 17]] = False
    bonds, pattern = Bonds.of(pairs, disks.potential), Pattern(pairs, disks.n)
    for shift, positive in ((0.1, True), (-1.0, False)):
        matter = blocks_of(pattern.indptr, pattern.indices, pattern.fill(bonds, free, shift))
        definite, factor = factorise(order, *matter)
        assert definite == positive == (len(factor[0]) > 0)
        exact, *_ = bonds.squares()
        matrix = dense(pairs, disks.n, exact, np.full(disks.n, shift))
        held = np.repeat(~free, 2)
        matrix[held] = matrix[:, held] = 0.0
        matrix[held, held] = 1.0
        assert (np.linalg.eigvalsh(matrix)[0] > 0) == positive
        if definite:
            b, x = np.random.default_rng(3).normal(size=(disks.n, 2)), np.empty((disks.n, 2))
            solve(factor, b, x, np.empty_like(b))
            assert np.abs(matrix @ x.ravel() - b.ravel()).max() < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_blocks_that_couple_unlike_unknowns(d):
    """A_ij need not be symmetric, as where moves and spins are coupled."""
    rng, n = np.random.default_rng(5), 12
    ends = np.array([(a, b) for a in range(n) for b in range(a + 1, n) if rng.uniform() < 0.3], np.uint32)
    pairs = SimpleNamespace(i=ends[:, 0].copy(), j=ends[:, 1].copy())
    pattern = Pattern(pairs, n, d)
    values = rng.normal(size=pattern.indptr[-1])
    values[pattern.diagonal] += 20.0
    matrix = np.zeros((n * d, n * d))
    for row in range(n * d):
        part = slice(pattern.indptr[row], pattern.indptr[row + 1])
        matrix[row, pattern.indices[part]] = matrix[pattern.indices[part], row] = values[part]
    blocks = (blocks_of if d == 2 else space_blocks_of)(pattern.indptr, pattern.indices, values)
    definite, factor = factorise(rng.permutation(n).astype(np.uint32), *blocks)
    b, x = rng.normal(size=(n, d)), np.empty((n, d))
    solve(factor, b, x, np.empty_like(b))
    assert definite and np.abs(matrix @ x.ravel() - b.ravel()).max() < 1e-12


def test_a_saddle_is_told_from_a_minimum_and_a_symmetry_from_disorder():
    """A square lattice has negative modes with pre-stress, a triangular one has none; of both contacts are alike."""
    for sample, expected in ((samples.lattice(), False), (samples.crystal(), True)):
        pairs, still = NeighbourList.build(sample, 0.3), np.zeros((sample.n, 2))
        order, law = np.arange(sample.n, dtype=np.uint32), sample.potential.constants
        assert compiled.is_minimum(order, pairs, still, 0.0, law, 1.0, 1e-9) == expected
        assert compiled.contacts_at(pairs, still, 0.0, law)[2] > 0.8
    loose = pairs._replace(r0=tuple(2.0 * component for component in pairs.r0))
    assert compiled.contacts_at(loose, still, 0.0, law) == (0, 0.0, 0.0)
    assert compiled.is_minimum(order, loose, still, 0.0, law, 1.0, 1e-9)


def test_pairs_that_are_nearly_closed_are_half_as_stiff(listed):
    disks, pairs, _ = listed
    law, still = disks.potential.constants, np.zeros((disks.n, 2))
    blocks, chosen = compiled.springs(pairs, still, UNSTRAINED, law, 0.1, 0.0)
    overlap = Bonds.of(pairs, disks.potential, still).overlap
    near = (overlap > -0.1) & (overlap <= 0)
    assert near.sum() > 3 and np.array_equal(chosen, overlap > -0.1)
    stiffness = disks.potential.contact_stiffness(np.full(near.sum(), 0.1), pairs.sigma[near])
    assert np.trace(blocks[near], axis1=1, axis2=2) == pytest.approx(0.5 * stiffness)


def followed(listed, skin=2.0, **changes):
    """Status of `follow` from the disks as they are; changes: entries of its aim."""
    disks, _, order = listed
    pairs = NeighbourList.build(disks, 2.0)
    law, still = disks.potential.constants, np.zeros((disks.n, 2))
    aim = {"share": 1e-8, "floor": 0.0, "apart": 1e-12, "diameter": 1.2, "reach": 0.1}
    aim |= {"soft": 0.5, "most": 2000}
    aim |= changes
    factor = compiled.factor_of(order, pairs, still, 0.0, law, 1e-3, 1e-4, 0.5)
    memory, forces = compiled.nothing_remembered(still.shape), np.empty_like(still)
    listed_so = 2.0 * float(disks.radii.max()), skin, disks.volume, 0.0
    status, evaluations, sums = compiled.follow(
        pairs, law, (*listed_so, *aim.values()), factor, memory, still, np.zeros_like(still), forces
    )
    return status, evaluations, np.hypot(*forces.T).max(), 0.5 * (sums[1] + sums[3]) / disks.volume


def test_where_following_ends(listed):
    status, evaluations, force, pressure = followed(listed)
    assert status == compiled.CONVERGED and force <= 1e-8 * pressure * 1.2 and evaluations < 500
    assert followed(listed, most=3)[:2] == (compiled.SPENT, 3)
    assert followed(listed, apart=1.0)[:2] == (compiled.SEPARATED, 1)
    status, few, force, _ = followed(listed, floor=1e-7)
    assert status == compiled.CONVERGED and few < evaluations and force <= 1e-7
    assert followed(listed, skin=1e-6)[0] == compiled.STALE


def test_displacements_are_told_without_their_drift():
    moved = np.random.default_rng(1).normal(size=(40, 2)) + np.array([3.0, -2.0])
    rest = moved - moved.mean(axis=0)
    size, longest = compiled.without_drift(moved, LIKE)
    np.testing.assert_allclose(moved, rest, atol=1e-14)
    assert size == pytest.approx(np.sqrt(np.mean(np.sum(rest**2, axis=1)))) and longest == np.abs(moved).max()


@pytest.mark.parametrize(
    ("block", "shift", "definite"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], 0.1, False),  # a positive diagonal and a negative determinant
        ([[1.0, 2.0], [2.0, 1.0]], 2.1, True),
        ([[-1.0, 0.0], [0.0, -1.0]], 0.1, False),  # a positive determinant of two negative ones
        ([[1.0, 1.0], [1.0, 1.0]], 0.0, False),
    ],
)
def test_both_minors_of_a_pivot_count(block, shift, definite):
    one, two = np.array([0], np.uint32), np.array([1], np.uint32)
    order = np.array([0, 1], np.uint32)
    matter = one, two, np.array([block]), np.ones(1, bool)
    found = factorise(order, *matter, diagonal_of(*matter, np.full(2, shift)))
    assert found[0] == definite


def test_loose_disks_are_held_and_what_is_indefinite_is_taken_without_stress(listed):
    disks, pairs, order = listed
    law, still, n = disks.potential.constants, np.zeros((disks.n, 2)), disks.n
    for damping, nearby, crushed in ((0.05, 1e-3, 1.03), (1e-6, 1e-3, 0.62)):
        # crushed, forces are so large that K is indefinite
        close = tuple(crushed * component for component in pairs.r0)
        arrays = pairs._replace(r0=close)
        factor = compiled.factor_of(order, arrays, still, 0.0, law, nearby, damping, 0.7)
        held = np.zeros(n, int)
        chosen = np.hypot(*close) < pairs.sigma + nearby
        np.add.at(held, np.concatenate((pairs.i[chosen], pairs.j[chosen])), 1)
        shift = damping + np.where(held < 3, 0.7, 0.0)
        matrices = [
            dense(pairs, n, compiled.springs(arrays, still, UNSTRAINED, law, nearby, stress)[0], shift)
            for stress in (1.0, 0.0)
        ]
        definite = np.linalg.eigvalsh(matrices[0])[0] > 0
        assert definite == (held < 3).any() == (crushed > 1.0)
        b, x = np.random.default_rng(3).normal(size=(n, 2)), np.empty((n, 2))
        solve(factor, b, x, np.empty_like(b))
        wanted = np.linalg.solve(matrices[0 if definite else 1], b.ravel())
        np.testing.assert_allclose(x.ravel(), wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("where", [0, 39])
def test_what_is_no_number_is_lost_and_no_minimum(listed, where):
    """Comparisons with NaN are all false, of every force and of every pivot: neither may count as small or positive."""
    disks, pairs, order = listed
    law, still, forces = disks.potential.constants, np.zeros((disks.n, 2)), np.empty((disks.n, 2))
    pair = np.flatnonzero(pairs.i == where)[0] if where == 0 else np.flatnonzero(pairs.j == where)[-1]
    for height, status in ((1.0, compiled.LOST), (0.9, compiled.CONVERGED)):
        offsets, moved = still.copy(), still.copy()  # of disks on the same spot the force is no number
        offsets[pairs.j[pair]] = [-height * component[pair] for component in pairs.r0]
        scalars = (1.4, 3.0, disks.volume, 0.0, 0.0, 1e300, -1.0, 1.2, 0.1, 0.5, 40)
        memory = compiled.nothing_remembered(still.shape)
        found = compiled.follow(pairs, law, scalars, compiled.NO_FACTOR[2], memory, offsets, moved, forces)
        assert found[0] == status and np.isnan(forces[where]).all() == (status == compiled.LOST)
    blocks, chosen = compiled.springs(pairs, still, UNSTRAINED, law, 0.0, 1.0)
    shift = np.full(disks.n, 0.1)
    matter = pairs.i, pairs.j, blocks, chosen
    assert factorise(order, *matter, diagonal_of(*matter, shift))[0]
    shift[where] = np.nan
    assert not factorise(order, *matter, diagonal_of(*matter, shift))[0]

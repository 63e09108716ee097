"""Follows a minimum that moves a little: L-BFGS preconditioned by a factor of the Hessian some steps old, compiled.

While contacts stay, the response is linear and one solve with the factor leads to the minimum; the pairs (s, y) of
L-BFGS account for the few contacts that open or close (Nocedal & Wright, Numerical Optimization, alg. 7.4, with H₀ the
inverse of the factor). For disks in a cell of fixed shape; moves are in the laboratory frame.
"""

import numpy as np

from jampetsc.minimisation.lbfgs_kernels import dot
from jampetsc.minimisation.ldl import diagonal_of, factorise, solve, space_diagonal_of
from jampetsc.packing.bond import (
    add_to_row,
    added,
    bond_vector,
    difference,
    displace,
    entry,
    inner,
    row,
    scaled,
    secant,
    simple_shear,
    strain_between,
    tangent_ratio,
)
from jampetsc.packing.compiled import FAST, NUMBERS, compiled, nested
from jampetsc.packing.contacts import LOAD_RATIO
from jampetsc.packing.kernel import bond_forces, elastic_trace
from jampetsc.packing.neighbour_list import is_stale
from jampetsc.packing.strain import UNSTRAINED

MEMORY = 8  # pairs (s, y)
OVERSHOT = 0.5  # a step is too long if the slope at its end is against it by more than this part of that at its start
MAX_STEP_HALVINGS = 8  # of a step that goes too far
MIN_CURVATURE = 1e-9  # of the stiffness of a contact: curvature that counts as none, as that of translations
CELLS = 20  # for each contact, of overlaps up to twice their mean: two in one cell are alike
CONVERGED, STALE, SPENT, SEPARATED, LOST = range(5)


NO_FACTOR = {  # by dimension
    2: (np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty((0, 4))),
    3: (np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty((0, 3, 3))),
}


def nothing_remembered(shape):
    """An empty memory for moves of a shape (N, D).

    (s and y (2, MEMORY, DN), s · y (MEMORY,), [number of pairs, next place], work (4, DN)).
    """
    size = shape[0] * shape[1]
    return np.zeros((2, MEMORY, size)), np.zeros(MEMORY), np.zeros(2, np.int64), np.zeros((4, size))


@nested(FAST, forceinline=True)
def _set_block(block, k, f, n):
    """block ← k n nᵀ − f (1 − n nᵀ) in three dimensions."""
    for x in range(3):
        for y in range(3):
            block[x, y] = (k + f) * n[x] * n[y]
        block[x, x] -= f


@compiled(FAST, forceinline=True)
def springs(pairs, o, strain, potential, nearby, stress):
    """(blocks k n nᵀ − (f/r) (1 − n nᵀ), (M, D, D), of the pairs at offsets o and `strain`, mask of those that count).

    A pair with a gap below `nearby` counts with half the stiffness that it has at an overlap of `nearby`, so that a
    move that closes it has a cost. With stress = 0 the blocks are without f.
    """
    return _springs(pairs.i, pairs.j, pairs.r0, pairs.sigma, o, strain, potential, nearby, stress)


@nested(FAST, forceinline=True)
def _springs(i, j, r0, sigma, o, strain, potential, nearby, stress):
    """`springs`, of the arrays of the pairs."""
    blocks, chosen = np.zeros((len(i), len(r0), len(r0))), np.zeros(len(i), np.bool_)
    for p in range(len(i)):
        a, b = i[p], j[p]
        if len(r0) == 3:
            bond = bond_vector(strain, entry(r0, p), difference(o, a, b, r0))
        else:
            bond = bond_vector(strain, (r0[0][p], r0[1][p]), (o[b, 0] - o[a, 0], o[b, 1] - o[a, 1]))
        r = np.sqrt(inner(bond, bond))
        d = sigma[p] - r
        if d <= -nearby:
            continue
        chosen[p] = True
        f = stress * secant(max(d, 0.0), sigma[p], potential) * max(d, 0.0) / r
        depth = d if d > 0.0 else nearby
        k = tangent_ratio(depth, sigma[p], potential) * secant(depth, sigma[p], potential)
        if d <= 0.0:
            k *= 0.5
        if len(r0) == 3:
            _set_block(blocks[p], k, f, (bond[0] / r, bond[1] / r, bond[2] / r))
        else:
            x, y = bond[0] / r, bond[1] / r
            blocks[p, 0, 0] = k * x * x - f * y * y
            blocks[p, 0, 1] = blocks[p, 1, 0] = (k + f) * x * y
            blocks[p, 1, 1] = k * y * y - f * x * x
    return blocks, chosen


@nested(False)
def held_by(pairs, chosen, n):
    """How many chosen pairs each of N disks has, (N,)."""
    number = np.zeros(n, np.int64)
    for p in range(len(chosen)):
        if chosen[p]:
            number[pairs.i[p]] += 1
            number[pairs.j[p]] += 1
    return number


@nested(NUMBERS, forceinline=True)
def diagonal_blocks(like, i, j, blocks, chosen, shift):
    """Diagonal blocks for `factorise`; like: a tuple of length D."""
    if len(like) == 3:
        return space_diagonal_of(i, j, blocks, chosen, shift)
    return diagonal_of(i, j, blocks, chosen, shift)


@compiled(False)
def _factorised(order, pairs, o, g, potential, nearby, stress, damping, stiffness):
    """(definite, factor) of the Hessian with `damping` on its diagonal, and `stiffness` for what few contacts hold."""
    n, axes = o.shape
    shift = np.empty(n)
    blocks, chosen = springs(pairs, o, simple_shear(g), potential, nearby, stress)
    number = held_by(pairs, chosen, n)
    for k in range(n):
        shift[k] = damping + (stiffness if number[k] < axes + 1 else 0.0)
    diagonal = diagonal_blocks(pairs.r0, pairs.i, pairs.j, blocks, chosen, shift)
    return factorise(order, pairs.i, pairs.j, blocks, chosen, diagonal)


# The next three are not compiled: their copies of `_factorised` would round in their own way, see `packing.compiled`.
def factor_of(order, pairs, o, g, potential, nearby, damping, stiffness):
    """A factor of the Hessian with `damping` on its diagonal; without pre-stress if it is not definite with it.

    A disk with fewer than D + 1 contacts also gets this `stiffness` on its diagonal: otherwise it would move far when
    another one touches it.
    """
    definite, factor = _factorised(order, pairs, o, g, potential, nearby, 1.0, damping, stiffness)
    if not definite:
        factor = _factorised(order, pairs, o, g, potential, nearby, 0.0, damping, stiffness)[1]
    return factor


def is_minimum(order, pairs, o, g, potential, stiffness, force):
    """Whether the Hessian of the contacts has no eigenvalue below −MIN_CURVATURE · stiffness; rattlers have none.

    A disk with fewer than D + 1 contacts may have curvatures down to that of contacts with a few times this `force`,
    which may be left on it. One that others press between them has lower ones.
    """
    slack = LOAD_RATIO * force / pairs.sigma.min(initial=np.inf)
    return factor_of_hessian(order, pairs, o, g, potential, MIN_CURVATURE * stiffness, slack)[0]


def factor_of_hessian(order, pairs, o, g, potential, damping, stiffness):
    """(definite, factor) of the Hessian of the contacts as they are, with its diagonal raised as in `factor_of`."""
    return _factorised(order, pairs, o, g, potential, 0.0, 1.0, damping, stiffness)


@nested(FAST, forceinline=True)
def displace_disks(o, moved, d, length, strain, like):
    """Move by length · d in the laboratory frame, at a strain of the list; returns max |o|. like: D numbers."""
    far, back = 0.0, strain_between(UNSTRAINED, strain)
    for k in range(len(o)):
        move = scaled(length, row(d, k, like))
        add_to_row(moved, k, move)
        add_to_row(o, k, added(move, displace(back, move)))
        here = row(o, k, like)
        far = max(far, inner(here, here))
    return np.sqrt(far)


@compiled(FAST)
def moved_on(o, strain, way, moved, like):
    """Move by `way` (N, D) in the laboratory frame: change the offsets o, copy it into `moved`; returns max |o|."""
    moved[:] = 0.0
    return displace_disks(o, moved, way, 1.0, strain, like)


@compiled(FAST)
def displace_disks_by(o, moved, d, strain, like):
    """`displace_disks` by d, which is added to `moved`."""
    return displace_disks(o, moved, d, 1.0, strain, like)


@compiled(FAST)
def without_drift(moved, like):
    """Take the mean out of `moved` (N, D); returns the rms of what is left, and its largest component.

    like: a tuple of length D, a constant to the compiler
    """
    n, square, longest = len(moved), 0.0, 0.0
    for axis in range(len(like)):
        mean = np.mean(moved[:, axis])
        for k in range(n):
            moved[k, axis] -= mean
            square += moved[k, axis] ** 2
            longest = max(longest, abs(moved[k, axis]))
    return np.sqrt(square / n), longest


@compiled(FAST)
def contacts_at(pairs, o, g, potential):
    """(number of contacts, Σ k (n_x r_y)², V times the modulus of affine motion, share with equal overlaps).

    At offsets o and shear g. Without symmetry some 3 % of the contacts share a cell of overlaps with an earlier one; a
    symmetry, which maps contacts onto others, makes it half of them or more.
    """
    i, j, r0, sigma = pairs.i, pairs.j, pairs.r0, pairs.sigma
    strain, number, modulus = simple_shear(g), 0, 0.0
    overlaps = np.empty(len(i))
    for p in range(len(i)):
        a, b = i[p], j[p]
        r = bond_vector(strain, entry(r0, p), difference(o, a, b, r0))
        square = inner(r, r)
        if square < sigma[p] * sigma[p]:
            number += 1
            d = overlaps[number - 1] = sigma[p] - np.sqrt(square)
            k = tangent_ratio(d, sigma[p], potential) * secant(d, sigma[p], potential)
            modulus += k * (r[0] * r[1]) ** 2 / square
    bins = CELLS * max(number, 1)
    taken, alike, total = np.zeros(bins, np.bool_), 0, np.sum(overlaps[:number])
    for q in range(number):
        place = int(0.5 * bins * number * overlaps[q] / total) % bins
        alike += taken[place]
        taken[place] = True
    return number, modulus, CELLS * alike / bins


@nested(FAST, forceinline=True)
def _add_dot(x, c, y, z):
    """x ← x + c y; returns z · x."""
    total = 0.0
    for q in range(len(x)):
        x[q] += c * y[q]
        total += z[q] * x[q]
    return total


@nested(FAST, forceinline=True)
def _direction(factor, softness, memory, forces, d, work, axes):
    """d = H F, (DN,), by the two loops over the memory; without a factor H₀ is a number, at first `softness`."""
    both, product, count, spaces = memory
    s, y = both[0], both[1]
    kept, following = count
    share = np.empty(MEMORY)
    work[:] = forces
    m = (following - 1) % MEMORY
    pull = dot(s[m], work) if kept else 0.0
    for _ in range(kept):
        share[m] = pull / product[m]
        older = (m - 1) % MEMORY
        pull = _add_dot(work, -share[m], y[m], s[older])
        m = older
    if len(factor[0]):
        solve(factor, work.reshape(-1, axes), d.reshape(-1, axes), spaces[3].reshape(-1, axes))
    else:
        newest = (following - 1) % MEMORY
        scale = product[newest] / dot(y[newest], y[newest]) if kept else softness
        for q in range(len(work)):
            d[q] = scale * work[q]
    m = (following - kept) % MEMORY
    pull = dot(y[m], d) if kept else 0.0
    for _ in range(kept):
        newer = (m + 1) % MEMORY
        pull = _add_dot(d, share[m] - pull / product[m], s[m], y[newer])
        m = newer


@compiled(NUMBERS, forceinline=True)
def _longest(a, like):
    """Largest |a|² of N vectors one after another (DN,), NaN where there is one; like: a tuple of length D."""
    longest = total = 0.0
    for k in range(len(a) // len(like)):
        if len(like) == 3:
            square = a[3 * k] * a[3 * k] + a[3 * k + 1] * a[3 * k + 1] + a[3 * k + 2] * a[3 * k + 2]
        else:
            square = a[2 * k] * a[2 * k] + a[2 * k + 1] * a[2 * k + 1]
        longest = square if square > longest else longest
        total += square
    return longest if total == total else np.nan


@compiled(NUMBERS)
def follow(pairs, potential, scalars, factor, memory, o, moved, forces):
    """Go down from offsets o (N, D) at shear g of the list to the minimum; returns (status, evaluations, sums).

    pairs     a `NeighbourList` of one domain
    scalars   (σ_max, skin, V, g, max |F| / (p d^(D−1)) asked for, force that rounding leaves, pressure below which no
              disks touch, d^(D−1), longest move of a disk in one step, 1 / stiffness of a contact, most evaluations)
    factor    of `factor_of`
    memory    of `nothing_remembered`
    moved     (N, D), to which the moves in the laboratory frame are added

    sums are as in `bond_forces`, at the end.
    """
    largest, skin, volume, g, share, floor, separated_pressure, cross_section, reach, softness, most = scalars
    both, product, count, spaces = memory
    s, y = both[0], both[1]
    d, old, work = spaces[0], spaces[1], spaces[2]
    flat, axes = forces.reshape(-1), forces.shape[1]
    evaluations = tries = 0
    slope = length = done = 0.0
    while True:
        sums = bond_forces(pairs, o, simple_shear(g), potential, forces, None, None)
        evaluations += 1
        if tries:
            end = dot(flat, d)
            if end < -OVERSHOT * slope and tries < MAX_STEP_HALVINGS:
                length *= max(slope / (slope - end), 0.1)
            else:
                tries = 0
                bend = length * (slope - end)
                if bend > 1e-12 * slope * length:
                    m = count[1]
                    for q in range(len(d)):
                        s[m, q] = length * d[q]
                        y[m, q] = old[q] - flat[q]
                    product[m] = bend
                    count[0] = min(count[0] + 1, MEMORY)
                    count[1] = (m + 1) % MEMORY
        if not tries:
            top = np.sqrt(_longest(flat, pairs.r0))
            pressure = elastic_trace(sums) / (axes * volume)
            if not top < np.inf:
                return LOST, evaluations, sums
            if pressure < separated_pressure:
                return SEPARATED, evaluations, sums
            if top <= max(share * pressure * cross_section, floor):
                return CONVERGED, evaluations, sums
            if evaluations >= most:
                return SPENT, evaluations, sums
            for _ in range(2):
                _direction(factor, softness, memory, flat, d, work, axes)
                slope = dot(flat, d)
                if slope > 0.0:
                    break
                count[0] = 0  # what is remembered leads uphill
            if not slope > 0.0:
                return LOST, evaluations, sums
            length, done = min(1.0, reach / np.sqrt(_longest(d, pairs.r0))), 0.0
            old[:] = flat
        far = displace_disks(o, moved, d.reshape(-1, axes), length - done, simple_shear(g), pairs.r0)
        done = length
        tries += 1
        if is_stale(far, simple_shear(g), largest, skin):
            return STALE, evaluations, sums

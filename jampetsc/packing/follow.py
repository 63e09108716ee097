"""A minimum that moves a little is followed: L-BFGS on top of a Hessian's factor that is some steps old, compiled.

While contacts stay, the response is linear and the factor's inverse leads to the minimum at once; a few contacts that
open or close are what the pairs (s, y) of L-BFGS are for. (Nocedal & Wright, Numerical Optimization, alg. 7.4, with
H₀ the inverse of the factor.) For disks in a cell of fixed shape; moves are in the laboratory.
"""

import numba
import numpy as np

from jampetsc.contacts.kernel import FAST, _secant, bond_forces
from jampetsc.contacts.pairs import is_stale
from jampetsc.packing.ldl import factorise, solve

MEMORY = 8  # pairs (s, y)
OVERSHOT = 0.5  # slope at the end of a step, against it, as a share of that at its beginning: too far
TRIES = 8  # of a step that goes too far
CONVERGED, STALE, SPENT, APART, LOST = range(5)


NO_FACTOR = np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty((0, 4))


def nothing_remembered(n: int):
    """(s and y (2, MEMORY, N, 2), s · y (MEMORY,), (how many, where the next one goes), where to work (4, N, 2))."""
    return np.zeros((2, MEMORY, n, 2)), np.zeros(MEMORY), np.zeros(2, np.int64), np.zeros((4, n, 2))


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def springs(pairs, o, g, law, nearby, stress):
    """Blocks k n nᵀ − (f/r) t tᵀ (M, 2, 2) of the pairs at offsets o and shear g, and which of them there are, (M,).

    A pair that is open by less than `nearby` has half the stiffness that it would have when closed by as much: a move
    that closes it is then not taken for one that costs nothing. With stress = 0 the blocks have no f.
    """
    i, j, r0, sigma = pairs
    alpha = 2.5 if law[1] else 2.0
    blocks, chosen = np.zeros((len(i), 2, 2)), np.zeros(len(i), np.bool_)
    for p in range(len(i)):
        y = r0[1, p] + o[j[p], 1] - o[i[p], 1]
        x = r0[0, p] + o[j[p], 0] - o[i[p], 0] + g * y
        r = np.sqrt(x * x + y * y)
        d = sigma[p] - r
        if d <= -nearby:
            continue
        chosen[p] = True
        f = stress * _secant(max(d, 0.0), sigma[p], law) * max(d, 0.0) / r
        k = (alpha - 1.0) * _secant(d if d > 0.0 else nearby, sigma[p], law)
        if d <= 0.0:
            k *= 0.5
        x, y = x / r, y / r
        blocks[p, 0, 0] = k * x * x - f * y * y
        blocks[p, 0, 1] = blocks[p, 1, 0] = (k + f) * x * y
        blocks[p, 1, 1] = k * y * y - f * x * x
    return blocks, chosen


@numba.njit(cache=True)
def held_by(pairs, chosen, n):
    """How many chosen pairs each of N disks has, (N,)."""
    number = np.zeros(n, np.int64)
    for p in range(len(chosen)):
        if chosen[p]:
            number[pairs[0][p]] += 1
            number[pairs[1][p]] += 1
    return number


@numba.njit(cache=True, error_model="numpy")
def factor_of(order, pairs, o, g, law, nearby, damping, stiffness):
    """A factor of the Hessian with `damping` on its diagonal; without pre-stress where it is not definite with it.

    A disk with fewer than three contacts is held as if by one more, of this stiffness: else it would go far at the
    touch of another.
    """
    n = len(o)
    shift = np.empty(n)
    for stress in (1.0, 0.0):
        blocks, chosen = springs(pairs, o, g, law, nearby, stress)
        number = held_by(pairs, chosen, n)
        for k in range(n):
            shift[k] = damping + (stiffness if number[k] < 3 else 0.0)
        definite, factor = factorise(order, pairs[0], pairs[1], blocks, chosen, shift)
        if definite:
            break
    return factor


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _go(o, moved, d, length, g):
    """Move by length · d in the laboratory; returns max |o|."""
    far = 0.0
    for k in range(len(o)):
        dx, dy = length * d[k, 0], length * d[k, 1]
        moved[k, 0] += dx
        moved[k, 1] += dy
        o[k, 0] += dx - g * dy
        o[k, 1] += dy
        far = max(far, o[k, 0] * o[k, 0] + o[k, 1] * o[k, 1])
    return np.sqrt(far)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def moved_on(o, g, way, moved):
    """Move offsets o by `way` (N, 2) in the laboratory, which is copied into `moved`; returns max |o|."""
    moved[:] = 0.0
    return _go(o, moved, way, 1.0, g)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def without_drift(moved):
    """Take the mean out of `moved` (N, 2); returns the rms of what is left, and its largest component."""
    n, square, longest = len(moved), 0.0, 0.0
    for axis in range(2):
        mean = np.mean(moved[:, axis])
        for k in range(n):
            moved[k, axis] -= mean
            square += moved[k, axis] ** 2
            longest = max(longest, abs(moved[k, axis]))
    return np.sqrt(square / n), longest


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def contacts_at(pairs, o, g, law):
    """(number of contacts, Σ k (n_x r_y)², V times the modulus of affine motion) at offsets o and shear g."""
    i, j, r0, sigma = pairs
    alpha = 2.5 if law[1] else 2.0
    number, modulus = 0, 0.0
    for p in range(len(i)):
        y = r0[1, p] + o[j[p], 1] - o[i[p], 1]
        x = r0[0, p] + o[j[p], 0] - o[i[p], 0] + g * y
        square = x * x + y * y
        if square < sigma[p] * sigma[p]:
            number += 1
            k = (alpha - 1.0) * _secant(sigma[p] - np.sqrt(square), sigma[p], law)
            modulus += k * (x * y) ** 2 / square
    return number, modulus


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _dot(a, b):
    total = 0.0
    for k in range(len(a)):
        total += a[k, 0] * b[k, 0] + a[k, 1] * b[k, 1]
    return total


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _direction(factor, softness, memory, forces, d, work):
    """d = H F, (N, 2), by the two loops over what is remembered; H₀ without a factor: about `softness`."""
    both, product, count, spaces = memory
    s, y = both[0], both[1]
    kept, following = count
    share = np.empty(MEMORY)
    work[:] = forces
    for back in range(kept):
        m = (following - 1 - back) % MEMORY
        share[m] = _dot(s[m], work) / product[m]
        for k in range(len(work)):
            work[k, 0] -= share[m] * y[m, k, 0]
            work[k, 1] -= share[m] * y[m, k, 1]
    if len(factor[0]):
        solve(factor, work, d, spaces[3])
    else:
        newest = (following - 1) % MEMORY
        scale = product[newest] / _dot(y[newest], y[newest]) if kept else softness
        for k in range(len(work)):
            d[k, 0], d[k, 1] = scale * work[k, 0], scale * work[k, 1]
    for ahead in range(kept):
        m = (following - kept + ahead) % MEMORY
        rest = share[m] - _dot(y[m], d) / product[m]
        for k in range(len(work)):
            d[k, 0] += rest * s[m, k, 0]
            d[k, 1] += rest * s[m, k, 1]


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def follow(pairs, listed, law, area, factor, memory, o, g, moved, forces, aim):
    """Go down from offsets o (N, 2) at shear g of the list to the minimum; returns (status, evaluations, sums).

    listed = (σ_max, skin); factor, memory: of `factor_of`, `nothing_remembered`
    aim = (max |F| / (p d) asked for, force that rounding leaves, pressure at which no two disks touch, d, longest move
    of a disk in one step, one over the stiffness of a contact, evaluations at most). What is moved is added to `moved`
    (N, 2); sums: of `bond_forces`, at the end.
    """
    both, product, count, spaces = memory
    s, y = both[0], both[1]
    d, old, work = spaces[0], spaces[1], spaces[2]
    share, floor, apart, diameter, reach, softness, most = aim
    sums = bond_forces(pairs, o, 0.0, g, law, forces, None, None)
    evaluations = 1
    while True:
        top = 0.0
        for k in range(len(o)):
            top = max(top, forces[k, 0] ** 2 + forces[k, 1] ** 2)
        top = np.sqrt(top)
        pressure = 0.5 * (sums[1] + sums[3]) / area
        if not top < np.inf:
            return LOST, evaluations, sums
        if pressure < apart:
            return APART, evaluations, sums
        if top <= max(share * pressure * diameter, floor):
            return CONVERGED, evaluations, sums
        if evaluations >= most:
            return SPENT, evaluations, sums
        _direction(factor, softness, memory, forces, d, work)
        slope = _dot(forces, d)
        if not slope > 0.0:
            count[0] = 0
            _direction(factor, softness, memory, forces, d, work)
            slope = _dot(forces, d)
            if not slope > 0.0:
                return LOST, evaluations, sums
        longest = 0.0
        for k in range(len(o)):
            longest = max(longest, d[k, 0] ** 2 + d[k, 1] ** 2)
        length = min(1.0, reach / np.sqrt(longest))
        old[:] = forces
        done = 0.0
        for _ in range(TRIES):
            far = _go(o, moved, d, length - done, g)
            done = length
            if is_stale(far, 0.0, g, listed[0], listed[1]):
                return STALE, evaluations, sums
            sums = bond_forces(pairs, o, 0.0, g, law, forces, None, None)
            evaluations += 1
            end = _dot(forces, d)
            if end >= -OVERSHOT * slope:
                break
            length *= max(slope / (slope - end), 0.1)
        bend = length * (slope - end)
        if bend > 1e-12 * slope * length:
            m = count[1]
            for k in range(len(o)):
                for axis in range(2):
                    s[m, k, axis] = length * d[k, axis]
                    y[m, k, axis] = old[k, axis] - forces[k, axis]
            product[m] = bend
            count[0] = min(count[0] + 1, MEMORY)
            count[1] = (m + 1) % MEMORY

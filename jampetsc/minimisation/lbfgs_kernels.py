"""Compiled loops of L-BFGS over the disks of one domain: over coordinates, forces and the pairs (s, y) of the memory.

Two passes per step: one forms the direction from the pairs and moves the disks; the other, after the forces, stores the
change of the gradient and takes its products with all pairs. Disks are worked on in chunks of GRAIN, whose rows of all
pairs lie together in memory.

The pairs are kept in single precision; a stored s is exactly the move that was made.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import box_strain
from jampetsc.packing.compiled import FAST, compiled, nested
from jampetsc.packing.elementary import exp
from jampetsc.packing.kernel import domain_forces, elastic_trace
from jampetsc.packing.neighbour_list import GRAIN


class LbfgsArrays(NamedTuple):
    """State and memory of a minimisation; rows are padded to N' = a multiple of GRAIN disks."""

    offsets: np.ndarray  # (N', D)
    box: np.ndarray  # strains of the cell, see `strain.cell_strain`
    forces: np.ndarray  # (2, N', D): at this point and at the previous one
    pairs: np.ndarray  # (D N' · 2m,) float32: per chunk of GRAIN disks the rows s_0, y_0, s_1, y_1, …
    box_pairs: np.ndarray  # (2m, strains) their parts that belong to the cell
    products: np.ndarray  # (2, m, m): s_a · y_b for a no newer than b; y_a · y_b
    sums: np.ndarray  # (domains, 2m + 4 + strains) each domain's part of the sums over disks
    reaches: np.ndarray  # (domains, 3) each domain's longest move and offset


@nested(FAST, forceinline=True)
def dot(a, b):
    """Σ a b."""
    total = 0.0
    for q in range(len(a)):
        total += a[q] * b[q]
    return total


@nested(FAST, forceinline=True)
def _square(f, peaks):
    """f · f; peaks ← max(peaks, |f|) element by element, which compilers vectorise, unlike a single maximum."""
    total = 0.0
    for q in range(len(f)):
        total += f[q] * f[q]
        size = abs(f[q])
        peaks[q] = size if size > peaks[q] else peaks[q]
    return total


@nested(FAST, forceinline=True)
def _peaks(f, peaks):
    for q in range(len(f)):
        size = abs(f[q])
        peaks[q] = size if size > peaks[q] else peaks[q]


@nested(FAST, forceinline=True)
def _change(new, factor_new, old, factor_old, y):
    """y ← g_new − g_old, in single precision; returns y · y and y · f_new."""
    square = product = 0.0
    for q in range(len(y)):
        y[q] = factor_old * old[q] - factor_new * new[q]
        here = np.float64(y[q])
        square += here * here
        product += here * new[q]
    return square, product


@nested(FAST, forceinline=True)
def _add_pair(sum_, c_s, s, c_y, y):
    for q in range(len(sum_)):
        sum_[q] += c_s * s[q] + c_y * y[q]


@nested(FAST, forceinline=True)
def _scaled(f, c, out):
    for q in range(len(out)):
        out[q] = c * f[q]


@nested(FAST, forceinline=True)
def _move(direction, s, o):
    """s ← direction in single precision, o ← o + s."""
    for q in range(len(o)):
        s[q] = direction[q]
        o[q] += np.float64(s[q])


@nested(FAST, forceinline=True)
def _rescale(ratio, s, o):
    """Multiply the last move s by `ratio`, in s and in o; returns max |o|."""
    far = 0.0
    for q in range(len(o)):
        old = np.float64(s[q])
        s[q] = ratio * old
        here = o[q] + (np.float64(s[q]) - old)
        o[q] = here
        size = abs(here)
        far = size if size > far else far
    return far


@nested(False, forceinline=True)
def is_sheared(box, like):
    """Whether a cell has shears; like: a tuple of length D."""
    if len(like) == 3:
        return box[1] != 0.0 or box[2] != 0.0 or box[3] != 0.0
    return box[1] != 0.0


@nested(FAST, forceinline=True)
def _shear(f, growth, box, like):
    """f ← Fᵀ f, f (n, D), with F = growth (1 + shears of the box); like: a tuple of length D."""
    shear = box[1]
    for q in range(len(f)):
        if len(like) == 3:
            f[q, 2] = growth * (f[q, 2] + box[2] * f[q, 0] + box[3] * f[q, 1])
        f[q, 1] = growth * (f[q, 1] + shear * f[q, 0])
        f[q, 0] = growth * f[q, 0]


@compiled(FAST, forceinline=True)
def measure(domains, d, space, task, factors, now, slot, room, like):
    """Forces of domain d, the change of its gradient as y of pair `slot` (unless −1), and its part of all sums.

    room: see `block_room`; like, here and below: a tuple of length D.
    """
    if len(like) == 3:  # coordinates of a chunk: constants to the compiler
        size = 3 * GRAIN
    else:
        size = 2 * GRAIN
    box = space.box
    strain = box_strain(box, like)
    fresh = space.forces[now]
    bonds = domain_forces(domains, d, space.offsets, strain, task.potential, fresh, None, None, room)
    first, last = domains.disks[d], domains.disks[d + 1]
    if is_sheared(box, like):
        _shear(fresh[first:last], exp(box[0]), box, like)
    rows = len(space.box_pairs)
    new = fresh.reshape(-1)
    old = space.forces[1 - now].reshape(-1)
    sums = space.sums[d]
    sums[:] = 0.0
    peaks = room[0][:size]
    peaks[:] = 0.0
    for chunk in range(first // GRAIN, last // GRAIN):
        here = slice(chunk * size, (chunk + 1) * size)
        base = chunk * rows * size
        f = new[here]
        if slot >= 0:
            y = space.pairs[base + (2 * slot + 1) * size : base + (2 * slot + 2) * size]
            square, product = _change(f, factors[now], old[here], factors[1 - now], y)
            sums[rows] += square
            sums[2 * slot + 1] += product
        for row in range(rows):
            if row != 2 * slot + 1:
                sums[row] += dot(space.pairs[base + row * size : base + (row + 1) * size], f)
        sums[rows + 1] += _square(f, peaks)
    sums[rows + 2] = peaks.max()
    for row in range(rows):
        sums[row] *= -factors[now]
    sums[rows + 1] *= factors[now] * factors[now]
    sums[rows + 3] = elastic_trace(bonds)
    sums[rows + 4] = bonds.elastic_xy
    if len(box) == 4:
        sums[rows + 5], sums[rows + 6] = bonds.elastic_xz, bonds.elastic_yz


@nested(FAST, forceinline=True)
def step(domains, d, space, now, factor, coefficients, head, room, like):
    """Move the disks of domain d along the direction, which becomes the s of pair `head`."""
    if len(like) == 3:  # coordinates of a chunk: constants to the compiler
        size = 3 * GRAIN
    else:
        size = 2 * GRAIN
    rows = len(space.box_pairs)
    f = space.forces[now].reshape(-1)
    o = space.offsets.reshape(-1)
    direction, longest, far = room[0][:size], room[1][:size], room[2][:size]
    longest[:], far[:] = 0.0, 0.0
    for chunk in range(domains.disks[d] // GRAIN, domains.disks[d + 1] // GRAIN):
        here = slice(chunk * size, (chunk + 1) * size)
        base = chunk * rows * size
        _scaled(f[here], -factor * coefficients[rows], direction)
        for row in range(0, rows, 2):
            if coefficients[row] != 0.0 or coefficients[row + 1] != 0.0:
                s = space.pairs[base + row * size : base + (row + 1) * size]
                y = space.pairs[base + (row + 1) * size : base + (row + 2) * size]
                _add_pair(direction, coefficients[row], s, coefficients[row + 1], y)
        s = space.pairs[base + 2 * head * size : base + (2 * head + 1) * size]
        _move(direction, s, o[here])
        _peaks(s, longest)
        _peaks(o[here], far)
    space.reaches[d, 0], space.reaches[d, 1] = longest.max(), far.max()


@nested(FAST, forceinline=True)
def adjust(domains, d, space, ratio, head, like):
    """Multiply the last move, the s of pair `head`, by `ratio` for the disks of domain d; returns max |o|."""
    if len(like) == 3:  # coordinates of a chunk: constants to the compiler
        size = 3 * GRAIN
    else:
        size = 2 * GRAIN
    rows = len(space.box_pairs)
    o = space.offsets.reshape(-1)
    far = 0.0
    for chunk in range(domains.disks[d] // GRAIN, domains.disks[d + 1] // GRAIN):
        base = (chunk * rows + 2 * head) * size
        here = slice(chunk * size, (chunk + 1) * size)
        far = max(far, _rescale(ratio, space.pairs[base : base + size], o[here]))
    return far

"""Pairs of nearby particles in a periodic, possibly sheared cell in two or three dimensions, through a grid of cells.

Each periodic image is a separate neighbour, so small cells, where two particles can touch through more than one image,
need no special case. No compiled code is needed: numba takes longer to load than the contacts of 1e5
disks take to find. `pair_search` is the compiled search, for lists that are remade often.

Rows of a cell are lower triangular: a₁ = (Lx, 0, 0), a₂ = (xy, Ly, 0), a₃ = (xz, yz, Lz), or in a plane (Lx, 0) and
(γ Ly, Ly).
"""

import math
from itertools import pairwise

import numpy as np

CHUNK = 65536  # particles whose neighbours are searched at a time, to limit memory


def upright(cell):
    """(cell of the same lattice with the least tilts, T): rows T · cell, T (D, D) of whole numbers; best for a grid."""
    dimension = len(cell)
    reduced, numbers = np.array(cell), np.eye(dimension, dtype=int)
    for row in range(1, dimension):
        for column in range(row)[::-1]:
            turns = round(reduced[row, column] / reduced[column, column])
            reduced[row] = reduced[row] - turns * reduced[column]
            numbers[row] -= turns * numbers[column]
    return reduced, numbers


def grid_shape(cell, n, cutoff):
    """Cells of a grid over an upright `cell`, and how many of them lie within `cutoff`, both (D,), first axis first."""
    # At most about as many cells as particles: more would only cost memory in a dilute packing.
    limit = math.floor(n ** (1.0 / len(cell)) + 1e-9) + 1
    heights = 1.0 / np.sqrt(np.sum(np.linalg.inv(cell) ** 2, axis=0))  # between opposite faces
    shape = tuple(min(max(int(h / cutoff), 1), limit) for h in heights)
    return shape, tuple(math.ceil(cutoff * s / h) for s, h in zip(shape, heights, strict=True))


def vectors(numbers, cell):
    """Sums (N, D) of cell vectors, (N, D) numbers of each; without BLAS, whose last digits depend on the processor."""
    total = numbers[:, :1] * cell[0]
    for axis in range(1, len(cell)):
        total = total + numbers[:, axis : axis + 1] * cell[axis]
    return total


def fractional(positions, cell):
    """Coordinates (N, D) in cell vectors of positions (N, D)."""
    places = np.empty(np.shape(positions))
    for axis in range(len(cell))[::-1]:
        rest = positions[:, axis]
        for above in range(axis + 1, len(cell)):
            rest = rest - places[:, above] * cell[above, axis]
        places[:, axis] = rest / cell[axis, axis]
    return places


def _ranges(first, count):
    """count[0] consecutive integers from first[0], then count[1] from first[1], …"""
    return np.repeat(first - (np.cumsum(count) - count), count) + np.arange(count.sum())


def _grid_sum(parts):
    """Sums of one entry of each of `parts`, flat, the first of them running fastest."""
    total = np.zeros(1, int)
    for values in parts:
        total = np.add.outer(values, total).ravel()
    return total


def neighbour_pairs(positions, radii, cell, skin=0.0, rows=None):
    """All pairs closer than ρ_i + ρ_j + skin, as (i, j, image): j lies at x_j − x_i + image · cell from i.

    positions (N, D), radii (N,), cell (D, D). With rows=None each pair appears once (i < j). With
    rows=(first, last) every pair with first ≤ i < last appears, so a pair with both ends there appears twice,
    once from each end. Returns int32 arrays (M,), (M,) and (M, D), ordered by i. A particle's own images are left out:
    `Packing.from_positions` refuses cells in which they could overlap.
    """
    n, dimension = positions.shape
    cell, numbers = upright(cell)
    shape, margin = grid_shape(cell, n, 2.0 * float(radii.max()) + skin)
    wide = [s + 2 * m for s, m in zip(shape, margin, strict=True)]
    strides, wide_strides = (np.cumprod([1, *sides[:-1]]) for sides in (shape, wide))
    places = fractional(positions, cell)
    wrapped = np.floor(places)
    place_in_grid = np.minimum(((places - wrapped) * shape).astype(np.int64), np.array(shape) - 1)
    inside = positions
    for axis in range(dimension):
        inside = inside - wrapped[:, axis : axis + 1] * cell[axis]

    # The grid with margins of images, row by row: neighbours in space are in a few contiguous ranges of entries.
    turns, columns = zip(
        *(np.divmod(np.arange(-m, s + m), s) for s, m in zip(shape, margin, strict=True)), strict=True
    )
    cell_of_particle = place_in_grid @ strides
    occupancy = np.bincount(cell_of_particle, minlength=math.prod(shape))
    cells = _grid_sum([stride * column for stride, column in zip(strides, columns, strict=True)])
    start = np.concatenate(([0], np.cumsum(occupancy[cells])))
    members = np.argsort(cell_of_particle, kind="stable")
    particle = members[_ranges((np.cumsum(occupancy) - occupancy)[cells], occupancy[cells])]
    shift = np.stack(np.meshgrid(*turns[::-1], indexing="ij")[::-1], axis=-1).reshape(-1, dimension)
    shift = np.repeat(shift, occupancy[cells], axis=0)
    place = inside[particle] + vectors(shift, cell)
    reach = radii[particle] + skin

    rows_of_cells = _grid_sum(
        [stride * np.arange(2 * m + 1) for stride, m in zip(wide_strides[1:], margin[1:], strict=True)]
    )
    corner = (place_in_grid @ wide_strides)[:, None] + rows_of_cells
    first, last = rows or (0, n)
    blocks = []
    for begin in range(first, max(last, first + 1), CHUNK):
        block = slice(begin, min(begin + CHUNK, last))
        begins = start[corner[block]]
        count = start[corner[block] + 2 * margin[0] + 1] - begins
        e = _ranges(begins.ravel(), count.ravel())
        i = np.repeat(np.arange(block.start, block.stop), count.sum(axis=1))
        near = radii[i] + reach[e]
        chosen = squared_length((place[e] - inside[i]).T) < near * near
        chosen &= particle[e] > i if rows is None else particle[e] != i
        blocks.append((i[chosen], e[chosen]))
    i, e = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    image = shift[e] - wrapped[particle[e]] + wrapped[i]
    return i.astype(np.int32), particle[e].astype(np.int32), vectors(image, numbers).astype(np.int32)


def squared_length(components):
    """Σ x² over the first axis of components (D, M), added in the order of the axes, (M,)."""
    x, *rest = components
    total = x * x
    for y in rest:
        total = total + y * y
    return total


def lengths(vectors):
    """|v| (M,) of vectors (M, D).

    In extended precision, so that they are rounded once and in range, whatever the C library.
    """
    return np.sqrt(squared_length(np.asarray(vectors).T.astype(np.longdouble))).astype(float)


def longest(vectors) -> float:
    """Largest |v| of vectors (M, D), to rounding."""
    return float(np.sqrt(squared_length(vectors.T).max()))


def _hilbert(axes, bits):
    """Position along the Hilbert curve of points with D coordinates `axes`, (N,) unsigned of `bits` bits each.

    J. Skilling, AIP Conf. Proc. 707, 381 (2004). The coordinates are overwritten.
    """
    first, last = axes[0], axes[-1]
    for bit in range(1, bits)[::-1]:
        low = first.dtype.type((1 << bit) - 1)
        for axis in axes:
            is_up = (axis >> bit) & 1
            swapped = (first ^ axis) & (low * (1 - is_up))
            first ^= low * is_up ^ swapped
            axis ^= swapped
    for previous, axis in pairwise(axes):
        axis ^= previous
    turned = np.zeros_like(first)
    for bit in range(1, bits)[::-1]:
        turned ^= ((last >> bit) & 1) * first.dtype.type((1 << bit) - 1)
    key = np.zeros_like(first)
    for bit in range(bits)[::-1]:
        for axis in axes:
            key = (key << 1) | (((axis ^ turned) >> bit) & 1)
    return key


def spatial_order(positions, cell):
    """Permutation (N,) that sorts particles along a Hilbert curve through the cell.

    Neighbours in space become neighbours in memory, and ranges of the new numbering are compact patches: good
    for caches, for matrix bandwidth and for ownership by ranks. Depends on the coordinates alone, so it is
    the same on every rank.
    """
    bits = 16
    places = fractional(positions, upright(cell)[0])
    places -= np.floor(places)
    kind = np.uint32 if len(cell) == 2 else np.uint64  # wide enough for D · bits
    return np.argsort(_hilbert(list((places.T * 2**bits).astype(kind)), bits), kind="stable")

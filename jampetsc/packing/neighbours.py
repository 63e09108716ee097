"""Pairs of nearby disks in a periodic, possibly sheared cell, through a grid of cells.

Each periodic image is a separate neighbour, so small cells, where two disks can touch through more than one image,
need no special case. No compiled code is needed: numba takes longer to load than the contacts of 1e5
disks take to find. `pair_search` is the compiled search, for lists that are remade often.
"""

import math

import numpy as np

CHUNK = 65536  # disks whose neighbours are searched at a time, to limit memory


def upright(cell):
    """(rows a1 and a2 − m a1, m) with the least tilt: the widest such cell of this lattice, best for a grid."""
    turns = round(cell[1, 0] / cell[0, 0])
    return np.array([cell[0], cell[1] - turns * cell[0]]), turns


def grid_shape(cell, n, cutoff):
    """Cells of a grid over an upright `cell`, and how many of them lie within `cutoff`, both (columns, rows)."""
    (length, _), (tilt, height) = cell.tolist()
    # At most about as many cells as disks: more would only cost memory in a dilute packing.
    limit = math.isqrt(n) + 1
    heights = (length * height / math.hypot(tilt, height), height)
    shape = tuple(min(max(int(h / cutoff), 1), limit) for h in heights)
    return shape, tuple(math.ceil(cutoff * s / h) for s, h in zip(shape, heights, strict=True))


def vectors(numbers, cell):
    """Sums (N, 2) of cell vectors, (N, 2) numbers of each; without BLAS, whose last digits depend on the processor."""
    return numbers[:, :1] * cell[0] + numbers[:, 1:] * cell[1]


def fractional(positions, cell):
    """Coordinates (N, 2) in cell vectors of positions (N, 2) in a cell with rows (Lx, 0) and (γ Ly, Ly)."""
    up = positions[:, 1] / cell[1, 1]
    return np.column_stack(((positions[:, 0] - up * cell[1, 0]) / cell[0, 0], up))


def _ranges(first, count):
    """count[0] consecutive integers from first[0], then count[1] from first[1], …"""
    return np.repeat(first - (np.cumsum(count) - count), count) + np.arange(count.sum())


def neighbour_pairs(positions, radii, cell, skin=0.0, rows=None):
    """All pairs closer than ρ_i + ρ_j + skin, as (i, j, image): j lies at x_j − x_i + image · cell from i.

    positions (N, 2), radii (N,), cell (2, 2). With rows=None each pair appears once (i < j). With
    rows=(first, last) every pair with first ≤ i < last appears, so a pair with both ends there appears twice,
    once from each end. Returns int32 arrays (M,), (M,) and (M, 2), ordered by i. A disk's own images are left out:
    `Packing.from_positions` refuses cells in which they could overlap.
    """
    n = len(radii)
    cell, turns = upright(cell)
    shape, margin = grid_shape(cell, n, 2.0 * float(radii.max()) + skin)
    places = fractional(positions, cell)
    wrapped = np.floor(places)
    column, row = np.minimum(((places - wrapped) * shape).astype(np.int64), np.array(shape) - 1).T
    inside = positions - wrapped[:, :1] * cell[0] - wrapped[:, 1:] * cell[1]

    # The grid with margins of images, row by row: disks near one another are in a few contiguous ranges of entries.
    width = shape[0] + 2 * margin[0]
    (over, column_of), (up, row_of) = (
        np.divmod(np.arange(-m, s + m), s) for s, m in zip(shape, margin, strict=True)
    )
    cell_of_disk = row * shape[0] + column
    occupancy = np.bincount(cell_of_disk, minlength=shape[0] * shape[1])
    cells = (row_of[:, None] * shape[0] + column_of).ravel()
    start = np.concatenate(([0], np.cumsum(occupancy[cells])))
    members = np.argsort(cell_of_disk, kind="stable")
    disk = members[_ranges((np.cumsum(occupancy) - occupancy)[cells], occupancy[cells])]
    shift = np.stack(np.broadcast_arrays(over, up[:, None]), axis=-1).reshape(-1, 2)
    shift = np.repeat(shift, occupancy[cells], axis=0)
    place = inside[disk] + vectors(shift, cell)
    reach = radii[disk] + skin

    corner = (row * width + column)[:, None] + width * np.arange(2 * margin[1] + 1)
    first, last = rows or (0, n)
    found = []
    for begin in range(first, max(last, first + 1), CHUNK):
        some = slice(begin, min(begin + CHUNK, last))
        begins = start[corner[some]]
        count = start[corner[some] + 2 * margin[0] + 1] - begins
        e = _ranges(begins.ravel(), count.ravel())
        i = np.repeat(np.arange(some.start, some.stop), count.sum(axis=1))
        x, y = (place[e] - inside[i]).T
        near = radii[i] + reach[e]
        chosen = (x * x + y * y < near * near) & (disk[e] > i if rows is None else disk[e] != i)
        found.append((i[chosen], e[chosen]))
    i, e = (np.concatenate(parts) for parts in zip(*found, strict=True))
    image = (shift[e] - wrapped[disk[e]] + wrapped[i]).astype(np.int32)
    image[:, 0] -= turns * image[:, 1]
    return i.astype(np.int32), disk[e].astype(np.int32), image


def _hilbert(x, y, bits):
    """Position along the Hilbert curve of points with x, y (N,) uint32 of `bits` bits, which are overwritten."""
    key = np.zeros(len(x), np.uint32)
    for bit in range(bits)[::-1]:
        right, low = (x >> bit) & 1, (~y >> bit) & 1
        key = (key << 2) | ((3 * right) ^ (1 - low))
        turned = np.uint32((1 << bit) - 1) * (right & low)
        x ^= turned
        y ^= turned
        swapped = (x ^ y) * low
        x ^= swapped
        y ^= swapped
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
    grid = (places.T * 2**bits).astype(np.uint32)
    return np.argsort(_hilbert(*grid, bits), kind="stable")

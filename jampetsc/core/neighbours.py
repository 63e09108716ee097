"""Pairs of nearby disks in a periodic, possibly sheared cell, through a grid of cells.

Every periodic image counts as a neighbour of its own, so small cells, where two disks can touch through more
than one image, need no special case.
"""

import math
from typing import NamedTuple

import numba
import numpy as np


class Grid(NamedTuple):
    """Disks sorted by the cells of a grid, row by row, with a margin of images: neighbours are in runs of cells.

    An entry is a disk or an image of one; cell c holds the entries start[c] to start[c + 1].
    """

    corner: np.ndarray  # (N,) uint64: lower left of the cells around each disk
    width: int  # cells in a row, with margins
    start: np.ndarray  # (cells + 1,) uint64
    x: np.ndarray  # (E,)
    y: np.ndarray  # (E,)
    reach: np.ndarray  # (E,) ρ + skin
    disk: np.ndarray  # (E,) uint32
    image: np.ndarray  # (E, 2) of the coordinates as they were given
    inside: np.ndarray  # (N, 2) coordinates of the disks in the cell
    wrapped: np.ndarray  # (N, 2) whole cell vectors that were taken away for that


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def _grid(positions, radii, cell, skin, shape, margin):
    """The Grid of `shape` cells and `margin` more on each side, both (columns, rows)."""
    n = len(positions)
    nx, ny = shape
    width, height = nx + 2 * margin[0], ny + 2 * margin[1]
    home, corner = np.empty(n, np.uint32), np.empty(n, np.uint64)
    inside, wrapped = np.empty((n, 2)), np.empty((n, 2), np.int32)
    held = np.zeros(nx * ny + 1, np.uint32)  # disks in cells before each
    for p in range(n):
        fy = positions[p, 1] / cell[1, 1]
        fx = (positions[p, 0] - fy * cell[1, 0]) / cell[0, 0]
        over, up = np.floor(fx), np.floor(fy)
        wrapped[p, 0], wrapped[p, 1] = over, up
        inside[p, 0] = positions[p, 0] - over * cell[0, 0] - up * cell[1, 0]
        inside[p, 1] = positions[p, 1] - up * cell[1, 1]
        column, row = min(int((fx - over) * nx), nx - 1), min(int((fy - up) * ny), ny - 1)
        home[p] = row * nx + column
        corner[p] = row * width + column
        held[row * nx + column + 1] += np.uint32(1)
    for c in range(nx * ny):
        held[c + 1] += held[c]
    fill, members = held[:-1].copy(), np.empty(n, np.uint32)
    for p in range(n):
        members[fill[home[p]]] = p
        fill[home[p]] += np.uint32(1)
    start = np.zeros(width * height + 1, np.uint64)
    for r in range(height):
        first = (r - margin[1]) % ny * nx
        for c in range(width):
            real = first + (c - margin[0]) % nx
            start[r * width + c + 1] = start[r * width + c] + np.uint64(held[real + 1] - held[real])
    entries = start[width * height]
    x, y, reach = np.empty(entries), np.empty(entries), np.empty(entries)
    disk, image = np.empty(entries, np.uint32), np.empty((entries, 2), np.int32)
    for r in range(height):
        up = (r - margin[1]) // ny
        first = (r - margin[1] - up * ny) * nx
        for c in range(width):
            over = (c - margin[0]) // nx
            real = first + c - margin[0] - over * nx
            shift_x, shift_y = over * cell[0, 0] + up * cell[1, 0], up * cell[1, 1]
            e = start[r * width + c]
            for m in range(held[real], held[real + 1]):
                j = members[m]
                x[e] = inside[j, 0] + shift_x
                y[e] = inside[j, 1] + shift_y
                reach[e] = radii[j] + skin
                disk[e] = j
                image[e, 0] = over - wrapped[j, 0]
                image[e, 1] = up - wrapped[j, 1]
                e += np.uint64(1)
    return Grid(corner, width, start, x, y, reach, disk, image, inside, wrapped)


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def _search(grid, radii, first, last, half, around, found, ends):
    """Entries near disks first … last − 1 into `found`, those of each up to its `ends`; their number, −1 without room.

    around = (columns, rows) of cells to look at. Which entries are near is hard to predict: all are stored, and
    only near ones counted.
    """
    x, y, reach, disk = grid.x, grid.y, grid.reach, grid.disk
    columns, rows, width = np.uint64(around[0]), np.uint64(around[1]), np.uint64(grid.width)
    count = np.uint64(0)
    for i in range(np.uint64(first), np.uint64(last)):
        xi, yi, radius = grid.inside[i, 0], grid.inside[i, 1], radii[i]
        least = i if half else np.uint64(0)
        for row in range(rows):
            cells = grid.corner[i] + row * width
            begin, end = grid.start[cells], grid.start[cells + columns]
            if count + end - begin > np.uint64(len(found)):
                return -1
            for e in range(begin, end):
                dx, dy, near = x[e] - xi, y[e] - yi, radius + reach[e]
                found[count] = e
                count += np.uint64((dx * dx + dy * dy < near * near) & (disk[e] >= least) & (disk[e] != i))
        ends[i - np.uint64(first)] = count
    return np.int64(count)


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def _pairs(positions, radii, cell, skin, shape, margin, first, last, half):
    """`neighbour_pairs` on a grid of `shape` cells with `margin` cells within reach of each, both (columns, rows)."""
    grid = _grid(positions, radii, cell, skin, shape, margin)
    around = (2 * margin[0] + 1, 2 * margin[1] + 1)
    ends = np.empty(last - first, np.int64)
    room = (4 if half else 8) * (last - first) + 64
    while True:
        found = np.empty(room, np.uint32)
        count = _search(grid, radii, first, last, half, around, found, ends)
        if count >= 0:
            break
        room *= 2
    i, j, image = np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 2), np.int32)
    q = 0
    for a in range(first, last):
        while q < ends[a - first]:
            e = found[q]
            i[q], j[q] = a, grid.disk[e]
            image[q, 0] = grid.image[e, 0] + grid.wrapped[a, 0]
            image[q, 1] = grid.image[e, 1] + grid.wrapped[a, 1]
            q += 1
    return i, j, image


def _upright(cell):
    """(rows a1 and a2 − m a1, m) with the least tilt: of all cells of this lattice the widest one for a grid."""
    turns = round(cell[1, 0] / cell[0, 0])
    return np.array([cell[0], cell[1] - turns * cell[0]]), turns


def neighbour_pairs(positions, radii, cell, skin=0.0, rows=None):
    """All pairs closer than ρ_i + ρ_j + skin, as (i, j, image): j lies at x_j − x_i + image · cell from i.

    positions (N, 2), radii (N,), cell (2, 2). With rows=None each pair appears once (i < j). With
    rows=(first, last) every pair with first ≤ i < last appears, so a pair with both ends there appears twice,
    once from each end. Returns int32 arrays (M,), (M,) and (M, 2), ordered by i. A disk is never its own
    neighbour (`Disks` sees to it that cells are wide enough).
    """
    cutoff = 2.0 * float(radii.max()) + skin
    cell, turns = _upright(cell)
    (length, _), (tilt, height) = cell.tolist()
    # At most about one particle per cell: a dilute cell would only cost memory.
    limit = math.isqrt(len(radii)) + 1
    heights = (length * height / math.hypot(tilt, height), height)
    shape = tuple(min(max(int(h / cutoff), 1), limit) for h in heights)
    margin = tuple(math.ceil(cutoff * s / h) for s, h in zip(shape, heights, strict=True))
    first, last = rows or (0, len(radii))
    i, j, image = _pairs(positions, radii, cell, skin, shape, margin, first, last, rows is None)
    image[:, 0] -= turns * image[:, 1]
    return i, j, image


@numba.njit(cache=True, fastmath=False)
def _hilbert(column, row, bits):
    """Distance along the Hilbert curve of integer coordinates, taken modulo 2**bits."""
    key = np.empty(len(column), np.int64)
    for p in range(len(column)):
        x, y, d = column[p], row[p], 0
        s = 1 << (bits - 1)
        while s > 0:
            rx = 1 if x & s else 0
            ry = 1 if y & s else 0
            d += s * s * ((3 * rx) ^ ry)
            if ry == 0:
                if rx == 1:
                    x, y = s - 1 - (x & (s - 1)), s - 1 - (y & (s - 1))
                x, y = y, x
            s >>= 1
        key[p] = d
    return key


def spatial_order(positions, cell):
    """Permutation (N,) that sorts particles along a Hilbert curve through the cell.

    Neighbours in space become neighbours in memory, and ranges of the new numbering are compact patches: good
    for caches, for matrix bandwidth and for ownership by ranks. Depends on the coordinates alone, so it is
    the same on every rank.
    """
    bits = 16
    fractional = positions @ np.linalg.inv(_upright(cell)[0])
    fractional -= np.floor(fractional)
    grid = (fractional * 2**bits).astype(np.int64)
    return np.argsort(_hilbert(grid[:, 0], grid[:, 1], bits), kind="stable")

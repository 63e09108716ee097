"""The search of `neighbours`, compiled, for lists that are made anew every hundred steps: same pairs, same order."""

from typing import NamedTuple

import numpy as np

from jampetsc.core.compiled import compiled
from jampetsc.core.neighbours import grid_shape, upright


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


@compiled(False)
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


@compiled(False)
def _search(grid, radii, around, found, ends):
    """Entries near each disk and after it into `found`, those of each up to its `ends`; their number, −1 without room.

    around = (columns, rows) of cells to look at. Which entries are near is hard to predict: all are stored, and
    only near ones counted.
    """
    x, y, reach, disk = grid.x, grid.y, grid.reach, grid.disk
    columns, rows, width = np.uint64(around[0]), np.uint64(around[1]), np.uint64(grid.width)
    count = np.uint64(0)
    for i in range(np.uint64(len(ends))):
        xi, yi, radius = grid.inside[i, 0], grid.inside[i, 1], radii[i]
        for row in range(rows):
            cells = grid.corner[i] + row * width
            begin, end = grid.start[cells], grid.start[cells + columns]
            if count + end - begin > np.uint64(len(found)):
                return -1
            for e in range(begin, end):
                dx, dy, near = x[e] - xi, y[e] - yi, radius + reach[e]
                found[count] = e
                count += np.uint64((dx * dx + dy * dy < near * near) & (disk[e] > i))
        ends[i] = count
    return np.int64(count)


@compiled(False)
def _pairs(positions, radii, cell, skin, shape, margin):
    """`half_list` on a grid of `shape` cells with `margin` cells within reach of each, both (columns, rows)."""
    n = len(radii)
    grid = _grid(positions, radii, cell, skin, shape, margin)
    around = (2 * margin[0] + 1, 2 * margin[1] + 1)
    ends = np.empty(n, np.int64)
    room = 4 * n + 64
    while True:
        found = np.empty(room, np.uint32)
        count = _search(grid, radii, around, found, ends)
        if count >= 0:
            break
        room *= 2
    i, j, image = np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 2), np.int32)
    q = 0
    for a in range(n):
        while q < ends[a]:
            e = found[q]
            i[q], j[q] = a, grid.disk[e]
            image[q, 0] = grid.image[e, 0] + grid.wrapped[a, 0]
            image[q, 1] = grid.image[e, 1] + grid.wrapped[a, 1]
            q += 1
    return i, j, image


def half_list(positions, radii, cell, skin):
    """What `neighbours.neighbour_pairs` returns where each pair is to appear once."""
    cell, turns = upright(cell)
    shape, margin = grid_shape(cell, len(radii), 2.0 * float(radii.max()) + skin)
    i, j, image = _pairs(positions, radii, cell, skin, shape, margin)
    image[:, 0] -= turns * image[:, 1]
    return i, j, image

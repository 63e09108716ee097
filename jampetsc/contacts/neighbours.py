"""Pairs of nearby disks in a periodic, possibly sheared cell, through a grid of cells.

Every periodic image counts as a neighbour of its own, so small cells, where two disks can touch through more
than one image, need no special case.
"""

import numba
import numpy as np


@numba.njit(cache=True)
def _bin(positions, inverse, shape):
    """Grid cell and wrapping image of each particle, and the particles sorted by grid cell."""
    n = len(positions)
    nx, ny = shape
    column = np.empty(n, np.int64)
    row = np.empty(n, np.int64)
    wrapped = np.empty((n, 2), np.int64)
    start = np.zeros(nx * ny + 1, np.int64)
    for p in range(n):
        fx = positions[p, 0] * inverse[0, 0] + positions[p, 1] * inverse[1, 0]
        fy = positions[p, 0] * inverse[0, 1] + positions[p, 1] * inverse[1, 1]
        wrapped[p, 0] = int(np.floor(fx))
        wrapped[p, 1] = int(np.floor(fy))
        column[p] = min(int((fx - wrapped[p, 0]) * nx), nx - 1)
        row[p] = min(int((fy - wrapped[p, 1]) * ny), ny - 1)
        start[row[p] * nx + column[p] + 1] += 1
    start = np.cumsum(start)
    fill = start[:-1].copy()
    members = np.empty(n, np.int64)
    for p in range(n):
        c = row[p] * nx + column[p]
        members[fill[c]] = p
        fill[c] += 1
    return column, row, wrapped, start, members


@numba.njit(cache=True)
def _search(positions, radii, cell, skin, first, last, half, shape, reach, bins, out_i, out_j, out_image):
    """Pairs with i in [first, last); counts them all, stores those that fit into the output arrays."""
    nx, ny = shape
    column, row, wrapped, start, members = bins
    # divisions are what a search would spend its time on
    images_x = np.arange(-reach[0], nx + reach[0]) // nx
    images_y = np.arange(-reach[1], ny + reach[1]) // ny
    count = 0
    for i in range(first, last):
        for dy in range(2 * reach[1] + 1):
            image_y = images_y[row[i] + dy]
            y = row[i] + dy - reach[1] - image_y * ny
            for dx in range(2 * reach[0] + 1):
                image_x = images_x[column[i] + dx]
                c = y * nx + column[i] + dx - reach[0] - image_x * nx
                for m in range(start[c], start[c + 1]):
                    j = members[m]
                    if j == i or (half and j < i):
                        continue
                    ix = image_x - wrapped[j, 0] + wrapped[i, 0]
                    iy = image_y - wrapped[j, 1] + wrapped[i, 1]
                    rx = positions[j, 0] - positions[i, 0] + ix * cell[0, 0] + iy * cell[1, 0]
                    ry = positions[j, 1] - positions[i, 1] + iy * cell[1, 1]
                    reach_ij = radii[i] + radii[j] + skin
                    if rx * rx + ry * ry < reach_ij * reach_ij:
                        if count < len(out_i):
                            out_i[count] = i
                            out_j[count] = j
                            out_image[count, 0] = ix
                            out_image[count, 1] = iy
                        count += 1
    return count


def neighbour_pairs(positions, radii, cell, skin=0.0, rows=None):
    """All pairs closer than ρ_i + ρ_j + skin, as (i, j, image): j lies at x_j − x_i + image · cell from i.

    positions (N, 2), radii (N,), cell (2, 2). With rows=None each pair appears once (i < j). With
    rows=(first, last) every pair with first ≤ i < last appears, so a pair with both ends there appears twice,
    once from each end. Returns int32 arrays (M,), (M,) and (M, 2), ordered by i. A disk is never its own
    neighbour (`Disks` sees to it that cells are wide enough).
    """
    cutoff = 2.0 * radii.max() + skin
    area = cell[0, 0] * cell[1, 1]
    heights = area / np.array([np.hypot(cell[1, 0], cell[1, 1]), cell[0, 0]])
    # At most about one particle per cell: a dilute cell would only cost memory.
    limit = int(np.sqrt(len(radii))) + 1
    shape = tuple(int(s) for s in np.clip(heights // cutoff, 1, limit))
    reach = tuple(int(np.ceil(cutoff * s / h)) for s, h in zip(shape, heights, strict=True))
    bins = _bin(positions, np.linalg.inv(cell), shape)
    first, last = rows if rows is not None else (0, len(radii))
    capacity = 4 * (last - first) * (1 if rows is None else 2) + 64
    while True:
        i, j = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
        image = np.empty((capacity, 2), np.int32)
        count = _search(
            positions, radii, cell, skin, first, last, rows is None, shape, reach, bins, i, j, image
        )
        if count <= capacity:
            return i[:count], j[:count], image[:count]
        capacity = count


@numba.njit(cache=True)
def _hilbert(column, row, bits):
    """Distance along the Hilbert curve of integer coordinates below 2**bits."""
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
    fractional = positions @ np.linalg.inv(cell)
    fractional -= np.floor(fractional)
    grid = np.minimum((fractional * 2**bits).astype(np.int64), 2**bits - 1)
    return np.argsort(_hilbert(grid[:, 0], grid[:, 1], bits), kind="stable")

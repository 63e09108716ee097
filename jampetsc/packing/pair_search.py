"""The search of `neighbours`, compiled, for lists that are remade every hundred steps: same pairs, same order."""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import put, row
from jampetsc.packing.compiled import compiled, nested
from jampetsc.packing.neighbours import grid_shape, upright
from jampetsc.packing.threads import meet

FIRST_PAIRS_PER_DISK = 4  # pairs per disk for which arrays have room at first


class Grid(NamedTuple):
    """Disks sorted by the cells of a grid, row by row, layer by layer, with margins of images around them.

    An entry is a disk or an image of one; cell c has the entries start[c] … start[c + 1] − 1. The entries near a disk
    are therefore in contiguous ranges, one for each row of cells.
    """

    corner: np.ndarray  # (N,) uint64: the first one of the cells around each disk
    columns: int  # of the cells around a disk, its own included
    rows: np.ndarray  # (R,) uint64: where the rows of these cells begin, from the corner
    start: np.ndarray  # (cells + 1,) uint64
    place: tuple  # D arrays (E,): coordinates
    reach: np.ndarray  # (E,) ρ + skin
    disk: np.ndarray  # (E,) uint32
    image: np.ndarray  # (E, D) cell vectors from the disk's given coordinates to the entry
    inside: np.ndarray  # (N, D) coordinates of the disks in the cell
    wrapped: np.ndarray  # (N, D) numbers of cell vectors subtracted for that


@nested(False, forceinline=True)
def _sum(a, b):
    if len(a) == 3:
        return a[0] + b[0], a[1] + b[1], a[2] + b[2]
    return a[0] + b[0], a[1] + b[1]


@nested(False)
def _shift(cell, over, up, deep, like):
    """A sum of vectors of an upright cell."""
    if len(like) == 3:
        x = over * cell[0, 0] + up * cell[1, 0] + deep * cell[2, 0]
        return x, up * cell[1, 1] + deep * cell[2, 1], deep * cell[2, 2]
    return over * cell[0, 0] + up * cell[1, 0], up * cell[1, 1]


@nested(False)
def _places(number, shape):
    """D arrays (number,)."""
    if len(shape) == 3:
        return np.empty(number), np.empty(number), np.empty(number)
    return np.empty(number), np.empty(number)


@nested(False)
def _grid(positions, radii, cell, skin, shape, margin):
    """The Grid of `shape` cells and `margin` more on each side, both (columns, rows) or (columns, rows, layers)."""
    n, dimension = positions.shape
    nx, ny, nz = shape[0], shape[1], 1 if dimension == 2 else shape[-1]
    margin_z = 0 if dimension == 2 else margin[-1]
    width, height, depth = nx + 2 * margin[0], ny + 2 * margin[1], nz + 2 * margin_z
    cell_of_disk, corner = np.empty(n, np.uint32), np.empty(n, np.uint64)
    inside, wrapped = np.empty((n, dimension)), np.empty((n, dimension), np.int32)
    preceding = np.zeros(nx * ny * nz + 1, np.uint32)  # [c]: disks in the cells before c
    for p in range(n):
        fz = over_z = 0.0
        layer = 0
        if dimension == 3:
            fz = positions[p, 2] / cell[2, -1]
            over_z = np.floor(fz)
            layer = min(int((fz - over_z) * nz), nz - 1)
            fy = (positions[p, 1] - fz * cell[2, 1]) / cell[1, 1]
            fx = (positions[p, 0] - fy * cell[1, 0] - fz * cell[2, 0]) / cell[0, 0]
        else:
            fy = positions[p, 1] / cell[1, 1]
            fx = (positions[p, 0] - fy * cell[1, 0]) / cell[0, 0]
        over, up = np.floor(fx), np.floor(fy)
        wrapped[p, 0], wrapped[p, 1] = over, up
        inside[p, 0] = positions[p, 0] - over * cell[0, 0] - up * cell[1, 0]
        inside[p, 1] = positions[p, 1] - up * cell[1, 1]
        if dimension == 3:
            wrapped[p, 2] = over_z
            inside[p, 0] -= over_z * cell[2, 0]
            inside[p, 1] -= over_z * cell[2, 1]
            inside[p, 2] = positions[p, 2] - over_z * cell[2, 2]
        column, line = min(int((fx - over) * nx), nx - 1), min(int((fy - up) * ny), ny - 1)
        real = (layer * ny + line) * nx + column
        cell_of_disk[p] = real
        corner[p] = (layer * height + line) * width + column
        preceding[real + 1] += np.uint32(1)
    for c in range(nx * ny * nz):
        preceding[c + 1] += preceding[c]
    fill, members = preceding[:-1].copy(), np.empty(n, np.uint32)
    for p in range(n):
        members[fill[cell_of_disk[p]]] = p
        fill[cell_of_disk[p]] += np.uint32(1)
    start = np.zeros(width * height * depth + 1, np.uint64)
    for r in range(height * depth):
        layer, line = (r // height - margin_z) % nz, (r % height - margin[1]) % ny
        first = (layer * ny + line) * nx
        for c in range(width):
            real = first + (c - margin[0]) % nx
            start[r * width + c + 1] = start[r * width + c] + np.uint64(preceding[real + 1] - preceding[real])
    entries = start[width * height * depth]
    place, reach = _places(entries, shape), np.empty(entries)
    disk, image = np.empty(entries, np.uint32), np.empty((entries, dimension), np.int32)
    for r in range(height * depth):
        layer, line = r // height - margin_z, r % height - margin[1]
        deep, up = layer // nz, line // ny
        first = ((layer - deep * nz) * ny + line - up * ny) * nx
        for c in range(width):
            over = (c - margin[0]) // nx
            real = first + c - margin[0] - over * nx
            shift = _shift(cell, over, up, deep, place)
            e = start[r * width + c]
            for m in range(preceding[real], preceding[real + 1]):
                j = members[m]
                put(place, e, _sum(row(inside, j, place), shift))
                reach[e] = radii[j] + skin
                disk[e] = j
                image[e, 0] = over - wrapped[j, 0]
                image[e, 1] = up - wrapped[j, 1]
                if dimension == 3:
                    image[e, 2] = deep - wrapped[j, 2]
                e += np.uint64(1)
    rows = np.empty((2 * margin[1] + 1) * (2 * margin_z + 1), np.uint64)
    for r in range(len(rows)):
        rows[r] = (r // (2 * margin[1] + 1) * height + r % (2 * margin[1] + 1)) * width
    return Grid(corner, 2 * margin[0] + 1, rows, start, place, reach, disk, image, inside, wrapped)


@nested(False, forceinline=True)
def _squared_distance(place, e, here):
    dx, dy = place[0][e] - here[0], place[1][e] - here[1]
    if len(place) == 3:
        dz = place[2][e] - here[2]
        return dx * dx + dy * dy + dz * dz
    return dx * dx + dy * dy


@nested(False)
def _search(grid, radii, first, entries, ends):
    """Write the entries near disks first, first + 1, … into `entries`, of disk first + a before ends[a].

    Returns how many, or −1 if `entries` is too short. A pair of two of these disks is found once, from the lower index;
    a pair with any other disk, from the one that is among these. No branch depends on which entries are near, which
    would often be mispredicted: all are stored, and only near ones advance the count.
    """
    place, reach, disk, rows, columns = grid.place, grid.reach, grid.disk, grid.rows, np.uint64(grid.columns)
    count, base = np.uint64(0), np.uint64(first)
    for own in range(np.uint64(len(ends))):
        i = base + own
        here, radius = row(grid.inside, i, place), radii[i]
        for r in range(np.uint64(len(rows))):
            cells = grid.corner[i] + rows[r]
            begin, end = grid.start[cells], grid.start[cells + columns]
            if count + end - begin > np.uint64(len(entries)):
                return -1
            for e in range(begin, end):
                near = radius + reach[e]
                entries[count] = e
                is_near = _squared_distance(place, e, here) < near * near
                count += np.uint64(is_near & ((disk[e] > i) | (disk[e] < base)))
        ends[own] = count
    return np.int64(count)


@nested(False)
def _search_domains(grid, radii, borders, counts):
    """(entries, ends) of `_search` for domains with borders (D + 1,); writes numbers of their pairs into counts."""
    first, total, d = borders[0], 0, 0
    ends = np.empty(borders[-1] - first, np.int64)  # relative to the first entry of the domain
    entries = np.empty(FIRST_PAIRS_PER_DISK * len(ends) + 64, np.uint32)
    while d < len(counts):
        low, high = borders[d], borders[d + 1]
        count = _search(grid, radii, low, entries[total:], ends[low - first : high - first])
        if count < 0:
            longer = np.empty(2 * len(entries), np.uint32)
            longer[:total] = entries[:total]
            entries = longer
            continue
        inside = 0
        for q in range(total, total + count):
            b = np.int64(grid.disk[entries[q]])
            inside += (low <= b) & (b < high)
        counts[d, 0], counts[d, 1] = inside, count - inside
        total += count
        d += 1
    return entries, ends


@compiled(False, nogil=True)
def _fill_lists(me, threads, counter, borders, grid_arguments, exact, counts, pairs):
    """Thread `me`'s part of `listed`: counts (D, 2), and pairs = (i, j, r0, sigma) if they have room for all.

    Returns (number of all pairs, 1).

    grid_arguments: of `_grid`, in the upright cell T · cell; exact = (base, offset, cell_base, cell_offset, T) of
    the disks
    """
    meet(counter, threads)  # all begin together
    number = len(borders) - 1
    first, last = me * number // threads, (me + 1) * number // threads
    grid, radii = _grid(*grid_arguments), grid_arguments[1]
    entries, ends = _search_domains(grid, radii, borders[first : last + 1], counts[first:last])
    meet(counter, threads)
    (base, offset, cell_base, cell_offset, numbers), (i, j, r0, sigma) = exact, pairs
    needed = counts.sum()
    if needed > len(sigma):
        return needed, 1
    dimension = base.shape[1]
    # unsigned: no code for negative indices
    disk, image, wrapped = grid.disk, grid.image, grid.wrapped
    at, q, disk_of_part = np.uint64(counts[:first].sum()), np.uint64(0), np.uint64(0)
    for d in range(first, last):
        within, low, high = at, np.uint64(borders[d]), np.uint64(borders[d + 1])
        across = at + np.uint64(counts[d, 0])
        at, start = across + np.uint64(counts[d, 1]), q
        for a in range(low, high):
            stop = start + np.uint64(ends[disk_of_part])
            disk_of_part += np.uint64(1)
            while q < stop:
                e = entries[q]
                q += np.uint64(1)
                b = np.uint64(disk[e])
                inside = (b >= low) & (b < high)
                p = within if inside else across
                within += np.uint64(inside)
                across += np.uint64(not inside)
                up = image[e, 1] + wrapped[a, 1]
                over = image[e, 0] + wrapped[a, 0] + numbers[1, 0] * up
                deep = np.int64(0)
                if dimension == 3:
                    deep = np.int64(image[e, 2] + wrapped[a, 2])
                    up += numbers[2, 1] * deep
                    over += numbers[2, 0] * deep
                i[p], j[p], sigma[p] = a, b, radii[a] + radii[b]
                for axis in range(dimension):  # differences of bases are exact, offsets are added to them
                    coarse = base[b, axis] - base[a, axis]
                    coarse += over * cell_base[0, axis] + up * cell_base[1, axis]
                    fine = offset[b, axis] - offset[a, axis]
                    fine += over * cell_offset[0, axis] + up * cell_offset[1, axis]
                    if dimension == 3:
                        coarse += deep * cell_base[2, axis]
                        fine += deep * cell_offset[2, axis]
                    r0[axis, p] = coarse + fine
    return needed, 1


def listed(disks, skin, borders, team):
    """Pairs of `disks` closer than σ + skin, by domains; d has the disks borders[d] … borders[d + 1] − 1, up to N.

    Returns counts (D, 2) of pairs within each domain, and across its border with i in it; and i, j, r0 (D, M'),
    sigma: domain by domain, first the pairs within it. The arrays are longer than the list.
    """
    n, number, borders = disks.n, len(borders) - 1, np.minimum(borders, disks.n)
    cell, numbers = upright(disks.cell)
    shape = grid_shape(cell, n, 2.0 * float(disks.radii.max()) + skin)
    arguments = disks.positions, disks.radii, cell, skin, *shape
    cells = np.ascontiguousarray(disks.cell_base), np.ascontiguousarray(disks.cell_offset)
    exact = disks.base, disks.offset, *cells, numbers
    counts, needed, room = np.empty((number, 2), np.int64), 1, 0
    while needed > room:
        room = max(FIRST_PAIRS_PER_DISK * n, needed)
        i, j = np.empty((2, room), np.uint32)
        pairs = i, j, np.empty((len(cell), room)), np.empty(room)
        needed, _ = team.run(_fill_lists, number, borders, arguments, exact, counts, pairs)
    return counts, *pairs

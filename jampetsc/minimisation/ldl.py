"""L D Lᵀ of a Hessian by 2×2 or 3×3 blocks, one for each disk and contact, compiled: a factor for many small solves.

It pays up to some 2e4 disks, from where a library's dense blocks are faster; at some thousand disks the call and the
analysis of a library cost more than the work. The caller gives the order of elimination. Row k of L follows from the
rows before it: with W_j = L_kj D_j,

    W_j = A_kj − Σ_{i<j} W_i L_jiᵀ,    L_kj = W_j D_j⁻¹,    D_k = A_kk − Σ_j L_kj W_jᵀ,

j running over the disks that the elimination tree leads to from the neighbours of k. Blocks on the diagonal are rows
(xx, xy, yy) in a plane and matrices (3, 3) in space: by the number of axes of their array numba knows the dimension.
"""

import numpy as np

from jampetsc.packing.compiled import FAST, NUMBERS, compiled, nested


@nested(False)
def rows_below(order, i, j, chosen):
    """(start (N + 1,), column, pair): for each disk, in the order of elimination, its contacts with earlier ones.

    chosen (M,): which pairs are in the matrix.
    """
    n = len(order)
    place = np.empty(n, np.int64)
    for k in range(n):
        place[order[k]] = k
    start = np.zeros(n + 1, np.int64)
    for p in range(len(i)):
        if chosen[p]:
            start[max(place[i[p]], place[j[p]]) + 1] += 1
    for k in range(n):
        start[k + 1] += start[k]
    fill = start[:-1].copy()
    column, pair = np.empty(start[n], np.int64), np.empty(start[n], np.int64)
    for p in range(len(i)):
        if chosen[p]:
            a, b = place[i[p]], place[j[p]]
            row = max(a, b)
            column[fill[row]] = min(a, b)
            pair[fill[row]] = p
            fill[row] += 1
    return start, column, pair


@nested(False)
def _tree(start, column):
    """(parent (N,) in the elimination tree, begin (N + 1,) of each column of L)."""
    n = len(start) - 1
    parent, seen = np.full(n, -1), np.full(n, -1)
    begin = np.zeros(n + 1, np.uint32)
    for k in range(n):
        seen[k] = k
        for e in range(start[k], start[k + 1]):
            a = column[e]
            while seen[a] != k:
                if parent[a] < 0:
                    parent[a] = k
                begin[a + 1] += np.uint32(1)
                seen[a] = k
                a = parent[a]
    for k in range(n):
        begin[k + 1] += begin[k]
    return parent, begin


@compiled(NUMBERS, forceinline=True)
def diagonal_of(i, j, blocks, chosen, shift):
    """(N, 3) xx, xy and yy of the diagonal blocks of Σ blocks (u_j − u_i)² + Σ shift u², shift (N,)."""
    diagonal = np.zeros((len(shift), 3))
    for p in range(len(i)):
        if chosen[p]:
            for disk in (i[p], j[p]):
                diagonal[disk, 0] += blocks[p, 0, 0]
                diagonal[disk, 1] += blocks[p, 0, 1]
                diagonal[disk, 2] += blocks[p, 1, 1]
    for disk in range(len(shift)):
        diagonal[disk, 0] += shift[disk]
        diagonal[disk, 2] += shift[disk]
    return diagonal


@nested(NUMBERS, forceinline=True)
def space_diagonal_of(i, j, blocks, chosen, shift):
    """(N, 3, 3) diagonal blocks of Σ blocks (u_j − u_i)² + Σ shift u², blocks (M, 3, 3), shift (N,)."""
    diagonal = np.zeros((len(shift), 3, 3))
    for p in range(len(i)):
        if chosen[p]:
            for disk in (i[p], j[p]):
                for x in range(3):
                    for y in range(3):
                        diagonal[disk, x, y] += blocks[p, x, y]
    for disk in range(len(shift)):
        for x in range(3):
            diagonal[disk, x, x] += shift[disk]
    return diagonal


@compiled(False)
def space_blocks_of(indptr, indices, values):
    """As `blocks_of`, of a triangle of 3×3 blocks; diagonal (N, 3, 3)."""
    n = len(indptr) // 3
    number = (len(indices) - 6 * n) // 9
    i, j = np.empty(number, np.uint32), np.empty(number, np.uint32)
    blocks, chosen, diagonal = np.empty((number, 3, 3)), np.zeros(number, np.bool_), np.empty((n, 3, 3))
    p = 0
    for k in range(n):
        first = indptr[3 * k]
        for x in range(3):
            for y in range(x, 3):
                diagonal[k, x, y] = diagonal[k, y, x] = values[indptr[3 * k + x] + y - x]
        for e in range(3, indptr[3 * k + 1] - first, 3):
            i[p], j[p] = k, indices[first + e] // 3
            for x in range(3):
                for y in range(3):
                    blocks[p, x, y] = -values[indptr[3 * k + x] + e - x + y]
                    chosen[p] |= blocks[p, x, y] != 0.0
            p += 1
    return i, j, blocks, chosen, diagonal


@compiled(False)
def blocks_of(indptr, indices, values):
    """(i, j, blocks, chosen, diagonal) for `factorise`, of the upper triangle of a symmetric matrix as CSR.

    The triangle is of 2×2 blocks, see `hessian.Pattern`; a block that is zero is not chosen.
    """
    n = len(indptr) // 2
    number = (len(indices) - 3 * n) // 4
    i, j = np.empty(number, np.uint32), np.empty(number, np.uint32)
    blocks, chosen, diagonal = np.empty((number, 2, 2)), np.zeros(number, np.bool_), np.empty((n, 3))
    p = 0
    for k in range(n):
        upper, lower = indptr[2 * k], indptr[2 * k + 1]
        diagonal[k, 0], diagonal[k, 1], diagonal[k, 2] = values[upper], values[upper + 1], values[lower]
        for e in range(2, lower - upper, 2):
            i[p], j[p] = k, indices[upper + e] // 2
            for y in range(2):
                blocks[p, 0, y], blocks[p, 1, y] = -values[upper + e + y], -values[lower + e - 1 + y]
                chosen[p] |= blocks[p, 0, y] != 0.0 or blocks[p, 1, y] != 0.0
            p += 1
    return i, j, blocks, chosen, diagonal


@nested(False)
def _find_pattern(k, start, column, parent, seen, path, pattern):
    """First place in `pattern`, to whose end it has the columns of row k of L, in order."""
    top = len(pattern)
    seen[k] = k
    for e in range(start[k], start[k + 1]):
        a, length = column[e], 0
        while seen[a] != k:
            path[length] = a
            length += 1
            seen[a] = k
            a = parent[a]
        while length > 0:
            length -= 1
            top -= 1
            pattern[top] = path[length]
    return top


@nested(NUMBERS, forceinline=True)
def _invert(d, inverse):
    """Inverse of a symmetric 3×3 matrix; returns whether it is positive definite."""
    xx = d[1, 1] * d[2, 2] - d[1, 2] * d[1, 2]
    xy = d[0, 2] * d[1, 2] - d[0, 1] * d[2, 2]
    xz = d[0, 1] * d[1, 2] - d[0, 2] * d[1, 1]
    minor = d[0, 0] * d[1, 1] - d[0, 1] * d[0, 1]
    determinant = d[0, 0] * xx + d[0, 1] * xy + d[0, 2] * xz
    if not (d[0, 0] > 0.0 and minor > 0.0 and determinant > 0.0):
        return False
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = xx, d[0, 0] * d[2, 2] - d[0, 2] * d[0, 2], minor
    inverse[0, 1] = inverse[1, 0] = xy
    inverse[0, 2] = inverse[2, 0] = xz
    inverse[1, 2] = inverse[2, 1] = d[0, 1] * d[0, 2] - d[0, 0] * d[1, 2]
    for x in range(3):
        for y in range(3):
            inverse[x, y] /= determinant
    return True


@nested(NUMBERS, forceinline=True)
def _factorise_in_space(order, i, start, column, pair, blocks, diagonal):
    """`factorise` for 3×3 blocks, of what `rows_below` gives."""
    n = len(order)
    parent, begin = _tree(start, column)
    fill = begin[:-1].copy()
    row, lower = np.empty(begin[n], np.uint32), np.empty((begin[n] + n, 3, 3))
    inverse = lower[begin[n] :]
    w, d = np.zeros((n, 3, 3)), np.empty((3, 3))
    seen, path, pattern = np.full(n, -1), np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n):
        top, disk = _find_pattern(k, start, column, parent, seen, path, pattern), order[k]
        for e in range(start[k], start[k + 1]):
            a, p = column[e], pair[e]
            for x in range(3):
                for y in range(3):
                    w[a, x, y] -= blocks[p, x, y] if i[p] == disk else blocks[p, y, x]
        d[:] = diagonal[disk]
        for q in range(top, n):
            c = pattern[q]
            # numbers: entries of an array would be loaded again after each store
            w00, w01, w02 = w[c, 0, 0], w[c, 0, 1], w[c, 0, 2]
            w10, w11, w12 = w[c, 1, 0], w[c, 1, 1], w[c, 1, 2]
            w20, w21, w22 = w[c, 2, 0], w[c, 2, 1], w[c, 2, 2]
            w[c] = 0.0
            for e in range(begin[c], fill[c]):
                r = row[e]
                for y in range(3):
                    l0, l1, l2 = lower[e, y, 0], lower[e, y, 1], lower[e, y, 2]
                    w[r, 0, y] -= w00 * l0 + w01 * l1 + w02 * l2
                    w[r, 1, y] -= w10 * l0 + w11 * l1 + w12 * l2
                    w[r, 2, y] -= w20 * l0 + w21 * l1 + w22 * l2
            e = fill[c]
            row[e] = k
            fill[c] = e + 1
            for y in range(3):
                i0, i1, i2 = inverse[c, 0, y], inverse[c, 1, y], inverse[c, 2, y]
                lower[e, 0, y] = w00 * i0 + w01 * i1 + w02 * i2
                lower[e, 1, y] = w10 * i0 + w11 * i1 + w12 * i2
                lower[e, 2, y] = w20 * i0 + w21 * i1 + w22 * i2
            for x in range(3):
                l0, l1, l2 = lower[e, x, 0], lower[e, x, 1], lower[e, x, 2]
                d[x, 0] -= l0 * w00 + l1 * w01 + l2 * w02
                d[x, 1] -= l0 * w10 + l1 * w11 + l2 * w12
                d[x, 2] -= l0 * w20 + l1 * w21 + l2 * w22
        if not _invert(d, inverse[k]):
            return False, (order[:0], begin[:1], row[:0], lower[:0])
    return True, (order, begin, row, lower)


@compiled(NUMBERS, forceinline=True)
def factorise(order, i, j, blocks, chosen, diagonal):
    """L D Lᵀ, in `order`, of a matrix with −blocks (M, D, D) of the chosen pairs (M,) and `diagonal`.

    A_ij, of the rows of i and the columns of j, is minus a block; for `diagonal` see `diagonal_of`. Returns (definite,
    factor): factor is (order, begin (N + 1,), row (nonzeros,), L followed by D⁻¹ (nonzeros + N, 4) or
    (nonzeros + N, 3, 3)), four arrays only, since numba takes long to inspect longer tuples; of no disk where the
    matrix is not definite.
    """
    start, column, pair = rows_below(order, i, j, chosen)
    if diagonal.ndim == 3:
        return _factorise_in_space(order, i, start, column, pair, blocks, diagonal)
    n = len(order)
    parent, begin = _tree(start, column)
    fill = begin[:-1].copy()
    inverse = np.zeros((n, 3))
    row, lower = np.empty(begin[n], np.uint32), np.empty((begin[n] + n, 4))
    w = np.zeros((n, 4))
    seen, path, pattern = np.full(n, -1), np.empty(n, np.int64), np.empty(n, np.int64)
    definite = True
    for k in range(n):
        top, disk = _find_pattern(k, start, column, parent, seen, path, pattern), order[k]
        for e in range(start[k], start[k + 1]):
            a, p = column[e], pair[e]
            for b in range(4):
                w[a, b] -= blocks[p, b // 2, b % 2] if i[p] == disk else blocks[p, b % 2, b // 2]
        d0, d1, d2 = diagonal[disk, 0], diagonal[disk, 1], diagonal[disk, 2]
        for q in range(top, n):
            c = pattern[q]
            w0, w1, w2, w3 = w[c, 0], w[c, 1], w[c, 2], w[c, 3]
            w[c] = 0.0
            for e in range(begin[c], fill[c]):
                r = row[e]
                l0, l1, l2, l3 = lower[e, 0], lower[e, 1], lower[e, 2], lower[e, 3]
                w[r, 0] -= w0 * l0 + w1 * l1
                w[r, 1] -= w0 * l2 + w1 * l3
                w[r, 2] -= w2 * l0 + w3 * l1
                w[r, 3] -= w2 * l2 + w3 * l3
            i0, i1, i2 = inverse[c, 0], inverse[c, 1], inverse[c, 2]
            l0, l1 = w0 * i0 + w1 * i1, w0 * i1 + w1 * i2
            l2, l3 = w2 * i0 + w3 * i1, w2 * i1 + w3 * i2
            d0 -= l0 * w0 + l1 * w1
            d1 -= l0 * w2 + l1 * w3
            d2 -= l2 * w2 + l3 * w3
            e = fill[c]
            row[e] = k
            lower[e, 0], lower[e, 1], lower[e, 2], lower[e, 3] = l0, l1, l2, l3
            fill[c] = e + 1
        minor = d0 * d2 - d1 * d1
        if not (d0 > 0.0 and minor > 0.0):
            definite = False
            break
        inverse[k, 0], inverse[k, 1], inverse[k, 2] = d2 / minor, -d1 / minor, d0 / minor
    lower[begin[n] :, :3] = inverse
    if not definite:
        return False, (order[:0], begin[:1], row[:0], lower[:0])
    return True, (order, begin, row, lower)


@compiled(FAST, forceinline=True)
def solve(factor, b, x, work):
    """x = A⁻¹ b, (N, D) each; work (N, D)."""
    order, begin, row, lower = factor
    _substitute(order, begin, row, lower, b, x, work)


@nested(FAST, forceinline=True)
def _substitute(order, begin, row, lower, b, x, work):
    """Forward and backward substitution of `solve`."""
    n = len(order)
    if lower.ndim == 3:
        y = np.empty(3)
        for k in range(n):
            work[k] = b[order[k]]
        for k in range(n):
            y[:] = work[k]
            for e in range(begin[k], begin[k + 1]):
                for axis in range(3):
                    work[row[e], axis] -= (
                        lower[e, axis, 0] * y[0] + lower[e, axis, 1] * y[1] + lower[e, axis, 2] * y[2]
                    )
        for k in range(n - 1, -1, -1):
            own = lower[begin[n] + k]
            for axis in range(3):
                y[axis] = own[axis, 0] * work[k, 0] + own[axis, 1] * work[k, 1] + own[axis, 2] * work[k, 2]
            for e in range(begin[k], begin[k + 1]):
                r = row[e]
                for axis in range(3):
                    y[axis] -= (
                        lower[e, 0, axis] * work[r, 0]
                        + lower[e, 1, axis] * work[r, 1]
                        + lower[e, 2, axis] * work[r, 2]
                    )
            work[k] = y
            x[order[k]] = y
        return
    inverse = lower[begin[n] :]
    for k in range(n):
        work[k, 0], work[k, 1] = b[order[k], 0], b[order[k], 1]
    for k in range(n):
        y0, y1 = work[k, 0], work[k, 1]
        for e in range(begin[k], begin[k + 1]):
            r = row[e]
            work[r, 0] -= lower[e, 0] * y0 + lower[e, 1] * y1
            work[r, 1] -= lower[e, 2] * y0 + lower[e, 3] * y1
    for k in range(n - 1, -1, -1):
        y0 = inverse[k, 0] * work[k, 0] + inverse[k, 1] * work[k, 1]
        y1 = inverse[k, 1] * work[k, 0] + inverse[k, 2] * work[k, 1]
        for e in range(begin[k], begin[k + 1]):
            r = row[e]
            y0 -= lower[e, 0] * work[r, 0] + lower[e, 2] * work[r, 1]
            y1 -= lower[e, 1] * work[r, 0] + lower[e, 3] * work[r, 1]
        work[k, 0], work[k, 1] = y0, y1
        x[order[k], 0], x[order[k], 1] = y0, y1

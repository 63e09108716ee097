"""Velocities of disks coupled by contact damping: contact graph, resistance matrix, conjugate gradients.

Without inertia the viscous forces balance the elastic ones,

    (A + s) u = b,    A u = Σ_j [c_⊥ (u_i − u_j) + (c_∥ − c_⊥) n n·(u_i − u_j)] over the contacts of i,

b the forces at u = 0 (the affine flow moves contacts too) and s what ties a disk to the affine flow: drag,
friction, inertia over a time step. With s = 0 and both weights positive, A leaves one translation free for every
connected cluster, on which b sums to zero. The limit s → 0⁺ is then: mean u = 0 in each cluster, and a disk
without contacts follows the flow. Conjugate gradients solve the singular system as it is, from the last
velocities; the means are subtracted afterwards (see `clusters`), so s needs no small value.

The first `held` disks, of walls, keep u = 0: their rows are left out, and a cluster that touches one has no free
translation.

Threads share the work by domains (see `packing.neighbour_list`); all take the same decisions, from the same sums.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import bond_vector, difference, entry, inner, scaled, set_row, zero
from jampetsc.packing.compiled import FAST, compiled, nested
from jampetsc.packing.threads import meet

SOLVES = 20_000  # most iterations: far more than any tolerance above rounding takes
# Contacts in the row of a disk, padded with the disk itself: processors predict loops of one length. The further
# contacts of a few disks are in `Graph.more`.
WIDTH = 6


class Graph(NamedTuple):
    """Contacts of every disk; contacts of domain d beyond WIDTH begin at 2 begin[d] of `more`."""

    disks: np.ndarray  # (D + 1,) of the domains,
    begin: np.ndarray  # (D,) and where their pairs begin
    column: np.ndarray  # (N, WIDTH) uint32: the other disks
    number: np.ndarray  # (N,) uint32: of contacts
    normals: np.ndarray  # (N, WIDTH, D), zero where column is the disk itself, or (0, WIDTH, D)
    more: np.ndarray  # (2M', 2) uint32: the disk itself and the other one
    more_normals: np.ndarray  # (2M', D), or (0, D)
    touching: np.ndarray  # (M',) uint32: pairs that touch, of domain d from begin[d]
    ends: np.ndarray  # (D, 3): ends of touching pairs within the domain, of all, and of `more`
    root: np.ndarray  # (N,) uint32: first disk of a disk's cluster within the domain,
    over: np.ndarray  # (N,) uint32: of these, parents; in the end, first disk of the whole cluster
    queue: np.ndarray  # (N,) uint32: of the search for clusters
    total: np.ndarray  # (N, D) sum of u over a cluster, at its first disk,
    size: np.ndarray  # (N,) int64: and its number of disks
    held: int

    @classmethod
    def room(cls, domains, n: int, held: int, with_normals: bool) -> "Graph":
        """Arrays for the contacts of n disks among the pairs of domains."""
        m, some, axes = len(domains.i), int(with_normals), len(domains.r0)
        return cls(
            domains.disks, domains.begin, np.empty((n, WIDTH), np.uint32), np.empty(n, np.uint32),
            np.empty((some * n, WIDTH, axes)), np.empty((2 * m, 2), np.uint32), np.empty((some * 2 * m, axes)),
            np.empty(m, np.uint32), np.empty((len(domains.begin), 3), np.int64),
            *np.empty((3, n), np.uint32), np.empty((n, axes)), np.empty(n, np.int64), held,
        )  # fmt: skip


@compiled(FAST, nogil=True, forceinline=True)
def find_contacts_of(domains, d, o, strain, graph):
    """Write the contacts of domain d into `graph`, at offsets o (N, D) and `strain`."""
    i, j, sigma, r0 = domains.i, domains.j, domains.sigma, domains.r0
    # taken out of their tuples, or their references would be counted at every access
    column, number, touching = graph.column, graph.number, graph.touching
    normals, more, more_normals = graph.normals, graph.more, graph.more_normals
    count = np.uint64(domains.begin[d])
    # Which pairs touch is hard to predict: they are collected without a branch.
    for part in range(2):
        first = np.uint64(domains.begin[d] if part == 0 else domains.across[d])
        for p in range(first, np.uint64(domains.across[d] if part == 0 else domains.end[d])):
            a, b = i[p], j[p]
            r = bond_vector(strain, entry(r0, p), difference(o, a, b, r0))
            touching[count] = p
            count += np.uint64(inner(r, r) < sigma[p] * sigma[p])
        graph.ends[d, part] = count
    first, last = np.uint64(graph.disks[d]), np.uint64(graph.disks[d + 1])
    number[first:last] = 0
    for a in range(first, last):
        for k in range(WIDTH):
            column[a, k] = a
    if len(normals):
        normals[first:last] = 0.0
    end = np.uint64(2 * graph.begin[d])
    inside = np.uint64(graph.ends[d, 0])
    n = zero(r0)
    for c in range(np.uint64(graph.begin[d]), count):
        p = touching[c]
        a, b = i[p], j[p]
        if len(normals):
            n = bond_vector(strain, entry(r0, p), difference(o, a, b, r0))
            n = scaled(1.0 / np.sqrt(inner(n, n)), n)
        for _ in range(2 if c < inside else 1):
            k = number[a]
            number[a] = k + np.uint32(1)
            if k < np.uint32(WIDTH):
                column[a, k] = b
                if len(normals):
                    set_row(normals[a], k, n)
            else:
                more[end, 0], more[end, 1] = a, b
                if len(normals):
                    set_row(more_normals, end, n)
                end += np.uint64(1)
            a, b = b, a
    graph.ends[d, 2] = end


@nested(FAST, forceinline=True)
def _add_third(graph, e, across, extra, x, y):
    """Third component of contact e of `more` in `multiply`."""
    a, b = graph.more[e, 0], graph.more[e, 1]
    d2 = x[a, 2] - x[b, 2]
    y2 = across * d2
    if len(graph.more_normals):
        n = graph.more_normals[e]
        stretch = n[0] * (x[a, 0] - x[b, 0]) + n[1] * (x[a, 1] - x[b, 1]) + n[2] * d2
        y2 += extra * stretch * n[2]
    y[a, 2] += y2
    return x[a, 2] * y2


@compiled(FAST, forceinline=True)
def multiply(graph, d, weights, hold, x, y, like):
    """y = (A + hold) x for the disks of domain d, x, y (N, D), zero for held ones; returns their part of x·y.

    like, here and below: a tuple of length D.
    """
    column, normals = graph.column, graph.normals
    along, across = weights[0], weights[1]
    extra = along - across
    first, last = graph.disks[d], graph.disks[d + 1]
    free = min(max(first, graph.held), last)
    y[first:free] = 0.0
    product = 0.0
    for a in range(np.uint64(free), np.uint64(last)):
        x0, x1 = x[a, 0], x[a, 1]
        s0 = s1 = 0.0
        if len(normals) == 0:
            for k in range(np.uint64(WIDTH)):
                b = column[a, k]
                s0 += x[b, 0]
                s1 += x[b, 1]
            s0 = across * (WIDTH * x0 - s0)
            s1 = across * (WIDTH * x1 - s1)
        else:
            for k in range(np.uint64(WIDTH)):
                b = column[a, k]
                d0, d1 = x0 - x[b, 0], x1 - x[b, 1]
                if len(like) == 3:
                    d2 = x[a, 2] - x[b, 2]
                    stretch = extra * (normals[a, k, 0] * d0 + normals[a, k, 1] * d1 + normals[a, k, 2] * d2)
                else:
                    stretch = extra * (normals[a, k, 0] * d0 + normals[a, k, 1] * d1)
                s0 += across * d0 + stretch * normals[a, k, 0]
                s1 += across * d1 + stretch * normals[a, k, 1]
        y0, y1 = s0 + hold * x0, s1 + hold * x1
        y[a, 0] = y0
        y[a, 1] = y1
        product += x0 * y0 + x1 * y1
        if len(like) == 3:
            x2 = x[a, 2]
            s2 = 0.0
            if len(normals) == 0:
                for k in range(np.uint64(WIDTH)):
                    s2 += x[column[a, k], 2]
                s2 = across * (WIDTH * x2 - s2)
            else:
                for k in range(np.uint64(WIDTH)):
                    b = column[a, k]
                    d2 = x2 - x[b, 2]
                    stretch = normals[a, k, 0] * (x0 - x[b, 0]) + normals[a, k, 1] * (x1 - x[b, 1])
                    stretch = extra * (stretch + normals[a, k, 2] * d2)
                    s2 += across * d2 + stretch * normals[a, k, 2]
            y2 = s2 + hold * x2
            y[a, 2] = y2
            product += x2 * y2
    for e in range(np.uint64(2 * graph.begin[d]), np.uint64(graph.ends[d, 2])):
        a, b = graph.more[e, 0], graph.more[e, 1]
        if a >= graph.held:
            d0, d1 = x[a, 0] - x[b, 0], x[a, 1] - x[b, 1]
            y0, y1 = across * d0, across * d1
            if len(like) == 3:
                product += _add_third(graph, e, across, extra, x, y)
            if len(normals):
                nx, ny = graph.more_normals[e, 0], graph.more_normals[e, 1]
                if len(like) == 3:
                    stretch = extra * (nx * d0 + ny * d1 + graph.more_normals[e, 2] * (x[a, 2] - x[b, 2]))
                else:
                    stretch = extra * (nx * d0 + ny * d1)
                y0 += stretch * nx
                y1 += stretch * ny
            y[a, 0] += y0
            y[a, 1] += y1
            product += x[a, 0] * y0 + x[a, 1] * y1
    return product


@compiled(FAST, forceinline=True)
def invert_diagonal(graph, d, weights, hold, inverse, like):
    """1 / diagonal of A + hold into the rows of domain d of `inverse` (N, D); 1 where no damping acts on a disk."""
    along, across = weights[0], weights[1]
    first, last, number = graph.disks[d], graph.disks[d + 1], graph.number
    for a in range(first, last):
        inverse[a, 0] = inverse[a, 1] = hold + across * float(number[a])
        if len(like) == 3:
            inverse[a, 2] = inverse[a, 0]
    if len(graph.normals):
        for a in range(first, last):
            for k in range(WIDTH):
                for axis in range(len(like)):
                    inverse[a, axis] += (along - across) * graph.normals[a, k, axis] ** 2
        for e in range(2 * graph.begin[d], graph.ends[d, 2]):
            for axis in range(len(like)):
                inverse[graph.more[e, 0], axis] += (along - across) * graph.more_normals[e, axis] ** 2
    for a in range(first, last):
        for axis in range(len(like)):
            inverse[a, axis] = 1.0 / inverse[a, axis] if inverse[a, axis] > 0.0 else 1.0


class Search(NamedTuple):
    """Work arrays of conjugate gradients."""

    q: np.ndarray  # (N, D) (A + hold) p
    p: np.ndarray  # (N, D) direction
    inverse: np.ndarray  # (N, D) 1 / diagonal
    sums: np.ndarray  # (2, domains, 3); two in turn: some threads still read the last ones
    rounding: np.ndarray  # (domains,) square of the residual that rounding leaves


@compiled(FAST, forceinline=True)
def solve(me, threads, counter, graph, weights, hold, residual, u, tolerance, search, like):
    """Add to u (N, D) the correction x with (A + hold) x = residual, all axes in one conjugate gradient.

    residual = b − (A + hold) u is overwritten; ends when |residual| ≤ tolerance |b|, or at `Search.rounding`: where
    forces cancel, as in a crystal, b is less than that. Preconditioned by the diagonal.
    Returns the number of iterations, −1 if SOLVES were not enough. By thread `me` of `threads`: see `packing.threads`.
    """
    number = len(graph.begin)
    own = range(me * number // threads, (me + 1) * number // threads)
    axes = np.uint64(len(like))  # flat: one loop over the coordinates of all axes
    x, r, q, p = u.reshape(-1), residual.reshape(-1), search.q.reshape(-1), search.p.reshape(-1)
    inverse, (sums, products) = search.inverse.reshape(-1), (search.sums[0], search.sums[1])
    for d in own:
        multiply(graph, d, weights, hold, u, search.q, like)
        invert_diagonal(graph, d, weights, hold, search.inverse, like)
        goal = rho = size = 0.0
        for a in range(axes * np.uint64(graph.disks[d]), axes * np.uint64(graph.disks[d + 1])):
            b = r[a] + q[a]
            goal += b * b
            size += r[a] * r[a]
            p[a] = inverse[a] * r[a]
            rho += p[a] * r[a]
        sums[d, 0], sums[d, 1], sums[d, 2] = size, rho, tolerance * tolerance * goal + search.rounding[d]
    meet(counter, threads)
    goal = rho = size = 0.0
    for d in range(number):
        size += sums[d, 0]
        rho += sums[d, 1]
        goal += sums[d, 2]
    for iteration in range(SOLVES):
        if size <= goal:
            return iteration
        for d in own:
            products[d, 0] = multiply(graph, d, weights, hold, search.p, search.q, like)
        meet(counter, threads)
        curvature = 0.0
        for d in range(number):
            curvature += products[d, 0]
        step = rho / curvature if curvature > 0.0 else 0.0
        for d in own:
            size = after = 0.0
            for a in range(axes * np.uint64(graph.disks[d]), axes * np.uint64(graph.disks[d + 1])):
                x[a] += step * p[a]
                left = r[a] - step * q[a]
                r[a] = left
                left *= left
                size += left
                after += left * inverse[a]
            sums[d, 0], sums[d, 1] = size, after
        meet(counter, threads)
        last, rho, size = rho, 0.0, 0.0
        for d in range(number):
            size += sums[d, 0]
            rho += sums[d, 1]
        beta = rho / last
        for d in own:
            for a in range(axes * np.uint64(graph.disks[d]), axes * np.uint64(graph.disks[d + 1])):
                p[a] = inverse[a] * r[a] + beta * p[a]
        meet(counter, threads)
    return -1

"""Velocities of disks that contacts hold to one another: the contact graph, its resistance matrix, its clusters.

Without inertia the viscous forces balance the elastic ones,

    (A + s) u = b,    A u = Σ_j [c_⊥ (u_i − u_j) + (c_∥ − c_⊥) n n·(u_i − u_j)] over the contacts of i,

b the forces at u = 0 (the affine flow moves contacts too) and s whatever holds a disk to the affine flow: drag,
friction, inertia over a time step. With s = 0 and both weights positive, A leaves one translation free for every
connected cluster, on which b sums to zero. The limit s → 0⁺ is then: mean u = 0 in each cluster, and a disk
without contacts follows the flow. Conjugate gradients solve the singular system as it is, from the last
velocities; the means are taken out afterwards, so no small number enters.

The first `held` disks, those of walls, keep u = 0: their rows are left out, and a cluster that touches one has no free
translation.
"""

import numba
import numpy as np

from jampetsc.contacts.kernel import FAST

SOLVES = 20_000  # iterations at most: far more than any tolerance above rounding takes


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_graph(pairs, o, shear, n, held, with_normals):
    """Contacts of every disk: (start (n + 1,), column (E,), normals (E, 2) or (0, 2), held).

    Row a has the disks column[start[a]:start[a + 1]]; pairs, o: see `bond_forces`, at no strain but `shear`.
    """
    i, j, r0, sigma = pairs
    r0x, r0y = r0[0], r0[1]
    m = np.uint64(len(j))
    rx, ry = np.empty(m), np.empty(m)
    # Which pairs touch is hard to predict: they are collected without a branch.
    touching, count = np.empty(m, np.uint32), np.uint64(0)
    for p in range(m):
        y = r0y[p] + (o[j[p], 1] - o[i[p], 1])
        x = r0x[p] + (o[j[p], 0] - o[i[p], 0]) + shear * y
        rx[p] = x
        ry[p] = y
        touching[count] = p
        count += np.uint64(x * x + y * y < sigma[p] * sigma[p])
    one = np.uint32(1)
    start = np.zeros(n + 1, np.uint32)
    for c in range(count):
        p = touching[c]
        start[i[p] + one] += one
        start[j[p] + one] += one
    for a in range(n):
        start[a + 1] += start[a]
    fill = start[:-1].copy()
    column = np.empty(start[n], np.uint32)
    normals = np.empty((start[n] if with_normals else np.uint32(0), 2))
    for c in range(count):
        p = touching[c]
        a, b = i[p], j[p]
        column[fill[a]] = b
        column[fill[b]] = a
        if with_normals:
            unit = 1.0 / np.sqrt(rx[p] * rx[p] + ry[p] * ry[p])
            for end in (a, b):
                normals[fill[end], 0] = unit * rx[p]
                normals[fill[end], 1] = unit * ry[p]
        fill[a] += one
        fill[b] += one
    return start, column, normals, held


def deepest_overlap(pairs, o, shear) -> float:
    """Largest δ/σ of all pairs, zero if none touches; arguments as for `contact_graph`."""
    i, j, r0, sigma = pairs
    x, y = r0 + (o[j] - o[i]).T
    return float(np.max(1.0 - np.hypot(x + shear * y, y) / sigma, initial=0.0))


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def resist(graph, weights, hold, x, y):
    """y = (A + hold) x for x, y (N, 2), zero for held disks; returns x·y. weights = (c_∥, c_⊥, …)."""
    start, column, normals, held = graph
    along, across = weights[0], weights[1]
    product = 0.0
    y[:held] = 0.0
    for a in range(np.uint64(held), np.uint64(len(x))):
        first, last = np.uint64(start[a]), np.uint64(start[a + np.uint64(1)])
        x0, x1 = x[a, 0], x[a, 1]
        s0 = s1 = 0.0
        if len(normals) == 0:
            for e in range(first, last):
                b = column[e]
                s0 += x[b, 0]
                s1 += x[b, 1]
            z = float(last - first)
            s0 = across * (z * x0 - s0)
            s1 = across * (z * x1 - s1)
        else:
            for e in range(first, last):
                b = column[e]
                d0, d1 = x0 - x[b, 0], x1 - x[b, 1]
                stretch = (along - across) * (normals[e, 0] * d0 + normals[e, 1] * d1)
                s0 += across * d0 + stretch * normals[e, 0]
                s1 += across * d1 + stretch * normals[e, 1]
        y0, y1 = s0 + hold * x0, s1 + hold * x1
        y[a, 0] = y0
        y[a, 1] = y1
        product += x0 * y0 + x1 * y1
    return product


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def inverse_diagonal(graph, weights, hold, n):
    """1 / diagonal of A + hold, (N, 2); 1 where that is zero: nothing acts on a disk without contacts."""
    start, _, normals, _ = graph
    along, across = weights[0], weights[1]
    inverse = np.empty((n, 2))
    for a in range(n):
        first, last = start[a], start[a + 1]
        for axis in range(2):
            value = hold + across * float(last - first)
            if len(normals):
                for e in range(first, last):
                    value += (along - across) * normals[e, axis] * normals[e, axis]
            inverse[a, axis] = 1.0 / value if value > 0.0 else 1.0
    return inverse


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def solve(graph, weights, hold, residual, u, tolerance):
    """Add to u (N, 2) the correction x with (A + hold) x = residual, both axes in one conjugate gradient.

    residual = b − (A + hold) u, overwritten, until |residual| ≤ tolerance |b|. Jacobi. Returns the number of
    iterations, −1 where SOLVES of them were not enough.
    """
    q, p = np.empty_like(u), np.empty_like(u)
    resist(graph, weights, hold, u, q)
    # one loop over both axes: what follows is done for all coordinates alike
    flat = 2 * len(u)
    x, r, qs, ps = u.reshape(flat), residual.reshape(flat), q.reshape(flat), p.reshape(flat)
    inverse = inverse_diagonal(graph, weights, hold, len(u)).reshape(flat)
    goal = rho = size = 0.0
    for a in range(flat):
        b = r[a] + qs[a]
        goal += b * b
        size += r[a] * r[a]
        ps[a] = inverse[a] * r[a]
        rho += ps[a] * r[a]
    goal *= tolerance * tolerance
    for iteration in range(SOLVES):
        if size <= goal:
            return iteration
        curvature = resist(graph, weights, hold, p, q)
        step = rho / curvature if curvature > 0.0 else 0.0
        last, rho, size = rho, 0.0, 0.0
        for a in range(flat):
            x[a] += step * ps[a]
            left = r[a] - step * qs[a]
            r[a] = left
            left *= left
            size += left
            rho += left * inverse[a]
        turn = rho / last
        for a in range(flat):
            ps[a] = inverse[a] * r[a] + turn * ps[a]
    return -1


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def centre_clusters(graph, u):
    """Take the mean of u (N, 2) out of every connected cluster, in place; returns (number, largest) of them.

    A disk without contacts is a cluster of one: its u becomes zero. Clusters with held disks keep theirs.
    """
    start, column, _, held = graph
    n = len(u)
    queue = np.empty(n, np.uint32)
    seen = np.zeros(n, np.bool_)
    number = largest = 0
    for root in range(n):
        if seen[root]:
            continue
        seen[root] = True
        queue[0] = root
        found, done = 1, 0
        anchored = root < held  # held disks come first: they are roots
        m0 = m1 = 0.0
        while done < found:
            a = queue[done]
            done += 1
            m0 += u[a, 0]
            m1 += u[a, 1]
            for e in range(start[a], start[a + np.uint32(1)]):
                b = column[e]
                if not seen[b]:
                    seen[b] = True
                    queue[found] = b
                    found += 1
        m0 /= found
        m1 /= found
        if not anchored:
            for c in range(found):
                u[queue[c], 0] -= m0
                u[queue[c], 1] -= m1
        number += 1
        largest = max(largest, found)
    return number, largest

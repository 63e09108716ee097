"""Connected clusters of touching disks, and removal of the mean velocity of each.

Each domain finds the clusters of its own disks; then clusters that touch across borders are united.
"""

import numpy as np

from jampetsc.flows.resistance import WIDTH, find_contacts_of
from jampetsc.packing.bond import bond_vector, difference, entry, inner, simple_shear
from jampetsc.packing.compiled import FAST, compiled, nested

NONE = np.uint32(2**32 - 1)


@compiled(False)
def find_clusters_of(graph, d, u, like):
    """Clusters of the disks of domain d by contacts within it, with their sums of u (N, D) and sizes, into `graph`.

    like: a tuple of length D
    """
    # taken out of their tuple, or their references would be counted at every access
    column, number, root, over, queue = graph.column, graph.number, graph.root, graph.over, graph.queue
    first, last = np.uint32(graph.disks[d]), np.uint32(graph.disks[d + 1])
    root[first:last] = NONE
    for start in range(first, last):
        if root[start] != NONE:
            continue
        root[start] = over[start] = queue[first] = start
        done, end = np.uint64(first), np.uint64(first) + np.uint64(1)
        m0 = m1 = m2 = 0.0
        while done < end:
            a = queue[done]
            done += np.uint64(1)
            m0 += u[a, 0]
            m1 += u[a, 1]
            if len(like) == 3:
                m2 += u[a, 2]
            for k in range(min(number[a], np.uint32(WIDTH))):
                b = column[a, k]
                if first <= b < last and root[b] == NONE:
                    root[b] = start
                    queue[end] = b
                    end += np.uint64(1)
        graph.total[start, 0], graph.total[start, 1] = m0, m1
        if len(like) == 3:
            graph.total[start, 2] = m2
        graph.size[start] = end - np.uint64(first)


@nested(False)
def _unite(over, a, b):
    while over[a] != a:
        a = over[a]
    while over[b] != b:
        b = over[b]
    over[max(a, b)] = min(a, b)


@compiled(False)
def unite_clusters(domains, graph):
    """Unite clusters that touch across borders of domains; returns (number of clusters, disks of the largest).

    Clusters with held disks are to keep their u: their sums become zero.
    """
    root, over, total, size = graph.root, graph.over, graph.total, graph.size
    for d in range(len(graph.begin)):
        for c in range(graph.ends[d, 0], graph.ends[d, 1]):
            p = graph.touching[c]
            _unite(over, root[domains.i[p]], root[domains.j[p]])
        for e in range(2 * graph.begin[d], graph.ends[d, 2]):
            _unite(over, root[graph.more[e, 0]], root[graph.more[e, 1]])
    number = largest = 0
    for a in range(len(root)):
        if root[a] == a:
            top = over[over[a]]  # over[a] ≤ a, so its own root is final already
            over[a] = top
            if top == a:
                number += 1
            else:
                for axis in range(total.shape[1]):
                    total[top, axis] += total[a, axis]
                size[top] += size[a]
            largest = max(largest, size[top])
    for a in range(graph.held):
        total[over[root[a]]] = 0.0
    return number, largest


@compiled(FAST, forceinline=True)
def centre_clusters_of(graph, d, u, like):
    """Subtract the mean of its cluster from u (N, D) for every disk of domain d; a disk without contacts gets u = 0."""
    root, over, total, size = graph.root, graph.over, graph.total, graph.size
    for a in range(graph.disks[d], graph.disks[d + 1]):
        top = over[root[a]]
        u[a, 0] -= total[top, 0] / size[top]
        u[a, 1] -= total[top, 1] / size[top]
        if len(like) == 3:
            u[a, 2] -= total[top, 2] / size[top]


@compiled(FAST)
def survey_of(domains, o, shear, graph):
    """(number of clusters, disks of the largest, largest δ/σ) at offsets o (N, D) and `shear`; overwrites `graph`."""
    i, j, sigma, r0 = domains.i, domains.j, domains.sigma, domains.r0
    strain, deepest = simple_shear(shear), 0.0
    for d in range(len(domains.begin)):
        find_contacts_of(domains, d, o, strain, graph)
        find_clusters_of(graph, d, o, r0)
        for c in range(domains.begin[d], graph.ends[d, 1]):
            p = graph.touching[c]
            a, b = i[p], j[p]
            r = bond_vector(strain, entry(r0, p), difference(o, a, b, r0))
            deepest = max(deepest, 1.0 - np.sqrt(inner(r, r)) / sigma[p])
    number, largest = unite_clusters(domains, graph)
    return number, largest, deepest

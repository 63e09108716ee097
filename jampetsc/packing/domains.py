"""Domains of a packing: compact ranges of disks, each of which one thread can work on without the others.

A domain writes forces on its own disks only (see `neighbour_list`). The borders depend on the number of disks alone, so
forces and their sums are the same to the last bit on any number of threads.
"""

import numpy as np

from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import Packing

# disks: domains begin at multiples of GRAIN, and arrays are padded to one; numba compiles it into loops over disks
GRAIN = 256
SIZE = 2048  # least disks of one domain of several: two to four of a hundred pairs then cross a border
MOST_DOMAINS = 64
EDGE = 0.6  # mean radii: a disk with a gap below this to a disk of another domain is at the border


def padded(n: int) -> int:
    """Length of arrays over n disks: the next multiple of GRAIN."""
    return -(-n // GRAIN) * GRAIN


def borders(n: int):
    """First disks of the domains of n disks, and the end, (D + 1,)."""
    number = min(max(1, n // SIZE), MOST_DOMAINS)
    return GRAIN * (padded(n) // GRAIN * np.arange(number + 1) // number)


def domain_order(packing: Packing, wall_disks: int = 0):
    """Order (N,) in which domains are compact patches, each with the disks at its border first.

    What a thread reads of disks across a border was written by another core, from which a cache line takes 50 to
    250 ns; disks that are adjacent in memory fill a quarter as many lines. The first `held` disks keep their places.
    """
    places = packing.positions[wall_disks:]
    order = np.append(np.arange(wall_disks), wall_disks + spatial_order(places, packing.cell))
    ends = borders(packing.n)
    domains = NeighbourList.build(packing.reordered(order), EDGE * float(np.mean(packing.radii)), ends)
    inside = np.ones(packing.n, bool)
    for across, end in zip(domains.across, domains.end, strict=True):
        inside[domains.i[across:end]] = False
    inside[:wall_disks] = False
    return order[np.lexsort((inside, np.searchsorted(ends, np.arange(packing.n), "right")))]

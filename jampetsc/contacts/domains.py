"""Contact forces by domains: compact ranges of disks, each of which one thread can work on without the others.

A pair within a domain is computed once and acts on both of its disks. A pair across a border is listed in both
domains, from the side of the own disk, and acts on that one only: a domain writes no forces but its own. Which
pairs are where depends on the number of disks alone, so forces and their sums are the same to the last bit on any
number of threads.
"""

from typing import NamedTuple

import numba
import numpy as np

from jampetsc.contacts.kernel import BLOCK, FAST, _block_forces
from jampetsc.contacts.pairs import PairList

GRAIN = 256  # disks: domains begin at multiples of it, and arrays are padded to one
SIZE = 2048  # disks per domain: two to four of a hundred pairs then cross a border
MOST = 64  # domains


class Domains(NamedTuple):
    """A pair list sorted by domain, as compiled code takes it; first within the domain, then across its borders."""

    disks: np.ndarray  # (D + 1,) int64: domain d has the disks disks[d] to disks[d + 1]
    begin: np.ndarray  # (D + 1,) int64: its pairs begin here,
    across: np.ndarray  # (D,) int64: and from here on i alone is its own
    i: np.ndarray  # (M',) uint32
    j: np.ndarray  # (M',) uint32
    r0: np.ndarray  # (2, M')
    sigma: np.ndarray  # (M',)

    @property
    def number(self) -> int:
        """How many domains there are."""
        return len(self.across)


def padded(n: int) -> int:
    """Length of arrays over n disks: the next multiple of GRAIN."""
    return -(-n // GRAIN) * GRAIN


def borders(n: int):
    """First disks of the domains of n disks, and the end, (D + 1,)."""
    number = min(max(1, n // SIZE), MOST)
    return GRAIN * (padded(n) // GRAIN * np.arange(number + 1) // number)


def into_domains(pairs: PairList, n: int) -> Domains:
    """The pairs of a half list of n disks by domain."""
    disks = borders(n)
    if len(disks) == 2:
        ends = np.array([0, len(pairs.i)])
        return Domains(disks, ends, ends[1:], pairs.i, pairs.j, pairs.r0, pairs.sigma)
    home_i, home_j = (np.searchsorted(disks, end, side="right") - 1 for end in (pairs.i, pairs.j))
    inner = np.flatnonzero(home_i == home_j)
    outer = np.flatnonzero(home_i != home_j)
    # 2 d: within domain d; 2 d + 1: across its border
    key = np.concatenate((2 * home_i[inner], 2 * home_i[outer] + 1, 2 * home_j[outer] + 1))
    order = np.argsort(key, kind="stable")
    ends = np.searchsorted(key[order], np.arange(len(disks) * 2 - 1))
    i = np.concatenate((pairs.i[inner], pairs.i[outer], pairs.j[outer]))[order]
    j = np.concatenate((pairs.j[inner], pairs.j[outer], pairs.i[outer]))[order]
    r0 = np.hstack((pairs.r0[:, inner], pairs.r0[:, outer], -pairs.r0[:, outer]))
    r0 = np.ascontiguousarray(r0[:, order])
    sigma = np.concatenate((pairs.sigma[inner], pairs.sigma[outer], pairs.sigma[outer]))[order]
    # whole arrays, as one domain has: numba would compile all that takes them once more for arrays with gaps
    return Domains(disks, ends[::2].copy(), ends[1::2].copy(), i, j, r0, sigma)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def domain_forces(domains, d, o, strain, shear, law, forces):
    """Net contact forces on the disks of domain d into their rows of `forces` (N, 2).

    o (N, 2) offsets; law = `Potential.constants`. Returns the domain's share of U and of Σ (f/r) r_x r_x,
    r_x r_y, r_y r_y. Three plain passes per block (gather, compute, scatter) without a branch: loops over the
    neighbours of each disk lose most of their time to mispredicted ends.
    """
    scale = np.exp(strain)
    mix = scale * shear
    i, j, sigma = domains.i, domains.j, domains.sigma
    r0x, r0y = domains.r0[0], domains.r0[1]
    bx = np.empty(BLOCK)
    by = np.empty(BLOCK)
    none = np.empty(1)
    energy = wxx = wxy = wyy = 0.0
    forces[domains.disks[d] : domains.disks[d + 1]] = 0.0
    for part in range(2):
        begin = np.uint64(domains.begin[d] if part == 0 else domains.across[d])
        last = np.uint64(domains.across[d] if part == 0 else domains.begin[d + 1])
        weight = 1.0 if part == 0 else 0.5  # a pair across a border is met again from its other side
        while begin < last:
            end = min(begin + np.uint64(BLOCK), last)
            for p in range(begin, end):
                a = i[p]
                b = j[p]
                bx[p - begin] = o[b, 0] - o[a, 0]
                by[p - begin] = o[b, 1] - o[a, 1]
            block = slice(begin, end)
            inside = slice(0, end - begin)
            x, y = bx[inside], by[inside]
            sums = _block_forces(
                r0x[block], r0y[block], sigma[block], x, y, none, scale, mix, law, None, None
            )
            energy += weight * sums[0]
            wxx += weight * sums[1]
            wxy += weight * sums[2]
            wyy += weight * sums[3]
            if part == 0:
                for p in range(begin, end):
                    a = i[p]
                    b = j[p]
                    wx = bx[p - begin]
                    wy = by[p - begin]
                    forces[b, 0] += wx
                    forces[b, 1] += wy
                    forces[a, 0] -= wx
                    forces[a, 1] -= wy
            else:
                for p in range(begin, end):
                    a = i[p]
                    forces[a, 0] -= bx[p - begin]
                    forces[a, 1] -= by[p - begin]
            begin = end
    return energy / (2.5 if law[1] else 2.0), wxx, wxy, wyy

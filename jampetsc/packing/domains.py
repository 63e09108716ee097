"""Contact forces by domains: compact ranges of disks, each of which one thread can work on without the others.

A pair within a domain is computed once and acts on both of its disks. A pair across a border is listed in both
domains, each time with the domain's own disk as i, and acts on i only: a domain writes forces on its own disks only.
The borders depend on the number of disks alone, so forces and their sums are the same to the last bit on any number of
threads.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.compiled import FAST, compiled
from jampetsc.packing.kernel import add_forces
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import Packing
from jampetsc.packing.pair_search import listed
from jampetsc.packing.pairs import PairList
from jampetsc.packing.threads import Team

GRAIN = 256  # disks: domains begin at multiples of GRAIN, and arrays are padded to one
SIZE = 2048  # least disks of one domain of several: two to four of a hundred pairs then cross a border
MOST_DOMAINS = 64
EDGE = 0.6  # mean radii: a disk with a gap below this to a disk of another domain is at the border


class Domains(NamedTuple):
    """A pair list sorted by domain, as compiled code takes it; first within the domain, then across its borders."""

    disks: np.ndarray  # (D + 1,) int64: domain d has the disks disks[d] … disks[d + 1] − 1
    begin: np.ndarray  # (D,) int64: its pairs begin here,
    across: np.ndarray  # (D,) int64: from here on only i is in the domain,
    end: np.ndarray  # (D,) int64: and here they end
    i: np.ndarray  # (M',) uint32; M' ≥ end[-1]: arrays are longer than the list
    j: np.ndarray  # (M',) uint32
    r0: np.ndarray  # (2, M')
    sigma: np.ndarray  # (M',)

    @classmethod
    def build(cls, disks: Packing, skin: float, borders, team: Team | None = None) -> "Domains":
        """All pairs of `disks` closer than σ + skin, by domains with these `borders` (D + 1,)."""
        counts, *pairs = listed(disks, skin, borders, team or Team())
        ends = counts.ravel().cumsum().reshape(-1, 2)
        return cls(borders, ends[:, 0] - counts[:, 0], ends[:, 0].copy(), ends[:, 1].copy(), *pairs)

    @property
    def pairs(self) -> PairList:
        """All listed pairs as one list; unlike a half list it has a pair across a border twice, once from each side."""
        return PairList(*(one[..., : self.end[-1]] for one in (self.i, self.j, self.r0, self.sigma)))

    def room(self) -> "Domains":
        """A copy of the same size with new arrays, which `choose_near` fills; `disks` and `begin` are shared."""
        return self._replace(**{name: np.empty_like(getattr(self, name)) for name in self._fields[2:]})

    @property
    def number(self) -> int:
        """How many domains there are."""
        return len(self.across)


def padded(n: int) -> int:
    """Length of arrays over n disks: the next multiple of GRAIN."""
    return -(-n // GRAIN) * GRAIN


def borders(n: int):
    """First disks of the domains of n disks, and the end, (D + 1,)."""
    number = min(max(1, n // SIZE), MOST_DOMAINS)
    return GRAIN * (padded(n) // GRAIN * np.arange(number + 1) // number)


def domain_order(disks: Packing, held: int = 0):
    """Order (N,) in which domains are compact patches, each with the disks at its border first.

    What a thread reads of disks across a border was written by another core, from which a cache line takes 50 to
    250 ns; disks that are adjacent in memory fill a quarter as many lines. The first `held` disks keep their places.
    """
    places = disks.positions[held:]
    order = np.append(np.arange(held), held + spatial_order(places, disks.cell))
    ends = borders(disks.n)
    domains = Domains.build(disks.reordered(order), EDGE * float(np.mean(disks.radii)), ends)
    inside = np.ones(disks.n, bool)
    for across, end in zip(domains.across, domains.end, strict=True):
        inside[domains.i[across:end]] = False
    inside[:held] = False
    return order[np.lexsort((inside, np.searchsorted(ends, np.arange(disks.n), "right")))]


@compiled(FAST, forceinline=True)
def domain_forces(domains, d, o, strain, shear, law, forces, motion, rolling, room):
    """Net forces on the disks of domain d into their rows of `forces`; returns the domain's Sums. See `bond_forces`.

    room: see `block_room`.
    """
    own = slice(domains.disks[d], domains.disks[d + 1])
    forces[own] = 0.0
    if rolling is not None:
        rolling[2][own] = 0.0
    pairs = domains.i, domains.j, domains.r0, domains.sigma
    ends = domains.begin[d], domains.across[d], domains.end[d]
    return add_forces(pairs, *ends, o, strain, shear, law, forces, motion, rolling, room)


@compiled(False)
def choose_near(domains, d, o, shear, skin, near):
    """Put the pairs of domain d that are closer than σ + skin at offsets o and `shear` into `near`, in order."""
    # local names: numba would count references at every access to a field of a tuple
    i, j, sigma, r0x, r0y = domains.i, domains.j, domains.sigma, domains.r0[0], domains.r0[1]
    to_i, to_j, to_sigma, to_x, to_y = near.i, near.j, near.sigma, near.r0[0], near.r0[1]
    count, across = np.uint64(domains.begin[d]), np.uint64(domains.across[d])
    # no branch, which would often be mispredicted: all are copied, and only near ones advance the count
    for p in range(np.uint64(domains.begin[d]), np.uint64(domains.end[d])):
        if p == across:
            near.across[d] = count
        a, b = i[p], j[p]
        y = r0y[p] + (o[b, 1] - o[a, 1])
        x = r0x[p] + (o[b, 0] - o[a, 0]) + shear * y
        reach = sigma[p] + skin
        to_i[count], to_j[count], to_sigma[count] = a, b, sigma[p]
        to_x[count], to_y[count] = r0x[p], r0y[p]
        count += np.uint64(x * x + y * y < reach * reach)
    near.end[d] = count
    if domains.across[d] == domains.end[d]:
        near.across[d] = count

"""The neighbour list: nearby pairs frozen between rebuilds, by domains; the rule for when it is stale; a packing that
moves while a list serves it.

A list holds r0 = x_j − x_i + image · cell of every pair closer than σ + skin, rounded once from the split
coordinates. Until the next list disks move by small offsets o, and the whole cell by F = 1 + E (see `strain`), so
that a bond is

    r = F (r0 + o_j − o_i)

with neither images nor large coordinates: forces are exact to the rounding of r ~ d whatever the size of the
cell. In a quench F = e^ε [[1, g], [0, 1]]; under steady shear ε = 0 and g = γ − γ_ref. Components of r0 are a tuple of
D arrays, whose length tells compiled loops the dimension.

Staleness. Two disks that touch now, |r| ≤ σ, had r0 = F⁻¹ r − (o_j − o_i), hence

    |r0| ≤ ‖F⁻¹‖ σ + 2 max|o|,

‖F⁻¹‖ the largest singular value of F⁻¹. So no touching pair is missing from the list while, with σ_max the largest σ,

    2 max|o| + max(0, ‖F⁻¹‖ − 1) σ_max ≤ skin.

Inner list. Forces need not go through all of a wide list: its pairs that are now within a thinner skin suffice
for a while, by the same rule. With r and F of now, r' and F' of later,

    r = (F' F⁻¹)⁻¹ r' − F (Δo_j − Δo_i),

so |Δo| counts ‖F‖ times, and the strain F' F⁻¹ as for a list.

Domains are compact ranges of disks, each of which one thread can work on without the others: it writes forces on its
own disks only. Borders depend on the number of disks alone, so forces and their sums are the same to the last bit on
any number of threads. A pair within a domain is listed once. A pair across a border is listed in both domains, each
time with the domain's own disk as i. A half list is that of a single domain.
"""

import math
from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import bond_vector, difference, entry, inner, norms, put, strain_between
from jampetsc.packing.compiled import compiled
from jampetsc.packing.neighbours import lengths, spatial_order
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.pair_search import listed
from jampetsc.packing.strain import UNSTRAINED, Strain
from jampetsc.packing.threads import Team

# disks: domains begin at multiples of GRAIN, and arrays are padded to one; numba compiles it into loops over disks
GRAIN = 256
MIN_DOMAIN_SIZE = 2048  # disks of one domain of several: two to four of a hundred pairs then cross a border
MAX_DOMAINS = 64
BORDER_GAP = 0.6  # mean radii: a disk with a gap below this to a disk of another domain is at the border
MAX_STEP_RATIO = 3.0  # distance of consecutive disks in an order good for domains, over V/N to the power 1/D
SKIN_START = 0.3  # skin of the first list in units of d
SKIN_RANGE = (0.02, 0.5)  # limits of later skins in units of d
REBUILD_COST = 10.0  # cost of a new list in evaluations of forces
SKIN_COST = 0.6  # relative rise of the cost of an evaluation per skin/d


class NeighbourList(NamedTuple):
    """Pairs sorted by domain, in it by i; first those within the domain, then those across its borders."""

    disks: np.ndarray  # (D + 1,) int64: domain d has the disks disks[d] … disks[d + 1] − 1
    begin: np.ndarray  # (D,) int64: its pairs begin here,
    across: np.ndarray  # (D,) int64: from here on only i is in the domain,
    end: np.ndarray  # (D,) int64: and here they end
    i: np.ndarray  # (M,) uint32: unsigned, so that loops are compiled without code for negative indices
    j: np.ndarray  # (M,) uint32
    r0: tuple  # D arrays (M,)
    sigma: np.ndarray  # (M,) ρ_i + ρ_j

    @classmethod
    def build(cls, packing: Packing, skin: float, borders=None, team: Team | None = None) -> "NeighbourList":
        """All pairs closer than σ + skin, in domains with these `borders` (D + 1,); by default in one.

        With borders the arrays may be longer than the list; see `trimmed`.
        """
        whole = np.array([0, packing.n]) if borders is None else borders
        counts, i, j, r0, sigma = listed(packing, skin, whole, team or Team())
        ends = counts.ravel().cumsum().reshape(-1, 2)
        result = cls(
            whole, ends[:, 0] - counts[:, 0], ends[:, 0].copy(), ends[:, 1].copy(), i, j, tuple(r0), sigma
        )
        return result.trimmed() if borders is None else result

    @classmethod
    def of_pairs(cls, n: int, i, j, r0, sigma) -> "NeighbourList":
        """A list in one domain of n disks of given pairs, arrays and tuple of arrays as above."""
        begin, end = np.zeros(1, np.int64), np.array([len(i)])
        i, j, sigma = (np.ascontiguousarray(array) for array in (i, j, sigma))
        r0 = tuple(np.ascontiguousarray(component) for component in r0)
        return cls(np.array([0, n]), begin, end, end.copy(), i, j, r0, sigma)

    def trimmed(self) -> "NeighbourList":
        """The same list with arrays as long as it; lists of several domains have a pair across a border twice."""
        i, j, sigma, *r0 = (array[: self.end[-1]] for array in (self.i, self.j, self.sigma, *self.r0))
        return self._replace(i=i, j=j, r0=tuple(r0), sigma=sigma)

    def room(self) -> "NeighbourList":
        """New arrays of the same size, which `choose_inner_list` fills with an inner list."""
        arrays = {name: np.empty_like(getattr(self, name)) for name in self._fields[2:] if name != "r0"}
        return self._replace(r0=tuple(np.empty_like(component) for component in self.r0), **arrays)

    @property
    def number(self) -> int:
        """How many domains there are."""
        return len(self.across)


@compiled(False)
def is_stale(far, strain, largest, skin):
    """Whether a list may miss a touching pair: far = max |o|, `strain` since the list, largest = σ_max."""
    squeeze = norms(strain)[0]
    return 2.0 * far + max(squeeze - 1.0, 0.0) * largest > skin


@compiled(False)
def inner_list_is_stale(moved, strain, earlier, largest, skin):
    """Whether an inner list within `skin`, chosen at a strain `earlier`, may miss a contact; moved = max |Δo| since."""
    return is_stale(norms(earlier)[1] * moved, strain_between(strain, earlier), largest, skin)


@compiled(False)
def choose_inner_list(domains, d, o, strain, skin, near):
    """Put the pairs of domain d that are closer than σ + skin at offsets o and `strain` into `near`, in order."""
    # local names: numba would count references at every access to a field of a tuple
    i, j, sigma, r0 = domains.i, domains.j, domains.sigma, domains.r0
    to_i, to_j, to_sigma, to_r0 = near.i, near.j, near.sigma, near.r0
    count, across = np.uint64(domains.begin[d]), np.uint64(domains.across[d])
    # no branch, which would often be mispredicted: all are copied, and only near ones advance the count
    for p in range(np.uint64(domains.begin[d]), np.uint64(domains.end[d])):
        if p == across:
            near.across[d] = count
        a, b = i[p], j[p]
        listed_bond = entry(r0, p)
        r = bond_vector(strain, listed_bond, difference(o, a, b, r0))
        reach = sigma[p] + skin
        to_i[count], to_j[count], to_sigma[count] = a, b, sigma[p]
        put(to_r0, count, listed_bond)
        count += np.uint64(inner(r, r) < reach * reach)
    near.end[d] = count
    if domains.across[d] == domains.end[d]:
        near.across[d] = count


def padded(n: int) -> int:
    """Length of arrays over n disks: the next multiple of GRAIN."""
    return -(-n // GRAIN) * GRAIN


def borders(n: int):
    """First disks of the domains of n disks, and the end, (D + 1,)."""
    number = min(max(1, n // MIN_DOMAIN_SIZE), MAX_DOMAINS)
    return GRAIN * (padded(n) // GRAIN * np.arange(number + 1) // number)


def is_scattered(packing: Packing) -> bool:
    """Whether the disks of domains are all over the cell, as in files that other programs have written."""
    if len(borders(packing.n)) == 2:
        return False
    steps = lengths(np.diff(packing.positions, axis=0))
    return bool(np.median(steps) > MAX_STEP_RATIO * (packing.volume / packing.n) ** (1.0 / packing.dimension))


def domain_order(packing: Packing, wall_disks: int = 0):
    """Order (N,) in which domains are compact patches, each with the disks at its border first.

    What a thread reads of disks across a border was written by another core, from which a cache line takes 50 to
    250 ns; disks that are adjacent in memory fill a quarter as many lines. Disks of walls, the first
    ones, keep their places.
    """
    places = packing.positions[wall_disks:]
    order = np.append(np.arange(wall_disks), wall_disks + spatial_order(places, packing.cell))
    ends = borders(packing.n)
    domains = NeighbourList.build(packing.reordered(order), BORDER_GAP * float(np.mean(packing.radii)), ends)
    inside = np.ones(packing.n, bool)
    for across, end in zip(domains.across, domains.end, strict=True):
        inside[domains.i[across:end]] = False
    inside[:wall_disks] = False
    return order[np.lexsort((inside, np.searchsorted(ends, np.arange(packing.n), "right")))]


def tuned_skin(skin: float, steps: float, diameter: float, rebuild: float = REBUILD_COST) -> float:
    """Skin of the next list when the last one served for `steps` evaluations; lengths in one unit.

    With steps = v skin, and `rebuild` the cost of a list, an evaluation costs 1 + c skin/d + rebuild/(v skin) with
    c = SKIN_COST, which is least at skin² = rebuild d/(c v). The result is kept in SKIN_RANGE and within half to 1.5
    times `skin`.
    """
    best = math.sqrt(rebuild / SKIN_COST * diameter * skin / max(steps, 1))
    narrowest, widest = (limit * diameter for limit in SKIN_RANGE)
    return min(max(best, 0.5 * skin, narrowest), 1.5 * skin, widest)


class ListedPacking:
    """A packing with a list of its pairs: `reference` as it was listed, moved since by `offsets` (N, D), `cell_strain`.

    skin: of the first list, in mean diameters; team: the threads that make lists
    """

    def __init__(self, packing: Packing, skin: float = SKIN_START, team: Team | None = None):
        self.team = team or Team()
        self.diameter = 2.0 * float(np.mean(packing.radii))
        self.largest = 2.0 * float(packing.radii.max())  # σ_max
        self.skin = skin * self.diameter
        self.list(packing)

    def list(self, packing: Packing):
        """Take a packing as the reference of a new list."""
        self.reference, self._pairs = packing, None
        self.offsets = np.zeros(packing.base.shape)

    @property
    def pairs(self) -> NeighbourList:
        """The half list of the reference, made at the first access."""
        if self._pairs is None:
            self._pairs = NeighbourList.build(self.reference, self.skin)
        return self._pairs

    def fold(self):
        """Make the packing as it is now the reference of a new list."""
        self.list(self.disks)

    @property
    def cell_strain(self) -> Strain:
        """Strain of the cell since the list was made; none here."""
        return UNSTRAINED

    @property
    def disks(self) -> Packing:
        """The packing as it is now."""
        return deformed(self.reference, self.offsets, self.cell_strain)

    def stale(self, far: float | None = None) -> bool:
        """Whether the list may miss a contact; far = max |o|, computed if it is not given."""
        if far is None:
            far = float(lengths(self.offsets).max())
        return bool(is_stale(far, self.cell_strain, self.largest, self.skin))

    def tune(self, steps: float, rebuild: float = REBUILD_COST):
        """Choose the skin of the next list when this one served for `steps` evaluations: see `tuned_skin`."""
        self.skin = tuned_skin(self.skin, steps, self.diameter, rebuild)

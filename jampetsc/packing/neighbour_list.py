"""The neighbour list: nearby pairs frozen between rebuilds, by domains, and the one rule for when it is stale.

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

Inner list. Forces need not go through all of a wide list: those of its pairs that are now within a thinner skin suffice
for a while, by the same rule. With r and F of now, r' and F' of later,

    r = (F' F⁻¹)⁻¹ r' − F (Δo_j − Δo_i),

so |Δo| counts ‖F‖ times, and the strain F' F⁻¹ as that of a list does.

Domains are compact ranges of disks, each of which one thread can work on without the others. A pair within a domain is
listed once. A pair across a border is listed in both domains, each time with the domain's own disk as i. A half list
is that of a single domain.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import bond_vector, difference, entry, inner, norms, put, strain_between
from jampetsc.packing.compiled import compiled
from jampetsc.packing.packing import Packing
from jampetsc.packing.pair_search import listed
from jampetsc.packing.threads import Team


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
        """The same list with arrays as long as it; those of several domains have a pair across a border twice."""
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

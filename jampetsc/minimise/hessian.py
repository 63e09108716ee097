"""The exact Hessian of the enthalpy, in moves o of the disks and a strain of the cell from where they are now.

Bonds become e^ε [[1, g], [0, 1]] (r + o_j − o_i). With M = k n nᵀ − (f/r) t tᵀ (BT eqs. 4, 11) and s = (r_y, 0):

    ∂²H/∂o∂o   blocks M                      ∂²H/∂ε²   Σ (k r² − f r) + 4 p V
    ∂²H/∂o∂ε   Σ (k r − f) n                 ∂²H/∂g²   Σ sᵀ M s
    ∂²H/∂o∂g   Σ M s − f (0, n_x)            ∂²H/∂ε∂g  Σ (k r − f) n_x r_y
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.laws.relative_motion import linear_forms, squares
from jampetsc.packing.compiled import compiled
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.strain import UNSTRAINED, Strain, bond_vector


@dataclass(frozen=True, eq=False)
class Bonds:
    """Forces and stiffnesses of all listed pairs, zero for those that do not touch."""

    pairs: NeighbourList
    r: np.ndarray  # (2, M)
    normal: np.ndarray  # (2, M)
    distance: np.ndarray  # (M,)
    overlap: np.ndarray  # (M,) negative for gaps
    force: np.ndarray  # (M,)
    stiffness: np.ndarray  # (M,)

    @classmethod
    def of(cls, pairs: NeighbourList, potential, offsets=None, strain: Strain = UNSTRAINED) -> "Bonds":
        """State of the listed pairs after offsets (N, 2) and a strain of the cell since the list."""
        moved = np.zeros(len(pairs.r0)) if offsets is None else (offsets[pairs.j] - offsets[pairs.i]).T
        r = np.stack(bond_vector(strain, pairs.r0, moved))
        distance = np.hypot(r[0], r[1])
        overlap = pairs.sigma - distance
        touching = overlap > 0
        depth = np.where(touching, overlap, 0.0)
        force = potential.force(depth, pairs.sigma)
        stiffness = np.where(touching, potential.contact_stiffness(depth, pairs.sigma), 0.0)
        return cls(pairs, r, r / distance, distance, overlap, force, stiffness)

    def only(self, bearing) -> "Bonds":
        """The same with the forces and stiffnesses of the bonds in the mask (M,) alone."""
        return replace(self, force=self.force * bearing, stiffness=self.stiffness * bearing)

    def squares(self):
        """M of each bond and its derivatives by a shear strain: see `forms.squares`."""
        weights = np.column_stack((self.stiffness, -self.force / self.distance))
        return squares(linear_forms(self.normal.T, self.r[1]), weights)

    def on_disks(self, bond_forces, n):
        """Sum over pairs of the forces (2, M) on j, and of their opposites on i, (N, 2)."""
        return gathered(np.concatenate((-bond_forces, bond_forces)).T, self.pairs.i, self.pairs.j, n)


def gathered(ends, i, j, n: int):
    """Sums (N, dofs) of what bonds (M, 2 dofs) do to both of their disks."""
    dofs = ends.shape[1] // 2
    total = np.empty((n, dofs))
    for axis in range(dofs):
        total[:, axis] = np.bincount(i, ends[:, axis], minlength=n)
        total[:, axis] += np.bincount(j, ends[:, dofs + axis], minlength=n)
    return total


class Pattern:
    """Upper triangle, as CSR, of a matrix with a block of order `dofs` for every disk and every listed pair, i < j.

    diagonal    (N, dofs) positions of the rows' diagonal entries in the values
    """

    def __init__(self, pairs, n: int, dofs: int = 2):
        self._i, self._j = pairs.i, pairs.j
        key = pairs.i.astype(np.int64) * n + pairs.j
        unique, slot = np.unique(key, return_inverse=True)  # one block for all images of a pair
        i, j = unique // n, (unique % n).astype(np.int32)
        count = np.bincount(i, minlength=n)
        own = dofs - np.arange(dofs)  # entries in each row of a disk's own block
        self.indptr = np.zeros(dofs * n + 1, np.int32)
        np.cumsum((own + dofs * count[:, None]).ravel(), out=self.indptr[1:])
        self.diagonal = self.indptr[:-1].reshape(n, dofs).astype(np.int64)
        place = np.arange(len(unique)) - (np.cumsum(count) - count)[i]
        blocks = self.diagonal[i] + own + dofs * place[:, None]  # where their rows begin
        self.indices = np.empty(self.indptr[-1], np.int32)
        for x in range(dofs):
            for y in range(dofs):
                self.indices[blocks[:, x] + y] = dofs * j + y
                if y >= x:
                    self.indices[self.diagonal[:, x] + y - x] = dofs * np.arange(n) + y
        self._blocks = blocks[slot]  # (M, dofs)

    def sum(self, on_i, on_j, across, free):
        """Values of the sum of blocks (M, dofs, dofs), `across` in the rows of i; none of disks not in `free`."""
        values = np.zeros(self.indptr[-1])
        _sum(values, self._i, self._j, on_i, on_j, across, free, self.diagonal, self._blocks)
        return values

    def fill(self, bonds: Bonds, free, shift=0.0):
        """Values of K + shift for the disks in the mask `free`; unit rows for the others. (nonzeros,)"""
        own, across, *_ = bonds.squares()
        across[:, 1, 0] = across[:, 0, 1]  # symmetric to the last digit
        values = self.sum(own, own, across, free)
        values[self.diagonal[free]] += shift
        values[self.diagonal[~free]] = 1.0
        return values


@compiled(False)
def _sum(values, i, j, on_i, on_j, across, free, diagonal, blocks):
    dofs = diagonal.shape[1]
    for p in range(len(i)):
        a, b = i[p], j[p]
        for x in range(dofs):
            for y in range(x, dofs):
                if free[a]:
                    values[diagonal[a, x] + y - x] += on_i[p, x, y]
                if free[b]:
                    values[diagonal[b, x] + y - x] += on_j[p, x, y]
            if free[a] and free[b]:
                for y in range(dofs):
                    values[blocks[p, x] + y] += across[p, x, y]


def border(bonds: Bonds, n: int, area: float, pressure: float):
    """(∂²H/∂o∂(ε, g), ∂²H/∂(ε, g)²): (N, 2, 2) with the last axis ε, g, and (2, 2)."""
    nx, r, f, k = bonds.normal[0], bonds.distance, bonds.force, bonds.stiffness
    _, _, sheared, stiffness = bonds.squares()  # −M s and sᵀ M s
    strain_row = bonds.on_disks((k * r - f) * bonds.normal, n)
    shear_row = bonds.on_disks(-sheared.T - np.stack((np.zeros_like(f), f * nx)), n)
    mixed = np.sum((k * r - f) * nx * bonds.r[1])
    corner = np.array(
        [
            [np.sum(k * r * r - f * r) + 4.0 * pressure * area, mixed],
            [mixed, np.sum(stiffness)],
        ]
    )
    return np.stack((strain_row, shear_row), axis=-1), corner

"""The exact Hessian of the enthalpy, in moves o of the disks and strains of the cell from where they are now.

Bonds become e^ε (1 + g) (r + o_j − o_i), with shears g_ab of the axes a < b, see `strain.cell_strain`. With
M = k n nᵀ − (f/r) (1 − n nᵀ) (BT eqs. 4, 11) and s_ab = r_b x̂_a:

    ∂²H/∂o∂o       blocks M                        ∂²H/∂ε²            Σ (k r² − f r) + D² p V
    ∂²H/∂o∂ε       Σ (k r − f) n                   ∂²H/∂g_ab ∂g_cd    Σ s_abᵀ M s_cd
    ∂²H/∂o∂g_ab    Σ M s_ab − f n_a x̂_b            ∂²H/∂ε∂g_ab        Σ (k r − f) n_a r_b
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.laws.forms import CENTRAL_FORMS
from jampetsc.laws.relative_motion import linear_forms, squares, transverse_axes
from jampetsc.packing.compiled import compiled
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.strain import UNSTRAINED, Strain, bond_vector


@dataclass(frozen=True, eq=False)
class Bonds:
    """Forces and stiffnesses of all listed pairs, zero for those that do not touch."""

    pairs: NeighbourList
    r: np.ndarray  # (D, M)
    normal: np.ndarray  # (D, M)
    distance: np.ndarray  # (M,)
    overlap: np.ndarray  # (M,) negative for gaps
    force: np.ndarray  # (M,)
    stiffness: np.ndarray  # (M,)

    @classmethod
    def of(cls, pairs: NeighbourList, potential, offsets=None, strain: Strain = UNSTRAINED) -> "Bonds":
        """State of the listed pairs after offsets (N, D) and a strain of the cell since the list."""
        moved = np.zeros(len(pairs.r0)) if offsets is None else (offsets[pairs.j] - offsets[pairs.i]).T
        r = np.stack(bond_vector(strain, pairs.r0, moved))
        distance = lengths(r.T)
        overlap = pairs.sigma - distance
        touching = overlap > 0
        depth = np.where(touching, overlap, 0.0)
        force = potential.force(depth, pairs.sigma)
        stiffness = np.where(touching, potential.contact_stiffness(depth, pairs.sigma), 0.0)
        return cls(pairs, r, r / distance, distance, overlap, force, stiffness)

    def only(self, bearing) -> "Bonds":
        """The same with the forces and stiffnesses of the bonds in the mask (M,) alone."""
        return replace(self, force=self.force * bearing, stiffness=self.stiffness * bearing)

    @property
    def dimension(self) -> int:
        """D."""
        return len(self.r)

    @property
    def weights(self):
        """k and −f/r of the normal and of the D − 1 transverse motions, (M, D)."""
        return np.column_stack((self.stiffness, *[-self.force / self.distance] * (self.dimension - 1)))

    def squares(self):
        """M of each bond and −M, (M, D, D) each: see `relative_motion.squares`."""
        return squares(linear_forms(CENTRAL_FORMS, self.normal.T), self.weights)

    def on_disks(self, bond_forces, n):
        """Sum over pairs of the forces (D, M) on j, and of their opposites on i, (N, D)."""
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

    def own_blocks(self, values, disks):
        """Lower triangles of the blocks of a mask of disks with themselves in the values, (n, dofs, dofs)."""
        diagonal = self.diagonal[disks]
        dofs = diagonal.shape[1]
        blocks = np.zeros((len(diagonal), dofs, dofs))
        for x in range(dofs):
            for y in range(x, dofs):
                blocks[:, y, x] = values[diagonal[:, x] + y - x]
        return blocks

    def fill(self, bonds: Bonds, free, shift=0.0):
        """Values of K + shift for the disks in the mask `free`; unit rows for the others. (nonzeros,)"""
        own, across = bonds.squares()
        for a, b in itertools.combinations(range(bonds.dimension), 2):
            across[:, b, a] = across[:, a, b]  # symmetric to the last digit
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


def border(bonds: Bonds, n: int, volume: float, pressure: float):
    """Second derivatives by moves and strains of the cell (N, D, C), and by two strains (C, C).

    The C strains are as in `strain.cell_strain`: ε and the shears.
    """
    r, f, k, weights = bonds.distance, bonds.force, bonds.stiffness, bonds.weights.T
    forms = [bonds.normal.T, *transverse_axes(bonds.normal.T)]
    planes = list(itertools.combinations(range(bonds.dimension), 2))
    corner = np.zeros((1 + len(planes),) * 2)
    corner[0, 0] = np.sum(k * r * r - f * r) + bonds.dimension**2 * pressure * volume
    rows, loads = [bonds.on_disks((k * r - f) * bonds.normal, n)], []
    for load, (a, b) in enumerate(planes, 1):
        loads.append([axis[:, a] * bonds.r[b] for axis in forms])
        sheared = np.zeros_like(bonds.r)
        for axis, weight, motion in zip(forms, weights, loads[-1], strict=True):
            sheared += weight * axis.T * motion
        sheared[b] -= f * bonds.normal[a]
        rows.append(bonds.on_disks(sheared, n))
        corner[0, load] = corner[load, 0] = np.sum((k * r - f) * bonds.normal[a] * bonds.r[b])
        for other, motions in enumerate(loads, 1):
            squares_of = [
                w * (load * motion) for w, load, motion in zip(weights, loads[-1], motions, strict=True)
            ]
            corner[load, other] = corner[other, load] = np.sum(sum(squares_of))
    return np.stack(rows, axis=-1), corner

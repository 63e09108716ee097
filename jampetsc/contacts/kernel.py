"""Contact forces of a quench: a pair list frozen between rebuilds, and the compiled loop over it.

A list holds r0 = x_j − x_i + image · cell of every nearby pair, rounded once from the split coordinates.
Until the next rebuild disks move by small offsets o and the whole cell by F = e^ε [[1, g], [0, 1]]. A bond is

    r = F (r0 + o_j − o_i)

with neither images nor large coordinates: forces are exact to the rounding of r ~ d whatever the size of the
cell.
"""

from dataclasses import dataclass

import numba
import numpy as np

from jampetsc.contacts.disks import Disks, split
from jampetsc.contacts.neighbours import neighbour_pairs
from jampetsc.contacts.state import bond_vectors

BLOCK = 1024  # pairs worked on at a time: their temporaries stay in the first-level cache


@dataclass(frozen=True, eq=False)
class PairList:
    """Half list of the M pairs closer than σ + skin, sorted by i."""

    i: np.ndarray  # (M,) uint32: unsigned, so that compiled code need not think of negative indices
    j: np.ndarray  # (M,) uint32
    r0: np.ndarray  # (2, M)
    sigma: np.ndarray  # (M,) ρ_i + ρ_j
    skin: float

    @classmethod
    def build(cls, disks: Disks, skin: float) -> "PairList":
        """All pairs of `disks` closer than σ + skin."""
        i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, skin=skin)
        r0 = np.ascontiguousarray(bond_vectors(disks, i, j, image).T)
        return cls(i.astype(np.uint32), j.astype(np.uint32), r0, disks.radii[i] + disks.radii[j], skin)


def law_constants(potential):
    """(k, hertzian, scaled): the potential as the compiled loops take it."""
    return potential.k, potential.kind == "hertzian", potential.stiffness == "inverse-square-diameter"


def deformed(disks: Disks, offsets, strain, shear) -> Disks:
    """The disks at F (x + o), with F = e^strain [[1, shear], [0, 1]].

    Only the change is rounded, never the coordinates: base + (offset + o) + (F − 1)(x + o).
    """
    growth = np.expm1(strain)
    mixing = np.exp(strain) * shear

    def change(x):
        delta = growth * x
        delta[:, 0] += mixing * x[:, 1]
        return delta

    moved = disks.offset + offsets
    base, offset = split(disks.base, moved + change(disks.base + moved))
    cell_base, cell_offset = split(disks.cell_base, disks.cell_offset + change(disks.cell))
    return Disks(base, offset, disks.radii, cell_base, cell_offset, disks.potential, disks.record)


# Sums may be reordered and multiplications fused: that lets the compiler use its widest vectors.
FAST = {"reassoc", "contract", "nsz", "arcp", "nnan", "ninf"}


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _bond_forces(r0x, r0y, sigma, bx, by, scale, mix, k, hertzian, scaled):
    """Turn o_j − o_i in (bx, by) into the forces on j, for one block of pairs: no branches, no indices."""
    energy = wxx = wxy = wyy = 0.0
    for q in range(len(bx)):
        dy = r0y[q] + by[q]
        rx = scale * (r0x[q] + bx[q]) + mix * dy
        ry = scale * dy
        r = np.sqrt(rx * rx + ry * ry)
        d = sigma[q] - r
        d = d if d > 0.0 else 0.0
        unit = 1.0 / sigma[q] if scaled else 1.0
        f = k * unit * unit * d
        if hertzian:
            f *= np.sqrt(unit * d)
        energy += f * d
        w = f / r
        wx = w * rx
        wy = w * ry
        wxx += wx * rx
        wxy += wx * ry
        wyy += wy * ry
        bx[q] = wx
        by[q] = wy
    return energy, wxx, wxy, wyy


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def pair_forces(i, j, r0, sigma, o, strain, shear, law, forces):
    """Net contact forces into `forces` (N, 2); returns U and Σ (f/r) r_x r_x, r_x r_y, r_y r_y.

    i, j, r0, sigma: a PairList; o (N, 2) offsets; law = `law_constants(potential)`. Three plain passes per
    block (gather, compute, scatter) without a branch: loops over the neighbours of each disk lose most of
    their time to mispredicted ends.
    """
    k, hertzian, scaled = law
    scale = np.exp(strain)
    mix = scale * shear
    r0x, r0y = r0[0], r0[1]
    bx = np.empty(BLOCK)
    by = np.empty(BLOCK)
    energy = wxx = wxy = wyy = 0.0
    forces[:] = 0.0
    pairs = np.uint64(len(j))
    begin = np.uint64(0)
    while begin < pairs:
        end = min(begin + np.uint64(BLOCK), pairs)
        for p in range(begin, end):
            a = i[p]
            b = j[p]
            bx[p - begin] = o[b, 0] - o[a, 0]
            by[p - begin] = o[b, 1] - o[a, 1]
        block = slice(begin, end)
        sums = _bond_forces(
            r0x[block],
            r0y[block],
            sigma[block],
            bx[: end - begin],
            by[: end - begin],
            scale,
            mix,
            k,
            hertzian,
            scaled,
        )
        energy += sums[0]
        wxx += sums[1]
        wxy += sums[2]
        wyy += sums[3]
        for p in range(begin, end):
            a = i[p]
            b = j[p]
            wx = bx[p - begin]
            wy = by[p - begin]
            forces[b, 0] += wx
            forces[b, 1] += wy
            forces[a, 0] -= wx
            forces[a, 1] -= wy
        begin = end
    return energy / (2.5 if hertzian else 2.0), wxx, wxy, wyy

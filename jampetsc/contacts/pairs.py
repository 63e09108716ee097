"""The pair list: nearby pairs frozen between rebuilds, the one rule for when it is stale, and the width of its skin.

A list holds r0 = x_j − x_i + image · cell of every pair closer than σ + skin, rounded once from the split
coordinates. Until the next list disks move by small offsets o, and the whole cell by F = e^ε [[1, g], [0, 1]], so
that a bond is

    r = F (r0 + o_j − o_i)

with neither images nor large coordinates: forces are exact to the rounding of r ~ d whatever the size of the
cell. A quench moves o, ε and g; under steady shear ε = 0 and g = γ − γ_ref.

Staleness. Two disks that touch now, |r| ≤ σ, had r0 = F⁻¹ r − (o_j − o_i), hence

    |r0| ≤ ‖F⁻¹‖ σ + 2 max|o|,    ‖F⁻¹‖ = e^−ε (√(1 + g²/4) + |g|/2),

the larger singular value of F⁻¹. So no touching pair is missing from the list while, with σ_max the largest σ,

    2 max|o| + max(0, ‖F⁻¹‖ − 1) σ_max ≤ skin.

Near pairs. Forces need not look at all of a wide list: those of its pairs that are within a thinner skin now serve for
a while, by the same rule. With r of now and r' of later, at ε = 0,

    r = F(g − g') r' − F(g) (Δo_j − Δo_i),

so moves Δo since then count ‖F(g)‖ times, and the shear since then as that of a list.
"""

from dataclasses import dataclass

import numba
import numpy as np

from jampetsc.contacts.disks import GRID, Disks, split
from jampetsc.contacts.neighbours import neighbour_pairs

SKIN_START = 0.3  # skin of the first list in units of d,
SKIN_RANGE = (0.02, 0.5)  # and between which it is tuned
FAR = 1e300  # moved so far, no pairs are near any more
REBUILD = 10.0  # evaluations that a new list costs
WIDTH = 0.6  # share that skin/d = 1 adds to the cost of an evaluation


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
        i, j = i.view(np.uint32), j.view(np.uint32)
        r0, sigma = _bonds(
            disks.base, disks.offset, disks.cell_base, disks.cell_offset, disks.radii, i, j, image
        )
        return cls(i, j, r0, sigma, skin)

    @property
    def arrays(self):
        """(i, j, r0, sigma), as the compiled loops take them."""
        return self.i, self.j, self.r0, self.sigma


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def _bonds(base, offset, cell_base, cell_offset, radii, i, j, image):
    """`state.bond_vectors` as (2, M), and σ (M,): differences of bases are exact, offsets are added to them."""
    r0, sigma = np.empty((2, len(i))), np.empty(len(i))
    for p in range(np.uint64(len(i))):
        a, b = i[p], j[p]
        for axis in range(2):
            coarse = base[b, axis] - base[a, axis]
            coarse += image[p, 0] * cell_base[0, axis] + image[p, 1] * cell_base[1, axis]
            fine = offset[b, axis] - offset[a, axis]
            fine += image[p, 0] * cell_offset[0, axis] + image[p, 1] * cell_offset[1, axis]
            r0[axis, p] = coarse + fine
        sigma[p] = radii[a] + radii[b]
    return r0, sigma


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def is_stale(far, strain, shear, largest, skin):
    """Whether a list may miss a touching pair: far = max |o|, (ε, g) = (strain, shear), largest = σ_max."""
    stretch = np.exp(-strain) * (np.sqrt(1.0 + 0.25 * shear * shear) + 0.5 * abs(shear))
    return 2.0 * far + max(stretch - 1.0, 0.0) * largest > skin


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def near_pairs(pairs, o, shear, skin):
    """The pairs (i, j, r0, sigma) of a list that are closer than σ + skin at offsets o (N, 2) and `shear`, in order."""
    i, j, r0, sigma = pairs
    r0x, r0y = r0[0], r0[1]
    near, count = np.empty(len(j), np.uint32), np.uint64(0)
    # which are near is hard to predict: they are collected without a branch
    for p in range(np.uint64(len(j))):
        a, b = i[p], j[p]
        y = r0y[p] + (o[b, 1] - o[a, 1])
        x = r0x[p] + (o[b, 0] - o[a, 0]) + shear * y
        reach = sigma[p] + skin
        near[count] = p
        count += np.uint64(x * x + y * y < reach * reach)
    near_i, near_j = np.empty(count, np.uint32), np.empty(count, np.uint32)
    near_r0, near_sigma = np.empty((2, count)), np.empty(count)
    for c in range(count):
        p = near[c]
        near_i[c], near_j[c] = i[p], j[p]
        near_r0[0, c], near_r0[1, c] = r0x[p], r0y[p]
        near_sigma[c] = sigma[p]
    return near_i, near_j, near_r0, near_sigma


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def nearest(pairs, near, o, shear, listed):
    """The near pairs of a list: those of `near` while they serve, then others.

    near = (near pairs, bound on how far a disk has moved since they were chosen, `shear` then), at first
    (pairs, FAR, 0); listed = (σ_max, skin of the list, skin of near pairs).
    """
    _, moved, then = near
    stretch = np.sqrt(1.0 + 0.25 * then * then) + 0.5 * abs(then)
    if is_stale(stretch * moved, 0.0, shear - then, listed[0], listed[2]):
        return near_pairs(pairs, o, shear, listed[2]), 0.0, shear
    return near


def tuned_skin(skin: float, steps: float, diameter: float, rebuild: float = REBUILD) -> float:
    """Skin of the next list when the last one served for `steps` evaluations; lengths of one unit.

    A list serves the longer the wider its skin, steps = v skin, and one evaluation costs (1 + WIDTH skin/d) as much as
    without: with one worth `rebuild` evaluations the cost per evaluation is least at
    skin² = rebuild d/(WIDTH v).
    """
    best = np.sqrt(rebuild / WIDTH * diameter * skin / max(steps, 1))
    narrowest, widest = (limit * diameter for limit in SKIN_RANGE)
    return float(min(max(best, 0.5 * skin, narrowest), 1.5 * skin, widest))


def deformed(disks: Disks, offsets, strain, shear) -> Disks:
    """The disks at F (x + o), with F = e^strain [[1, shear], [0, 1]].

    Only the change is rounded, never the coordinates: base + (offset + o) + (F − 1)(x + o).
    """
    growth, mixing = np.expm1(strain), np.exp(strain) * shear
    base, offset = _deformed(disks.base, disks.offset, offsets, growth, mixing, GRID)
    cell = disks.cell
    change = growth * cell
    change[:, 0] += mixing * cell[:, 1]
    cell_base, cell_offset = split(disks.cell_base, disks.cell_offset + change)
    return Disks(
        base, offset, disks.radii, cell_base, cell_offset, disks.potential, disks.record, disks.images
    )


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def _deformed(base, offset, moves, growth, mixing, grid):
    """(base, offset) of x + o + (F − 1)(x + o), all (N, 2), with F − 1 = [[growth, mixing], [0, growth]]."""
    to, rest = np.empty_like(base), np.empty_like(base)
    for a in range(len(base)):
        low_x, low_y = offset[a, 0] + moves[a, 0], offset[a, 1] + moves[a, 1]
        x, y = base[a, 0] + low_x, base[a, 1] + low_y
        low_x += growth * x + mixing * y
        low_y += growth * y
        carry_x, carry_y = grid * np.rint(low_x / grid), grid * np.rint(low_y / grid)
        to[a, 0], to[a, 1] = base[a, 0] + carry_x, base[a, 1] + carry_y
        rest[a, 0], rest[a, 1] = low_x - carry_x, low_y - carry_y
    return to, rest

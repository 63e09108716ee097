"""Particles of a cell with coordinates more precise than one double: what forces and contacts are computed from.

At low pressure an overlap (~ p) is far smaller than a coordinate (~ √N), so rounding coordinates to one
double would set the force residual (Vågberg, thesis sec. 4.7). Every coordinate is therefore a sum base +
offset: `base` is a multiple of GRID, so that differences of bases and cell vectors are exact, and `offset`
(|offset| ≤ GRID/2) carries the rest.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.packing.cell import reduced_basis
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.potentials import Potential

GRID = 2.0**-24  # exact for coordinates below 2**29; offsets are then resolved to 3e-24
UNIT_BALL = {2: np.pi, 3: 4.0 / 3.0 * np.pi}  # volume of a ball of radius one in D dimensions


def split(high, low=0.0):
    """(base, offset) of the number high + low: base on the grid, offset the exact remainder plus low."""
    base = np.round(np.asarray(high, float) / GRID) * GRID
    offset = (high - base) + low
    carry = np.round(offset / GRID) * GRID
    return base + carry, offset - carry


def join(base, offset):
    """(high, low) with high = the double nearest to base + offset and low what it cannot hold."""
    high = base + offset
    return high, offset - (high - base)


@dataclass(frozen=True, eq=False)
class Particles:
    """N interacting disks or spheres in a periodic cell of D = 2 or 3 dimensions; arrays are never changed in place."""

    base: np.ndarray  # (N, D) coordinates, multiples of GRID
    offset: np.ndarray  # (N, D) remainder
    radii: np.ndarray  # (N,)
    cell_base: np.ndarray  # (D, D) lower triangular rows a1 = (Lx, 0), a2 = (γ Ly, Ly) …, multiples of GRID
    cell_offset: np.ndarray  # (D, D)
    potential: Potential

    @property
    def n(self) -> int:
        """Number of disks N."""
        return len(self.radii)

    @property
    def dimension(self) -> int:
        """D, 2 or 3."""
        return self.base.shape[1]

    @property
    def positions(self):
        """Coordinates rounded to one double, (N, D)."""
        return self.base + self.offset

    @property
    def cell(self):
        """Cell rows rounded to one double, (D, D)."""
        return self.cell_base + self.cell_offset

    @property
    def volume(self) -> float:
        """V = Lx Ly (Lz), an area in two dimensions."""
        return math.prod(np.diag(self.cell).tolist())

    @property
    def period(self) -> float:
        """Distance between a disk and its nearest image: the shortest vector of the lattice."""
        return float(lengths(reduced_basis(self.cell)[0])[0])

    @property
    def phi(self) -> float:
        """Packing fraction Σ π ρ² / V, in 3D Σ (4/3) π ρ³ / V, overlaps counted twice (the field's convention)."""
        return float(UNIT_BALL[self.dimension] * np.sum(self.radii**self.dimension) / self.volume)

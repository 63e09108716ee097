"""Bonds as K and B need them: vectors, forces and stiffnesses; contacts of a packing are bonds with overlaps."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True, eq=False)
class LinearBonds:
    """M bonds, structure of arrays. Bond vectors point from i to j: r = x_j − x_i + image · cell."""

    i: np.ndarray  # (M,)
    j: np.ndarray  # (M,)
    r: np.ndarray  # (M, D) bond vector
    distance: np.ndarray  # (M,) |r|
    force: np.ndarray  # (M,) f = −dV/dr, positive in compression
    stiffness: np.ndarray  # (M,) d²V/dr², the k of BT eq. 4

    def __len__(self):
        return len(self.i)

    def __getitem__(self, selection):
        """The bonds of a mask or an index array."""
        return type(self)(*(getattr(self, f.name)[selection] for f in fields(self)))

    @property
    def force_per_length(self):
        """f/r, (M,): what pre-stress takes from the stiffness across a bond (BT eq. 4)."""
        return self.force / self.distance

    @property
    def normal(self):
        """n = r/|r|, (M, D)."""
        return self.r / self.distance[:, None]

    @property
    def weight_rounding(self):
        """What rounding of the input may do to k and to f/r, in units of ε, (M, 2): nothing, where they are given."""
        return np.zeros((len(self), 2))

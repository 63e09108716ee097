"""A packing that moves while a neighbour list serves it, and the width of the skin of its lists."""

import math

import numpy as np

from jampetsc.packing.neighbour_list import NeighbourList, is_stale
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.strain import UNSTRAINED, Strain
from jampetsc.packing.threads import Team

SKIN_START = 0.3  # skin of the first list in units of d
SKIN_RANGE = (0.02, 0.5)  # limits of later skins in units of d
REBUILD = 10.0  # cost of a new list in evaluations of forces
WIDTH = 0.6  # relative rise of the cost of an evaluation per skin/d


def tuned_skin(skin: float, steps: float, diameter: float, rebuild: float = REBUILD) -> float:
    """Skin of the next list when the last one served for `steps` evaluations; lengths in one unit.

    With steps = v skin, and `rebuild` the cost of a list, an evaluation costs 1 + WIDTH skin/d + rebuild/(v skin),
    which is least at skin² = rebuild d/(WIDTH v). The result is kept in SKIN_RANGE and within half to 1.5 times `skin`.
    """
    best = math.sqrt(rebuild / WIDTH * diameter * skin / max(steps, 1))
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

    def tune(self, steps: float, rebuild: float = REBUILD):
        """Choose the skin of the next list when this one served for `steps` evaluations: see `tuned_skin`."""
        self.skin = tuned_skin(self.skin, steps, self.diameter, rebuild)

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

Near pairs. Forces need not go through all of a wide list: those of its pairs that are now within a thinner skin suffice
for a while, by the same rule. With r of now and r' of later, at ε = 0,

    r = F(g − g') r' − F(g) (Δo_j − Δo_i),

so |Δo| counts ‖F(g)‖ times, and the shear g' − g as that of a list does.
"""

import math
from typing import NamedTuple

import numpy as np

from jampetsc.packing.compiled import compiled
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.pair_search import listed
from jampetsc.packing.threads import Team

SKIN_START = 0.3  # skin of the first list in units of d
SKIN_RANGE = (0.02, 0.5)  # limits of later skins in units of d
REBUILD = 10.0  # cost of a new list in evaluations of forces
WIDTH = 0.6  # relative rise of the cost of an evaluation per skin/d


class PairList(NamedTuple):
    """Half list of the M pairs closer than σ + skin, sorted by i."""

    i: np.ndarray  # (M,) uint32: unsigned, so that loops are compiled without code for negative indices
    j: np.ndarray  # (M,) uint32
    r0: np.ndarray  # (2, M)
    sigma: np.ndarray  # (M,) ρ_i + ρ_j

    @classmethod
    def build(cls, disks: Packing, skin: float) -> "PairList":
        """All pairs of `disks` closer than σ + skin."""
        counts, *pairs = listed(disks, skin, np.array([0, disks.n]), Team())
        return cls(*(np.ascontiguousarray(one[..., : counts.sum()]) for one in pairs))


@compiled(False)
def is_stale(far, strain, shear, largest, skin):
    """Whether a list may miss a touching pair: far = max |o|, (ε, g) = (strain, shear), largest = σ_max."""
    stretch = np.exp(-strain) * (np.sqrt(1.0 + 0.25 * shear * shear) + 0.5 * abs(shear))
    return 2.0 * far + max(stretch - 1.0, 0.0) * largest > skin


@compiled(False)
def are_worn(moved, shear, then, largest, skin):
    """Whether near pairs within `skin`, chosen at the shear `then`, may miss a contact; moved = max |Δo| since then."""
    stretch = np.sqrt(1.0 + 0.25 * then * then) + 0.5 * abs(then)
    return is_stale(stretch * moved, 0.0, shear - then, largest, skin)


def tuned_skin(skin: float, steps: float, diameter: float, rebuild: float = REBUILD) -> float:
    """Skin of the next list when the last one served for `steps` evaluations; lengths in one unit.

    With steps = v skin, and `rebuild` the cost of a list, an evaluation costs 1 + WIDTH skin/d + rebuild/(v skin),
    which is least at skin² = rebuild d/(WIDTH v). The result is kept in SKIN_RANGE and within half to 1.5 times `skin`.
    """
    best = math.sqrt(rebuild / WIDTH * diameter * skin / max(steps, 1))
    narrowest, widest = (limit * diameter for limit in SKIN_RANGE)
    return min(max(best, 0.5 * skin, narrowest), 1.5 * skin, widest)


class ListedDisks:
    """Disks with a list of their pairs: `reference` as they were listed, moved by `offsets` (N, 2) and `box` since.

    skin: of the first list, in mean diameters; team: the threads that make lists
    """

    def __init__(self, disks: Packing, skin: float = SKIN_START, team: Team | None = None):
        self.team = team or Team()
        self.diameter = 2.0 * float(np.mean(disks.radii))
        self.largest = 2.0 * float(disks.radii.max())  # σ_max
        self.skin = skin * self.diameter
        self.list(disks)

    def list(self, disks: Packing):
        """Take these disks as the reference of a new list."""
        self.reference, self._pairs = disks, None
        self.offsets = np.zeros((disks.n, 2))

    @property
    def pairs(self) -> PairList:
        """The half list of the reference, made at the first access."""
        if self._pairs is None:
            self._pairs = PairList.build(self.reference, self.skin)
        return self._pairs

    def fold(self):
        """Make the disks as they are now the reference of a new list."""
        self.list(self.disks)

    @property
    def box(self):
        """Strain and shear (ε, g) of the cell since the list was made; none here."""
        return 0.0, 0.0

    @property
    def disks(self) -> Packing:
        """The packing as it is now."""
        return deformed(self.reference, self.offsets, *self.box)

    def stale(self, far: float | None = None) -> bool:
        """Whether the list may miss a contact; far = max |o|, computed if it is not given."""
        if far is None:
            far = float(np.hypot(*self.offsets.T).max())
        return bool(is_stale(far, *self.box, self.largest, self.skin))

    def tune(self, steps: float, rebuild: float = REBUILD):
        """Choose the skin of the next list when this one served for `steps` evaluations: see `tuned_skin`."""
        self.skin = tuned_skin(self.skin, steps, self.diameter, rebuild)

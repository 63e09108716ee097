"""What is recorded of the events of quasistatic shear."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.rearrangement import NEIGHBOUR_GAP, least_square_deviation
from jampetsc.packing.contacts import bond_vectors
from jampetsc.packing.neighbours import neighbour_pairs

# what happens: a contact opens or closes, the minimum is lost, a particle that nothing holds is touched or left; an
# event that rounding hides
OPENS, CLOSES, UNSTABLE, TOUCHES, LEAVES, HIDDEN = range(6)
EVENT_COLUMNS = {  # of an event, and how many parts its values have: before and after it, or two particles
    "strain": 0, "kind": 0, "particles": 2, "shear_stress": 2, "pressure": 2, "energy": 2, "contacts": 2, "drop": 0,
    "participation": 0, "lowest_eigenvalue": 0,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Measures:
    """Stress, energy and contacts of a state."""

    shear_stress: float  # σ_xy
    pressure: float
    energy: float  # U
    contacts: int  # that bear a force


def deviations(disks, displacement):
    """D²min (N,) of disks that are displaced by (N, D), see `rearrangement.least_square_deviation`."""
    gap = NEIGHBOUR_GAP * 2.0 * float(np.mean(disks.radii))
    i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, gap)
    return least_square_deviation(i, j, bond_vectors(disks, i, j, image), displacement)

"""What is recorded of the events of quasistatic shear."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.rearrangement import NEIGHBOUR_GAP, least_square_deviation, participation
from jampetsc.analysis.strain_series import StrainSeries
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
    """D²min (N,) of disks that are displaced by (N, D), see `rearrangement.least_square_deviation`.

    Neighbours have a gap below NEIGHBOUR_GAP mean diameters before.
    """
    gap = NEIGHBOUR_GAP * 2.0 * float(np.mean(disks.radii))
    i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, gap)
    return least_square_deviation(i, j, bond_vectors(disks, i, j, image), displacement)


class EventTable(StrainSeries):
    """Events of n particles in D dimensions, in the order in which they happen, with EVENT_COLUMNS.

    `largest`: of the largest drop of the energy so far its size and row (−1: none yet), positions and cell before it,
    displacements (N, D) without their mean, and D²min (N,)
    """

    def __init__(self, n: int, dimension: int):
        super().__init__(EVENT_COLUMNS)
        self.largest = {
            "drop": np.float64(0.0),
            "row": np.int64(-1),
            "positions": np.full((n, dimension), np.nan),
            "cell": np.full((dimension, dimension), np.nan),
            "displacement": np.full((n, dimension), np.nan),
            "d2min": np.full(n, np.nan),
        }

    def record(
        self, strain, kind, particles, before: Measures, after: Measures, lowest, drop=0.0, participating=0.0
    ):
        """Add an event of two particles; lowest: eigenvalue of K before it."""
        both = {name: [getattr(before, name), getattr(after, name)] for name in vars(before)}
        self.add(
            strain=strain,
            kind=kind,
            particles=particles,
            drop=drop,
            participation=participating,
            lowest_eigenvalue=lowest,
            **both,
        )

    def record_fall(self, strain, kind, disks, displacement, before: Measures, after: Measures, lowest):
        """Add an event in which `disks`, as they were before it, have displacements (N, D) without their mean."""
        farthest = tuple(sorted(int(k) for k in np.argsort(np.sum(displacement**2, axis=1))[-2:]))
        drop = before.energy - after.energy
        self.record(strain, kind, farthest, before, after, lowest, drop, participation(displacement))
        if drop > self.largest["drop"]:
            self.largest = {
                "drop": np.float64(drop),
                "row": np.int64(len(self) - 1),
                "positions": disks.positions,
                "cell": disks.cell,
                "displacement": displacement,
                "d2min": deviations(disks, displacement),
            }

    def state(self) -> dict:
        """Arrays for `restore`."""
        events = {f"events/{name}": values for name, values in self.arrays().items()}
        return events | {f"largest/{name}": value for name, value in self.largest.items()}

    def restore(self, state: dict) -> None:
        """Take the events that `state` gave."""
        super().restore({name: state[f"events/{name}"] for name in EVENT_COLUMNS})
        self.largest = {name: np.asarray(state[f"largest/{name}"])[()] for name in self.largest}

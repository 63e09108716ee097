"""Masses of particles and their moments of inertia, as data.

With s = iω inertia adds s²M to K + sB, M diagonal. It acts on velocities relative to the affine flow, and on spins
relative to its rotation (SLLOD, as Lees–Edwards conditions have it), so the load column stays as it is. M is m on
displacements and on spins

    I = ½ m ρ² of a disk,   I = (2/5) m ρ² of a sphere,

both uniform, of radius ρ. At high frequency G* → iω b_γγ/V + (k_γγ − b_γᵀM⁻¹b_γ)/V: G' may be negative there.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named

BY_NUMBER, BY_VOLUME = "number", "volume"
GYRATION = {2: 0.5, 3: 0.4}  # by D: I/(m ρ²) of a uniform disk or sphere


@dataclass(frozen=True)
class Masses:
    """Masses of the particles of a packing or of the nodes of a network.

    mass   in units of k × time²: of every particle, or of one of the mean diameter
    by     "number": all are equal; "volume": m ∝ ρ^D
    """

    mass: float
    by: str = BY_NUMBER

    def of(self, radii, n: int, diameter: float, dimension: int):
        """Masses (n,) of n particles; radii (n,), or None; diameter: the mean of all.

        Raises InputError for masses by the volume of nodes without radii.
        """
        if self.by == BY_NUMBER:
            return np.full(n, float(self.mass))
        if radii is None:
            raise InputError(
                f"{named('mass_by')} {self.by}: the nodes of this network have no radii. Give radii, or masses by "
                f"{BY_NUMBER}."
            )
        return self.mass * (2.0 * np.asarray(radii, float) / diameter) ** dimension

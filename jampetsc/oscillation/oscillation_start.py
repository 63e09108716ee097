"""The start of an oscillation with moving contacts: the steady one with fixed contacts."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.oscillation.drive import Drive
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.strain import simple_shear
from jampetsc.response.contact_network import DistributedNetwork


@dataclass(frozen=True, eq=False)
class Start:
    """A steady oscillation of N disks at the time when the drive grows through zero; time is in units of 1/ω."""

    drive: Drive
    displacement: np.ndarray  # (N, D) non-affine; 0 for rattlers
    velocity: np.ndarray  # (N, dofs), with spins where the law has them
    gamma: float
    rate: float  # of strain
    strain: float  # amplitude
    modulus: float  # |G*|
    speed: float  # root mean square of |z| over contacts and time, see `power_law`

    @classmethod
    def of(cls, network: DistributedNetwork, drive: Drive, motion, velocity, *scalars: float) -> "Start":
        """From arrays of a network's n disks: displacements (and rotations) `motion` (n, ≥ D), velocities (n, dofs).

        scalars: gamma, rate, strain, modulus, speed
        """

        def whole(part):
            field = np.zeros((network.n + network.rattlers, part.shape[1]))
            field[network.particles] = part
            return field

        return cls(drive, whole(motion[:, : network.dimension]), whole(velocity), *scalars)

    def near(self, disks: Packing) -> "Start":
        """This start or, if its displacements open or close contacts of these disks, an undeformed start at rest.

        Forces of fixed contacts are wrong where contacts open or close: a disk with only one neighbour, such as a
        rattler that another disk hits, would roll off it at once, however short the steps are.
        """
        moved = deformed(disks, self.displacement, simple_shear(self.gamma))
        has_same_contacts = np.array_equal(
            *(_pairs(find_contacts(packing), disks.n) for packing in (disks, moved))
        )
        at_rest = {name: 0.0 * getattr(self, name) for name in ("displacement", "velocity", "gamma", "rate")}
        return self if has_same_contacts else replace(self, **at_rest)


def _pairs(contacts, n):
    return np.sort(contacts.i.astype(np.int64) * n + contacts.j)

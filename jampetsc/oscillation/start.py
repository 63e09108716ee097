"""The start of an oscillation with moving contacts: the steady one with fixed contacts."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.network.contact_network import Network
from jampetsc.oscillation.response import Drive
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.disks import Disks, deformed


@dataclass(frozen=True, eq=False)
class Start:
    """A steady oscillation of N disks at the time when the drive grows through zero; time is in units of 1/ω."""

    drive: Drive
    displacement: np.ndarray  # (N, 2) non-affine; 0 for rattlers
    velocity: np.ndarray  # (N, dofs), with spins where the law has them
    gamma: float
    rate: float  # of strain
    strain: float  # amplitude
    modulus: float  # |G*|
    speed: float  # root mean square of |z| over contacts and time, see `powerlaw`

    @classmethod
    def of(cls, network: Network, drive: Drive, motion, velocity, *scalars: float) -> "Start":
        """From arrays of a network's n disks: displacements (and rotations) `motion` (n, ≥ 2), velocities (n, dofs).

        scalars: gamma, rate, strain, modulus, speed
        """

        def whole(part):
            field = np.zeros((network.n + network.rattlers, part.shape[1]))
            field[network.particles] = part
            return field

        return cls(drive, whole(motion[:, :2]), whole(velocity), *scalars)

    def near(self, disks: Disks) -> "Start":
        """This start or, if its displacements open or close contacts of these disks, one undeformed and at rest.

        Forces of fixed contacts are wrong where contacts open or close: a disk with only one neighbour, such as a
        rattler that another disk hits, would roll off it at once, however short the steps are.
        """
        moved = deformed(disks, self.displacement, 0.0, self.gamma)
        same = np.array_equal(*(_pairs(find_contacts(one), disks.n) for one in (disks, moved)))
        still = {name: 0.0 * getattr(self, name) for name in ("displacement", "velocity", "gamma", "rate")}
        return self if same else replace(self, **still)


def _pairs(contacts, n):
    return np.sort(contacts.i.astype(np.int64) * n + contacts.j)

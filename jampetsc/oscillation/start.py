"""Where oscillations with moving contacts begin: the steady one with fixed contacts."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.core.disks import Disks
from jampetsc.core.pairs import deformed
from jampetsc.core.state import find_contacts
from jampetsc.mechanics.network import Network
from jampetsc.oscillation.response import Drive


@dataclass(frozen=True, eq=False)
class Start:
    """A steady oscillation of N disks at the time at which what is imposed grows through zero; time is in 1/ω."""

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
        """Of the disks of a network: displacements and, where there are, turns (n, ≥ 2), velocities (n, dofs)."""

        def whole(part):
            field = np.zeros((network.n + network.rattlers, part.shape[1]))
            field[network.particles] = part
            return field

        return cls(drive, whole(motion[:, :2]), whole(velocity), *scalars)

    def near(self, disks: Disks) -> "Start":
        """This one or, where it would open or close contacts of these disks, one undeformed and at rest.

        Fixed contacts pull where they are gone, and do not push where others are new: a disk that is left with one
        neighbour, as a rattler is by what runs into it, would roll off that at once, by steps however short.
        """
        moved = deformed(disks, self.displacement, 0.0, self.gamma)
        same = np.array_equal(*(_pairs(find_contacts(one), disks.n) for one in (disks, moved)))
        still = {name: 0.0 * getattr(self, name) for name in ("displacement", "velocity", "gamma", "rate")}
        return self if same else replace(self, **still)


def _pairs(contacts, n):
    return np.sort(contacts.i.astype(np.int64) * n + contacts.j)

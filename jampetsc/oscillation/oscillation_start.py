"""The start of an oscillation with moving contacts: the steady one with fixed contacts, or the end of another one."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.oscillation.drive import Drive
from jampetsc.packing.contacts import find_contacts, pair_keys
from jampetsc.packing.packing import PLACES, Packing, deformed
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
    reference: float = 0.0  # strain of the disks that `displacement` is for

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

    def record(self, disks: Packing) -> dict:
        """What an oscillation of another amplitude of these disks needs, in numbers and lists: see `after`.

        disks   where they are now, so that `displacement` is zero
        """
        fields = {name: getattr(self, name) for name in ("gamma", "rate", "strain", "modulus", "speed")}
        fields |= {"velocity": self.velocity.tolist()}
        fields |= {name: getattr(disks, name).tolist() for name in PLACES}
        return fields | {"amplitude": self.drive.amplitude}

    @classmethod
    def after(cls, record: dict, disks: Packing, drive: Drive) -> tuple["Start", Packing]:
        """The start of an oscillation where another one of the same packing has ended, and the disks there.

        record   of the other one; velocities and the scales of strain are multiplied by the ratio of the amplitudes
        """
        ratio = drive.amplitude / record["amplitude"]
        disks = disks.replace(**{name: np.array(record[name]) for name in PLACES})
        start = cls(
            drive,
            displacement=np.zeros_like(disks.base),
            velocity=ratio * np.array(record["velocity"]),
            gamma=record["gamma"],
            rate=ratio * record["rate"],
            strain=ratio * record["strain"],
            modulus=record["modulus"],
            speed=ratio * record["speed"],
            reference=record["gamma"],
        )
        return start, disks

    def near(self, disks: Packing) -> "Start":
        """This start or, if its displacements open or close contacts of these disks, an undeformed start at rest.

        Forces of fixed contacts are wrong where contacts open or close: a disk with only one neighbour, such as a
        rattler that another disk hits, would roll off it at once, however short the steps are.
        """
        moved = deformed(disks, self.displacement, simple_shear(self.gamma - self.reference))
        has_same_contacts = np.array_equal(
            *(np.sort(pair_keys(find_contacts(packing), disks.n)) for packing in (disks, moved))
        )
        at_rest = {name: 0.0 * getattr(self, name) for name in ("displacement", "velocity", "gamma", "rate")}
        return self if has_same_contacts else replace(self, **at_rest)

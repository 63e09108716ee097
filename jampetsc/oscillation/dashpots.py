"""Damping of the current contacts: relative velocities from the motion of disks and strain, and the forces they cause.

The relative velocities of a contact, times the square roots of the law's weights, are the vector z of `power_law`. In a
step of length h in which disks move by x (spins times h included) and the strain by s, z = Z (x, s) / h, and

    h R(z)  is the potential,     Zᵀ f(z)  the forces on disks and strain,     Zᵀ (df/dz) Z / h  its second derivative.

Z is of one geometry and does not change within a step: R stays convex, and the forces do the work that is
dissipated.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load
from jampetsc.laws.relative_motion import linear_forms, load_coefficients
from jampetsc.minimisation.hessian import Bonds, gathered
from jampetsc.oscillation.power_law import ContactPowerLaw
from jampetsc.response.compatibility import stacked

LINEAR_BELOW = 1e-5  # of the typical |z|: below, the force of a contact is linear in its velocity


@dataclass(frozen=True, eq=False)
class Damping:
    """A damping law for contacts, linear far below their typical |z|."""

    power: ContactPowerLaw
    forms: tuple  # of contacts
    roots: np.ndarray  # (forms,) square roots of the weights, for each axis of a form
    floor: float  # |z| below which the force is linear

    @classmethod
    def of(cls, law: Law, dimension: int, power: ContactPowerLaw, speed: float) -> "Damping":
        """Of a law in D dimensions; speed: typical |z|, without effect where damping is linear."""
        forms = law.contact_forms()
        return cls(power, forms, np.sqrt(law.on_axes(forms, dimension)), LINEAR_BELOW * speed)


class Dashpots:
    """The damping of the bonds that touch. Arrays of z and f are (contacts, damped).

    rims: radii of all disks (N,), in units of the length by which rotations are multiplied
    flow: the affine flow at unit rate of strain
    """

    def __init__(self, bonds: Bonds, rims, damping: Damping, dofs: int, flow: Load):
        self.touching = np.flatnonzero(bonds.overlap > 0.0)
        self.i, self.j = bonds.pairs.i[self.touching], bonds.pairs.j[self.touching]
        self._damping = damping
        rows, sheared = motion_rows(damping.forms, bonds, rims, dofs, flow, self.touching)
        damped = np.flatnonzero(damping.roots)
        roots = damping.roots[damped]
        self._Z, self._sheared = roots[:, None] * rows[:, damped], roots * sheared[:, damped]

    @property
    def damped(self) -> int:
        """Number of components of z."""
        return self._sheared.shape[1]

    def velocities(self, x, strain, h):
        """z of displacements x (N, dofs) and a growth of the strain within a time h."""
        ends = np.concatenate((x[self.i], x[self.j]), axis=1)
        return (np.einsum("cfx,cx->cf", self._Z, ends) + strain * self._sheared) / h

    def forces(self, z):
        """f(z)."""
        return self._damping.power.forces(z, self._damping.floor)

    def tangents(self, z, f):
        """df/dz for Newton's method, (contacts, damped, damped): see `ContactPowerLaw.stiffness`."""
        return self._damping.power.stiffness(z, f, self._damping.floor)

    def on_disks(self, f, n: int):
        """Zᵀf on the disks, (N, dofs): the forces that balance f."""
        return gathered(np.einsum("cf,cfx->cx", f, self._Z), self.i, self.j, n)

    def on_strain(self, f) -> float:
        """Zᵀf on the strain: viscous shear stress times volume."""
        return float(np.sum(f * self._sheared))

    def squares(self, tangents):
        """Zᵀ D Z of each contact for D = `tangents`: its blocks disks–disks, disks–strain and strain–strain."""
        weighted = tangents @ self._Z
        along = (tangents @ self._sheared[:, :, None])[:, :, 0]
        return (
            self._Z.swapaxes(1, 2) @ weighted,
            (along[:, None, :] @ self._Z)[:, 0],
            np.sum(self._sheared * along, axis=1),
        )


def motion_rows(forms, bonds: Bonds, rims, dofs: int, flow: Load, chosen=slice(None)):
    """`linear_forms` of the chosen bonds: coefficients of disks, (M, axes, 2 dofs), and of the strain, (M, axes)."""
    i, j = bonds.pairs.i[chosen], bonds.pairs.j[chosen]
    ends = (rims[i], rims[j]) if dofs > bonds.dimension else None
    coefficients = linear_forms(forms, bonds.normal[:, chosen].T, ends)
    sheared = load_coefficients(coefficients, flow.imposed(bonds.r[:, chosen].T))
    return stacked(coefficients), np.stack(sheared, axis=1)

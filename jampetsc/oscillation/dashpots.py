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
from jampetsc.minimisation.hessian import Bonds
from jampetsc.oscillation.power_law import ContactPowerLaw
from jampetsc.packing.compiled import NUMBERS, compiled
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

    def velocities(self, u, rate: float):
        """z of velocities u (N, dofs) and a rate of strain."""
        return _velocities(self.i, self.j, self._Z, self._sheared, u, rate)

    def forces(self, z):
        """f(z)."""
        return self._damping.power.forces(z, self._damping.floor)

    def tangents(self, z, f):
        """df/dz for Newton's method, (contacts, damped, damped): see `ContactPowerLaw.stiffness`."""
        return self._damping.power.stiffness(z, f, self._damping.floor)

    def subtract_forces(self, f, forces):
        """Subtract Zᵀf, what balances f, from the forces on the disks (N, dofs)."""
        _subtract_forces(self.i, self.j, self._Z, f, forces)

    def on_strain(self, f) -> float:
        """Zᵀf on the strain: viscous shear stress times volume."""
        return float(np.vdot(f, self._sheared))

    def squares(self, tangents):
        """Zᵀ D Z of each contact for D = `tangents`, (contacts, 2 dofs, 2 dofs)."""
        return _squares(self._Z, tangents)

    def border(self, tangents):
        """The parts of Zᵀ D Z that couple disks and strain, (contacts, 2 dofs), and of the strain, (contacts,)."""
        along = (tangents @ self._sheared[:, :, None])[:, :, 0]
        return (along[:, None, :] @ self._Z)[:, 0], np.sum(self._sheared * along, axis=1)


@compiled(NUMBERS)
def _velocities(i, j, Z, sheared, u, rate):
    """Z (u, rate), (contacts, damped)."""
    z, dofs = np.empty(sheared.shape), u.shape[1]
    for c in range(len(i)):
        a, b = i[c], j[c]
        for row in range(z.shape[1]):
            total = rate * sheared[c, row]
            for x in range(dofs):
                total += Z[c, row, x] * u[a, x] + Z[c, row, dofs + x] * u[b, x]
            z[c, row] = total
    return z


@compiled(NUMBERS)
def _squares(Z, tangents):
    """Zᵀ D Z, (contacts, 2 dofs, 2 dofs)."""
    count, damped, ends = Z.shape
    blocks = np.zeros((count, ends, ends))
    weighted = np.empty(ends)
    for c in range(count):
        for row in range(damped):
            weighted[:] = 0.0
            for column in range(damped):
                for x in range(ends):
                    weighted[x] += tangents[c, row, column] * Z[c, column, x]
            for y in range(ends):
                for x in range(ends):
                    blocks[c, y, x] += Z[c, row, y] * weighted[x]
    return blocks


@compiled(NUMBERS)
def _subtract_forces(i, j, Z, f, forces):
    """Subtract Zᵀf from the forces (N, dofs)."""
    dofs = forces.shape[1]
    for c in range(len(i)):
        a, b = i[c], j[c]
        for row in range(f.shape[1]):
            for x in range(dofs):
                forces[a, x] -= Z[c, row, x] * f[c, row]
                forces[b, x] -= Z[c, row, dofs + x] * f[c, row]


def motion_rows(forms, bonds: Bonds, rims, dofs: int, flow: Load, chosen=slice(None)):
    """`linear_forms` of the chosen bonds: coefficients of disks, (M, axes, 2 dofs), and of the strain, (M, axes)."""
    i, j = bonds.pairs.i[chosen], bonds.pairs.j[chosen]
    ends = (rims[i], rims[j]) if dofs > bonds.dimension else None
    coefficients = linear_forms(forms, bonds.normal[:, chosen].T, ends)
    sheared = load_coefficients(coefficients, flow.imposed(bonds.r[:, chosen].T))
    return stacked(coefficients), np.stack(sheared, axis=1)

"""Damping of the contacts there are: how they move when disks and strain do, and what they push with.

The relative velocities of a contact, weighted as the law has it, are the vector z of `powerlaw`; so a step of length h,
in which disks move by x (spins times h included) and the strain by s, has z = Z (x, s) / h, and the potential

    h R(z) ,     forces on disks and strain  Zᵀ f(z) ,     second derivative  Zᵀ (df/dz) Z / h .

Z belongs to one geometry and does not change within a step: R stays convex, and forces do the work that is dissipated.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.core.forms import linear_forms
from jampetsc.core.laws import Law
from jampetsc.mechanics.compatibility import stacked
from jampetsc.minimise.hessian import Bonds, gathered
from jampetsc.oscillation.powerlaw import PowerLaw

LINEAR_BELOW = 1e-5  # of the typical speed: there the force of a contact is linear in its velocity


@dataclass(frozen=True, eq=False)
class Damping:
    """A law as contacts have it that typically move with this |z|."""

    power: PowerLaw
    roots: np.ndarray  # (forms,) square roots of the weights
    floor: float  # |z| below which the force is linear

    @classmethod
    def of(cls, law: Law, power: PowerLaw, speed: float) -> "Damping":
        """speed: typical |z|; nothing depends on it where damping is linear."""
        return cls(power, np.sqrt(law.on_contacts), LINEAR_BELOW * speed)


class Dashpots:
    """The contacts of some bonds; arrays (contacts, damped) for z and f.

    rims: radii of all disks, in the length that turns are multiplied by
    """

    def __init__(self, bonds: Bonds, rims, damping: Damping, dofs: int):
        self.touching = np.flatnonzero(bonds.overlap > 0.0)
        self.i, self.j = bonds.pairs.i[self.touching], bonds.pairs.j[self.touching]
        self._damping = damping
        rows, sheared = motion_rows(bonds, rims, dofs, self.touching)
        damped = np.flatnonzero(damping.roots[: rows.shape[1]])
        roots = damping.roots[damped]
        self._Z, self._sheared = roots[:, None] * rows[:, damped], roots * sheared[:, damped]

    @property
    def damped(self) -> int:
        """Number of components of z."""
        return self._sheared.shape[1]

    def velocities(self, x, strain, h):
        """z of x (N, dofs) and a strain within h."""
        ends = np.concatenate((x[self.i], x[self.j]), axis=1)
        return (np.einsum("cfx,cx->cf", self._Z, ends) + strain * self._sheared) / h

    def forces(self, z):
        """f of z."""
        return self._damping.power.forces(z, self._damping.floor)

    def tangents(self, z, f):
        """df/dz for Newton's method, (contacts, damped, damped): see `PowerLaw.stiffness`."""
        return self._damping.power.stiffness(z, f, self._damping.floor)

    def on_disks(self, f, n: int):
        """Forces (N, dofs) that hold against f."""
        return gathered(np.einsum("cf,cfx->cx", f, self._Z), self.i, self.j, n)

    def on_strain(self, f) -> float:
        """Shear stress times area."""
        return float(np.sum(f * self._sheared))

    def squares(self, tangents):
        """Zᵀ D Z of each contact: on its disks, on them and the strain, on the strain alone."""
        weighted = np.einsum("cfg,cgx->cfx", tangents, self._Z)
        along = np.einsum("cfg,cg->cf", tangents, self._sheared)
        return (
            np.einsum("cfx,cfy->cxy", self._Z, weighted),
            np.einsum("cfx,cf->cx", self._Z, along),
            np.einsum("cf,cf->c", self._sheared, along),
        )


def motion_rows(bonds: Bonds, rims, dofs: int, chosen=slice(None)):
    """`linear_forms` of the chosen bonds as (M, forms, 2 dofs), and what a strain adds, (M, forms)."""
    i, j = bonds.pairs.i[chosen], bonds.pairs.j[chosen]
    ends = (rims[i], rims[j]) if dofs == 3 else None
    return stacked(linear_forms(bonds.normal[:, chosen].T, bonds.r[1, chosen], ends))

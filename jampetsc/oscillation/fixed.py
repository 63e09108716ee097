"""Fixed contacts of a packing: linear springs, and dashpots whose geometry does not change.

K is that of `response.assembly` with its γ border, as a sum over contacts of weighted squares of relative motions,

    ½ (x, γ)ᵀ K (x, γ) = ½ Σ_c [ k (a∥)² − (f/r) (a⊥)² ] ,

so that forces lose no digits where displacements are far larger than relative displacements.
"""

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.minimise.hessian import Bonds, gathered
from jampetsc.network.contact_network import Network
from jampetsc.oscillation.dashpots import Damping, Dashpots, motion_rows
from jampetsc.oscillation.stage import State


class FixedSprings:
    """The `stage.Springs` of a network that lies on one rank. Motions (2n + 1,) are displacements and a strain.

    k   stiffness of a contact, in the units of this oscillation
    """

    stiffness, reach = 1.0, np.inf  # in these units; forces are linear in all displacements

    def __init__(self, network: Network, law: Law, k: float, damping: Damping):
        contacts = network.contacts
        contacts = contacts[contacts.i < contacts.j]  # a network lists each twice
        self.n, self.dofs, self.area = network.n, law.dofs, network.area
        self.largest, self.rims = 2.0 * float(network.radii.max()), network.radii
        self.count = len(contacts)
        scale, r = k / network.k, contacts.r.T
        force = contacts.force * (scale if network.prestress else 0.0)
        normal = r / contacts.distance
        self._bonds = Bonds(
            contacts, r, normal, contacts.distance, contacts.overlap, force, scale * contacts.stiffness
        )
        self._weights = np.column_stack((self._bonds.stiffness, -force / contacts.distance))
        self._rows, self._sheared = motion_rows(self._bonds, None, 2)
        self.damp(damping)

    def damp(self, damping: Damping):
        """Use this damping from now on."""
        self._dashpots = Dashpots(self._bonds, self.rims, damping, self.dofs)

    def at(self, base, x, gamma) -> State:
        """See `stage.Springs`."""
        return State(base + x, gamma, self._bonds)

    def covers(self, state) -> bool:
        """See `stage.Springs`: contacts are fixed."""
        return True

    def forces(self, state):
        """See `stage.Springs`."""
        i, j = self._bonds.pairs.i, self._bonds.pairs.j
        ends = np.concatenate((state.places[i], state.places[j]), axis=1)
        motions = np.einsum("cfx,cx->cf", self._rows, ends) + state.gamma * self._sheared
        tensions = self._weights * motions
        forces = gathered(np.einsum("cf,cfx->cx", tensions, self._rows), i, j, self.n)
        return -forces, float(np.sum(tensions * self._sheared))

    def curvature(self, state, x, growth):
        """See `stage.Springs`: zero, forces are linear."""
        return np.zeros((self.n, 2)), 0.0

    def dashpots(self, state) -> Dashpots:
        """See `stage.Springs`: those of all contacts of the packing."""
        return self._dashpots

    def times_K(self, motion):
        """K (x, γ), (2n + 1,)."""
        forces, sheared = self.forces(State(motion[:-1].reshape(self.n, 2), motion[-1], self._bonds))
        return np.append(-forces, sheared)

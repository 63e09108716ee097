"""The contacts of a packing as they are: linear springs, and dashpots that stay where they are.

K is that of `mechanics.assembly`, as the sum over contacts of weighted squares of relative motions, with its γ border,

    ½ (x, γ)ᵀ K (x, γ) = ½ Σ_c [ k (a∥)² − (f/r) (a⊥)² ] ,

so that forces lose no digits where displacements are far larger than what contacts feel of them.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.core.laws import Law
from jampetsc.mechanics.network import Network
from jampetsc.minimise.hessian import Bonds
from jampetsc.oscillation.dashpots import Damping, Dashpots, gathered, motion_rows
from jampetsc.oscillation.stepmatrix import StepMatrix


@dataclass(frozen=True, eq=False)
class State:
    """Displacements (n, 2) and a strain."""

    places: np.ndarray
    gamma: float


class FixedSprings:
    """The springs of a network that one rank has whole: `stage.Springs`.

    stiffness   of a contact, k, in the units of this oscillation
    """

    reach = np.inf  # elasticity is the same everywhere

    def __init__(self, network: Network, law: Law, stiffness: float, damping: Damping, prefix: str):
        contacts = network.contacts
        contacts = contacts[contacts.i < contacts.j]  # of the two ends that see it
        self.n, self.dofs, self.area = network.n, law.dofs, network.area
        self.largest, self.unit = 2.0 * float(network.radii.max()), 2.0 * float(network.radii.max())
        self.count = len(contacts)
        scale = stiffness / network.k
        force = contacts.force * (scale if network.prestress else 0.0)
        along, r = contacts.r.T / contacts.distance, contacts.r.T
        self._bonds = Bonds(
            contacts, r, along, contacts.distance, contacts.overlap, force, scale * contacts.stiffness
        )
        self._weights = np.column_stack((self._bonds.stiffness, -force / contacts.distance))
        self._rows, self._sheared = motion_rows(along.T, r[1], None)
        self._radii = network.radii
        self._matrix = StepMatrix(prefix, 1.0, float(np.sqrt(network.area)))
        self._matrix.list(contacts, network.radii, law.dofs)
        self.damp(damping)

    def damp(self, damping: Damping):
        """From now on dashpots are these."""
        self._dashpots = Dashpots(self._bonds, self._radii, damping, self.dofs)

    @property
    def factorisations(self) -> int:
        """So far."""
        return self._matrix.factorisations

    def at(self, base, x, gamma):
        """See `stage.Springs`."""
        return State(base + x, gamma)

    def serves(self, state) -> bool:
        """Always."""
        return True

    def pull(self, state):
        """See `stage.Springs`."""
        i, j = self._bonds.pairs.i, self._bonds.pairs.j
        ends = np.concatenate((state.places[i], state.places[j]), axis=1)
        motions = np.einsum("cfx,cx->cf", self._rows, ends) + state.gamma * self._sheared
        tensions = self._weights * motions
        forces = gathered(np.einsum("cf,cfx->cx", tensions, self._rows), i, j, self.n)
        return -forces, float(np.sum(tensions * self._sheared))

    def bend(self, state, x, growth):
        """These springs are linear."""
        return np.zeros((self.n, 2)), 0.0

    def product(self, a: State, b: State) -> float:
        """(x_a, γ_a)ᵀ K (x_b, γ_b)."""
        forces, sheared = self.pull(b)
        return a.gamma * sheared - float(np.sum(forces * a.places))

    def shear_modulus(self) -> float:
        """Of springs alone."""
        forces, _ = self.pull(State(np.zeros((self.n, 2)), 1.0))
        damped = self._dashpots.damped
        self._matrix.factorise(self._bonds, self._dashpots, np.zeros((self.count, damped, damped)), False)
        right = np.zeros((self.n, self.dofs))
        right[:, :2] = forces
        moved = self.solve(np.append(right, 0.0))[:-1].reshape(self.n, -1)[:, :2]
        sheared = State(moved, 1.0)
        return self.product(sheared, sheared) / self.area

    def dashpots(self, state) -> Dashpots:
        """Those of the packing."""
        return self._dashpots

    def factorise(self, state, dashpots, damping, free):
        """See `StepMatrix`."""
        self._matrix.factorise(self._bonds, dashpots, damping, free)

    def solve(self, right):
        """See `StepMatrix`."""
        return self._matrix.solve(right)

    def destroy(self):
        """Free the factor."""
        self._matrix.destroy()

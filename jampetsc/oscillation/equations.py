"""The equations of a steady oscillation as one nonlinear system: force balance in every step of half a cycle.

Unknown are the velocities v_n of all unknowns of the pencil in the middle of every step n, under stress control the
strain rate, and the damping forces f_n of the contacts (see `powerlaw` for why these):

    Cᵀ [ W_K a_n + √w f_n ] = F_n ,   z_n − z(f_n) = 0 ,    ȧ_n = C v_n + g γ̇_n ,   z = √w ȧ ,   a = S ȧ

with S the integral in time of `cycle`. Each step alone would minimise ½QᵀKQ − F·Q + h R; together they are a monotone
map, S being antisymmetric, which has one zero where K has no negative modes.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jampetsc.mechanics.compatibility import Compatibility
from jampetsc.oscillation.cycle import Cycle
from jampetsc.oscillation.powerlaw import PowerLaw
from jampetsc.oscillation.response import Drive
from jampetsc.petsc.session import current


class Contacts:
    """What contacts feel of motion at several times, and forces on the unknowns. Methods are collective.

    C takes all times at once. The strain enters as γL, L = √V, so that its row of the equations is a force like the
    others.
    """

    def __init__(self, compatibility: Compatibility):
        network, law = compatibility.pencil.network, compatibility.pencil.law
        self.compatibility, self.network = compatibility, network
        self.length = np.sqrt(network.area)
        self.g = compatibility.g / self.length
        self.w_K, self.forms = compatibility.w_K, compatibility.forms
        weights = np.array(law.on_contacts[: self.forms])
        self.damped = np.flatnonzero(weights)  # of the forms
        self.roots = np.sqrt(weights[self.damped])
        self.rows, self.unknowns = compatibility.C.getLocalSize()
        self.count = self.rows // self.forms  # of contacts
        self._products = {}

    def _product(self, multiply, values):
        """Rows of `values` (m, …) each multiplied by C (its matMult) or Cᵀ (transposeMatMult)."""
        key = multiply.__name__, len(values)
        if key not in self._products:
            sizes = (values.shape[1], None), (None, len(values))
            vectors = current().PETSc.Mat().createDense(sizes, comm=self.network.comm)
            vectors.setUp()
            vectors.assemble()
            self._products[key] = vectors, multiply(vectors)
        vectors, result = self._products[key]
        vectors.getDenseArray()[:] = values.T
        vectors.assemble()
        multiply(vectors, result)
        return result.getDenseArray().T.copy()

    def motions(self, x, strain):
        """(m, rows) of x (m, unknowns) and strain (m,) on all ranks."""
        return self._product(self.compatibility.C.matMult, x) + np.outer(strain, self.g)

    def forces(self, tensions):
        """On the unknowns, (m, unknowns), and on the strain, (m,) the same on all ranks, of tensions (m, rows)."""
        return self._product(self.compatibility.C.transposeMatMult, tensions), self.network.sum(
            tensions @ self.g
        )

    def squares(self, g):
        """Of each damped row of (C, g): the unknowns it feels (rows, e), γL the last, and the products of its entries.

        These are (rows, e, e).
        """
        _, columns, values = self.compatibility.C.getValuesCSR()
        rows = (np.arange(self.count)[:, None] * self.forms + self.damped).ravel()
        pencil = self.compatibility.pencil
        felt, values = (
            np.column_stack((part.reshape(self.rows, 2 * pencil.law.dofs), strain))[rows]
            for part, strain in ((columns, np.full(self.rows, pencil.unknowns)), (values.real, g))
        )
        return felt, values[:, :, None] * values[:, None, :]

    def damping_motions(self, a):
        """z (m, contacts, damped) of (m, rows)."""
        return a.reshape(len(a), self.count, self.forms)[..., self.damped] * self.roots

    def add_damping(self, tensions, f):
        """Add what damping forces f (m, contacts, damped) are in tensions (m, rows), in place."""
        tensions.reshape(len(f), self.count, self.forms)[..., self.damped] += self.roots * f

    def destroy(self):
        """Free what products are made in."""
        for matrix in itertools.chain(*self._products.values()):
            matrix.destroy()


@dataclass(frozen=True, eq=False)
class State:
    """This rank's part of the unknowns, or of the equations: views into one vector."""

    v: np.ndarray  # (m, unknowns)
    rate: np.ndarray  # (m,) γ̇L under stress control, on rank 0; else (0,)
    f: np.ndarray  # (m, contacts, damped)


@dataclass(frozen=True, eq=False)
class Equations:
    """Residual and its derivative on one cycle. Methods are collective; arrays are this rank's."""

    contacts: Contacts
    cycle: Cycle
    law: PowerLaw
    drive: Drive
    stress: float  # amplitude; where the strain is imposed, the one that is expected
    unit: float  # what a unit of damping velocity counts in the second equation, as a force

    @property
    def force(self) -> float:
        """σ₀V/L, on the strain."""
        return self.stress * self.contacts.length

    def motions(self, state: State):
        """z (m, contacts, damped)."""
        return self.contacts.damping_motions(self.contacts.motions(state.v, self.rate(state)))

    @property
    def holds_rate(self) -> bool:
        """Whether the strain rate is among this rank's unknowns."""
        return self.drive.stress_controlled and self.contacts.network.comm.rank == 0

    @cached_property
    def _ends(self):
        return np.cumsum([self.cycle.m * self.contacts.unknowns, self.cycle.m * self.holds_rate])

    @property
    def size(self) -> int:
        """Of this rank's part of the vector of unknowns."""
        return int(self._ends[-1]) + self.cycle.m * self.contacts.count * len(self.contacts.damped)

    def split(self, values) -> State:
        """Views of a local vector (size,)."""
        v, rate, f = np.split(values, self._ends)
        m, contacts = self.cycle.m, self.contacts
        return State(v.reshape(m, -1), rate, f.reshape(m, contacts.count, len(contacts.damped)))

    def rate(self, state: State):
        """γ̇L (m,) on all ranks."""
        if self.drive.stress_controlled:
            return self.contacts.network.comm.bcast(state.rate)
        strain = self.drive.amplitude * self.contacts.length
        return -self.cycle.omega * strain * np.sin(self.cycle.phase)

    def balance(self, state: State, rate):
        """Forces on unknowns and strain without the drive, and z, of motions with this strain rate."""
        a = self.contacts.motions(state.v, rate)
        tensions = (self.cycle.integral @ a) * self.contacts.w_K
        self.contacts.add_damping(tensions, state.f)
        return *self.contacts.forces(tensions), self.contacts.damping_motions(a)

    def residual(self, state: State, out: State):
        """What is left of the equations."""
        out.v[:], row, z = self.balance(state, self.rate(state))
        if self.holds_rate:
            out.rate[:] = row - self.force * np.cos(self.cycle.phase)
        out.f[:] = self.law.mismatch(z, state.f, self.unit)

    def derivative(self, tangent, change: State, out: State):
        """Its derivative along a change."""
        rate = self.rate(change) if self.drive.stress_controlled else np.zeros(self.cycle.m)
        out.v[:], row, z = self.balance(change, rate)
        if self.holds_rate:
            out.rate[:] = row
        out.f[:] = tangent.mismatch(z, change.f, self.unit)

"""The equations of a steady oscillation as one nonlinear system: force balance in every step of half a cycle.

Its unknowns are the velocities v_n of all unknowns of the pencil in the middle of every step n, under stress control
the strain rate, and the damping forces f_n of the contacts (`power_law` explains why):

    Cᵀ [ W_K a_n + √w f_n ] = F_n ,   z_n − z(f_n) = 0 ,    ȧ_n = C v_n + g γ̇_n ,   z = √w ȧ ,   a = S ȧ

with S the integral in time of `Cycle`. Each step alone would minimise ½QᵀKQ − F·Q + h R; together they are a monotone
map, S being antisymmetric, which has one zero where K has no negative modes.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jampetsc.oscillation.drive import Drive
from jampetsc.oscillation.half_cycle import Cycle
from jampetsc.oscillation.power_law import ContactPowerLaw
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil


class ContactMotions:
    """Relative motions of contacts at several times, and forces on the unknowns. Methods are collective.

    C is applied to all times at once. The strain enters as γL with V = L²H, H = ρ₀^(D−2), so that its row of the
    equations is a force as the others; rho0 is a length of the order of a diameter.
    """

    def __init__(self, pencil: Pencil, rho0: float):
        network, compatibility = pencil.network, pencil.compatibility
        self.pencil, self.C, self.network = pencil, compatibility.C, network
        self.thickness = rho0 ** (network.dimension - 2)  # H
        self.length = np.sqrt(network.volume / self.thickness)  # L
        self.g = compatibility.g / self.length
        self.w_K, self.forms = compatibility.w_K, compatibility.forms
        weights = np.array(pencil.law.on_axes(compatibility.rows, network.dimension))
        self.damped = np.flatnonzero(weights)  # indices of forms
        self.roots = np.sqrt(weights[self.damped])
        self.rows, self.unknowns = self.C.getLocalSize()
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
        """Relative motions (m, rows) for x (m, unknowns) and strain γL (m,), which all ranks give."""
        return self._product(self.C.matMult, x) + np.outer(strain, self.g)

    def forces(self, tensions):
        """Forces of tensions (m, rows): on the unknowns, (m, unknowns), and on γL, (m,), alike on all ranks."""
        return self._product(self.C.transposeMatMult, tensions), self.network.sum(tensions @ self.g)

    def squares(self, g):
        """Of each damped row of (C, g): its columns (rows, e), last γL, and products of entries (rows, e, e)."""
        _, columns, values = self.C.getValuesCSR()
        rows = (np.arange(self.count)[:, None] * self.forms + self.damped).ravel()
        felt, values = (
            np.column_stack((part.reshape(self.rows, 2 * self.pencil.dofs), strain))[rows]
            for part, strain in ((columns, np.full(self.rows, self.pencil.unknowns)), (values.real, g))
        )
        return felt, values[:, :, None] * values[:, None, :]

    def damping_motions(self, a):
        """z (m, contacts, damped) for rates of motions a (m, rows)."""
        return a.reshape(len(a), self.count, self.forms)[..., self.damped] * self.roots

    def add_damping(self, tensions, f):
        """Add the damping forces f (m, contacts, damped) to tensions (m, rows), in place."""
        tensions.reshape(len(f), self.count, self.forms)[..., self.damped] += self.roots * f


@dataclass(frozen=True, eq=False)
class CycleState:
    """This rank's part of the unknowns, or of the residual of the equations: views into one vector."""

    v: np.ndarray  # (m, unknowns)
    rate: np.ndarray  # (m,) γ̇L under stress control, on rank 0; else (0,)
    f: np.ndarray  # (m, contacts, damped)


@dataclass(frozen=True, eq=False)
class Equations:
    """Residual of the equations on one cycle, and its derivative. Methods are collective; arrays are this rank's."""

    contacts: ContactMotions
    cycle: Cycle
    law: ContactPowerLaw
    drive: Drive
    stress: float  # amplitude; an estimate where the strain is imposed
    unit: float  # force by which velocities z are multiplied in the second equation

    @property
    def force(self) -> float:
        """Amplitude of the force on γL, σ₀V/L."""
        return self.stress * self.contacts.length * self.contacts.thickness

    def motions(self, state: CycleState):
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
        """Length of this rank's part of the vector of unknowns."""
        return int(self._ends[-1]) + self.cycle.m * self.contacts.count * len(self.contacts.damped)

    def split(self, values) -> CycleState:
        """Views of a local vector (size,)."""
        v, rate, f = np.split(values, self._ends)
        m, contacts = self.cycle.m, self.contacts
        return CycleState(v.reshape(m, -1), rate, f.reshape(m, contacts.count, len(contacts.damped)))

    def rate(self, state: CycleState):
        """γ̇L (m,) on all ranks."""
        if self.drive.stress_controlled:
            return self.contacts.network.comm.bcast(state.rate)
        strain = self.drive.amplitude * self.contacts.length
        return -self.cycle.omega * strain * np.sin(self.cycle.phase)

    def balance(self, state: CycleState, rate):
        """(forces on the unknowns, forces on γL, z) of a state and a strain rate γ̇L (m,), without the drive."""
        a = self.contacts.motions(state.v, rate)
        tensions = (self.cycle.integral @ a) * self.contacts.w_K
        self.contacts.add_damping(tensions, state.f)
        return *self.contacts.forces(tensions), self.contacts.damping_motions(a)

    def residual(self, state: CycleState, out: CycleState):
        """out ← the residual of the equations."""
        out.v[:], row, z = self.balance(state, self.rate(state))
        if self.holds_rate:
            out.rate[:] = row - self.force * np.cos(self.cycle.phase)
        out.f[:] = self.law.mismatch(z, state.f, self.unit)

    def derivative(self, tangent, change: CycleState, out: CycleState):
        """out ← the derivative of the residual along a change of the state."""
        rate = self.rate(change) if self.drive.stress_controlled else np.zeros(self.cycle.m)
        out.v[:], row, z = self.balance(change, rate)
        if self.holds_rate:
            out.rate[:] = row
        out.f[:] = tangent.mismatch(z, change.f, self.unit)

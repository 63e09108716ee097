"""The equations of a steady oscillation as one nonlinear system: force balance in every step of half a cycle.

Unknown are the velocities v_n of all unknowns of the pencil in the middle of every step n, under stress control the
strain rate, and the damping forces f_n of the contacts (see `powerlaw` for why these):

    Cᵀ [ W_K a_n + √w f_n ] = F_n ,   z_n − z(f_n) = 0 ,    ȧ_n = C v_n + g γ̇_n ,   z = √w ȧ ,   a = S ȧ

with S the integral in time of `cycle`. Each step alone would minimise ½QᵀKQ − F·Q + h R; together they are a monotone
map, S being antisymmetric, which has one zero where K has no negative modes.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from jampetsc.mechanics.compatibility import Compatibility
from jampetsc.oscillation.cycle import Cycle
from jampetsc.oscillation.powerlaw import PowerLaw
from jampetsc.petsc.session import current


class Contacts:
    """What contacts feel of motion at several times, and forces on the unknowns. Methods are collective.

    All times go through C together, in one exchange between ranks. The strain enters as γL, L = √V, so that its row of
    the equations is a force like the others.
    """

    def __init__(self, compatibility: Compatibility):
        network, law = compatibility.pencil.network, compatibility.pencil.law
        self.compatibility, self.network = compatibility, network
        self.length = np.sqrt(network.area)
        self.g = compatibility.g / self.length
        self.w_K = compatibility.w_K
        self.forms = compatibility.forms
        weights = np.array(law.on_contacts[: self.forms])
        self.damped = np.flatnonzero(weights)  # of the forms
        self.roots = np.sqrt(weights[self.damped])
        self.rows, self.unknowns = compatibility.C.getLocalSize()
        self.count = self.rows // self.forms  # of contacts
        indptr, columns, values = compatibility.C.getValuesCSR()
        self._felt, places = np.unique(columns, return_inverse=True)  # unknowns that contacts here feel
        self._C = csr_array((values.real, places, indptr), shape=(self.rows, len(self._felt)))
        self._CT = self._C.T.tocsr()
        self._exchanges = {}

    def _exchange(self, times: int) -> "_Exchange":
        if times not in self._exchanges:
            self._exchanges[times] = _Exchange(self.network.comm, self.unknowns, self._felt, times)
        return self._exchanges[times]

    def motions(self, x, strain):
        """(m, rows) of x (m, unknowns) and strain (m,) on all ranks."""
        felt = self._exchange(len(x)).gather(x.T)
        return (self._C @ felt).T + np.outer(strain, self.g)

    def forces(self, tensions):
        """On the unknowns, (m, unknowns), and on the strain, (m,) the same on all ranks, of tensions (m, rows)."""
        on_unknowns = self._exchange(len(tensions)).add(self._CT @ tensions.T)
        return on_unknowns.T, self.network.sum(tensions @ self.g)

    def products(self):
        """Of each damped row of C: the unknowns it feels (rows, e), and the products of its entries (rows, e, e)."""
        entries = len(self._C.data) // self.rows if self.rows else 0
        rows = (np.arange(self.count)[:, None] * self.forms + self.damped).ravel()
        felt = self._felt[self._C.indices.reshape(self.rows, entries)[rows]]
        values = self._C.data.reshape(self.rows, entries)[rows]
        return felt, values[:, :, None] * values[:, None, :]

    def damping_motions(self, a):
        """z (m, contacts, damped) of (m, rows)."""
        return a.reshape(len(a), self.count, self.forms)[..., self.damped] * self.roots

    def add_damping(self, tensions, f):
        """Add what damping forces f (m, contacts, damped) are in tensions (m, rows), in place."""
        tensions.reshape(len(f), self.count, self.forms)[..., self.damped] += self.roots * f

    def destroy(self):
        """Free what exchanges between ranks."""
        for exchange in self._exchanges.values():
            exchange.destroy()


class _Exchange:
    """Values of unknowns between the ranks that own them and those that feel them, several times at once."""

    def __init__(self, comm, unknowns: int, felt, times: int):
        PETSc = current().PETSc
        self._shapes = (unknowns, times), (len(felt), times)
        self._owned = PETSc.Vec().createMPI((unknowns * times, None), bsize=times, comm=comm)
        self._felt = PETSc.Vec().createSeq(len(felt) * times)
        source = PETSc.IS().createBlock(times, felt.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self._owned, source, self._felt, None)
        source.destroy()

    def gather(self, owned):
        """(felt, times) of (unknowns, times)."""
        self._owned.setArray(np.ascontiguousarray(owned).ravel())
        self._scatter.scatter(self._owned, self._felt)
        return self._felt.getArray().reshape(self._shapes[1])

    def add(self, felt):
        """(unknowns, times), sums over ranks of (felt, times)."""
        PETSc = current().PETSc
        self._felt.setArray(np.ascontiguousarray(felt).ravel())
        self._owned.zeroEntries()
        backwards = {"addv": PETSc.InsertMode.ADD_VALUES, "mode": PETSc.ScatterMode.REVERSE}
        self._scatter.scatter(self._felt, self._owned, **backwards)
        return self._owned.getArray().reshape(self._shapes[0]).copy()

    def destroy(self):
        """Free PETSc's objects."""
        for item in (self._owned, self._felt, self._scatter):
            item.destroy()


@dataclass(frozen=True, eq=False)
class State:
    """This rank's part of the unknowns, or of the equations: views into one vector."""

    v: np.ndarray  # (m, unknowns)
    rate: np.ndarray  # (m,) γ̇L under stress control, on rank 0; else (0,)
    f: np.ndarray  # (m, contacts, damped)


@dataclass(frozen=True, eq=False)
class Drive:
    """The amplitude of what is imposed, ∝ cos ωt: of stress in `force` = σ₀V/L, or of strain, γ₀L."""

    stress_controlled: bool
    force: float  # under strain control the size that it is expected to have
    strain: float  # imposed; not used under stress control


@dataclass(frozen=True, eq=False)
class Equations:
    """Residual and its derivative on one cycle. Methods are collective; arrays are this rank's."""

    contacts: Contacts
    cycle: Cycle
    law: PowerLaw
    drive: Drive
    unit: float  # what a unit of damping velocity counts in the second equation, as a force

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
        return -self.cycle.omega * self.drive.strain * np.sin(self.cycle.phase)

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
            out.rate[:] = row - self.drive.force * np.cos(self.cycle.phase)
        out.f[:] = self.law.mismatch(z, state.f, self.unit)

    def derivative(self, tangent, change: State, out: State):
        """Its derivative along a change."""
        held = self.drive.stress_controlled
        rate = self.rate(change) if held else np.zeros(self.cycle.m)
        out.v[:], row, z = self.balance(change, rate)
        if self.holds_rate:
            out.rate[:] = row
        out.f[:] = tangent.mismatch(z, change.f, self.unit)

"""Hessian K, damping matrix B and their load column, of a contact network, as distributed PETSc matrices.

Unknowns are the non-affine displacements ũ = u − ε E x of a load E (`laws.loads`; at first simple shear, γ y x̂) and,
where the law couples to them, the spins θ, interleaved (x, y, θ) per disk, (x, y, z, θ_x, θ_y, θ_z) per sphere. A
contact contributes weighted squares of its relative motions (`laws.relative_motion`):

    K:  k (a∥)² − (f/r) (a⊥)²           (BT eqs. 4, 11)
    B:  kτ₁ × the weights of the law on (a∥)², (a⊥)², (a⊥ᶜ)², |ũ_i|² and V γ²   (see `laws.damping`)
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array

from jampetsc.laws.damping import Law
from jampetsc.laws.loads import ForceLoad, Load, simple_shear
from jampetsc.laws.relative_motion import squares
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import diagonal_of, distributed_matrix
from jampetsc.response.compatibility import BondForms, Compatibility, build_compatibility, drag_of
from jampetsc.response.contact_network import DistributedNetwork, Pieces, find_pieces
from jampetsc.response.mass_matrix import MassMatrix, build_mass_matrix

# by D: |A| ≤ ROW max(diagonal) for the A of a contact network, the most unknowns of one form
ROW = {2: 6.0, 3: 12.0}


@dataclass(frozen=True, eq=False)
class Pencil:
    """K + sB and its load column for one law and load on one network. Matrices and vectors are distributed alike.

    Zero modes of K and B (translations of each connected piece, unless there is drag, and gear modes where disks roll,
    unless there is drag on spins) are removed by pinning one unknown each: its row and column are of the identity
    (times k) in K and zero in B, and zero in the load column. The response does not depend on the choice, because
    K, B and the load column vanish on these modes. Those that the fluid damps are removed by `project` instead.
    """

    network: DistributedNetwork
    law: Law
    pieces: Pieces
    K: object  # PETSc.Mat
    B: object  # PETSc.Mat, same nonzero pattern as K (explicit zeros)
    k_gamma: object  # PETSc.Vec
    b_gamma: object  # PETSc.Vec
    k_gg: float  # k_γγ
    b_gg: float  # b_γγ
    pins: np.ndarray  # pinned unknowns, global numbers
    load: Load
    compatibility: Compatibility  # the relative motions of which K and B are sums of squares
    mass: MassMatrix | None = None  # M of K + sB + s²M; None: overdamped

    def under(self, load: Load) -> "Pencil":
        """The same K and B with the columns of another load. Collective."""
        if load == self.load:
            return self
        c = self.compatibility.under(load)
        pencil = replace(self, load=load, compatibility=c, **_load_parts(c, load, self.pins))
        vars(pencil).update(diagonals=self.diagonals)  # which do not depend on the load
        return pencil

    @property
    def unknowns(self) -> int:
        """Number of unknowns, pinned ones included."""
        return self.network.n * self.dofs

    @property
    def dimension(self) -> int:
        """D, 2 or 3."""
        return self.network.dimension

    @property
    def dofs(self) -> int:
        """Unknowns of each disk."""
        return self.network.dofs(self.law)

    @property
    def rolls(self) -> bool:
        """Whether spins are among the unknowns."""
        return self.network.rolls(self.law)

    @property
    def spins(self):
        """Rows of this rank that are spins, global numbers, (m,)."""
        first, last = (disk * self.dofs for disk in (self.network.first, self.network.last))
        return np.arange(first, last).reshape(-1, self.dofs)[:, self.dimension :].ravel()

    @property
    def inertia(self):
        """Diagonal of M without what is pinned, (n_local,); None: overdamped."""
        return None if self.mass is None else self.mass.pinned_diagonal

    @property
    def mass_scale(self):
        """M^(−½), (n_local,), or 1 without masses: displacements φ of ψ = M^(½)φ, see `mass_matrix.mass_weighted`."""
        return 1.0 if self.mass is None else 1.0 / np.sqrt(self.mass.diagonal)

    @property
    def _projects_translations(self):
        """Whether the fluid alone holds translations, or with masses that share it alike."""
        return self.law.holds_translations and (self.mass is None or self.mass.are_equal)

    @property
    def _projects_gears(self):
        return self.law.holds_spins and self.mass is None

    @property
    def projects(self) -> bool:
        """Whether `project` removes anything: translations or gears that the fluid damps and K does not resist."""
        return self._projects_translations or (self._projects_gears and bool(self.gears.any()))

    @cached_property
    def gears(self):
        """(n,) ±1 where the disks of a piece can turn like gears, else 0, see `Pieces.gears`."""
        return self.pieces.gears(self.compatibility.rows)

    def project(self, x):
        """Remove from x (n_local,), in place, the moves that the fluid damps and K does not resist. Collective.

        They are the mean displacement of each piece under drag, and under drag on spins the turning of gears: no load
        drives them. With unequal masses other motions drive them, and they stay.
        """
        unknowns = x.reshape(-1, self.dofs)
        if self._projects_translations:
            local = unknowns[:, : self.dimension]
            local -= self.pieces.mean(self.network, local)
        if self._projects_gears:
            self.project_gears(unknowns)

    def project_gears(self, unknowns):
        """Remove the turning of gears from (disks, dofs), in place. Collective."""
        if self.gears.any():
            turn = (self.gears / self.network.radii)[self.network.first : self.network.last, None]
            parts = np.column_stack((turn * unknowns[:, self.dimension :], turn**2))
            mean = self.pieces.mean(self.network, parts)
            share = np.divide(mean, mean[:, -1:], out=np.zeros_like(mean), where=mean[:, -1:] != 0.0)
            unknowns[:, self.dimension :] -= turn * share[:, :-1]

    @cached_property
    def _vectors(self):
        return self.K.createVecs()

    def times(self, matrix, x):
        """K or B times x, (n_local,) real. Collective."""
        source, target = self._vectors
        source.setArray(x)
        matrix.mult(source, target)
        return target.getArray().copy()

    @cached_property
    def diagonals(self):
        """The diagonals of K and of B, (n_local,) each, real. Collective."""
        return diagonal_of(self.K), diagonal_of(self.B)

    @cached_property
    def largest_of_kinds(self) -> list[tuple[float, float]]:
        """Largest |diagonal entry| of K and of B on displacements, and on spins if K acts on them. Collective."""
        parts = [part.reshape(-1, self.dofs) for part in self.diagonals]
        kinds = [slice(0, self.dimension), slice(self.dimension, None)][: 1 + self.network.turns_elastically]
        return [tuple(self.network.max(np.abs(part[:, kind])) for part in parts) for kind in kinds]

    @property
    def exerts_forces(self) -> bool:
        """Whether its load is forces on particles: the load column has no viscous part then, and no corner."""
        return isinstance(self.load, ForceLoad)

    @property
    def drags_alone(self) -> bool:
        """Whether all that dissipates is drag on disks that do not turn: B is then diagonal, without a load column."""
        return not (self.law.damps_contacts or self.rolls)

    def diagonal(self, s: float):
        """The diagonal of K + sB, (n_local,). Collective."""
        of_K, of_B = self.diagonals
        return of_K + s * of_B

    @cached_property
    def largest(self) -> tuple[float, float]:
        """Largest |diagonal entry| of K and of B. Collective."""
        return tuple(self.network.max(np.abs(diagonal)) for diagonal in self.diagonals)

    def gathered(self) -> "Pencil":
        """A copy with all rows on every rank, on COMM_SELF; its contacts remain on this rank. Collective."""
        PETSc, MPI, comm = current().PETSc, current().MPI, self.network.comm
        columns = (
            np.concatenate(comm.allgather(vector.getArray())) for vector in (self.k_gamma, self.b_gamma)
        )
        return Pencil(
            replace(self.network, comm=MPI.COMM_SELF, first=0, last=self.network.n),
            self.law, self.pieces,
            *(matrix.getRedundantMatrix(comm.size) for matrix in (self.K, self.B)),
            *(PETSc.Vec().createWithArray(values, comm=PETSc.COMM_SELF) for values in columns),
            self.k_gg, self.b_gg, self.pins, self.load, self.compatibility,
        )  # fmt: skip

    def split(self, x):
        """This rank's (displacement (disks, D), rotation or None) of a solution vector (n_local,).

        Displacements are per unit strain and without the mean of each piece; rotations are (disks,) in 2D, (disks, 3)
        in 3D. Collective.
        """
        moves, spins = np.split(np.asarray(x).reshape(-1, self.dofs), [self.dimension], axis=1)
        displacement = moves - self.pieces.mean(self.network, moves)
        if not self.rolls:
            return displacement, None
        rotation = self.compatibility.bonds.rotation(self.load)
        if rotation is not None:
            spins = spins + rotation
        return displacement, spins[:, 0].copy() if self.dimension == 2 else spins.copy()


def assemble(network: DistributedNetwork, law: Law, pinned: bool = True) -> Pencil:
    """K, B and the load column, in the scalar type of the running PETSc. Collective.

    pinned   whether zero modes are pinned, see `Pencil`; False leaves K + sB singular on them
    """
    c = network.contacts
    dofs, bonds, load = network.dofs(law), BondForms.of(network, law), simple_shear(network.dimension)
    m, rows = len(c), (network.last - network.first) * dofs
    # K is the real, B the imaginary part of one complex array: they have one pattern, and are summed at once.
    near, far = squares(bonds.forms, bonds.weights)

    local = c.i - network.first
    own = np.arange(network.last - network.first)
    diagonal = bonds.sum_of_disks(near)
    component = np.arange(dofs)
    diagonal[:, component, component] += 1j * drag_of(network, law)

    row = np.r_[own, local][:, None, None] * dofs + component[None, :, None]
    column = np.r_[own + network.first, c.j][:, None, None] * dofs + component[None, None, :]
    shape = (len(own) + m, dofs, dofs)
    matrix = coo_array(
        (
            np.concatenate((diagonal, far)).ravel(),
            (np.broadcast_to(row, shape).ravel(), np.broadcast_to(column, shape).ravel()),
        ),
        shape=(rows, network.n * dofs),
    ).tocsr()
    matrix.sort_indices()

    pieces = find_pieces(network)
    pins = pins_of(network, law, pieces) if pinned else np.zeros(0, int)
    _pin(matrix, pins, network.first * dofs, network.k)
    compatibility = build_compatibility(bonds, pins, load)
    mass = build_mass_matrix(network, law, pieces, pins) if network.masses else None
    return Pencil(
        network, law, pieces,
        distributed_matrix(network.comm, matrix, matrix.data.real),
        distributed_matrix(network.comm, matrix, matrix.data.imag),
        **_load_parts(compatibility, load, pins), pins=pins, load=load, compatibility=compatibility, mass=mass,
    )  # fmt: skip


def _load_parts(compatibility, load, pins):
    """The load column and the corner of K and of B of a `Pencil`. Collective."""
    network = compatibility.network
    column, corner = compatibility.bonds.load_column(load, pins)
    column -= compatibility.force
    corner += 1j * compatibility.drag_gg
    return {
        "k_gamma": _vector(network.comm, column.real),
        "b_gamma": _vector(network.comm, column.imag),
        "k_gg": float(corner.real),
        "b_gg": float(corner.imag),
    }


def pins_of(network: DistributedNetwork, law: Law, pieces: Pieces):
    """Unknowns to pin against zero modes: moves of a disk of each piece, spins of one of each piece of gears.

    What the fluid damps is not pinned.
    """
    roots, dofs, pinned = pieces.roots, network.dofs(law), [np.zeros(0, int)]
    moves, spins = np.split(np.arange(dofs), [pieces.dimension])
    if network.rolls(law) and not law.holds_spins:
        gears = pieces.gears(network.contact_forms(law))[roots] != 0.0
        pinned.append((roots[gears, None] * dofs + spins).ravel())
    if not law.holds_translations:
        pinned.append((roots[:, None] * dofs + moves).ravel())
    return np.sort(np.concatenate(pinned))


def _pin(matrix, pins, offset, k):
    """Turn rows and columns of pinned unknowns into the identity's (times k in K), in place."""
    matrix.data[np.isin(matrix.indices, pins)] = 0.0
    for row in pins - offset:
        if 0 <= row < matrix.shape[0]:
            entries = slice(matrix.indptr[row], matrix.indptr[row + 1])
            matrix.data[entries] = np.where(matrix.indices[entries] == row + offset, k, 0.0)


def _vector(comm, values):
    PETSc = current().PETSc
    return PETSc.Vec().createWithArray(values.astype(PETSc.ScalarType), comm=comm)

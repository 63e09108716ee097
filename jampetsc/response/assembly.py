"""Hessian K, damping matrix B and their border, the load, of a contact network, as distributed PETSc matrices.

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
from jampetsc.laws.loads import Load, simple_shear
from jampetsc.laws.relative_motion import squares
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import diagonal_of, distributed_matrix
from jampetsc.response.compatibility import Compatibility, build_compatibility, forms_of, weights
from jampetsc.response.contact_network import DistributedNetwork, Pieces, find_pieces

# by D: |A| ≤ ROW max(diagonal) for the A of a contact network, the most unknowns of one form
ROW = {2: 6.0, 3: 12.0}


@dataclass(frozen=True, eq=False)
class Pencil:
    """K + sB and its border for one law and load on one network. Matrices and vectors are distributed alike.

    Zero modes of K and B (translations of each connected piece, unless there is drag, and gear modes where disks roll)
    are removed by pinning one unknown each: its row and column are of the identity (times k) in K and zero in B,
    and its border entries are zero. The response does not depend on the choice, because K, B and the border vanish on
    these modes. Under drag translations dissipate, and `project` removes them instead.
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

    def under(self, load: Load) -> "Pencil":
        """The same K and B with the border of another load. Collective."""
        if load == self.load:
            return self
        c = self.compatibility.under(load)
        forces = [c.forces(w * c.g) for w in (c.w_K, c.w_B)]
        corner = self.network.sum(np.array([c.w_K @ c.g**2, c.w_B @ c.g**2]))
        border = (_vector(self.network.comm, force) for force in forces)
        k_gamma, b_gamma = border
        k_gg, b_gg = corner + np.array([0.0, c.drag_gg])
        pencil = replace(
            self, load=load, k_gamma=k_gamma, b_gamma=b_gamma, k_gg=float(k_gg), b_gg=float(b_gg)
        )
        # What does not depend on the load is not computed again.
        vars(pencil).update(compatibility=c, diagonals=self.diagonals)
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
        return self.law.dofs(self.dimension)

    @property
    def spins(self):
        """Rows of this rank that are spins, global numbers, (m,)."""
        first, last = (disk * self.dofs for disk in (self.network.first, self.network.last))
        return np.arange(first, last).reshape(-1, self.dofs)[:, self.dimension :].ravel()

    def project(self, x):
        """Remove the mean displacement of each piece from x (n_local,), in place, if none is pinned. Collective."""
        if not self.law.holds_translations:
            return
        local = x.reshape(-1, self.dofs)[:, : self.dimension]
        local -= self.pieces.mean(self.network, local)

    @cached_property
    def compatibility(self) -> Compatibility:
        """The relative motions of which K and B are sums of squares. Collective."""
        return build_compatibility(self.network, self.law, self.pins)

    @cached_property
    def diagonals(self):
        """The diagonals of K and of B, (n_local,) each, real. Collective."""
        return diagonal_of(self.K), diagonal_of(self.B)

    @property
    def displacement_diagonals(self):
        """The diagonals of K and of B on displacements, (n_local / dofs, D) each. Collective."""
        return [part.reshape(-1, self.dofs)[:, : self.dimension] for part in self.diagonals]

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
        border = (
            np.concatenate(comm.allgather(vector.getArray())) for vector in (self.k_gamma, self.b_gamma)
        )
        return Pencil(
            replace(self.network, comm=MPI.COMM_SELF, first=0, last=self.network.n),
            self.law, self.pieces,
            *(matrix.getRedundantMatrix(comm.size) for matrix in (self.K, self.B)),
            *(PETSc.Vec().createWithArray(values, comm=PETSc.COMM_SELF) for values in border),
            self.k_gg, self.b_gg, self.pins, self.load,
        )  # fmt: skip

    def split(self, x):
        """This rank's (displacement (disks, D), rotation or None) of a solution vector (n_local,).

        Displacements are per unit strain and without the mean of each piece; rotations are (disks,) in 2D, (disks, 3)
        in 3D. Collective.
        """
        moves, spins = np.split(np.asarray(x).reshape(-1, self.dofs), [self.dimension], axis=1)
        displacement = moves - self.pieces.mean(self.network, moves)
        if not self.law.couples_rotations:
            return displacement, None
        return displacement, spins[:, 0].copy() if self.dimension == 2 else spins.copy()


def assemble(network: DistributedNetwork, law: Law, pinned: bool = True) -> Pencil:
    """K, B and the border, in the scalar type of the running PETSc. Collective.

    pinned   whether zero modes are pinned, see `Pencil`; False leaves K + sB singular on them
    """
    dimension, c = network.dimension, network.contacts
    dofs = law.dofs(dimension)
    m, rows = len(c), (network.last - network.first) * dofs
    # K is the real, B the imaginary part of one complex array: they have one pattern, and are summed at once.
    near, far, border, corner = squares(forms_of(network, law), weights(network, law))
    corner = network.sum(np.sum(corner)) / 2.0  # each contact is seen from both ends

    local = c.i - network.first
    own = np.arange(network.last - network.first)
    starts = np.searchsorted(local, own)  # contacts come ordered by i, and every disk here has some
    diagonal = np.add.reduceat(near, starts)
    gamma = np.add.reduceat(border, starts)
    damping = network.damping(law)
    moves = np.arange(dimension)
    diagonal[:, moves, moves] += 1j * damping * law.drag
    corner += 1j * damping * law.eta_f * network.volume

    component = np.arange(dofs)
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
    gamma = gamma.ravel()

    pieces = find_pieces(network)
    pins = pins_of(law, pieces) if pinned else np.zeros(0, int)
    _pin(matrix, gamma, pins, network.first * dofs, network.k)
    return Pencil(
        network, law, pieces,
        distributed_matrix(network.comm, matrix, matrix.data.real),
        distributed_matrix(network.comm, matrix, matrix.data.imag),
        _vector(network.comm, gamma.real), _vector(network.comm, gamma.imag),
        float(corner.real), float(corner.imag), pins, simple_shear(dimension),
    )  # fmt: skip


def pins_of(law: Law, pieces: Pieces):
    """Unknowns to pin against zero modes: moves of a disk of each piece, spins of one of each bipartite piece."""
    roots, dofs = pieces.roots, law.dofs(pieces.dimension)
    moves, spins = np.split(np.arange(dofs), [pieces.dimension])
    pinned = [(roots[pieces.bipartite[roots], None] * dofs + spins).ravel()]
    if not law.holds_translations:
        pinned.append((roots[:, None] * dofs + moves).ravel())
    return np.sort(np.concatenate(pinned))


def _pin(matrix, gamma, pins, offset, k):
    """Turn rows and columns of pinned unknowns into the identity's (times k in K), in place."""
    matrix.data[np.isin(matrix.indices, pins)] = 0.0
    for row in pins - offset:
        if 0 <= row < matrix.shape[0]:
            entries = slice(matrix.indptr[row], matrix.indptr[row + 1])
            matrix.data[entries] = np.where(matrix.indices[entries] == row + offset, k, 0.0)
            gamma[row] = 0.0


def _vector(comm, values):
    PETSc = current().PETSc
    return PETSc.Vec().createWithArray(values.astype(PETSc.ScalarType), comm=comm)

"""K, B and the γ border of a packing for other programs: as PETSc has them, or gathered for scipy and pymor.

With unknowns x and a strain γ of amplitude 1 at frequency ω (BT eqs. 10–14)

    (K + iωB) x = −(k_γ + iω b_γ) ,     G* = [k_γγ + iω b_γγ + (k_γ + iω b_γ)ᵀ x] / V ,

nothing pinned and nothing scaled. Leave out the rows and columns of `pins` to make K + iωB regular.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from jampetsc.errors import MissingPackage
from jampetsc.laws.damping import Law
from jampetsc.network.contact_network import Network
from jampetsc.petsc.sparse_matrices import whole_matrix
from jampetsc.response.assembly import assemble, pins_of

SPARSE, VECTORS, NUMBERS = ("K", "B"), ("k_gamma", "b_gamma"), ("k_gg", "b_gg", "area")
ROWS = ("particles", "dofs", "pins")
NAMES = (*SPARSE, *VECTORS, *NUMBERS, *ROWS)


@dataclass(frozen=True, eq=False)
class PackingMatrices:
    """K and B of u unknowns of the n disks that bear load, (x, y) or, where disks roll, (x, y, θ) one after another."""

    K: object  # (u, u) PETSc.Mat, or scipy's csr_array; k
    B: object  # (u, u) the same; kτ₁
    k_gamma: object  # (u,) PETSc.Vec, or numpy: derivative of the energy by an unknown and by γ
    b_gamma: object  # (u,)
    k_gg: float  # k_γγ = V G_A, G_A the modulus of affine motion
    b_gg: float  # b_γγ = V η_∞ of affine motion
    area: float  # V
    particles: np.ndarray  # (n,) numbers of the disks in the packing file
    dofs: np.ndarray  # (u, 2) of every unknown: number of its disk in the packing file; 0 x, 1 y, 2 θ
    pins: np.ndarray  # unknowns to leave out, so that K + iωB is regular

    def to_scipy(self) -> "PackingMatrices":
        """The same matrices whole on every rank, K and B as csr_array, the border as numpy arrays. Collective."""
        if not hasattr(self.K, "getValuesCSR"):
            return self
        comm = self.K.getComm().tompi4py()
        return PackingMatrices(
            *(whole_matrix(getattr(self, name)) for name in SPARSE),
            *(np.concatenate(comm.allgather(getattr(self, name).getArray().real)) for name in VECTORS),
            *(getattr(self, name) for name in (*NUMBERS, *ROWS)),
        )

    def to_pymor(self):
        """A pymor LTIModel from the rate γ̇ to the stress σ, the whole of it on every rank: H(iω) = G*/iω. Collective.

        With v = ẋ and without the rows of `pins`

            ẋ = v ,   0 = −K x − B v − k_γ γ − b_γ γ̇ ,   γ̇ = u ,   σ = (k_γᵀ x + b_γᵀ v + k_γγ γ + b_γγ γ̇)/V ,

        2 (unknowns) + 1 states (x, v, γ). Raises InputError where pymor is not installed.
        """
        try:
            from pymor.models.iosys import LTIModel
        except ImportError:
            raise MissingPackage("to_pymor", "pymor") from None
        from scipy.sparse import bmat, csc_matrix, eye

        whole = self.to_scipy()
        kept = np.setdiff1d(np.arange(len(whole.dofs)), whole.pins)
        K, B = (matrix[kept][:, kept] for matrix in (whole.K, whole.B))
        k, b = whole.k_gamma[kept], whole.b_gamma[kept]
        one, null = eye(len(kept)), np.zeros(len(kept))
        column = [csr_array(-vector[:, None]) for vector in (k, b)]
        A = bmat([[None, one, None], [-K, -B, column[0]], [None, None, csr_array((1, 1))]])
        E = bmat([[one, None, None], [None, 0 * K, None], [None, None, csr_array([[1.0]])]])
        into = np.concatenate((null, -b, [1.0]))[:, None]
        out = np.concatenate((k, b, [whole.k_gg]))[None] / whole.area
        through = np.array([[whole.b_gg / whole.area]])
        return LTIModel.from_matrices(csc_matrix(A), into, out, through, csc_matrix(E))

    def destroy(self):
        """Free the PETSc objects. Collective."""
        for name in (*SPARSE, *VECTORS):
            getattr(self, name).destroy()


def build_matrices(network: Network, law: Law) -> PackingMatrices:
    """The matrices of a network under a law. Collective."""
    comm, pencil = network.comm, assemble(network, law, pinned=False)
    particles = np.concatenate(comm.allgather(network.particles))
    component = np.tile(np.arange(law.dofs), len(particles))
    return PackingMatrices(
        *(getattr(pencil, name) for name in (*SPARSE, *VECTORS, "k_gg", "b_gg")),
        area=network.area,
        particles=particles,
        dofs=np.column_stack((np.repeat(particles, law.dofs), component)),
        pins=pins_of(law, pencil.pieces),
    )

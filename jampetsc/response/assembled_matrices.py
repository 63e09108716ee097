"""K, B and the load column of a packing for other programs: as PETSc has them, or gathered for scipy and pymor.

With unknowns x and a load of amplitude γ = 1 at frequency ω (BT eqs. 10–14; `laws.loads`: G* is the modulus of the
energy along F = 1 + γE)

    (K + iωB) x = −(k_γ + iω b_γ) ,     G* = [k_γγ + iω b_γγ + (k_γ + iω b_γ)ᵀ x] / V ,

nothing pinned and nothing scaled. Leave out the rows and columns of `pins` to make K + iωB regular.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from jampetsc.errors import InputError, MissingPackage, named
from jampetsc.laws.damping import Law
from jampetsc.petsc.sparse_matrices import whole_matrix
from jampetsc.response.assembly import assemble, pins_of
from jampetsc.response.contact_network import DistributedNetwork

SPARSE, VECTORS, CORNERS = ("K", "B"), ("k_gamma", "b_gamma"), ("k_gg", "b_gg")
NUMBERS = (*CORNERS, "area")
ROWS = ("particles", "dofs", "pins")
NAMES = (*SPARSE, *VECTORS, *NUMBERS, *ROWS)


@dataclass(frozen=True, eq=False)
class PackingMatrices:
    """K and B of u unknowns of the n disks that bear load: x, y, (z) and, where disks roll, spins, disk after disk."""

    K: object  # (u, u) PETSc.Mat, or scipy's csr_array; k
    B: object  # (u, u) the same; kτ₁
    k_gamma: object  # (u,) PETSc.Vec, or numpy: derivative of the energy by an unknown and γ; of a tensor L Vec, (u, L)
    b_gamma: object  # (u,) the same
    k_gg: object  # k_γγ = V G_A, G_A the modulus of affine motion; of a tensor (L, L)
    b_gg: object  # b_γγ = V η_∞ of affine motion; the same
    area: float  # V
    particles: np.ndarray  # (n,) numbers of the disks in the packing file
    # (u, 2) of every unknown: number of its disk in the packing file; 0 x, 1 y, 2 θ, in 3D 2 z, 3 … 5 θ
    dofs: np.ndarray
    pins: np.ndarray  # unknowns to leave out, so that K + iωB is regular

    def to_scipy(self) -> "PackingMatrices":
        """The same matrices whole on every rank, K and B as csr_array, load columns as numpy arrays. Collective."""
        if not hasattr(self.K, "getValuesCSR"):
            return self
        comm = self.K.getComm().tompi4py()
        return PackingMatrices(
            *(whole_matrix(getattr(self, name)) for name in SPARSE),
            *(_whole_border(comm, getattr(self, name)) for name in VECTORS),
            *(getattr(self, name) for name in (*NUMBERS, *ROWS)),
        )

    def to_pymor(self):
        """A pymor LTIModel from the rate γ̇ to the stress σ, the whole of it on every rank: H(iω) = G*/iω. Collective.

        With v = ẋ and without the rows of `pins`

            ẋ = v ,   0 = −K x − B v − k_γ γ − b_γ γ̇ ,   γ̇ = u ,   σ = (k_γᵀ x + b_γᵀ v + k_γγ γ + b_γγ γ̇)/V ,

        2 (unknowns) + 1 states (x, v, γ). Raises InputError for a tensor, and where pymor is not installed.
        """
        if isinstance(self.k_gamma, tuple) or np.ndim(self.k_gg):
            raise InputError(f"to_pymor: matrices of a tensor. Assemble them for a single {named('load')}.")
        try:
            from pymor.models.iosys import LTIModel
        except ImportError:
            raise MissingPackage("to_pymor", "pymor") from None
        from scipy.sparse import bmat, csc_matrix, eye

        whole = self.to_scipy()
        kept = np.setdiff1d(np.arange(len(whole.dofs)), whole.pins)
        K, B = (matrix[kept][:, kept] for matrix in (whole.K, whole.B))
        k, b = whole.k_gamma[kept], whole.b_gamma[kept]
        identity, null = eye(len(kept)), np.zeros(len(kept))
        column = [csr_array(-vector[:, None]) for vector in (k, b)]
        A = bmat([[None, identity, None], [-K, -B, column[0]], [None, None, csr_array((1, 1))]])
        E = bmat([[identity, None, None], [None, 0 * K, None], [None, None, csr_array([[1.0]])]])
        into = np.concatenate((null, -b, [1.0]))[:, None]
        out = np.concatenate((k, b, [whole.k_gg]))[None] / whole.area
        through = np.array([[whole.b_gg / whole.area]])
        return LTIModel.from_matrices(csc_matrix(A), into, out, through, csc_matrix(E))

    def destroy(self):
        """Free the PETSc objects. Collective."""
        for name in (*SPARSE, *VECTORS):
            value = getattr(self, name)
            for item in value if isinstance(value, tuple) else (value,):
                item.destroy()


def _whole_border(comm, vectors):
    """A load column (u,), or all of a tensor (u, L), on every rank. Collective."""
    if isinstance(vectors, tuple):
        return np.column_stack([_whole_border(comm, vector) for vector in vectors])
    return np.concatenate(comm.allgather(vectors.getArray().real))


def build_matrices(network: DistributedNetwork, law: Law, loads=None) -> PackingMatrices:
    """The matrices of a network under a law. Collective.

    loads   one, simple shear if not given, or several, whose columns stand side by side
    """
    comm, pencil = network.comm, assemble(network, law, pinned=False)
    pencils = [pencil.under(load) for load in loads or [pencil.load]]
    of_loads = [getattr(pencils[0], name) for name in (*VECTORS, *CORNERS)]
    if len(pencils) > 1:
        of_loads = [tuple(getattr(item, name) for item in pencils) for name in VECTORS] + corners(pencils)
    particles = np.concatenate(comm.allgather(network.particles))
    component = np.tile(np.arange(pencil.dofs), len(particles))
    return PackingMatrices(
        pencil.K, pencil.B, *of_loads,
        area=network.volume,
        particles=particles,
        dofs=np.column_stack((np.repeat(particles, pencil.dofs), component)),
        pins=pins_of(network, law, pencil.pieces),
    )  # fmt: skip


def corners(pencils):
    """[k, b] (L, L) between the loads of pencils that differ in the load alone. Collective."""
    c, network = pencils[0].compatibility, pencils[0].network
    g = np.array([pencil.compatibility.g for pencil in pencils])
    fluid = np.array([[c.fluid_gg(pencil.load, other.load) for other in pencils] for pencil in pencils])
    return [network.sum((g * c.w_K) @ g.T), network.sum((g * c.w_B) @ g.T) + fluid]

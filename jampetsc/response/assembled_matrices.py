"""K, B and the γ border of a packing for other programs: as PETSc has them, gathered for scipy, or in files.

With unknowns x and a strain γ of amplitude 1 at frequency ω (BT eqs. 10–14)

    (K + iωB) x = −(k_γ + iω b_γ) ,     G* = [k_γγ + iω b_γγ + (k_γ + iω b_γ)ᵀ x] / V ,

nothing pinned and nothing scaled. Leave out the rows and columns of `pins` to make K + iωB regular.
"""

import io
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import csr_array

from jampetsc.collective import on_root
from jampetsc.errors import InputError, MissingPackage, named
from jampetsc.io.atomic import write_whole
from jampetsc.laws.damping import Physics
from jampetsc.network.contact_network import build_network
from jampetsc.packing.packing import Packing
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import whole_matrix
from jampetsc.response.assembly import assemble, pins_of

ENDINGS = (".npz", ".mtx", ".petsc")
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


def matrices_of(disks: Packing, physics: Physics, comm) -> PackingMatrices:
    """The matrices of a packing that every rank has read. Collective. Raises InputError where it is not rigid."""
    network, law = build_network(disks, comm, physics.prestress), physics.law
    pencil = assemble(network, law, pinned=False)
    particles = np.concatenate(comm.allgather(network.particles))
    component = np.tile(np.arange(law.dofs), len(particles))
    return PackingMatrices(
        *(getattr(pencil, name) for name in (*SPARSE, *VECTORS, "k_gg", "b_gg")),
        area=network.area,
        particles=particles,
        dofs=np.column_stack((np.repeat(particles, law.dofs), component)),
        pins=pins_of(law, pencil.pieces),
    )


def files_of(out) -> dict:
    """{name of what it holds, "" for everything: path} of the files that `write_matrices` puts at `out`.

    Raises InputError for an ending without a format.
    """
    path = Path(out)
    if path.suffix not in ENDINGS:
        raise InputError(f"{named('out')} {out}: choose the ending of a format: {', '.join(ENDINGS)}")
    if path.suffix == ".mtx":  # Matrix Market: a matrix a file
        return {name: path.with_name(f"{path.stem}-{name}.mtx") for name in NAMES}
    return {"": path}


def write_matrices(out, matrices: PackingMatrices) -> None:
    """Write the files of `files_of`. Collective. Raises InputError or JampetscError where that fails."""
    comm, files = matrices.K.getComm().tompi4py(), files_of(out)
    if Path(out).suffix == ".petsc":
        _write_petsc(comm, files[""], matrices)
        return
    whole = matrices.to_scipy()
    on_root(comm, lambda: _write_npz(files[""], whole) if "" in files else _write_mtx(files, whole))


def _write_npz(path, whole):
    """K and B have one pattern: scipy.sparse.csr_array((K, indices, indptr))."""
    held = {name: getattr(whole, name) for name in NAMES if name not in SPARSE}
    content = io.BytesIO()
    np.savez(content, indptr=whole.K.indptr, indices=whole.K.indices, K=whole.K.data, B=whole.B.data, **held)
    write_whole(path, content.getvalue())


def _write_mtx(files, whole):
    for name, path in files.items():
        value, content = getattr(whole, name), io.BytesIO()
        array = value if name in SPARSE else np.reshape(value, (len(np.atleast_1d(value)), -1))
        mmwrite(content, array, precision=17, symmetry="general")
        write_whole(path, content.getvalue())


def _write_petsc(comm, path, matrices):
    """PETSc binary, one after another: Mat K, B, Vec k_γ, b_γ, Vec (k_γγ, b_γγ, V), IS of disk numbers, IS of pins."""
    PETSc, first = current().PETSc, comm.rank == 0
    numbers = PETSc.Vec().createMPI((3 if first else 0, 3), comm=comm)
    if first:
        numbers.getArray()[:] = [getattr(matrices, name) for name in NUMBERS]
    sets = [
        PETSc.IS().createGeneral((rows if first else rows[:0]).astype(PETSc.IntType), comm=comm)
        for rows in (matrices.particles, matrices.pins)
    ]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(comm.bcast(folder)) / "matrices"
        viewer = PETSc.Viewer().createBinary(str(file), "w", comm=comm)  # rank 0 writes
        for item in (*(getattr(matrices, name) for name in (*SPARSE, *VECTORS)), numbers, *sets):
            item.view(viewer)
        viewer.destroy()  # it writes the last of it
        on_root(comm, lambda: write_whole(path, file.read_bytes()))

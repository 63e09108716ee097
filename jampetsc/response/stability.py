"""Properties of K and B of a packing: size, asymmetry of the assembled matrices, inertia."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.network.contact_network import Network
from jampetsc.petsc.inertia import Inertia, count_eigenvalues
from jampetsc.petsc.session import current
from jampetsc.response.assembly import assemble
from jampetsc.response.minimum_check import count_modes


@dataclass(frozen=True, eq=False)
class Examination:
    """Facts about the matrices of one law on one network."""

    contacts: int  # on all ranks
    unknowns: int  # rows of K and B
    dofs: int  # unknowns of each disk
    nonzeros: int  # entries stored in each of K and B
    pieces: int  # connected pieces of the contact graph
    gears: int  # bipartite pieces, whose disks can turn like gears
    pins: int  # pinned unknowns, see `assembly.Pencil`
    asymmetry_K: float  # ‖K − Kᵀ‖ / ‖K‖ (Frobenius)
    asymmetry_B: float
    with_prestress: Inertia  # of K on the displacements, nothing pinned: two zeros per piece are translations
    without_prestress: Inertia
    damping: Inertia  # of B, pinned unknowns left out

    @property
    def translations(self) -> int:
        """Moves that cost no energy whatever the packing: two for each piece."""
        return 2 * self.pieces


def asymmetry(matrix) -> float:
    """‖A − Aᵀ‖ / ‖A‖ in the Frobenius norm. Collective."""
    PETSc = current().PETSc
    difference = matrix.transpose(PETSc.Mat())
    difference.axpy(-1.0, matrix, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    norm = matrix.norm(PETSc.NormType.FROBENIUS)
    result = difference.norm(PETSc.NormType.FROBENIUS) / norm if norm else 0.0
    return float(result)


def examine(network: Network, law: Law) -> Examination:
    """Assemble K and B of `law` and examine them. Collective; needs the real build of PETSc.

    Raises ConvergenceError if a factorisation fails.
    """
    pencil = assemble(network, law)
    roots = pencil.pieces.roots
    return Examination(
        contacts=network.contact_count,
        unknowns=pencil.unknowns,
        dofs=law.dofs,
        nonzeros=int(pencil.K.getInfo(current().PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]),
        pieces=len(roots),
        gears=int(np.count_nonzero(pencil.pieces.bipartite[roots])),
        pins=len(pencil.pins),
        asymmetry_K=asymmetry(pencil.K),
        asymmetry_B=asymmetry(pencil.B),
        with_prestress=count_modes(replace(network, prestress=True)),
        without_prestress=count_modes(network.unstressed()),
        damping=count_eigenvalues(pencil.B, "B", pencil.pins),
    )

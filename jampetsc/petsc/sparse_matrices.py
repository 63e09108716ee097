"""Distributed PETSc matrices from local rows, their diagonals, and all rows on every rank."""

import numpy as np
from scipy.sparse import csr_array

from jampetsc.petsc.session import current


def distributed_matrix(comm, csr, values, columns: int | None = None):
    """A PETSc Mat of this rank's rows, a scipy CSR array with `values` for its data. Collective.

    columns   how many of them belong to this rank; None: a symmetric matrix
    """
    PETSc = current().PETSc
    current().free_dropped(comm)  # dropped matrices make room
    rows, width = csr.shape
    structure = (part.astype(PETSc.IntType) for part in (csr.indptr, csr.indices))
    matrix = PETSc.Mat().createAIJ(
        ((rows, None), (rows if columns is None else columns, width)),
        csr=(*structure, values.astype(PETSc.ScalarType)),
        comm=comm,
    )
    if columns is None:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
    return matrix


def whole_matrix(matrix):
    """All rows of a distributed PETSc Mat, real, as csr_array on every rank. Collective."""
    parts = matrix.getComm().tompi4py().allgather(matrix.getValuesCSR())
    lengths = np.concatenate([np.diff(starts) for starts, *_ in parts])
    columns, values = (np.concatenate([part[which] for part in parts]) for which in (1, 2))
    return csr_array((values.real, columns, np.append(0, np.cumsum(lengths))), shape=matrix.getSize())


def diagonal_of(matrix):
    """This rank's part of the diagonal, (n_local,), real. Collective."""
    return matrix.getDiagonal().getArray().real.copy()


def set_diagonal(matrix, rows, value: float) -> None:
    """Put `value` on the diagonal of these rows, global numbers (m,) that all ranks give. Collective."""
    first, last = matrix.getOwnershipRange()
    diagonal = matrix.getDiagonal()
    diagonal.getArray()[rows[(rows >= first) & (rows < last)] - first] = value
    matrix.setDiagonal(diagonal)

"""Distributed PETSc matrices from local rows, and what one asks of them."""

import numpy as np

from jampetsc.petsc.session import current


def distributed_matrix(comm, csr, values):
    """A symmetric PETSc Mat of this rank's rows, a scipy CSR array with `values` for its data. Collective."""
    PETSc = current().PETSc
    rows, columns = csr.shape
    matrix = PETSc.Mat().createAIJ(
        ((rows, columns), (rows, columns)),
        csr=(
            csr.indptr.astype(PETSc.IntType),
            csr.indices.astype(PETSc.IntType),
            values.astype(PETSc.ScalarType),
        ),
        comm=comm,
    )
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
    return matrix


def diagonal_of(matrix):
    """This rank's part of the diagonal, (n_local,), real. Collective."""
    diagonal = matrix.getDiagonal()
    values = diagonal.getArray().real.copy()
    diagonal.destroy()
    return values


def set_diagonal(matrix, rows, value: float) -> None:
    """Put `value` on the diagonal of these rows, global numbers (m,) that all ranks give. Collective."""
    first, last = matrix.getOwnershipRange()
    diagonal = matrix.getDiagonal()
    diagonal.getArray()[rows[(rows >= first) & (rows < last)] - first] = value
    matrix.setDiagonal(diagonal)
    diagonal.destroy()


def largest_entry(matrix) -> float:
    """Largest diagonal entry of a matrix of squares, in modulus the largest of all. Collective."""
    local = float(np.abs(diagonal_of(matrix)).max(initial=0.0))
    return max(matrix.getComm().tompi4py().allgather(local))

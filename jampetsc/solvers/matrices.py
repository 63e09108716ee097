"""Distributed PETSc matrices out of the rows that each rank has."""

from jampetsc.session import current


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

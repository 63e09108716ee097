"""Distributed objects as whole numpy arrays on every rank, and back. All functions are collective."""

import numpy as np
from scipy.sparse import csr_array

from jampetsc.petsc.session import current


def csr(matrix):
    """The whole PETSc Mat as (indptr, indices, values)."""
    parts = matrix.getComm().tompi4py().allgather(matrix.getValuesCSR())
    indptr = np.concatenate([[0], *(np.diff(part[0]) for part in parts)]).cumsum()
    return indptr, *(np.concatenate([part[k] for part in parts]) for k in (1, 2))


def dense(matrix):
    """The whole PETSc Mat, (rows, columns)."""
    indptr, indices, values = csr(matrix)
    return csr_array((values, indices, indptr), shape=matrix.getSize()).toarray()


def whole(vector):
    """The whole PETSc Vec."""
    return np.concatenate(vector.getComm().tompi4py().allgather(vector.getArray().copy()))


def unknowns(network, dofs, disks):
    """For each unknown of `network` its row where `disks`, the particles in file order, are numbered."""
    particles = np.concatenate(network.comm.allgather(network.particles))
    rows = {particle: row for row, particle in enumerate(disks)}
    return (np.array([rows[particle] for particle in particles])[:, None] * dofs + np.arange(dofs)).ravel()


def spread(comm, dense):
    """A PETSc Mat with these entries, (n, n), zeros included."""
    matrix = current().PETSc.Mat().createAIJ(len(dense), nnz=len(dense), comm=comm)
    for row in range(*matrix.getOwnershipRange()):
        matrix.setValues(row, range(len(dense)), dense[row])
    matrix.assemble()
    return matrix

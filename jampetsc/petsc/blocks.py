"""A Hessian that lies on one rank, as a sum of 2×2 blocks over contacts, factorised by `minimise.ldl`.

A_ij = −b_ij for disks i ≠ j, A_ii = Σ_j b_ij, b symmetric. A block has one index where a library that sees single
entries has four, and the order of elimination is that of disks: a factorisation takes a third of the time of CHOLMOD
at N = 4096, half at 32768. It does not compute in dense blocks, so it takes longer at 1e5; its solves do not.
"""

import numpy as np

from jampetsc.minimise import ldl
from jampetsc.petsc.cholesky import suitesparse
from jampetsc.petsc.session import current


def factorised(matrix, shift: float):
    """A function b → (A + shift)⁻¹b, (2N,) each, for the PETSc.Mat A; None where A + shift is not positive definite."""
    from scipy.sparse import csr_array  # a quench does without

    n = matrix.getSize()[0] // 2
    indptr, indices, values = matrix.getValuesCSR()
    blocks = csr_array((values, indices, indptr), shape=matrix.getSize()).tobsr((2, 2))
    rows = np.repeat(np.arange(n), np.diff(blocks.indptr))
    upper = rows < blocks.indices
    # unsigned, as in a pair list, for which the code has been compiled already
    i, j = rows[upper].astype(np.uint32), blocks.indices[upper].astype(np.uint32)
    pairs = i, j, -blocks.data[upper], np.ones(len(i), bool)
    diagonal = ldl.diagonal_of(*pairs, np.full(n, shift))
    definite, factor = ldl.factorise(elimination_order(n, i, j), *pairs, diagonal)
    if not definite:
        return None
    work = np.empty((n, 2))

    def solve(b):
        x = np.empty((n, 2))
        ldl.solve(factor, b.reshape(n, 2), x, work)
        return x.ravel()

    return solve


def elimination_order(n: int, i, j):
    """N disks in the order of their elimination, by approximate minimum degree (N,); pairs (M,) i, j are neighbours."""
    petsc, disks = current().PETSc, np.arange(n)
    ends, others = np.concatenate((i, j, disks)), np.concatenate((j, i, disks))
    entries = np.unique(ends * n + others)  # row by row
    indptr = np.searchsorted(entries, n * np.arange(n + 1)).astype(petsc.IntType)
    pattern = petsc.Mat().createAIJ(
        (n, n),
        csr=(indptr, (entries % n).astype(petsc.IntType), np.ones(len(entries))),
        comm=petsc.COMM_SELF,
    )
    rows, _ = pattern.getOrdering("amd" if suitesparse() else "qmd")
    return rows.getIndices().astype(np.uint32)

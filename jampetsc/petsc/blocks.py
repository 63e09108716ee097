"""A Hessian that one rank has whole as a sum of 2×2 blocks over contacts, for `minimise.ldl` to factorise.

A_ij = −b_ij for disks i ≠ j, A_ii = Σ_j b_ij, b symmetric. A block has one index where a library that sees single
entries has four, and the order of elimination is that of disks: a factor costs a third of what CHOLMOD's does at
N = 4096, half at 32768. Its flops, not in dense blocks, tell beyond: at 1e5 it costs more, though solves do not.
"""

import numpy as np
from scipy.sparse import csr_array

from jampetsc.minimise import ldl
from jampetsc.petsc.cholesky import suitesparse
from jampetsc.petsc.session import current


class Blocks:
    """The blocks of a PETSc.Mat, and the order in which its disks are eliminated.

    i, j     (M,) contacts, i < j
    values   (M, 2, 2) b_ij
    order    (N,) disks, as they are eliminated
    """

    def __init__(self, matrix):
        size = matrix.getSize()
        indptr, indices, values = matrix.getValuesCSR()
        blocks = csr_array((values, indices, indptr), shape=size).tobsr((2, 2))
        rows = np.repeat(np.arange(size[0] // 2), np.diff(blocks.indptr))
        upper = rows < blocks.indices
        # unsigned, as in a list of pairs: compiled code is compiled for them already
        self.i, self.j = rows[upper].astype(np.uint32), blocks.indices[upper].astype(np.uint32)
        self.values = -blocks.data[upper]
        self.order = elimination_order(size[0] // 2, self.i, self.j)

    def factorise(self, shift: float):
        """A function b → (A + shift)⁻¹b, (2N,) each; None where A + shift is not positive definite."""
        n = len(self.order)
        definite, factor = ldl.factorise(
            self.order, self.i, self.j, self.values, np.ones(len(self.i), bool), np.full(n, shift)
        )
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
    rows, columns = pattern.getOrdering("amd" if suitesparse() else "qmd")
    order = rows.getIndices().astype(np.uint32)
    for item in (pattern, rows, columns):
        item.destroy()
    return order

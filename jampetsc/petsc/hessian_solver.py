"""Factorised Hessians that lie on one rank: the solvers for `minimisation.newton`, prefix `newton_`.

A symmetric A with a block for each disk and each pair of neighbours is factorised by `minimisation.ldl`, up to
MAX_BLOCK_DISKS disks: a block has one index where a library that sees single entries has four, and disks are
eliminated, not unknowns. The result is the same to the last bit on every processor, whatever BLAS is installed; last
digits decide which minimum a quench ends in. A larger A, and any where options begin with the prefix, is factorised by
`Cholesky`. A quench ends with the proof that it found a minimum, so options with which a factorisation proves nothing
are refused; where no proof is needed, only residuals are checked.
"""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.minimisation import ldl
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite, has_suitesparse
from jampetsc.petsc.session import current

PREFIX, HESSIAN = "newton_", "the Hessian of a Newton step"
# by the order of blocks; beyond, CHOLMOD is faster: four times at 131072 disks, 2.3 times at 1024 spheres and 2.6 times
# at 2048
MAX_BLOCK_DISKS = {2: 32768, 3: 1024}


class NewtonSolver:
    """Solves with real symmetric matrices of this rank alone (MPI_COMM_SELF), and says which are positive definite."""

    def __init__(self, prefix=PREFIX, what=HESSIAN, proves=True):
        self._prefix, self._what, self._proves = prefix, what, proves
        session = current()
        if session.scalar_type != "real":
            raise InputError(
                "Cholesky: complex scalars, not supported. Start the session with scalar='real'."
            )
        self._petsc = session.PETSc
        self._cholesky = self._pattern = None
        if proves:  # options that PETSc or the proof refuses are refused now, not at the first step
            self.factorise(np.array([0, 1], np.int32), np.array([0], np.int32), np.ones(1))

    def factorise(self, indptr, indices, values, order=1, elimination=None) -> bool:
        """Factorise the upper triangle with its diagonal, CSR (int32, sorted). False if not positive definite.

        order         of its blocks
        elimination   disks in the order of their elimination, see `order`; None: chosen for these values

        Raises InputError where the options are such that True would be no proof.
        """
        pattern = (indptr, indices)
        if self._cholesky is None or not all(map(np.array_equal, pattern, self._pattern)):
            self._cholesky, size = None, len(indptr) - 1  # the old factor makes room for the new one
            matrix = self._petsc.Mat().createSBAIJ(
                (size, size), 1, csr=(indptr, indices, values), comm=self._petsc.COMM_SELF
            )
            matrix.assemble()
            self._pattern = pattern
            self._cholesky = Cholesky(matrix, self._prefix, f"{self._what} ({size} unknowns)")
            self._solution, self._right = matrix.createVecs()
        else:
            self._cholesky.matrix.setValuesCSR(indptr, indices, values)
            self._cholesky.matrix.assemble()
        try:
            self._cholesky.factorise()
        except NotPositiveDefinite:
            self._cholesky = None  # its memory is freed
            return False
        if self._proves and self._cholesky.doubt:
            raise InputError(f"{self._cholesky.doubt}, which would prove no minimum. Leave this option out.")
        return True

    def solve(self, b):
        """x with A x = b, (n,) float64, after a `factorise` that returned True."""
        self._right.setArray(b)
        self._cholesky.solve(self._right, self._solution)
        return self._solution.getArray().copy()

    def order(self, n, i, j):
        """N disks in an order of elimination with little fill, (N,); pairs (M,) i, j are neighbours."""
        return elimination_order(n, i, j)


class HessianSolver(NewtonSolver):
    """A `NewtonSolver` for matrices of blocks, as `hessian.Pattern` has them; orders 2 and 3 need no library."""

    def __init__(self, prefix=PREFIX, what=HESSIAN, proves=True):
        self._by_library, self._factor = True, None
        super().__init__(prefix, what, proves)
        self._by_library = current().has_options(prefix)

    def factorise(self, indptr, indices, values, order=2, elimination=None) -> bool:
        """See `NewtonSolver.factorise`."""
        n, self._factor, self._block_order = len(indptr) // order, None, order
        if self._by_library or n > MAX_BLOCK_DISKS.get(order, 0):
            return super().factorise(indptr, indices, values)
        blocks_of = ldl.blocks_of if order == 2 else ldl.space_blocks_of
        i, j, blocks, chosen, diagonal = blocks_of(indptr, indices, values)
        if elimination is None:
            elimination = elimination_order(n, i[chosen], j[chosen])
        definite, self._factor = ldl.factorise(elimination, i, j, blocks, chosen, diagonal)
        return definite

    def solve(self, b):
        """See `NewtonSolver.solve`."""
        if self._factor is None:
            return super().solve(b)
        if not len(self._factor[0]):
            raise RuntimeError("solve: the matrix is not positive definite, so it has no factor")
        b = b.reshape(-1, self._block_order)
        x, work = np.empty_like(b), np.empty_like(b)
        ldl.solve(self._factor, b, x, work)
        return x.ravel()


def block_inverse(matrix, shift: float):
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
    rows, columns = np.concatenate((i, j, disks)), np.concatenate((j, i, disks))
    entries = np.unique(rows * n + columns)  # row by row
    indptr = np.searchsorted(entries, n * np.arange(n + 1)).astype(petsc.IntType)
    pattern = petsc.Mat().createAIJ(
        (n, n),
        csr=(indptr, (entries % n).astype(petsc.IntType), np.ones(len(entries))),
        comm=petsc.COMM_SELF,
    )
    order, _ = pattern.getOrdering("amd" if has_suitesparse() else "qmd")
    return order.getIndices().astype(np.uint32)

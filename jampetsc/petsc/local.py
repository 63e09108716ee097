"""A Hessian that lies on one rank, factorised by `Cholesky`: the solver for `minimise.newton`, prefix `newton_`.

A quench ends with the proof that it found a minimum, so options with which a factorisation proves nothing are refused.
Where no proof is needed, only residuals are checked.
"""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite
from jampetsc.petsc.session import current

PREFIX = "newton_"


class NewtonSolver:
    """Solves with real symmetric matrices of this rank alone (MPI_COMM_SELF), and says which are positive definite."""

    def __init__(self, prefix=PREFIX, what="the Hessian of a Newton step", proves=True):
        self._prefix, self._what, self._proves = prefix, what, proves
        session = current()
        if session.scalar_type != "real":
            raise InputError("Cholesky needs the real build of PETSc: start the session with scalar='real'")
        self._petsc = session.PETSc
        self._cholesky = self._pattern = None
        if proves:  # options that PETSc or the proof refuses are refused now, not at the first step
            self.factorise(np.array([0, 1], np.int32), np.array([0], np.int32), np.ones(1))

    def factorise(self, indptr, indices, values) -> bool:
        """Factorise the upper triangle with its diagonal, CSR (int32, sorted). False if not positive definite.

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
            raise InputError(f"{self._cholesky.doubt}: that would prove no minimum; leave this option out")
        return True

    def solve(self, b):
        """x with A x = b, (n,) float64, after a `factorise` that returned True."""
        self._right.setArray(b)
        self._cholesky.solve(self._right, self._solution)
        return self._solution.getArray().copy()

    def order(self, n, i, j):
        """N disks in an order of elimination with little fill, (N,); pairs (M,) i, j are neighbours."""
        from jampetsc.petsc.blocks import elimination_order  # loads scipy, which a quench does without

        return elimination_order(n, i, j)

"""Cholesky factorisation of one rank's own real matrices, through PETSc: solves, and proves definiteness.

Options prefix `newton_`: `-newton_pc_factor_mat_solver_type mumps` or `-newton_mat_cholmod_nmethods 3`, for
instance.
"""

import numpy as np

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.mechanics import mumps
from jampetsc.session import current

PREFIX = "newton_"
NOT_POSITIVE = 81  # PETSC_ERR_MAT_CH_ZRPVT
INDEFINITE = -40  # MUMPS INFOG(1): a block was found not to be positive definite


class SparseCholesky:
    """L Lᵀ of real symmetric matrices, on this rank alone (MPI_COMM_SELF).

    `factorise` takes the upper triangle with its diagonal as CSR (int32 indptr and indices, sorted) and says
    whether the matrix is positive definite. The symbolic analysis is kept while the pattern stays the same.
    """

    def __init__(self):
        session = current()
        if session.scalar_type != "real":
            raise InputError("Cholesky needs the real build of PETSc: start the session with scalar='real'")
        self._petsc = session.PETSc
        package = "cholmod" if _has_package(self._petsc, "cholmod") else "mumps"
        session.set_defaults(
            {
                PREFIX + "ksp_type": "preonly",
                PREFIX + "pc_type": "cholesky",
                PREFIX + "pc_factor_mat_solver_type": package,
                # Supernodal means L Lᵀ, which breaks down on any negative pivot; simplicial L D Lᵀ does not.
                PREFIX + "mat_cholmod_factor": "SUPERNODAL",
                PREFIX + "mat_cholmod_print": "0",  # a failure is an answer here, not worth a warning
                # Approximate minimum fill: the fastest ordering for planar contact networks here.
                PREFIX + "mat_mumps_icntl_7": "2",
            }
        )
        self._ksp = self._matrix = self._pattern = None

    def factorise(self, indptr, indices, values) -> bool:
        """Factorise; False if the matrix is not positive definite. Then `solve` must not be called."""
        pattern = (indptr, indices)
        if self._ksp is None or not all(map(np.array_equal, pattern, self._pattern)):
            self.destroy()
            self._pattern = pattern
            self._matrix = _upper_matrix(self._petsc, indptr, indices, values)
            self._matrix.setOption(self._petsc.Mat.Option.SPD, True)
            self._ksp = self._petsc.KSP().create(self._petsc.COMM_SELF)
            self._ksp.setOptionsPrefix(PREFIX)
            self._ksp.setFromOptions()
            self._solution, self._right = self._matrix.createVecs()
        else:
            self._matrix.setValuesCSR(indptr, indices, values)
            self._matrix.assemble()
        self._ksp.setOperators(self._matrix)
        if not self._set_up():
            self.destroy()  # a failed factor cannot be used again
            return False
        return True

    def _set_up(self) -> bool:
        petsc = self._petsc
        try:
            self._ksp.setUp()
        except petsc.Error as error:
            if error.ierr == NOT_POSITIVE:
                return False
            raise
        pc = self._ksp.getPC()
        code = mumps.failure(pc)
        if code is None:
            return True
        if code in mumps.SINGULAR or code == INDEFINITE:
            return False
        if code:
            raise mumps.explain(code, f"the {self._matrix.getSize()[0]} unknowns of a Newton step")
        return pc.getFactorMatrix().getMumpsInfog(12) == 0  # with SYM = 1 MUMPS lets negative pivots pass

    def solve(self, b):
        """x with A x = b, (n,) float64. Raises ConvergenceError when the solve fails."""
        self._right.setArray(b)
        self._ksp.solve(self._right, self._solution)
        reason = self._ksp.getConvergedReason()
        if reason < 0:
            raise ConvergenceError(
                f"Cholesky solve of {len(b)} unknowns failed (PETSc reason {reason}): please report it"
            )
        return self._solution.getArray().copy()

    def destroy(self):
        """Free the factor and the matrix."""
        for thing in (self._ksp, self._matrix):
            if thing is not None:
                thing.destroy()
        self._ksp = self._matrix = None


def _upper_matrix(petsc, indptr, indices, values):
    size = len(indptr) - 1
    matrix = petsc.Mat().createSBAIJ((size, size), 1, csr=(indptr, indices, values), comm=petsc.COMM_SELF)
    matrix.assemble()
    return matrix


def _has_package(petsc, name) -> bool:
    return petsc.Sys.hasExternalPackage("suitesparse" if name == "cholmod" else name)

"""L Lᵀ of a real symmetric PETSc matrix: it solves, and its success proves the matrix positive definite.

CHOLMOD on one rank, MUMPS on more, unless the options say otherwise.
"""

from jampetsc.errors import ConvergenceError
from jampetsc.session import current
from jampetsc.solvers import mumps

NOT_POSITIVE = 81  # PETSC_ERR_MAT_CH_ZRPVT, what CHOLMOD's breakdown becomes


class NotPositiveDefinite(ConvergenceError):
    """The matrix has an eigenvalue that is not positive."""


class Cholesky:
    """A matrix and its factor, with options of their own prefix. Collective on the ranks of the matrix.

    matrix  PETSc.Mat, real and symmetric; `factorise` takes its values as they are then
    what    names it in messages
    """

    def __init__(self, matrix, prefix: str, what: str):
        session = current()
        PETSc = session.PETSc
        self.matrix, self.what = matrix, what
        alone = matrix.getComm().size == 1 and PETSc.Sys.hasExternalPackage("suitesparse")
        session.set_defaults(
            {
                prefix + "ksp_type": "preonly",
                prefix + "pc_type": "cholesky",
                prefix + "pc_factor_mat_solver_type": "cholmod" if alone else "mumps",
                **(
                    {
                        # By dense blocks, the fastest; it is L Lᵀ, where the simplicial L D Lᵀ would let
                        # negative pivots pass.
                        prefix + "mat_cholmod_factor": "SUPERNODAL",
                        prefix + "mat_cholmod_print": "0",  # a failure is an answer, not worth a warning
                    }
                    if alone
                    else {
                        prefix + "mat_mumps_icntl_7": "2",  # approximate minimum fill
                        prefix
                        + "mat_mumps_icntl_13": "1",  # no ScaLAPACK at the root: pivots ≤ 0 are counted
                    }
                ),
            }
        )
        for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SPD):
            matrix.setOption(option, True)
        self.ksp = PETSc.KSP().create(matrix.getComm())
        self.ksp.setOptionsPrefix(prefix)
        self.ksp.setFromOptions()

    def factorise(self) -> None:
        """Factorise; the symbolic analysis is kept while the pattern stays the same.

        Raises NotPositiveDefinite, and ConvergenceError when it fails otherwise. After that the factor is of
        no use.
        """
        petsc = current().PETSc
        try:
            mumps.factorise(self.ksp, self.matrix, self.what)
        except petsc.Error as error:
            if error.ierr != NOT_POSITIVE:
                raise
            raise NotPositiveDefinite(f"{self.what} is not positive definite") from None
        except mumps.Failure as failure:
            if failure.code not in mumps.NOT_POSITIVE:
                raise
            raise NotPositiveDefinite(f"{self.what} is not positive definite") from None
        pc = self.ksp.getPC()
        if mumps.failure(pc) is not None and pc.getFactorMatrix().getMumpsInfog(12) > 0:
            # told that the matrix is positive definite, MUMPS lets negative pivots pass
            raise NotPositiveDefinite(f"{self.what} is not positive definite")

    def solve(self, rhs, out) -> None:
        """out ← A⁻¹ rhs, PETSc vectors. Raises ConvergenceError when the solve fails."""
        self.ksp.solve(rhs, out)
        reason = self.ksp.getConvergedReason()
        if reason < 0:
            raise ConvergenceError(f"solve with {self.what} failed (KSP reason {reason})")

    def destroy(self) -> None:
        """Free the factor and the matrix."""
        self.ksp.destroy()
        self.matrix.destroy()

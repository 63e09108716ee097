"""Cholesky factorisations of K + sB for real s > 0, distributed over the ranks of the pencil.

Scaled symmetrically to a unit diagonal first: at small s the θ block is of order s. CHOLMOD on one rank, MUMPS on more; options have the
prefix `shift_`.
"""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.mechanics import mumps
from jampetsc.mechanics.assembly import Pencil
from jampetsc.session import current

PREFIX = "shift_"
NOT_POSITIVE = 81  # PETSC_ERR_MAT_CH_ZRPVT


class NotPositiveDefinite(ConvergenceError):
    """K + sB has a negative eigenvalue, so K has one."""


class ShiftedFactor:
    """(K + sB)⁻¹ for one s. Collective.

    Raises NotPositiveDefinite where the factorisation meets a pivot ≤ 0, ConvergenceError when it fails otherwise.
    """

    def __init__(self, pencil: Pencil, s: float):
        session = current()
        PETSc = session.PETSc
        alone = pencil.network.comm.size == 1 and PETSc.Sys.hasExternalPackage("cholmod")
        session.set_defaults(
            {
                PREFIX + "ksp_type": "preonly",
                PREFIX + "pc_type": "cholesky",
                PREFIX + "pc_factor_mat_solver_type": "cholmod" if alone else "mumps",
                # L Lᵀ by dense blocks: the fastest on one rank, and it stops at a negative pivot.
                **(
                    {PREFIX + "mat_cholmod_factor": "SUPERNODAL", PREFIX + "mat_cholmod_print": "0"}
                    if alone
                    # Approximate minimum fill; and no ScaLAPACK at the root, so that pivots ≤ 0 are counted.
                    else {PREFIX + "mat_mumps_icntl_7": "2", PREFIX + "mat_mumps_icntl_13": "1"}
                ),
            }
        )
        self.pencil, self.s = pencil, s
        matrix = pencil.K.copy()
        matrix.axpy(s, pencil.B, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.scale = matrix.getDiagonal()
        diagonal = self.scale.getArray()
        if pencil.network.sum(int(np.count_nonzero(~(diagonal > 0)))):
            raise NotPositiveDefinite(self._verdict())
        self.scale.setArray(1.0 / np.sqrt(diagonal))
        matrix.diagonalScale(self.scale, self.scale)
        for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SPD):
            matrix.setOption(option, True)
        self.matrix = matrix
        self.work = matrix.createVecRight()
        self.ksp = PETSc.KSP().create(pencil.network.comm)
        self.ksp.setOptionsPrefix(PREFIX)
        self.ksp.setOperators(matrix)
        self.ksp.setFromOptions()
        self._set_up()

    def _verdict(self):
        return f"K + sB is not positive definite at s = {self.s:g}: the packing is not a minimum"

    def _set_up(self):
        petsc = current().PETSc
        for attempt in range(5):
            try:
                self.ksp.setUp()
            except petsc.Error as error:
                if error.ierr == NOT_POSITIVE:
                    raise NotPositiveDefinite(self._verdict()) from None
                raise
            pc = self.ksp.getPC()
            code = mumps.failure(pc)
            if code is None:
                return
            if code in mumps.SINGULAR or code == mumps.INDEFINITE:
                raise NotPositiveDefinite(self._verdict())
            if code >= 0:
                if pc.getFactorMatrix().getMumpsInfog(12) > 0:  # with SYM = 1 MUMPS lets negative pivots pass
                    raise NotPositiveDefinite(self._verdict())
                return
            if code not in mumps.WORKSPACE or attempt == 4:
                raise mumps.explain(code, f"K + sB at s = {self.s:g}")
            mumps.enlarge(self.ksp, PREFIX)

    def solve(self, rhs, out):
        """out ← (K + sB)⁻¹ rhs, PETSc vectors; rhs may be out. Collective."""
        self.work.pointwiseMult(self.scale, rhs)
        self.ksp.solve(self.work, out)
        if self.ksp.getConvergedReason() < 0:
            raise ConvergenceError(
                f"solve with K + sB at s = {self.s:g} failed (KSP reason {self.ksp.getConvergedReason()})"
            )
        out.pointwiseMult(self.scale, out)
        self.pencil.project(out.getArray())

    def destroy(self):
        """Free the factor. Collective."""
        for item in (self.ksp, self.matrix, self.scale, self.work):
            item.destroy()

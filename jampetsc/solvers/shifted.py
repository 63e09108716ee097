"""Cholesky factorisations of K + sB for real s ≥ 0, distributed over the ranks of the pencil.

Scaled symmetrically to a unit diagonal first: at small s the θ block is of order s. Options have the prefix
`shift_`.
"""

import numpy as np

from jampetsc.session import current
from jampetsc.solvers.cholesky import Cholesky, NotPositiveDefinite

PREFIX = "shift_"


def rehearse(matrix) -> None:
    """Set up as a ShiftedFactor would for this matrix, on all ranks together and on each alone. Collective."""
    alone = [matrix.getDiagonalBlock().copy()] if matrix.getComm().size > 1 else []
    for one in (matrix.copy(), *alone):
        cholesky = Cholesky(one, PREFIX, "a small matrix")
        try:
            cholesky.factorise()
        finally:
            cholesky.destroy()


class ShiftedFactor:
    """(K + sB)⁻¹ for one s. Collective.

    Raises NotPositiveDefinite where K + sB is not, so that K has a negative eigenvalue or, at s = 0, one that
    is zero; ConvergenceError when the factorisation fails otherwise.
    """

    def __init__(self, pencil, s: float):
        self.pencil, self.s = pencil, s
        what = f"K + sB at s = {s:g}"
        matrix = pencil.K.copy()
        matrix.axpy(s, pencil.B, structure=current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.scale = matrix.getDiagonal()
        diagonal = self.scale.getArray()
        if pencil.network.sum(int(np.count_nonzero(~(diagonal > 0)))):
            raise NotPositiveDefinite(f"{what} is not positive definite")
        self.scale.setArray(1.0 / np.sqrt(diagonal))
        matrix.diagonalScale(self.scale, self.scale)
        self.work = matrix.createVecRight()
        self.cholesky = Cholesky(matrix, PREFIX, what)
        self.cholesky.factorise()

    def solve(self, rhs, out) -> None:
        """out ← (K + sB)⁻¹ rhs, PETSc vectors; rhs may be out. Collective."""
        self.work.pointwiseMult(self.scale, rhs)
        self.cholesky.solve(self.work, out)
        out.pointwiseMult(self.scale, out)
        self.pencil.project(out.getArray())

    def destroy(self) -> None:
        """Free the factor. Collective."""
        for item in (self.cholesky, self.scale, self.work):
            item.destroy()

"""Cholesky factorisations of symmetric positive definite matrices, such as K + sB for real s ≥ 0.

Scaled symmetrically to a unit diagonal first: at small s the θ block is of order s. Options have the prefix
`shift_`.
"""

import numpy as np

from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite, least_eigenvalue
from jampetsc.petsc.session import current

PREFIX = "shift_"


def shifted(K, B, s: float, inertia=None):
    """K + sB as a new matrix, for PETSc matrices of one pattern; with inertia (n_local,) K + sB + s²M. Collective."""
    matrix = K.copy()
    _add(matrix, s, B, inertia)
    return matrix


def _add(matrix, s, B, inertia):
    matrix.axpy(s, B, structure=current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    if inertia is not None:
        diagonal = matrix.getDiagonal()
        diagonal.getArray()[:] += s * s * inertia
        matrix.setDiagonal(diagonal)


def _scaled(project, scale):
    """`project` for solutions that are scaled like a matrix, by a PETSc vector."""

    def project_scaled(x):
        unscaled = x * scale.getArray()
        project(unscaled)
        x[:] = unscaled / scale.getArray()

    return project_scaled


class ShiftedFactor:
    """A⁻¹ for one matrix A, which the factor takes over and changes. Collective on the ranks of the matrix.

    what      the name of A in messages
    project   orthogonal projection of local parts, in place, onto an invariant space of A that holds right-hand sides
              and solutions except for rounding
    spins     rows of this rank that are spins, to factorise the others alone, see `spin_split`

    Raises NotPositiveDefinite if A is not: K + sB if K has a negative eigenvalue or, at s = 0, a zero one.
    ConvergenceError if the factorisation fails for another reason.
    """

    def __init__(self, matrix, what: str, project=None, spins=None):
        self.project = project
        self.scale, self.work = matrix.createVecs()
        scaled = None if project is None else _scaled(project, self.scale)
        self.cholesky = Cholesky(matrix, PREFIX, what, scaled, spins)
        self._factorise()

    def renew(self, K, B, s: float, what: str, inertia=None) -> None:
        """Become the factor of `shifted(K, B, s, inertia)`, of the pattern of A. Collective.

        The symbolic analysis is reused. Raises as the constructor; the factor is not usable then.
        """
        matrix = self.cholesky.matrix
        K.copy(matrix, structure=current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        _add(matrix, s, B, inertia)
        self.cholesky.what = what
        self._factorise()

    def _factorise(self):
        matrix, what = self.cholesky.matrix, self.cholesky.what
        matrix.getDiagonal(self.scale)
        diagonal = self.scale.getArray()
        unfit = int(np.count_nonzero(~(diagonal > 0)))
        if matrix.getComm().tompi4py().allreduce(unfit):
            raise NotPositiveDefinite(f"{what} is not positive definite")
        self.scale.setArray(1.0 / np.sqrt(diagonal))
        matrix.diagonalScale(self.scale, self.scale)
        self.cholesky.factorise()

    def _scale(self, rhs):
        """`work` ← the right-hand side, projected and scaled like the matrix."""
        rhs.copy(self.work)
        if self.project is not None:
            self.project(self.work.getArray())
        self.work.pointwiseMult(self.work, self.scale)

    def prove(self) -> bool:
        """Whether the factorisation proves that A is positive definite, see `Cholesky.prove`. Collective."""
        return self.cholesky.prove()

    def solve(self, rhs, out) -> float:
        """out ← A⁻¹ rhs, PETSc vectors; rhs may be out. Collective.

        Returns and raises as `Cholesky.solve`; the residual is of the scaled system.
        """
        self._scale(rhs)
        residual = self.cholesky.solve(self.work, out)
        out.pointwiseMult(self.scale, out)
        return residual

    def energy(self, rhs) -> tuple[float, float]:
        """(e, residual): bᵀA⁻¹b = e + ρᵀA⁻¹ρ for b = `rhs`, with ρᵀD⁻¹ρ ≤ residual², D the diagonal of A.

        Collective.
        """
        self._scale(rhs)
        return self.cholesky.energy(self.work)

    def least_eigenvalue(self) -> float:
        """μ with A ≥ μD, D the diagonal of A; with `project`, A ≥ μ on the projected space. Collective.

        See `cholesky.least_eigenvalue`.
        """
        generator = np.random.default_rng(self.cholesky.matrix.getOwnershipRange()[0])
        out = self.work.duplicate()
        rhs = self.work.duplicate()
        largest = 1.0 / self.scale.min()[1]  # |ρ| unscaled ≤ √(largest diagonal) |ρ| scaled

        def start():
            x = generator.standard_normal(rhs.getLocalSize())
            if self.project is not None:
                self.project(x)
            return x

        def step(x):
            rhs.setArray(x)
            if self.project is None:
                residual = self.cholesky.solve(rhs, out)
            else:
                residual = largest * self.solve(rhs, out)
            return out.getArray().copy(), residual, out.norm()

        return least_eigenvalue(start, step)

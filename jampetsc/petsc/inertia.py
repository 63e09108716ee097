"""How many eigenvalues of a symmetric matrix are negative, zero and positive, from LDLᵀ factors.

Sylvester's law of inertia: a congruence A → D A D keeps the three numbers, and A = LDLᵀ has the numbers of D.
So A is scaled to a unit diagonal first, which makes blocks of different size (such as the θ block of B) comparable,
and factorised twice, shifted by ±σ: eigenvalues of D A D between −σ and σ count as zero.

σ = 1e-12. The scaled matrix of a contact network has norm below ten, its entries are rounded at 1e-16 and its
factors at some 1e-15, so zero modes come out within about 1e-14 of zero; the softest modes of a packing,
of order p and √p/N, lie above 1e-10 in the range of packings made here.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import (
    CHOLESKY_DEFAULTS,
    MUMPS_DEFAULTS,
    ROUNDING_RATIO,
    doubt,
    least_eigenvalue,
)
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import set_diagonal

SHIFT = 1e-12  # σ
PREFIX = "inertia_"
FACTOR_ROUNDING = 1e-13  # largest |A − L D Lᵀ| of a count that is certified, over |A|
MIN_VALUE_RATIO = 1e-11  # of |A|: nearer to an eigenvalue rounding of solves hides how near it is
NULL_PIVOTS = {"mat_mumps_icntl_24": 1}  # PETSc gives no inertia without their detection


@dataclass(frozen=True)
class Inertia:
    """Numbers of eigenvalues below −σ, within ±σ and above σ, pinned unknowns left out."""

    negative: int
    zero: int
    positive: int


class UncertainCount(ConvergenceError):
    """An eigenvalue lies, to rounding, at the value below which eigenvalues were to be counted."""


def count_eigenvalues(matrix, what: str, pins=()) -> Inertia:
    """Inertia of a distributed real symmetric PETSc Mat. Collective; needs the real build.

    what   name of the matrix, for messages
    pins   global numbers of unknowns to leave out: their rows and columns are zero off the diagonal

    Raises ConvergenceError if a factorisation fails, InputError for options with which its pivots prove nothing.
    """
    pins = np.asarray(pins, int)
    scaled = matrix.duplicate(copy=True)
    diagonal = scaled.getDiagonal()
    values = np.abs(diagonal.getArray())
    diagonal.setArray(1.0 / np.sqrt(np.where(values > 0, values, 1.0)))
    scaled.diagonalScale(diagonal, diagonal)
    set_diagonal(scaled, pins, 1.0)
    factor = ShiftedInertia(scaled, what)
    below_plus, below_minus = factor.count_below(SHIFT), factor.count_below(-SHIFT)
    positive = matrix.getSize()[0] - below_plus - len(pins)
    return Inertia(below_minus, below_plus - below_minus, positive)


class ShiftedInertia:
    """Counts of eigenvalues of a distributed symmetric Mat A by L D Lᵀ of A − λ, one factorisation for each λ.

    The symbolic analysis of the first one serves all. Methods are collective on the ranks of A.

    what   name of A in messages
    """

    def __init__(self, matrix, what: str):
        self.matrix, self.what = matrix, what
        self.shifted = matrix.copy()
        self.ksp = mumps.make_ksp(matrix.getComm(), PREFIX, CHOLESKY_DEFAULTS | MUMPS_DEFAULTS | NULL_PIVOTS)

    def count_below(self, value: float) -> int:
        """Number of eigenvalues below `value`, the negative pivots of A − `value`.

        Certain where no eigenvalue lies within the rounding of the factor, see `count_certified`. Raises
        UncertainCount where a pivot is zero to rounding, ConvergenceError where the factorisation fails, InputError
        for options with which its pivots prove nothing.
        """
        self.matrix.copy(self.shifted, structure=current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.shifted.shift(-value)
        mumps.factorise(self.ksp, self.shifted, self.what)
        if reason := doubt(self.ksp, null_pivots=True):
            raise InputError(
                f"{reason}, which would count no eigenvalues of {self.what}. Leave this option out."
            )
        negative, null, _ = self.ksp.getPC().getFactorMatrix().getInertia()
        if null:
            raise UncertainCount(
                f"{self.what}: {null} pivots of L D Lᵀ are zero to rounding, so how many eigenvalues are negative is "
                "not certain"
            )
        return negative

    def count_certified(self, value: float) -> int:
        """`count_below`, and the proof that no eigenvalue equals `value` to rounding, by four solves with the factor.

        The pivots belong to A − λ + E, where E is the rounding of the factorisation. By Weyl they have the signs of
        the eigenvalues of A − λ if |E| is below the distance of λ from the nearest eigenvalue. That distance is bounded
        by `cholesky.least_eigenvalue`; |E| is taken as `FACTOR_ROUNDING` of |A − λ|, which each solve must confirm:
        its residual is E y. A small pivot alone proves nothing: the distance may be smaller by |L⁻¹|².

        Raises as `count_below`, UncertainCount also where an eigenvalue is too near, ConvergenceError also for a factor
        that is not exact to rounding.
        """
        count = self.count_below(value)
        norm = self.shifted.norm(current().PETSc.NormType.INFINITY)
        if not self._bound_distance(norm) > FACTOR_ROUNDING * norm:
            raise UncertainCount(
                f"{self.what}: an eigenvalue lies at {value:.17g} to rounding, so how many are below is not certain"
            )
        return count

    def _bound_distance(self, norm):
        """A lower bound on the smallest |eigenvalue| of A − λ, of which `norm` bounds the largest."""
        rhs, y = self.shifted.createVecs()
        residual = rhs.duplicate()
        generator = np.random.default_rng(self.shifted.getOwnershipRange()[0])

        def step(x):
            rhs.setArray(x)
            mumps.solve(self.ksp, rhs, y, f"solve with {self.what}")
            self.shifted.mult(y, residual)
            residual.axpy(-1.0, rhs)
            left, size, rounding = residual.norm(), y.norm(), ROUNDING_RATIO * rhs.norm()
            if not left <= FACTOR_ROUNDING * norm * size + rounding:
                raise ConvergenceError(
                    f"{self.what}: the factor has a residual of {left:.0e}, above rounding. Change the options that "
                    f"begin with -{PREFIX}."
                )
            return y.getArray().copy(), left + ROUNDING_RATIO * norm * size + rounding, size

        return least_eigenvalue(lambda: generator.standard_normal(rhs.getLocalSize()), step)


def count_below(matrix, value: float, what: str) -> int:
    """Number of eigenvalues of a distributed symmetric Mat below `value`, see `ShiftedInertia.count_below`."""
    return ShiftedInertia(matrix, what).count_below(value)

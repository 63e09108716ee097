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
from jampetsc.petsc.cholesky import CHOLESKY_DEFAULTS, MUMPS_DEFAULTS, doubt
from jampetsc.petsc.sparse_matrices import set_diagonal

SHIFT = 1e-12  # σ
PREFIX = "inertia_"
NULL_PIVOTS = {"mat_mumps_icntl_24": 1}  # PETSc gives no inertia without their detection


@dataclass(frozen=True)
class Inertia:
    """Numbers of eigenvalues below −σ, within ±σ and above σ, pinned unknowns left out."""

    negative: int
    zero: int
    positive: int


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
    below_plus, below_minus = _negative(scaled, (-SHIFT, 2.0 * SHIFT), what)
    positive = matrix.getSize()[0] - below_plus - len(pins)
    return Inertia(below_minus, below_plus - below_minus, positive)


def _negative(matrix, shifts, what):
    """Numbers of negative eigenvalues (negative pivots) of a matrix after each of the shifts, which accumulate."""
    ksp = mumps.make_ksp(matrix.getComm(), PREFIX, CHOLESKY_DEFAULTS | MUMPS_DEFAULTS | NULL_PIVOTS)
    counts = []
    for shift in shifts:
        matrix.shift(shift)
        mumps.factorise(ksp, matrix, what)
        if reason := doubt(ksp, null_pivots=True):
            raise InputError(f"{reason}, which would count no eigenvalues of {what}. Leave this option out.")
        negative, null, _ = ksp.getPC().getFactorMatrix().getInertia()
        if null:
            raise ConvergenceError(
                f"{what}: {null} pivots of L D Lᵀ are zero to rounding, so how many eigenvalues are negative is not "
                "certain"
            )
        counts.append(negative)
    return counts


def count_below(matrix, value: float, what: str) -> int:
    """Number of eigenvalues of a distributed symmetric Mat below `value`, which must not be an eigenvalue. Collective.

    One LDLᵀ factorisation of A − value. Raises ConvergenceError if it fails, InputError for options with which its
    pivots prove nothing.
    """
    (below,) = _negative(matrix.copy(), (-value,), what)
    return below

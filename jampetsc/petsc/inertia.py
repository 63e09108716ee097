"""How many eigenvalues of a symmetric matrix are negative, zero and positive, from LDLᵀ factors.

Sylvester's law of inertia: a congruence A → D A D keeps the three numbers, and A = LDLᵀ has those of its D.
So A is scaled to a unit diagonal first, which puts blocks of any size (the θ block of B, say) on one footing,
and factorised twice, shifted up and down: eigenvalues of D A D between −σ and σ count as zero.

σ = 1e-12. The scaled matrix of a contact network has norm below ten, its entries are rounded at 1e-16 and its
factors at some 1e-15, so zero modes come out within about 1e-14 of zero; the softest modes of a packing,
of order p and √p/N, lie above 1e-10 in the range of packings made here.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.petsc import mumps
from jampetsc.petsc.matrices import set_diagonal
from jampetsc.petsc.proof import doubt
from jampetsc.petsc.session import current

SHIFT = 1e-12
PREFIX = "inertia_"
DEFAULTS = {
    "inertia_ksp_type": "preonly",
    "inertia_pc_type": "cholesky",
    "inertia_pc_factor_mat_solver_type": "mumps",
    "inertia_mat_mumps_icntl_7": 2,  # approximate minimum fill: faster here than what MUMPS would choose
    "inertia_mat_mumps_icntl_13": 1,  # no ScaLAPACK at the root, which would not count signs
    "inertia_mat_mumps_icntl_24": 1,  # PETSc gives no inertia without the detection of null pivots
}


@dataclass(frozen=True)
class Inertia:
    """Numbers of eigenvalues below −σ, within ±σ and above σ, pinned unknowns left out."""

    negative: int
    zero: int
    positive: int
    shift: float  # σ, for the matrix scaled to a unit diagonal


def count_eigenvalues(matrix, what: str, pins=(), shift: float = SHIFT) -> Inertia:
    """Inertia of a distributed real symmetric PETSc Mat. Collective; needs the real build.

    what   name of the matrix, for messages
    pins   global numbers of unknowns that do not count: their rows and columns are zero off the diagonal

    Raises ConvergenceError if a factorisation fails, InputError for options with which it counts nothing.
    """
    current().set_defaults(DEFAULTS)
    pins = np.asarray(pins, int)
    scaled = matrix.duplicate(copy=True)
    diagonal = scaled.getDiagonal()
    values = np.abs(diagonal.getArray())
    diagonal.setArray(1.0 / np.sqrt(np.where(values > 0, values, 1.0)))
    scaled.diagonalScale(diagonal, diagonal)
    set_diagonal(scaled, pins, 1.0)

    ksp = mumps.make_ksp(matrix.getComm(), PREFIX)
    try:
        scaled.shift(-shift)
        below_plus = _negative(ksp, scaled, what)
        scaled.shift(2.0 * shift)
        below_minus = _negative(ksp, scaled, what)
    finally:
        for item in (ksp, scaled, diagonal):
            item.destroy()
    positive = matrix.getSize()[0] - below_plus - len(pins)
    return Inertia(below_minus, below_plus - below_minus, positive, shift)


def _negative(ksp, matrix, what):
    """Number of negative eigenvalues of a regular matrix: of negative pivots, if they are all there."""
    mumps.factorise(ksp, matrix, what)
    if reason := doubt(ksp, null_pivots=True):
        raise InputError(f"{reason}: that would count no eigenvalues of {what}; leave this option out")
    negative, null, _ = ksp.getPC().getFactorMatrix().getInertia()
    if null:
        raise ConvergenceError(
            f"{what}: {null} pivots of L D Lᵀ are zero to rounding, so how many eigenvalues are negative is not certain"
        )
    return negative


def count_below(matrix, value: float, what: str) -> int:
    """Number of eigenvalues of a distributed symmetric Mat below `value`, itself none of them. Collective.

    One LDLᵀ factorisation of A − value. Raises ConvergenceError if it fails, InputError for options with which it
    counts nothing.
    """
    current().set_defaults(DEFAULTS)
    shifted = matrix.copy()
    shifted.shift(-value)
    ksp = mumps.make_ksp(matrix.getComm(), PREFIX)
    try:
        return _negative(ksp, shifted, what)
    finally:
        ksp.destroy()
        shifted.destroy()

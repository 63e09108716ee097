"""Finite-size scaling near jamming: η₀ = N^a f(pN²) (BT Fig. 8), and growth with ln N.

One contact more or less than isostatic is felt where ΔZ ~ p^½ is of the order of 1/N, that is pN² ~ 1: there f is
constant below and falls as (pN²)^(−a/2) above, where η₀ ~ p^(−a/2) does not depend on N. Under Stokes drag it does:
random forces make an isotropic elastic medium move by ⟨|u_na|²⟩ ~ ∫d²k/k² from 2π/L to 1/d, so √p (η₀ − η_F) =
A + B ln N, which over a range of N looks like a = 1 + d ln(A + B ln N)/d ln N.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError

FEWEST = 3  # sizes of a line in ln N
DEGREE = 5  # of the polynomial in ln pN² that stands for ln f


@dataclass(frozen=True)
class SizeScaling:
    """η₀/N^a as a function of pN²."""

    power: float  # a
    error: float  # from the errors of the points, times √(χ²/dof) where that is above 1
    chi2: float
    dof: int


@dataclass(frozen=True)
class LogarithmOfSize:
    """A + B ln N."""

    constant: float  # A
    slope: float  # B
    slope_error: float  # from the errors of the points
    chi2: float
    dof: int

    def power(self, n) -> float:
        """a = 1 + d ln(A + B ln N)/d ln N."""
        return 1.0 + self.slope / (self.constant + self.slope * np.log(n))


def size_scaling(n, pressure, values, errors, degree=DEGREE) -> SizeScaling:
    """The power a with which values/N^a become one curve of pN², a polynomial between logarithms.

    n, pressure, values, errors     (m,), values positive, errors of one standard deviation

    Raises InputError for values that are not positive and fewer points than there is to fit.
    """
    n, x, values = (
        np.asarray(n, float),
        np.log(pressure * np.square(n, dtype=float)),
        np.asarray(values, float),
    )
    _require(values, degree + 3)
    u = 2.0 * (x - x.min()) / np.ptp(x) - 1.0
    terms = np.column_stack((np.log(n), np.polynomial.chebyshev.chebvander(u, degree)))
    (power, *_), covariance, chi2, dof = _fit(terms, np.log(values), values / np.asarray(errors))
    return SizeScaling(power, float(np.sqrt(covariance[0, 0] * max(1.0, chi2 / dof))), chi2, dof)


def logarithm_of_size(n, values, errors) -> LogarithmOfSize:
    """A + B ln N through values (m,) with their errors at sizes n. Raises InputError for fewer than three."""
    values = np.asarray(values, float)
    _require(values, FEWEST)
    terms = np.column_stack((np.ones(len(values)), np.log(n)))
    (constant, slope), covariance, chi2, dof = _fit(terms, values, 1.0 / np.asarray(errors))
    return LogarithmOfSize(constant, slope, float(np.sqrt(covariance[1, 1])), chi2, dof)


def _require(values, enough):
    if not (values > 0).all():
        raise InputError(f"value {values[~(values > 0)][0]:g}: must be positive")
    if len(values) < enough:
        raise InputError(f"{len(values)} points: at least {enough} are needed; more sizes or pressures")


def _fit(terms, y, weights):
    """(coefficients, covariance, χ², degrees of freedom) of weighted least squares."""
    found, *_ = np.linalg.lstsq(terms * weights[:, None], y * weights, rcond=None)
    covariance = np.linalg.inv((terms * weights[:, None]).T @ (terms * weights[:, None]))
    chi2 = float(np.sum(((y - terms @ found) * weights) ** 2))
    return found.tolist(), covariance, chi2, len(y) - terms.shape[1]

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


def logarithm_of_size(n, values, errors) -> LogarithmOfSize:
    """A + B ln N through values (m,) with their errors at sizes n. Raises InputError for fewer than three."""
    values, errors, x = np.asarray(values, float), np.asarray(errors, float), np.log(n)
    if not (values > 0).all():
        raise InputError(f"value {values[~(values > 0)][0]:g}: must be positive")
    if len(values) < FEWEST:
        raise InputError(f"{len(values)} points: at least {FEWEST} are needed; more sizes")
    (slope, constant), covariance = np.polyfit(x, values, 1, w=1.0 / errors, cov="unscaled")
    chi2 = np.sum(((values - slope * x - constant) / errors) ** 2)
    found = constant, slope, np.sqrt(covariance[0, 0]), chi2
    return LogarithmOfSize(*map(float, found), len(values) - 2)

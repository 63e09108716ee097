"""Relaxation spectrum: the modulus as a sum of Maxwell elements with positive weights.

K and B are symmetric and positive semi-definite, so G* has all its poles on the negative real s axis:

    G*(ω) = G₀ + iω η_∞ + Σ_m g_m iω / (λ_m + iω) ,     λ_m > 0,  g_m ≥ 0 .

Every term adds to G' and to G'' with the same sign: neither is ever a difference of large numbers.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class RelaxationSpectrum:
    """Rates λ (m,) in 1/τ₁, weights g (m,) in k; G₀ in k and η_∞ in kτ₁."""

    G0: float
    eta_inf: float
    rates: np.ndarray
    weights: np.ndarray

    @property
    def eta0(self) -> float:
        """η₀ = lim G''/ω for ω → 0."""
        return self.eta_inf + float(np.sum(self.weights / self.rates))

    @property
    def G_inf(self) -> float:
        """lim G' for ω → ∞."""
        return self.G0 + float(np.sum(self.weights))

    def modulus(self, omega):
        """G*(ω), complex, in the shape of omega."""
        omega = np.asarray(omega, float)
        x = omega[..., None] / self.rates
        storage = self.G0 + np.sum(self.weights * (x * x / (1.0 + x * x)), axis=-1)
        loss = omega * self.eta_inf + np.sum(self.weights * (x / (1.0 + x * x)), axis=-1)
        return storage + 1j * loss

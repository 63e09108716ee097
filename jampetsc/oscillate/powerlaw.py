"""Power-law damping of a contact (BT eq. 9), written so that Newton's method can take it.

The relative velocity of a contact, weighted as the law has it, is z = (√w∥ ȧ∥, √w⊥ ȧ⊥, …), and the dissipation

    R = c Σ_c |z_c|^(1+α) / (1+α) ,     c = kτ₁ (ρ₀/τ₁)^(1−α) ,     f = ∂R/∂z = c |z|^(α−1) z

with the *vector's* length |z|: the force of a contact is against its velocity and does not depend on how that is
split into components. At α = 1 this is the quadratic form of `contacts.laws`, and for motion along a line, in any
direction, a cycle dissipates what BT 25 assumes. ρ₀ is the mean diameter.

For α < 1 the force has an infinite slope at z = 0, and Newton's method in z jumps from side to side there. Its inverse
has none, so the force is the unknown:

    z(f) = c^(−p) (|f|² + δ²)^((p−1)/2) f ,     p = 1/α ≥ 1 ,

δ = 0 in the law itself; a small δ keeps the slope of f(z) finite where a contact sticks.
"""

from dataclasses import dataclass

import numpy as np

STIFFEST = 1e7  # slope of a contact at rest over that of one that moves as most do


def relative_softening(alpha: float, stiffest: float = STIFFEST) -> float:
    """δ over the force at a typical velocity, such that a contact at rest is `stiffest` times as stiff as there."""
    return 0.0 if alpha == 1.0 else stiffest ** (-alpha / (1.0 - alpha))


@dataclass(frozen=True)
class PowerLaw:
    """One exponent 0 < α ≤ 1. Arrays of forces f and velocities z are (…, components)."""

    alpha: float
    coefficient: float  # c
    softening: float = 0.0  # δ

    @property
    def _p(self):
        return 1.0 / self.alpha

    def softened(self, velocity: float, stiffest: float = STIFFEST) -> "PowerLaw":
        """The law with the δ of `relative_softening` for this typical velocity."""
        typical = self.coefficient * velocity**self.alpha
        return PowerLaw(self.alpha, self.coefficient, typical * relative_softening(self.alpha, stiffest))

    def dissipation(self, z):
        """f·z = c |z|^(1+α) of each contact, without softening."""
        return self.coefficient * np.einsum("...f,...f", z, z) ** (0.5 * (1.0 + self.alpha))

    def forces(self, z, floor: float):
        """f(z), at least as soft as at |z| = floor: a start for Newton's method."""
        size = np.einsum("...f,...f", z, z) + floor**2
        return (self.coefficient * size ** (0.5 * (self.alpha - 1.0)))[..., None] * z

    def velocities(self, f):
        """z(f)."""
        return self._isotropic(f)[0][..., None] * f

    def _isotropic(self, f):
        size = np.einsum("...f,...f", f, f)
        return self.coefficient**-self._p * (size + self.softening**2) ** (0.5 * (self._p - 1.0)), size

    def tangent(self, f) -> "Tangent":
        """dz/df and its inverse at f."""
        compliance, size = self._isotropic(f)
        if self._p == 1.0:
            ratio = np.zeros_like(size)
        else:
            ratio = (self._p - 1.0) / (size + self.softening**2)
        return Tangent(compliance, ratio, ratio / (1.0 + ratio * size), f)


@dataclass(frozen=True, eq=False)
class Tangent:
    """dz/df = y (1 + q f fᵀ) of each contact, and its inverse (1 − q' f fᵀ)/y."""

    compliance: np.ndarray  # y
    ratio: np.ndarray  # q
    inverse_ratio: np.ndarray  # q'
    f: np.ndarray

    def velocities(self, df):
        """dz of df."""
        along = self.ratio * np.einsum("...f,...f", self.f, df)
        return self.compliance[..., None] * (df + along[..., None] * self.f)

    def forces(self, dz):
        """df of dz."""
        along = self.inverse_ratio * np.einsum("...f,...f", self.f, dz)
        return (dz - along[..., None] * self.f) / self.compliance[..., None]

    def mean_stiffness(self):
        """Diagonal of df/dz, (contacts, components), mean over the steps."""
        return np.mean((1.0 - self.inverse_ratio[..., None] * self.f**2) / self.compliance[..., None], axis=0)

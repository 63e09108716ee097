"""Power-law damping of a contact (BT eq. 9), written so that Newton's method can take it.

The relative velocity of a contact, weighted as the law has it, is z = (√w∥ ȧ∥, √w⊥ ȧ⊥, …), and the dissipation

    R = c Σ_c |z_c|^(1+α) / (1+α) ,     c = kτ₁ (ρ₀/τ₁)^(1−α) ,     f = ∂R/∂z = c |z|^(α−1) z

with the *vector's* length |z|: the force of a contact is against its velocity and does not depend on how that is
split into components. At α = 1 this is the quadratic form of `core.laws`, and for motion along a line, in any
direction, a cycle dissipates what BT 25 assumes. ρ₀ is the mean diameter.

For α < 1 the force has an infinite slope at z = 0, and Newton's method in z jumps from side to side there. Its inverse
has none, so the force is the unknown:

    z(f) = c^(−p) (|f|² + δ²)^((p−1)/2) f ,     p = 1/α ≥ 1 ,

δ = 0 in the law itself; a small δ keeps the slope of f(z) finite where a contact sticks. For α > 1 it is z(f) that has
the infinite slope, and f(z) is taken as it is.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.core.laws import Law

TINY = 1e-300
STIFFEST = 1e7  # slope of a contact at rest over that of one that moves as most do


def relative_softening(alpha: float, stiffest: float = STIFFEST) -> float:
    """δ over the force at a typical velocity, such that a contact at rest is `stiffest` times as stiff as there."""
    return 0.0 if alpha >= 1.0 else stiffest ** (-alpha / (1.0 - alpha))


@dataclass(frozen=True)
class PowerLaw:
    """One exponent α > 0. Arrays of forces f and velocities z are (…, components)."""

    alpha: float
    coefficient: float  # c
    softening: float = 0.0  # δ

    @classmethod
    def of(cls, law: Law, k: float, rho0: float) -> "PowerLaw":
        """Of a damping law; k: stiffness of a contact, rho0: mean diameter."""
        return cls(law.exponent, k * law.tau1 * (rho0 / law.tau1) ** (1.0 - law.exponent))

    @property
    def by_force(self) -> bool:
        """Whether z(f) stands in the equations, and not f(z)."""
        return self.alpha <= 1.0

    def softened(self, velocity: float, stiffest: float = STIFFEST) -> "PowerLaw":
        """The law with the δ of `relative_softening` for this typical velocity."""
        typical = self.coefficient * velocity**self.alpha
        return replace(self, softening=typical * relative_softening(self.alpha, stiffest))

    def dissipation(self, z):
        """f·z = c |z|^(1+α) of each contact, without softening."""
        return self.coefficient * np.einsum("...f,...f", z, z) ** (0.5 * (1.0 + self.alpha))

    def forces(self, z, floor: float):
        """f(z), at least as soft as at |z| = floor: a start for Newton's method."""
        size = np.einsum("...f,...f", z, z) + floor**2
        return (self.coefficient * size ** (0.5 * (self.alpha - 1.0)))[..., None] * z

    def stiffness(self, z, f, floor: float):
        """df/dz of `forces(z, floor)` for Newton's method in z, (…, components, components), positive definite.

        It is the derivative where f is the force at z. Where α < 1 an f that the last step has predicted keeps the
        method from jumping from side to side where contacts stick; without any, f = 0, it would be the secant
        (Chan, Golub & Mulet, SIAM J. Sci. Comput. 20, 1964 (1999)).
        """
        size = np.maximum(np.einsum("...f,...f", z, z) + floor**2, TINY)
        secant = self.coefficient * size ** (0.5 * (self.alpha - 1.0))
        if not self.by_force:
            f = secant[..., None] * z
        length = np.sqrt(np.einsum("...f,...f", f, f))
        pull = np.minimum(1.0, secant * np.sqrt(size) / np.maximum(length, TINY)) * (self.alpha - 1.0) / size
        outer = (0.5 * pull)[..., None, None] * (f[..., :, None] * z[..., None, :])
        identity = np.eye(z.shape[-1])
        return secant[..., None, None] * identity + outer + np.swapaxes(outer, -1, -2)

    def velocities(self, f):
        """z(f)."""
        return self._isotropic(f)[0][..., None] * f

    def _isotropic(self, f):
        p, size = 1.0 / self.alpha, np.einsum("...f,...f", f, f)
        return self.coefficient**-p * (size + self.softening**2) ** (0.5 * (p - 1.0)), size

    def mismatch(self, z, f, unit: float):
        """What z and f are off, as a force, where a unit of velocity counts `unit`."""
        if self.by_force:
            return unit * (z - self.velocities(f))
        return self.forces(z, 0.0) - f

    def tangent(self, z, f) -> "Tangent":
        """df/dz, at f or at z."""
        if not self.by_force:
            size = np.maximum(np.einsum("...f,...f", z, z), TINY)
            stiffness = self.coefficient * size ** (0.5 * (self.alpha - 1.0))
            return Tangent(stiffness, (self.alpha - 1.0) / size, z.copy(), False)
        compliance, size = self._isotropic(f)
        softened = size + self.softening**2
        ratio = (1.0 / self.alpha - 1.0) / softened if self.alpha < 1.0 else np.zeros_like(size)
        return Tangent(1.0 / compliance, -ratio / (1.0 + ratio * size), f.copy(), True)


@dataclass(frozen=True, eq=False)
class Tangent:
    """df/dz = s (1 + q x xᵀ) of each contact."""

    stiffness: np.ndarray  # s
    ratio: np.ndarray  # q
    x: np.ndarray
    by_force: bool  # see PowerLaw

    def forces(self, dz):
        """df of dz."""
        along = self.ratio * np.einsum("...f,...f", self.x, dz)
        return self.stiffness[..., None] * (dz + along[..., None] * self.x)

    def velocities(self, df):
        """dz of df."""
        ratio = self.ratio / (1.0 + self.ratio * np.einsum("...f,...f", self.x, self.x))
        along = ratio * np.einsum("...f,...f", self.x, df)
        return (df - along[..., None] * self.x) / self.stiffness[..., None]

    def mismatch(self, dz, df, unit: float):
        """Change of `PowerLaw.mismatch`."""
        return unit * (dz - self.velocities(df)) if self.by_force else self.forces(dz) - df

    def eliminated(self, mismatch, unit: float):
        """The −df of a change of the mismatch with dz = 0."""
        return self.forces(mismatch / unit) if self.by_force else mismatch

    def mean_stiffness(self):
        """Diagonal of df/dz, (contacts, components), mean over the steps, where α < 1 the geometric one.

        A contact that sticks is stiffer by decades for a moment, and so would be its arithmetic mean.
        """
        diagonal = self.stiffness[..., None] * (1.0 + self.ratio[..., None] * self.x**2)
        return np.exp(np.mean(np.log(diagonal), axis=0)) if self.by_force else np.mean(diagonal, axis=0)

"""Power-law damping of a contact (BT eq. 9), in a form that Newton's method can solve.

The weighted relative velocity of a contact is z = (√w∥ ȧ∥, √w⊥ ȧ⊥, …) with the law's weights, and the dissipation

    R = c Σ_c |z_c|^(1+α) / (1+α) ,     c = kτ₁ (ρ₀/τ₁)^(1−α) ,     f = ∂R/∂z = c |z|^(α−1) z

with the length |z| of the *vector*: the force of a contact is opposite to its velocity and does not depend on how that
is split into components. At α = 1 this is the quadratic form of `laws.damping`, and for motion along a line, in any
direction, a cycle dissipates what BT 25 assumes. ρ₀ is the mean diameter.

For α < 1 the force has an infinite slope at z = 0, where Newton's method in z alternates between both sides. The
inverse z(f) has a finite slope, so the force is the unknown:

    z(f) = c^(−p) (|f|² + δ²)^((p−1)/2) f ,     p = 1/α ≥ 1 ,

δ = 0 in the law itself; a small δ keeps the slope of f(z) finite where a contact sticks. For α > 1 z(f) has the
infinite slope, and f(z) is used.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.packing.compiled import NUMBERS, compiled

MIN_POSITIVE = 1e-300
MAX_SLOPE_RATIO = 1e7  # slope df/dz of a contact at rest over that at the typical velocity


def relative_softening(alpha: float, stiffest: float = MAX_SLOPE_RATIO) -> float:
    """δ over the force at the typical velocity, such that df/dz at rest is `stiffest` times that at this velocity."""
    return 0.0 if alpha >= 1.0 else stiffest ** (-alpha / (1.0 - alpha))


@dataclass(frozen=True)
class ContactPowerLaw:
    """One exponent α > 0. Arrays of forces f and velocities z are (…, components)."""

    alpha: float
    coefficient: float  # c
    softening: float = 0.0  # δ

    @classmethod
    def of(cls, law: Law, k: float, rho0: float) -> "ContactPowerLaw":
        """The power law of a damping law; k: stiffness of a contact, rho0: mean diameter."""
        return cls(law.exponent, k * law.tau1 * (rho0 / law.tau1) ** (1.0 - law.exponent))

    @property
    def by_force(self) -> bool:
        """Whether the equations contain z(f) instead of f(z)."""
        return self.alpha <= 1.0

    def softened(self, velocity: float, stiffest: float = MAX_SLOPE_RATIO) -> "ContactPowerLaw":
        """The law with the δ of `relative_softening` for this typical velocity."""
        typical = self.coefficient * velocity**self.alpha
        return replace(self, softening=typical * relative_softening(self.alpha, stiffest))

    def dissipation(self, z):
        """f·z = c |z|^(1+α) of each contact, without softening."""
        return self.coefficient * np.einsum("...f,...f", z, z) ** (0.5 * (1.0 + self.alpha))

    def forces(self, z, floor: float):
        """f(z), linear far below |z| = floor: |z|² is replaced by |z|² + floor² in its factor."""
        size = np.einsum("...f,...f", z, z) + floor**2
        return (self.coefficient * size ** (0.5 * (self.alpha - 1.0)))[..., None] * z

    def stiffness(self, z, f, floor: float):
        """df/dz of `forces(z, floor)` for Newton's method in z, (contacts, components, components), positive definite.

        It is the exact derivative if f is the force at z. For α < 1, the f that the last step has predicted keeps the
        method from alternating between both sides where contacts stick; f = 0 would give the secant (Chan, Golub &
        Mulet, SIAM J. Sci. Comput. 20, 1964 (1999)). z, f: (contacts, components).
        """
        return _stiffness(z, f, self.coefficient, self.alpha, floor, self.by_force)

    def velocities(self, f):
        """z(f)."""
        return self._isotropic(f)[0][..., None] * f

    def _isotropic(self, f):
        p, size = 1.0 / self.alpha, np.einsum("...f,...f", f, f)
        return self.coefficient**-p * (size + self.softening**2) ** (0.5 * (p - 1.0)), size

    def mismatch(self, z, f, unit: float):
        """The residual of z = z(f), or of f = f(z), as a force: velocities are multiplied by `unit`."""
        if self.by_force:
            return unit * (z - self.velocities(f))
        return self.forces(z, 0.0) - f

    def tangent(self, z, f) -> "Tangent":
        """df/dz, at f where `by_force`, else at z."""
        if not self.by_force:
            size = np.maximum(np.einsum("...f,...f", z, z), MIN_POSITIVE)
            stiffness = self.coefficient * size ** (0.5 * (self.alpha - 1.0))
            return Tangent(stiffness, (self.alpha - 1.0) / size, z.copy(), False)
        compliance, size = self._isotropic(f)
        softened = size + self.softening**2
        ratio = (1.0 / self.alpha - 1.0) / softened if self.alpha < 1.0 else np.zeros_like(size)
        return Tangent(1.0 / compliance, -ratio / (1.0 + ratio * size), f.copy(), True)


@compiled(NUMBERS)
def _stiffness(z, f, coefficient, alpha, floor, by_force):
    """See `ContactPowerLaw.stiffness`."""
    count, components = z.shape
    blocks = np.empty((count, components, components))
    for c in range(count):
        size, square = floor * floor, 0.0
        for x in range(components):
            size += z[c, x] * z[c, x]
            square += f[c, x] * f[c, x]
        size = max(size, MIN_POSITIVE)
        secant = coefficient * size ** (0.5 * (alpha - 1.0))
        force, pull = z[c], secant
        if by_force:
            force, pull = f[c], min(1.0, secant * np.sqrt(size) / max(np.sqrt(square), MIN_POSITIVE))
        pull *= 0.5 * (alpha - 1.0) / size
        for x in range(components):
            for y in range(x + 1):
                blocks[c, x, y] = blocks[c, y, x] = pull * (force[x] * z[c, y] + force[y] * z[c, x])
            blocks[c, x, x] += secant
    return blocks


@dataclass(frozen=True, eq=False)
class Tangent:
    """df/dz = s (1 + q x xᵀ) of each contact."""

    stiffness: np.ndarray  # s
    ratio: np.ndarray  # q
    x: np.ndarray
    by_force: bool  # see ContactPowerLaw

    def forces(self, dz):
        """df for a dz."""
        along = self.ratio * np.einsum("...f,...f", self.x, dz)
        return self.stiffness[..., None] * (dz + along[..., None] * self.x)

    def velocities(self, df):
        """dz for a df."""
        ratio = self.ratio / (1.0 + self.ratio * np.einsum("...f,...f", self.x, self.x))
        along = ratio * np.einsum("...f,...f", self.x, df)
        return (df - along[..., None] * self.x) / self.stiffness[..., None]

    def mismatch(self, dz, df, unit: float):
        """Change of `ContactPowerLaw.mismatch`."""
        return unit * (dz - self.velocities(df)) if self.by_force else self.forces(dz) - df

    def eliminated(self, mismatch, unit: float):
        """−df for a change of the mismatch at dz = 0."""
        return self.forces(mismatch / unit) if self.by_force else mismatch

    def mean_stiffness(self):
        """Diagonal of df/dz, (contacts, components): its mean over the steps, for α ≤ 1 the geometric mean.

        The stiffness of a contact that sticks is larger by decades for a moment; the arithmetic mean would be too.
        """
        diagonal = self.stiffness[..., None] * (1.0 + self.ratio[..., None] * self.x**2)
        return np.exp(np.mean(np.log(diagonal), axis=0)) if self.by_force else np.mean(diagonal, axis=0)

"""Elastic constants C in the order xx, yy, (zz, yz, xz,) xy: moduli that do not depend on axes, and C*(ω) of a reduced
pencil.

C (…, L, L), real or complex, with L = D(D + 1)/2, are second derivatives of the energy per volume along F = 1 + εE,
shears with E = ½(x̂ŷ + ŷx̂).
"""

from dataclasses import dataclass

import numpy as np


def dimension_of(C) -> int:
    """D of elastic constants (…, L, L)."""
    return {3: 2, 6: 3}[np.shape(C)[-1]]


def modulus_along(C, gradient):
    """E:C:E of a symmetric gradient E (D, D), (…)."""
    D = len(gradient)
    shears = [(1, 2), (0, 2), (0, 1)][3 - D * (D - 1) // 2 :]
    amplitudes = [*np.diag(gradient), *(2.0 * gradient[a][b] for a, b in shears)]
    return np.einsum("a,...ab,b->...", amplitudes, C, amplitudes)


def bulk_modulus(C, pressure: float):
    """−V dp/dV = M(1/D) + p (D − 1)/D, (…); M(1/D) is the mean of the constants among xx, yy, (zz)."""
    D = dimension_of(C)
    return np.mean(np.asarray(C)[..., :D, :D], axis=(-2, -1)) + pressure * (D - 1) / D


def shear_weights(dimension: int):
    """Weights (L, L) of the constants in the shear modulus averaged over all directions."""
    D = dimension
    shears = D * (D - 1) // 2
    weights = np.zeros((D + shears, D + shears))
    weights[:D, :D] = (np.eye(D) * D - 1.0) / D
    weights[range(D, D + shears), range(D, D + shears)] = 2.0
    return weights / ((D - 1) * (D + 2))


def shear_modulus(C):
    """The shear modulus averaged over all directions, (…): in 2D the mean of pure shear and of symmetric shear xy."""
    return np.einsum("ab,...ab->...", shear_weights(dimension_of(C)), C)


def poisson_ratio(bulk, shear, dimension: int):
    """Poisson's ratio (D K − 2G)/(D(D − 1) K + 2G), real or complex, of an isotropic solid in D dimensions."""
    D = dimension
    return (D * bulk - 2.0 * shear) / (D * (D - 1) * bulk + 2.0 * shear)


def _orthonormal(C):
    """C between loads of unit norm Σ E², (…, L, L): a shear stands for xy and yx."""
    C, D = np.asarray(C), dimension_of(C)
    scale = np.array([1.0] * D + [np.sqrt(2.0)] * (C.shape[-1] - D))
    return C * np.outer(scale, scale)


def least_modulus(C) -> tuple[float, np.ndarray]:
    """(value, E): the least E:C:E over symmetric gradients E (D, D) with Σ E² = 1, for real C (L, L).

    All loads have a positive modulus, and C is positive definite, where it is positive.
    """
    D = dimension_of(C)
    values, vectors = np.linalg.eigh(_orthonormal(C))
    gradient = np.diag(vectors[:D, 0])
    shears = [(1, 2), (0, 2), (0, 1)][3 - D * (D - 1) // 2 :]
    for (a, b), amplitude in zip(shears, vectors[D:, 0] / np.sqrt(2.0), strict=True):
        gradient[a, b] = gradient[b, a] = amplitude
    return float(values[0]), gradient


def anisotropy(C):
    """|C − C_iso|/|C|, (…): how far C is from its isotropic part, in the norm Σ |C_ijkl|²; 0 if it is isotropic."""
    D, weighted = dimension_of(C), _orthonormal(C)
    volume = np.zeros(weighted.shape[-1:])
    volume[:D] = 1.0 / np.sqrt(D)
    volumetric = np.outer(volume, volume)
    deviatoric = np.eye(len(volume)) - volumetric
    dilation = np.einsum("ab,...ab->...", volumetric, weighted)
    shear = 2.0 * shear_modulus(C)
    isotropic = dilation[..., None, None] * volumetric + shear[..., None, None] * deviatoric
    size = np.linalg.norm(weighted, axis=(-2, -1))
    return np.linalg.norm(weighted - isotropic, axis=(-2, -1)) / size


@dataclass(frozen=True, eq=False)
class ReducedTensor:
    """C*(ω) of several loads from a pencil that was projected on the response of each.

    The field of load E is a sum of columns, x_E(s) = Σ_m w_Em(s) X_m with the weights 1 of the quasistatic field and
    −s h_m/(λ_m + s) of its modes. With K and B between all columns, s = iω,

        C_EE′(ω) V = w_E(s)ᵀ (K + sB) w_E′(s) ,

    which is stationary: it is off by r_EᵀA⁻¹r_E′ with the residuals r of both fields. Columns of all L loads stand side
    by side: for each its quasistatic field, then its modes.
    """

    rates: np.ndarray  # (c,) λ in 1/time; inf for quasistatic fields
    forces: np.ndarray  # (c,) h; 0 for quasistatic fields
    loads: np.ndarray  # (c,) number of the load of each column
    K: np.ndarray  # (c, c) over V, in k
    B: np.ndarray  # (c, c) over V, in kτ₁

    def weights(self, omega):
        """w (M, L, c), complex, at frequencies (M,)."""
        s = 1j * np.asarray(omega, float)[:, None]
        is_mode = np.isfinite(self.rates)
        own = np.ones((len(s), len(self.rates)), complex)
        own[:, is_mode] = -s * self.forces[is_mode] / (self.rates[is_mode] + s)
        number = np.arange(self.loads.max() + 1)
        return own[:, None, :] * (self.loads == number[:, None])

    def modulus(self, omega):
        """C*(ω), complex, (…, L, L) for omega (…)."""
        flat = np.ravel(np.asarray(omega, float))
        w = self.weights(flat)
        value = w @ self.K @ w.transpose(0, 2, 1)
        value = value + 1j * flat[:, None, None] * (w @ self.B @ w.transpose(0, 2, 1))
        return value.reshape((*np.shape(omega), *value.shape[1:]))

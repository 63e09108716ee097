"""G*(ω) and C*(ω) with inertia from a pencil of second order that was projected on a few vectors."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


def solve_second_order(K, B, omega: float, columns):
    """(K + sB + s²)⁻¹ columns (m, L), s = iω, for K and B (m, m), scaled to a unit diagonal about."""
    s, size = 1j * omega, np.abs(np.diag(K)) + omega * np.abs(np.diag(B)) + omega**2
    scale = 1.0 / np.sqrt(size)
    matrix = (K + s * B + s**2 * np.eye(len(K))) * np.outer(scale, scale)
    return scale[:, None] * np.linalg.solve(matrix, scale[:, None] * columns)


@dataclass(frozen=True, eq=False)
class ReducedInertia:
    """C*(ω) of L loads in a space of m vectors, orthonormal in the mass matrix, eigenvectors of K in it.

    With s = iω, c_E(s) = k_E + s b_E and all of it over V,

        C_EE′(ω) = k_EE′ + s b_EE′ − c_E(s)ᵀ (Ω² + sB + s²)⁻¹ c_E′(s) .
    """

    stiffness: np.ndarray  # (m,) Ω², in 1/time²
    damping: np.ndarray  # (m, m) B, in 1/time
    k: np.ndarray  # (L, m) elastic load column over √V
    b: np.ndarray  # (L, m) viscous load column over √V
    k_gg: np.ndarray  # (L, L) of affine motion, in k
    b_gg: np.ndarray  # (L, L) the same, in kτ₁

    def modulus(self, omega):
        """C*(ω), complex, (…, L, L) for omega (…)."""
        flat = np.ravel(np.asarray(omega, float))
        values = []
        for at in flat:
            s = 1j * at
            column = (self.k + s * self.b).T
            solved = solve_second_order(np.diag(self.stiffness), self.damping, at, column)
            values.append(self.k_gg + s * self.b_gg - column.T @ solved)
        return np.array(values).reshape((*np.shape(omega), *self.k_gg.shape))

    def stress_relaxation(self, time):
        """G(t) after a step of each strain, (…, L, L), for times (…) > 0; without the Dirac part of `b_gg`.

        The step moves the vectors by ÿ + Bẏ + Ω²y = −k − b δ(t), so that y = 0 and ẏ = −b right after it, and

            G(t) = k_γγ + kᵀy(t) + bᵀẏ(t) .
        """
        m, loads = len(self.stiffness), len(self.k_gg)
        generator = np.zeros((2 * m + loads,) * 2)  # of (y, ẏ, 1)
        generator[:m, m : 2 * m] = np.eye(m)
        generator[m : 2 * m, :m], generator[m : 2 * m, m : 2 * m] = -np.diag(self.stiffness), -self.damping
        generator[m : 2 * m, 2 * m :] = -self.k.T
        start = np.vstack((np.zeros((m, loads)), -self.b.T, np.eye(loads)))
        output = np.hstack((self.k, self.b, self.k_gg))
        values = [output @ (expm(generator * at) @ start) for at in np.ravel(np.asarray(time, float))]
        return np.array(values).reshape((*np.shape(time), loads, loads))

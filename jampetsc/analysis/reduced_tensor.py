"""C*(ω) of several loads from a pencil that was projected on the response of each.

The field of load E is a sum of columns, x_E(s) = Σ_m w_Em(s) X_m with the weights 1 of the quasistatic field and
−s h_m/(λ_m + s) of its modes. With K and B between all columns, s = iω,

    C_EE′(ω) V = w_E(s)ᵀ (K + sB) w_E′(s) ,

which is stationary: it is off by r_EᵀA⁻¹r_E′ with the residuals r of both fields.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ReducedTensor:
    """Columns of all L loads side by side: for each its quasistatic field, then its modes."""

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

"""What an approximate solution is worth: G* from it, and a bound on the error of that G*.

With s = iω, A = K + sB, c = k_γ + s b_γ and any trial field x, the modulus is the stationary value of

    G* V = k_γγ + s b_γγ + 2 cᵀx + xᵀA x ,    and its error is exactly   rᵀA⁻¹r ,   r = c + A x .

The error is quadratic in the residual. With z = A⁻¹r and S = K + ωB, K and B positive semi-definite,

    |rᵀA⁻¹r| = |zᵀA z| ≤ zᴴS z ≤ √2 |zᴴA z| = √2 |zᴴr| ,

the first step because |zᵀK z| ≤ zᴴK z, the second because |a + ib| ≥ (a + b)/√2 for a, b ≥ 0. Where K has
negative modes |rᵀz| is left, which is the error as far as z = A⁻¹r: an estimate, no bound. The stationary
value is summed contact by contact (see `compatibility`), so what rounding of x, K and B may do to it is also
of second order.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.mechanics.assembly import ROW
from jampetsc.mechanics.compatibility import Compatibility
from jampetsc.solvers.matrices import largest_entry

EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Certified:
    """G* at one frequency with bounds: what the solve may have changed in |G*|, and rounding in each part."""

    omega: float
    G: complex
    error: float  # √2 |zᴴr| / V, or |rᵀz| / V where that is larger, which takes negative modes
    rounding: tuple[float, float]  # of G' and of G'', from the sums over contacts

    @property
    def error_bound(self) -> float:
        """Bound on |ΔG*|."""
        return self.error + float(np.hypot(*self.rounding))

    @property
    def parts(self) -> tuple[float, float]:
        """Bounds on |ΔG'| and |ΔG''|, each with its own rounding: G'' may be far smaller than |G*|."""
        return self.error + self.rounding[0], self.error + self.rounding[1]


class Functional:
    """G*, residual and bound of trial fields, complex (n_local,), of one pencil. All methods are collective."""

    def __init__(self, compatibility: Compatibility):
        self.compatibility = compatibility
        self.stiffest = [largest_entry(matrix) for matrix in (compatibility.pencil.K, compatibility.pencil.B)]
        squares = compatibility.g**2
        affine = np.array([compatibility.size_K @ squares, compatibility.w_B @ squares])
        self.affine = np.sqrt(compatibility.pencil.network.sum(affine))

    def residual(self, omega, x):
        """r = c + A x, from the relative motions a = C x + g, which are kept for `certify`."""
        c = self.compatibility
        self.motion = c.motions(x) + c.g
        return c.forces((c.w_K + 1j * omega * c.w_B) * self.motion) + 1j * omega * c.drag * x

    def certify(self, omega, x, z, r) -> Certified:
        """G* of x with its bound, after r = `residual(omega, x)` and with z ≈ A⁻¹r."""
        c = self.compatibility
        network = c.pencil.network
        a, field = self.motion, x
        parts = np.array([a.real**2, a.imag**2, a.real * a.imag])
        drag = c.drag * np.array(
            [np.sum(field.real**2), np.sum(field.imag**2), np.sum(field.real * field.imag)]
        )
        (K_rr, K_ii, K_ri), (B_rr, B_ii, B_ri), (abs_rr, abs_ii, _), (x_rr, x_ii) = (
            network.sum(sums)
            for sums in (
                parts @ c.w_K,
                parts @ c.w_B + drag,
                parts @ c.size_K,
                np.array([np.sum(field.real**2), np.sum(field.imag**2)]),
            )
        )
        B_rr += c.drag_gg
        elastic, viscous = complex(K_rr - K_ii, 2.0 * K_ri), complex(B_rr - B_ii, 2.0 * B_ri)
        # Evaluating a is off by ε|C||x|, and Σ w (|C||x|)² ≤ 6 max(diagonal) |x|², six unknowns at most in a
        # row. The coefficients are off by a few ε; they multiply relative motions, and g. The rest is Cauchy
        # and Schwarz. Real and imaginary parts are kept apart: at low frequency they differ by many decades.
        noise = e_Kr, e_Ki, e_Br, e_Bi = np.sqrt([abs_rr, abs_ii, B_rr, B_ii])
        noise = 7.0 * noise + np.sqrt([ROW * most * norm for most in self.stiffest for norm in (x_rr, x_ii)])
        noise[::2] += 4.0 * self.affine
        d_Kr, d_Ki, d_Br, d_Bi = noise
        storage = e_Kr * (e_Kr + d_Kr) + e_Ki * (e_Ki + d_Ki)
        storage += omega * (2.0 * e_Br * e_Bi + e_Br * d_Bi + e_Bi * d_Br)
        loss = 2.0 * e_Kr * e_Ki + e_Kr * d_Ki + e_Ki * d_Kr
        loss += omega * (e_Br * (e_Br + d_Br) + e_Bi * (e_Bi + d_Bi))
        volume = network.area
        hermitian, symmetric = network.sum(np.array([np.vdot(z, r), z @ r]))
        return Certified(
            omega=float(omega),
            G=(elastic + 1j * omega * viscous) / volume,
            error=float(max(np.sqrt(2.0) * abs(hermitian), abs(symmetric)) / volume),
            rounding=(float(2.0 * EPSILON * storage / volume), float(2.0 * EPSILON * loss / volume)),
        )


def field_bound(
    compatibility: Compatibility, omega: float, x, squared: float, size: float | None = None
) -> float:
    """Bound on ‖x − exact‖ / ‖x‖, the error of a field in the energy norm ‖x‖² = xᴴ(K + ωB) x. Collective.

    x        non-affine field (n_local,), complex
    squared  bound on ‖x − exact‖² from the residual r = c + A x. With e = A⁻¹r and S = K + ωB,
             ‖e‖² = eᴴS e ≤ √2 |eᴴA e| = √2 |eᴴr| when e itself is known, and from there, by Cauchy and
             Schwarz, √2 |eᴴr| ≤ √2 ‖e‖ (rᴴS⁻¹r)^½, so ‖e‖² ≤ 2 rᴴS⁻¹r, when only the energy of r is
    size     2-norm of what x was summed from, where that is larger than x: its rounding counts as well

    Translations, and turns of gears, cost nothing and do not count. Where K has negative modes this is no
    bound.
    """
    c = compatibility
    network = c.pencil.network
    a = np.abs(c.motions(x)) ** 2
    local = np.array([(c.w_K + omega * c.w_B) @ a + omega * c.drag * np.vdot(x, x).real, np.vdot(x, x).real])
    energy, norm2 = network.sum(local)
    if energy == 0.0:  # a crystal: nothing moves against the strain
        return 0.0 if squared == 0.0 else float("inf")
    stiffest = ROW * sum(
        factor * largest_entry(matrix) for factor, matrix in ((1.0, c.pencil.K), (omega, c.pencil.B))
    )
    rounding = 4.0 * EPSILON * np.sqrt(stiffest) * max(np.sqrt(norm2), size or 0.0)
    return float((np.sqrt(abs(squared)) + rounding) / np.sqrt(abs(energy)))

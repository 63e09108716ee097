"""What an approximate solution is worth: G* from it, and a bound on the error of that G*.

With s = iω, A = K + sB, c = k_γ + s b_γ and any trial field x, the modulus is the stationary value of

    G* V = k_γγ + s b_γγ + 2 cᵀx + xᵀA x ,    and its error is exactly   rᵀA⁻¹r ,   r = c + A x .

The error is quadratic in the residual. With z = A⁻¹r and S = K + ωB, K and B positive semi-definite,

    |rᵀA⁻¹r| = |zᵀA z| ≤ zᴴS z ≤ √2 |zᴴA z| = √2 |zᴴr| ,

the first step because |zᵀK z| ≤ zᴴK z, the second because |a + ib| ≥ (a + b)/√2 for a, b ≥ 0. The stationary value is summed contact
by contact (see `compatibility`), so what rounding of x, K and B may do to it is also of second order.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.mechanics.compatibility import Compatibility

EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Certified:
    """G* at one frequency and a bound on |ΔG*|, split into what the solve and what rounding can have changed."""

    omega: float
    G: complex
    error: float  # √2 |zᴴr| / V
    rounding: float  # of the sum over contacts, in double precision

    @property
    def error_bound(self) -> float:
        """Bound on |ΔG*|."""
        return self.error + self.rounding


class Functional:
    """G*, residual and bound of trial fields of one pencil, in the complex PETSc. All methods are collective."""

    def __init__(self, compatibility: Compatibility):
        self.compatibility = compatibility
        self.motion, self.force = compatibility.C.createVecLeft(), compatibility.C.createVecLeft()
        K, B = (getattr(compatibility.pencil, name).getDiagonal() for name in "KB")
        self.stiffest = abs(K.max()[1]), abs(B.max()[1])
        K.destroy()
        B.destroy()

    def residual(self, omega, x, r):
        """r ← c + A x, from the relative motions a = C x + g, which are kept for `certify`."""
        c = self.compatibility
        c.C.mult(x, self.motion)
        self.motion.getArray()[:] += c.g
        self.force.setArray((c.w_K + 1j * omega * c.w_B) * self.motion.getArray())
        c.C.multTranspose(self.force, r)
        if c.drag:
            r.axpy(1j * omega * c.drag, x)

    def certify(self, omega, x, z, r) -> Certified:
        """G* of x with its bound, after `residual(omega, x, r)` and with z ≈ A⁻¹r."""
        c = self.compatibility
        network = c.pencil.network
        a = self.motion.getArray()
        squares = a * a
        size = np.abs(squares)
        w_K = np.abs(c.w_K)
        elastic, viscous, abs_K, abs_B = network.sum(
            np.array([c.w_K @ squares, c.w_B @ squares, w_K @ size, c.w_B @ size])
        )
        norm = x.norm()
        if c.drag:
            viscous = viscous + c.drag * x.tDot(x) + c.drag_gg
            abs_B = abs_B + c.drag * norm**2 + c.drag_gg
        total = (abs_K + omega * abs_B).real
        # Each a is off by ε Σ|C||x|, and Σ w (|C||x|)² ≤ 6 max(diagonal) |x|²: six unknowns at most in a row.
        stiffest = self.stiffest[0] + omega * self.stiffest[1]
        rounding = EPSILON * (2.0 * total + 2.0 * np.sqrt(total * 6.0 * stiffest) * norm)
        return Certified(
            omega=omega,
            G=complex(elastic + 1j * omega * viscous) / network.area,
            error=float(np.sqrt(2.0) * abs(z.dot(r)) / network.area),
            rounding=float(rounding / network.area),
        )

    def destroy(self):
        """Free the work vectors. Collective."""
        self.motion.destroy()
        self.force.destroy()

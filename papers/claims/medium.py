"""Correlation of u_y along x in an isotropic medium that random stresses stir: what BT Fig. 7 is without disks.

A shear strain γ of a disordered solid leaves random stresses of order G*γ. In an isotropic medium without compression,
of complex modulus G* = |G*| e^{iφ}, with a drag nkτ₁ per area (Stokes; n disks per area), forces balance as

    (G* k² + iωn) u_k = i k G* ξ_k ,     ξ_k independent ,     u_k ⊥ k ,

so per strain u_k ∝ k e^{iφ}/(e^{iφ} k² + i), k in units of 1/ℓ with ℓ = √(|G*|/(nω)), and per stress e^{−iφ} times
that. In a square cell of side L

    C(δ) ∝ Σ_k (k_x²/k²) |a(k)|² cos(k_x δ) ,     k = 2π (m, n')/L ,

with a = Re or Im of that factor. As ω → 0, Re u_k → 1/k and Im u_k → −1/k³ (K u″ = −ωB u′); under contact damping
B ∝ k² as K, and both parts go as 1/k.
"""

import numpy as np
from scipy.optimize import brentq

_WAVES = 80  # along the lane, cut off smoothly: by disks of about L/80


def solid(k):
    """u_k of a solid, and of a contact-damped one at any frequency: 1/k."""
    return 1.0 / k


def dragged(k):
    """Im u_k of a solid under Stokes drag as ω → 0, and of all frequencies at k ℓ ≫ 1: 1/k³."""
    return k**-3.0


def correlation(factor, delta, waves: int):
    """C(δ) up to a factor, δ in units of the cell's side: lattice sum with `waves` waves along it, cut off smoothly.

    factor  a(k) of an array of |k|, k in units of 1/side
    delta   a number or an array
    """
    m = np.arange(1, 4 * waves)
    square = m[:, None] ** 2 + np.arange(-8 * waves, 8 * waves + 1) ** 2
    weights = np.sum(m[:, None] ** 2 / square * factor(2 * np.pi * np.sqrt(square)) ** 2, axis=1)
    weights *= np.exp(-0.5 * (m / waves) ** 2)
    return np.cos(2 * np.pi * np.multiply.outer(delta, m)) @ weights


def first_root(factor) -> float:
    """δ/L where C first vanishes, in a square cell of side 1. `factor` a(k) takes an array of |k|."""
    steps = np.linspace(0, 0.5, 4 * _WAVES)
    last = np.flatnonzero(correlation(factor, steps, _WAVES) <= 0)[0]
    return brentq(lambda delta: correlation(factor, delta, _WAVES), steps[last - 1], steps[last])

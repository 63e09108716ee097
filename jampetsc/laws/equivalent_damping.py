"""Power-law damping by the method of equivalent damping (BT eqs. 25–29, as corrected).

A contact that resists relative motion Δu with the viscous force k ρ₀ (τ₁|Δu̇|/ρ₀)^α dissipates, when it
oscillates with amplitude u₀ at frequency ω, as much per cycle as a linear dashpot kτ_α with

    τ_α = (2/√π) τ₁ (u₀ωτ₁/ρ₀)^(α−1) Γ(1 + α/2) / Γ(3/2 + α/2)                                  (BT 25)

and the moduli are of the linear law at the equivalent frequency,  G*_α(ω) = G*(Ω),  Ω = ω τ_α/τ₁.
The amplitude u₀ is that of one spring k beside one such dashpot under the force F₀ that the stress
amplitude σ₀ puts on a contact, F₀ = σ₀ρ₀ with ρ₀ the particle diameter (in 2D; ρ₀ itself then drops out):

    u₀/ρ₀ = (σ₀/k) / √(1 + (ωτ_α)²) .

With y = ωτ_α and C = (2/√π) Γ(1 + α/2)/Γ(3/2 + α/2) (σ₀/k)^(α−1) both equations together are

    y (1 + y²)^((α−1)/2) = C (ωτ₁)^α .

The left side grows with y for every α > 0, d ln(left)/d ln y = (1 + αy²)/(1 + y²), so there is one y for
each ω and it grows with ω. Its limits are BT 26: y = C (ωτ₁)^α for y ≪ 1, y = C^(1/α) ωτ₁ for y ≫ 1. With
the linear G* of a packing at pressure p (BT 16, 17; Δ = ½) they give the exponents of BT 27–29:

    Ωτ₁ ≪ p        G' ∝ ω⁰           G'' ∝ ω^α σ₀^(α−1)
    p ≪ Ωτ₁ ≪ 1    G', G'' ∝ ω^(α/2) σ₀^((α−1)/2)
    Ωτ₁ ≫ 1        G' ∝ ω⁰           G'' ∝ ω σ₀^((α−1)/α)

What it is: one linear dashpot for all contacts, dissipating the right energy at one stress amplitude.
What it is not: a solution of the nonlinear equations. In a packing some contacts move far more than u₀ and
others far less, normal and transverse motions differ, higher harmonics are dropped, and contacts neither
open nor close. Expect exponents from it and estimates of prefactors.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named

SMALLEST_ALPHA, LARGEST_ALPHA = 0.05, 5.0
STRESS_RATIOS = 1e-30, 1.0  # range of σ₀/k
_ITERATIONS = 100  # Newton needs about ten


@dataclass(frozen=True)
class EquivalentDamping:
    """Power-law damping of exponent α at stress amplitude σ₀; all frequencies in 1/τ₁, times in τ₁.

    Raises InputError for values out of range.
    """

    alpha: float  # exponent of the damping force, 1 is linear
    stress: float  # σ₀/k, of packings over `units.stress_unit_of`

    def __post_init__(self):
        if not SMALLEST_ALPHA <= self.alpha <= LARGEST_ALPHA:
            raise InputError(
                f"{named('alpha')} {self.alpha:g}: must lie between {SMALLEST_ALPHA:g} and {LARGEST_ALPHA:g}"
            )
        low, high = STRESS_RATIOS
        if not low <= self.stress <= high:
            raise InputError(
                f"{named('stress')}: {self.stress:g} k (must lie between {low:g} and {high:g} k)"
            )

    @property
    def coefficient(self) -> float:
        """C = (2/√π) Γ(1 + α/2)/Γ(3/2 + α/2) (σ₀/k)^(α−1), so that y = C (ωτ₁)^α at low frequency (BT 26)."""
        ratio = math.exp(math.lgamma(1 + self.alpha / 2) - math.lgamma(1.5 + self.alpha / 2))
        return 2.0 / math.sqrt(math.pi) * ratio * self.stress ** (self.alpha - 1.0)

    def frequency(self, omega):
        """Equivalent frequency Ω in the shape of omega, both in 1/τ₁; increasing, and odd as ω is."""
        omega = np.asarray(omega, float)
        if self.alpha == 1.0:
            return omega.copy()
        solved, moving = np.zeros_like(omega), omega != 0.0
        solved[moving] = np.copysign(self._frequency(np.abs(omega[moving])), omega[moving])
        return solved[()]

    def _frequency(self, omega):
        """That of ω > 0; infinite where no double holds it."""
        bend = 0.5 * (1.0 - self.alpha)
        target = math.log(self.coefficient) + self.alpha * np.log(omega)
        # In x = ln y the equation is  x − bend ln(1 + e^2x) = target : concave for α < 1, convex for α > 1,
        # with a slope between 1 and α. From the side where both limits lie Newton never overshoots.
        limits = target, target / self.alpha
        x = np.maximum(*limits) if self.alpha < 1.0 else np.minimum(*limits)
        for _ in range(_ITERATIONS):
            excess = x - bend * np.logaddexp(0.0, 2.0 * x) - target
            slope = 1.0 - 2.0 * bend / (1.0 + np.exp(-2.0 * np.clip(x, -300.0, 300.0)))
            step = excess / slope
            x = x - step
            if np.all(np.abs(step) <= 4.0 * np.finfo(float).eps * np.maximum(np.abs(x), 1.0)):
                break
        with np.errstate(over="ignore"):
            return np.exp(x)

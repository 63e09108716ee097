"""Relaxation spectrum: the modulus as a sum of Maxwell elements with positive weights.

K and B are symmetric and positive semi-definite, so G* has all its poles on the negative real s axis:

    G*(ω) = G₀ + iω η_∞ + Σ_m g_m iω / (λ_m + iω) ,     λ_m > 0,  g_m ≥ 0 .

Every term adds to G' and to G'' with the same sign: neither is ever a difference of large numbers. In time,
the stress after a step of strain γ at t = 0 is γ G(t), with a Dirac part from the instant of infinite rate:

    G(t) = η_∞ δ(t) + G₀ + Σ_m g_m exp(−λ_m t) ,     ∫ δ(t) dt = 1 over t ≥ 0 .

A packing of N disks has 2N modes or so; the spectrum of a rational sweep has a few tens. They are not a
selection of the packing's modes but nodes and weights of a quadrature of Gauss type for its spectrum: they
give G* to the accuracy that the sweep certifies, and each stands for all true modes around it. What can be
said of the true spectrum H(τ), defined by G(t) − G₀ = ∫ H(τ) exp(−t/τ) d ln τ, is its content between nodes
(`between`) and its average over a known window (`smoothed`), not its shape within.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError

MAX_WINDOW = 1.5  # decades; the window of `smoothed` can be no wider
_MIN_SHARE = 0.01  # a node with this share of all weight counts for the resolution


@dataclass(frozen=True, eq=False)
class RelaxationSpectrum:
    """Rates λ (m,) in 1/τ₁, weights g (m,) in k; G₀ in k and η_∞ in kτ₁."""

    G0: float
    eta_inf: float
    rates: np.ndarray
    weights: np.ndarray

    @property
    def eta0(self) -> float:
        """η₀ = lim G''/ω for ω → 0."""
        return self.eta_inf + float(np.sum(self.weights / self.rates))

    @property
    def G_inf(self) -> float:
        """lim G' for ω → ∞."""
        return self.G0 + float(np.sum(self.weights))

    def modulus(self, omega):
        """G*(ω), complex, in the shape of omega."""
        omega = np.asarray(omega, float)
        s = 1j * omega
        elements = s[..., None] / (self.rates + s[..., None])  # whose squares no double may hold
        return self.G0 + s * self.eta_inf + np.sum(self.weights * elements, axis=-1)

    def stress_relaxation(self, time):
        """G(t) for t > 0 in the shape of time; the Dirac part η_∞ δ(t) is not in it."""
        time = np.asarray(time, float)
        return self.G0 + np.sum(self.weights * np.exp(-time[..., None] * self.rates), axis=-1)

    def sorted(self) -> "RelaxationSpectrum":
        """The same spectrum with increasing times, modes without weight left out and equal ones joined."""
        carries = self.weights > 0
        rates, which = np.unique(self.rates[carries], return_inverse=True)
        weights = np.bincount(which, self.weights[carries], len(rates))
        return RelaxationSpectrum(self.G0, self.eta_inf, rates[::-1], weights[::-1])

    def between(self):
        """(times (m,), H (m − 1,)): mean of H(τ) over ln τ between neighbouring times of `sorted`.

        A Gauss quadrature knows the content of the spectrum up to a node within the weight of that node
        (Chebyshev, Markov and Stieltjes); half of each weight is counted to either side here.
        """
        ordered = self.sorted()
        times, weights = 1.0 / ordered.rates, ordered.weights
        return times, 0.5 * (weights[1:] + weights[:-1]) / np.diff(np.log(times))

    @property
    def resolution(self) -> float:
        """Widest gap in decades between neighbouring times that carry 1 % of all weight or more."""
        times = np.sort(1.0 / self.rates[self.weights >= _MIN_SHARE * np.sum(self.weights)])
        return float(np.max(np.diff(np.log10(times)), initial=0.0))

    def smoothed(self, tau, width: float):
        """H(τ) averaged over a window of `width` decades (at half its height), in the shape of tau.

        On a ray beside the negative s axis, H_ε(τ) = Im [G*(s) − s η_∞]/(π − ε) at s = exp(i(π − ε))/τ is

            H_ε(τ) = ∫ H(τ') k(ln τ − ln τ') d ln τ' ,   k(y) = sin ε / [2 (π − ε)(cosh y − cos ε)] ,

        an average with a positive window of unit content, so H_ε ≥ 0 and ∫ H_ε d ln τ = G_∞ − G₀. At ε = π/2
        it is the familiar estimate (2/π)(G'' − ωη_∞) at ω = 1/τ. Far from all times H_ε falls as τ^±1: those
        flanks are the window's. Raises InputError for a width that is not within 0.01 and 1.5 decades.
        """
        if not 0.01 <= width <= MAX_WINDOW:
            raise InputError(f"width {width:g}: must lie between 0.01 and {MAX_WINDOW:g} decades")
        tau = np.asarray(tau, float)
        angle = np.arccos(2.0 - np.cosh(0.5 * width * np.log(10.0)))
        y = np.log(tau[..., None] * self.rates)
        # cosh y − cos ε without cancellation for narrow windows
        height = 2.0 * (np.sinh(0.5 * np.clip(y, -700, 700)) ** 2 + np.sin(0.5 * angle) ** 2)
        return np.sum(self.weights * np.sin(angle) / (2.0 * (np.pi - angle) * height), axis=-1)

"""Galerkin's solution under forces f: the susceptibility as a sum over modes that keeps its digits at high frequency.

With the rates λ_m and modes φ_m, and x_∞ the part of the first field without viscous force on the modes,

    x(s) = x_∞ + Σ_m f_m φ_m/(λ_m + s) ,    f_m = φ_mᵀ(f − K x_∞) ,

    G* V = −χ = x_∞ᵀ(K + sB)x_∞ − 2fᵀx_∞ − Σ_m f_m²/(λ_m + s) .

It is the field of `galerkin` with x_qs = x_∞ + Σ h_m φ_m and h_m = f_m/λ_m, but not its modulus
G₀ + sη_∞ + Σ g_m s/(λ_m + s): where χ is far below its static value that is a difference of large numbers. x_∞ = 0
where the basis starts at s = ∞.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.response import tall
from jampetsc.response.assembly import ROW
from jampetsc.response.certificate import EPSILON, ROUNDING
from jampetsc.response.galerkin import Galerkin, products_rounding
from jampetsc.response.krylov_basis import RationalBasis


@dataclass(frozen=True, eq=False)
class ForceSpectrum:
    """G* = −χ/V as a sum over rates of relaxation."""

    rates: np.ndarray  # (m,) λ
    weights: np.ndarray  # (m,) f²/V
    G_inf: float  # limits of G' and G''/ω where ω → ∞
    eta_inf: float

    def modulus(self, omega):
        """G* (M,), complex, at frequencies (M,)."""
        s = 1j * np.asarray(omega, float)
        return self.G_inf + self.eta_inf * s - np.sum(self.weights / (self.rates + s[:, None]), axis=1)


class ForceGalerkin(Galerkin):
    """The best approximation of the response to forces in the space of a basis. Collective.

    spectrum   ForceSpectrum; other members as in `Galerkin`
    """

    def _relax(self, fields, motions, rates, is_floppy):
        c, network = self.pencil.compatibility, self.network
        for _ in range(2):  # the second time for what rounding of a larger first field leaves
            viscous = motions[:, 1:].T @ (c.w_B * motions[:, 0]) + fields[:, 1:].T @ (c.drag * fields[:, 0])
            fields[:, 0] -= fields[:, 1:] @ network.sum(viscous)
            motions[:, 0] = c.motions(
                fields[:, 0]
            )  # not from motions of the first field, which may be far larger
        local = fields[:, 1:].T @ c.force - motions[:, 1:].T @ (c.w_K * motions[:, 0])
        self._forces = network.sum(local)
        self._forces[is_floppy] = 0.0  # no quasistatic field balances them: the residual has what they leave
        self._set_limits(fields, motions, rates)
        self.loads = self._forces / rates
        for columns in (fields, motions):
            columns[:, 0] += columns[:, 1:] @ self.loads

    def _set_limits(self, fields, motions, rates):
        """The spectrum, and what rounds in it, of x_∞ and the modes."""
        c, network = self.pencil.compatibility, self.network
        squares = tall.squares(motions, np.array([c.w_K, c.w_B, np.abs(c.w_K), c.size_K]))
        squares[1] += tall.squares(fields, c.drag[None])[0]
        of_K, of_B, size_K, of_weights = network.sum(squares)
        work = network.sum(c.force @ fields[:, 0])
        self.spectrum = ForceSpectrum(
            rates,
            self._forces**2 / network.volume,
            float(of_K[0] - 2.0 * work) / network.volume,
            float(of_B[0]) / network.volume,
        )
        reach = network.sum(tall.squares(fields, np.array([c.reach_K, c.reach_B])))
        reach = np.sqrt(ROW[network.dimension] * reach)
        self._terms = (np.sqrt(size_K), reach[0]), (np.sqrt(of_B), reach[1])
        self._weight_roots = np.sqrt(of_weights)
        self._force_sizes = network.sum(np.abs(fields).T @ c.force_size)

    def _finish(self, motions, rates):
        reach = np.array([self.pencil.compatibility.reach_K, self.pencil.compatibility.reach_B])
        of_fields = np.column_stack((reach @ self.quasistatic**2, tall.squares(self.modes, reach)))
        self._norms = self.network.sum(of_fields)

    def rounding(self, omega):
        """What rounding can have changed in G' and in G'', (M, 2).

        Of the products of fields, of the weights of contacts in K, and of the work of the forces.
        """
        omega = np.asarray(omega, float)
        amplitudes = self._forces / (self.spectrum.rates + 1j * omega[:, None])
        amplitudes = np.column_stack((np.ones(len(omega)), amplitudes))  # of x_∞ and of the modes
        of_K, of_B = (
            products_rounding(amplitudes, *(np.append(0.0, part) for part in terms)) for terms in self._terms
        )
        total = of_K + omega * (of_B.imag + 1j * of_B.real)
        real, imaginary = np.abs(amplitudes.real), np.abs(amplitudes.imag)
        in_phase, lagging = (part @ self._weight_roots for part in (real, imaginary))
        total += EPSILON * (in_phase**2 + lagging**2 + 2j * in_phase * lagging)
        total += 2.0 * ROUNDING * ((real + 1j * imaginary) @ self._force_sizes)
        return np.column_stack((total.real, total.imag)) / self.network.volume


def solve_projected(basis: RationalBasis) -> Galerkin:
    """Galerkin's solution in the space of a basis, for the load of its pencil. Collective."""
    return (ForceGalerkin if basis.pencil.exerts_forces else Galerkin)(basis)

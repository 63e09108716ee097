"""From a basis to G*: the pencil projected contact by contact, and its relaxation spectrum to full relative accuracy.

The projection uses the motions P = C [x₀, V] (+ g) of the contacts: sums of W a² over contacts give the projected K and
B without the cancellation of products with the assembled matrices at low pressure. The small eigenvalue problem is then
solved to high relative accuracy in every rate (rotate, project again, Cholesky, one-sided Jacobi; Demmel & Veselić
1992), since rates span many decades.
"""

import numpy as np
from scipy.linalg import lapack, solve_triangular

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError
from jampetsc.response import tall
from jampetsc.response.assembly import ROW
from jampetsc.response.certificate import EPSILON, ROUNDING, field_bound
from jampetsc.response.krylov_basis import RationalBasis
from jampetsc.response.residual import GalerkinResidual

# relative rounding of a rate above which its vector counts as floppy; usual are 1e-13
MAX_RATE_ROUNDING = 1e-6


class Galerkin:
    """The best approximation of the response in the space of a basis. Collective.

    spectrum    RelaxationSpectrum, so G*(ω) of the projected pencil
    quasistatic (n_local,) the field x(ω → 0) in the space; modes (n_local, m) with rates λ, orthonormal in B
    """

    def __init__(self, basis: RationalBasis):
        self.pencil, self.network = basis.pencil, basis.pencil.network
        compatibility = self.pencil.compatibility
        comm = self.network.comm
        fields = np.array((basis.x0, *basis.vectors)).T  # column by column in memory, as they are made
        rates, is_floppy = np.empty(0), np.empty(0, bool)
        if basis.size:
            # The basis is orthonormal in B up to rounding; in the eigenvectors of K, K is graded and small
            # rates are exact.
            tall.rotate(fields[:, 1:], on_root(comm, lambda: np.linalg.eigh(basis.K)[1]))
        motions = np.empty((basis.size + 1, len(compatibility.g))).T
        for motion, field in zip(motions.T, fields.T, strict=True):
            motion[:] = compatibility.motions(field)
        motions[:, 0] += compatibility.g
        if basis.size:
            K, B = self._projected(fields[:, 1:], motions[:, 1:])
            slack = self._slack(fields[:, 1:], motions[:, 1:])
            rates, rotation, is_floppy = on_root(comm, lambda: graded_eigenpairs(K, B, slack))
            for columns in (fields, motions):
                tall.rotate(columns[:, 1:], rotation)
        self._relax(fields, motions, rates, is_floppy)
        self.quasistatic, self.modes = fields[:, 0], fields[:, 1:]
        self._finish(motions, rates)
        self._motions = motions

    def _relax(self, fields, motions, rates, is_floppy):
        """Make the first column the quasistatic field, in place, by a sum of modes."""
        for _ in range(2):  # the second time for what rounding of a larger first field leaves
            still = (
                -self.network.sum(motions[:, 1:].T @ (self.pencil.compatibility.w_K * motions[:, 0])) / rates
            )
            still[is_floppy] = 0.0  # their elastic load is rounding, as K does not resist them
            fields[:, 0] += fields[:, 1:] @ still
            motions[:, 0] += motions[:, 1:] @ still

    def residual(self) -> GalerkinResidual:
        """The residual of this solution. To be called once: the motions are handed over to it, not kept twice."""
        motions, self._motions = self._motions, None
        fields = self.quasistatic, self.modes
        return GalerkinResidual(self.pencil, motions, fields, self.spectrum.rates, self.loads)

    def _projected(self, fields, motions):
        """Vᵀ K V and Vᵀ B V, (m, m) each, from the motions of V."""
        c = self.pencil.compatibility
        K, B = tall.gram(motions, c.w_K), tall.gram(motions, c.w_B)
        return self.network.sum(K), self.network.sum(B + tall.gram(fields, c.drag) if c.drag.any() else B)

    def _slack(self, fields, motions):
        """What rounding may change in the diagonal of Vᵀ K V, (m,)."""
        c = self.pencil.compatibility
        local = np.array(
            [tall.squares(motions, np.abs(c.w_K)[None])[0], tall.squares(fields, c.reach_K[None])[0]]
        )
        sizes, reach = self.network.sum(local)
        return _rounding(sizes, np.sqrt(ROW[self.network.dimension] * reach))

    def _finish(self, motions, rates):
        c, volume = self.pencil.compatibility, self.network.volume
        still, modes, field = motions[:, 0], motions[:, 1:], self.quasistatic
        loads = modes.T @ (c.w_B * still) + self.modes.T @ (c.drag * field)
        loads = self.network.sum(loads)  # h: viscous force of the quasistatic flow on each mode
        fast = still - modes @ loads
        flow = field - self.modes @ loads
        size_K = np.abs(c.w_K)
        elastic, viscous = self.network.sum(
            np.array(
                [
                    [c.w_K @ still**2, size_K @ still**2, size_K @ c.g_size**2, c.size_K @ still**2],
                    [c.dissipation(fast, flow), c.dissipation(still, field), c.w_B @ c.g_size**2, 0.0],
                ]
            )
        )
        G0, eta_inf = elastic[0] / volume, (viscous[0] + c.drag_gg) / volume
        weights = rates * loads**2 / volume
        self.loads = loads
        self.spectrum = RelaxationSpectrum(float(G0), float(eta_inf), rates, weights)

        # Rounding of sums Σ w a²: see `_rounding`; reach: norms of the terms of the motions a = C x + g.
        reach = np.array([c.reach_K, c.reach_B])
        of_fields = np.column_stack((reach @ field**2, tall.squares(self.modes, reach)))
        self._norms = self.network.sum(of_fields)
        reach_K, reach_B = np.sqrt(ROW[self.network.dimension] * self._norms)
        reach_K[0] += np.sqrt(elastic[2])
        reach_B[0] += np.sqrt(viscous[2])
        sizes, of_weights = self.network.sum(tall.squares(modes, np.array([size_K, c.size_K])))
        of_rates = (_rounding(sizes, reach_K[1:]) + EPSILON * of_weights) / rates + _rounding(
            1.0, reach_B[1:]
        )
        of_loads = ROUNDING * (np.sqrt(viscous[1]) * (1.0 + reach_B[1:]) + reach_B[0])
        of_G0 = (_rounding(elastic[1], reach_K[0]) + EPSILON * elastic[3]) / volume
        # The flow minimises dissipation: rounding of its coefficients is of second order, that of its terms
        # is not.
        of_eta = (_rounding(viscous[0], 2.0 * reach_B[0]) + ROUNDING * c.drag_gg) / volume
        of_modes = 2.0 * weights * of_rates + 2.0 * rates * np.abs(loads) * of_loads / volume
        self._noise = RelaxationSpectrum(of_G0, of_eta, rates, of_modes)
        # root sum of squares and of terms of the motions of x_qs and of the modes in K, of the flow and the modes in B
        sizes_K, sizes_B = np.sqrt([elastic[1], *sizes]), np.sqrt([viscous[0], *np.ones(len(rates))])
        self._terms = (sizes_K, reach_K), (sizes_B, reach_B)

    def rounding(self, omega):
        """What rounding can have changed in G' and in G'', (M, 2)."""
        noise = self._noise.modulus(omega) + self._overlaps(np.asarray(omega, float))
        return np.column_stack((noise.real, noise.imag))

    def _overlaps(self, omega):
        """What products of different fields add to G' + iG'', (M,), that are zero but for rounding.

        With a = s h/(λ + s) and b = h − a the field is x_qs − Σ a_m φ_m = x_∞ + Σ b_m φ_m. Its form in K is summed over
        the first expression, that in B over the second, where x_qs and x_∞ are orthogonal to all modes.
        """
        amplitudes = np.array([self._amplitudes(frequency) for frequency in omega]).reshape(len(omega), -1)
        of_K, of_B = (
            products_rounding(parts, *terms)
            for parts, terms in zip((amplitudes, self.loads - amplitudes), self._terms, strict=True)
        )
        return (of_K + omega * (of_B.imag + 1j * of_B.real)) / self.network.volume

    def field(self, omega: float):
        """The non-affine field x(iω), complex (n_local,): x_qs − iω Σ_m h_m φ_m / (λ_m + iω)."""
        return self.quasistatic - self.modes @ self._amplitudes(omega)

    def _amplitudes(self, omega):
        return 1j * omega * self.loads / (self.spectrum.rates + 1j * omega)

    def field_bound(self, omega: float, error: float) -> float:
        """Bound on the error of `field`, relative in the energy norm, from |ΔG*| without rounding. Collective."""
        norms = np.sqrt(self._norms[0] + omega * self._norms[1])
        size = norms @ np.abs(np.append(1.0, self._amplitudes(omega)))
        squared = np.sqrt(2.0) * error * self.network.volume
        return field_bound(self.pencil, omega, self.field(omega), squared, size)


def products_rounding(weights, sizes, reach):
    """Rounding of 2 Σ w_m ⟨0, m⟩ + Σ_{m≠n} w_m w_n ⟨m, n⟩, real and imaginary part, (M,), for weights (M, m), complex.

    sizes, reach   (1 + m,) roots of Σ w a² and of the sum of squares of the terms of a, see `_rounding`
    """
    real, imaginary = (
        (np.abs(part) @ sizes[1:], np.abs(part) @ reach[1:]) for part in (weights.real, weights.imag)
    )

    def product(field, other):
        return ROUNDING * (field[0] * (other[0] + other[1]) + field[1] * (other[0] + ROUNDING * other[1]))

    first = sizes[0], reach[0]
    of_real = 2.0 * product(first, real) + product(real, real) + product(imaginary, imaginary)
    return of_real + 2j * (product(first, imaginary) + product(real, imaginary))


def _rounding(size, reach):
    """Bound on the rounding of a sum Σ w a² of this size, for terms of a with the root sum of squares `reach`.

    Each a is off by ROUNDING times its terms: 2 Σ w a δa, by Cauchy and Schwarz, and Σ w δa².
    """
    return ROUNDING * np.sqrt(size) * (np.sqrt(size) + reach) + (ROUNDING * reach) ** 2


def graded_eigenpairs(K, B, slack):
    """(rates, B-orthonormal vectors, mask of floppy ones) of a small pencil, K graded, B the identity but for rounding.

    slack   (m,) rounding of the diagonal of K: a vector near it is floppy, and is not mixed with others
    """
    lower = np.linalg.cholesky(B)
    H = solve_triangular(lower, solve_triangular(lower, K, lower=True).T, lower=True)
    floppy = np.flatnonzero(slack > MAX_RATE_ROUNDING * np.diag(K))
    H[floppy] = H[:, floppy] = 0.0
    H[floppy, floppy] = np.maximum(np.diag(K), slack)[floppy]
    try:
        R = np.linalg.cholesky(0.5 * (H + H.T))
    except np.linalg.LinAlgError:
        raise ConvergenceError(
            "the projected K is not positive definite: the packing is not a minimum"
        ) from None
    values, _, vectors, scaling, _, info = lapack.dgejsv(R.T, joba=0, jobu=3, jobv=0)
    if info != 0:
        raise ConvergenceError(f"one-sided Jacobi did not converge (info {info})")
    rates = (values * scaling[1] / scaling[0]) ** 2
    is_floppy = np.abs(vectors[floppy]).max(axis=0, initial=0.0) > 0.5
    return rates, solve_triangular(lower.T, vectors, lower=False), is_floppy

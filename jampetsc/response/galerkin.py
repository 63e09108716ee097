"""From a basis to G*: the pencil projected contact by contact, and its relaxation spectrum to full relative accuracy.

The motions P = C [x₀, V] (+ g) of the contacts carry everything: sums of W a² over contacts give the projected K and B without the cancellation that
the assembled matrices suffer at low pressure. The small eigenvalue problem is then solved to high relative accuracy in
every rate (rotate, project again, Cholesky, one-sided Jacobi; Demmel & Veselić 1992), since rates span many decades.
"""

import numpy as np
from scipy.linalg import lapack, solve_triangular

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.errors import ConvergenceError
from jampetsc.mechanics.compatibility import Compatibility
from jampetsc.response.basis import RationalBasis

EPSILON = float(np.finfo(float).eps)


class Galerkin:
    """The best approximation of the response in the space of a basis. Collective.

    spectrum    RelaxationSpectrum, so G*(ω) of the projected pencil
    quasistatic (n_local,) the field x(ω → 0) in the space; modes (n_local, m) with rates λ, orthonormal in B
    """

    def __init__(self, basis: RationalBasis, compatibility: Compatibility):
        self.compatibility = compatibility
        self.network = compatibility.pencil.network
        fields = np.column_stack((basis.x0, *basis.vectors))
        motions = self._motions(fields)
        motions[:, 0] += compatibility.g
        K, B = self._project(fields, motions)
        m = basis.size
        if m:
            # The basis is orthonormal in B up to rounding; in the eigenvectors of K, K is graded and small rates are exact.
            _, rotation = np.linalg.eigh(K[1:, 1:])
            fields[:, 1:], motions[:, 1:] = fields[:, 1:] @ rotation, motions[:, 1:] @ rotation
            K, B = self._project(fields, motions)
            rates, rotation = _graded_eigen(K[1:, 1:], B[1:, 1:])
            fields[:, 1:], motions[:, 1:] = fields[:, 1:] @ rotation, motions[:, 1:] @ rotation
            K, B = self._project(fields, motions)
            still = -K[0, 1:] / rates
            fields[:, 0] += fields[:, 1:] @ still
            motions[:, 0] += motions[:, 1:] @ still
        else:
            rates = np.empty(0)
        self.quasistatic, self.modes = fields[:, 0], fields[:, 1:]
        self._finish(motions, rates)

    def _motions(self, fields):
        C = self.compatibility.C
        x, a = C.createVecs()
        motions = np.empty((a.getLocalSize(), fields.shape[1]))
        for column, field in enumerate(fields.T):
            x.setArray(field)
            C.mult(x, a)
            motions[:, column] = a.getArray()
        x.destroy()
        a.destroy()
        return motions

    def _project(self, fields, motions):
        """[x₀, V]ᵀ K [x₀, V] and the same of B, with γ in the first row: (m + 1, m + 1) each."""
        c = self.compatibility
        K = motions.T @ (c.w_K[:, None] * motions)
        B = motions.T @ (c.w_B[:, None] * motions)
        if c.drag:
            B += c.drag * (fields.T @ fields)
        return self.network.sum(np.stack((K, B)))

    def _finish(self, motions, rates):
        c, volume = self.compatibility, self.network.area
        still, modes = motions[:, 0], motions[:, 1:]
        field = self.quasistatic
        loads = modes.T @ (c.w_B * still) + c.drag * (self.modes.T @ field)
        loads = self.network.sum(loads)  # h: viscous force of the quasistatic flow on each mode
        fast = still - modes @ loads
        flow = field - self.modes @ loads
        sums = self.network.sum(
            np.array(
                [
                    c.w_K @ still**2,
                    c.w_B @ fast**2 + c.drag * (flow @ flow),
                    np.abs(c.w_K) @ still**2,
                    c.w_B @ still**2 + c.drag * (field @ field),
                    field @ field,
                ]
            )
        )
        norms = self.network.sum(np.einsum("ij,ij->j", self.modes, self.modes))
        weights = rates * loads**2 / volume
        self.loads = loads
        self.spectrum = RelaxationSpectrum(
            float(sums[0] / volume), float((sums[1] + c.drag_gg) / volume), rates, weights
        )
        # A sum Σ w a b is off by ε Σ w |a||b| and by what rounding did to a and b, ε|C||x| each: see `certificate`.
        K_most, B_most = (6.0 * abs(matrix.getDiagonal().max()[1]) for matrix in (c.pencil.K, c.pencil.B))
        viscous = np.sqrt(sums[3])
        self._noise_G0 = 2.0 * EPSILON * float(sums[2] + np.sqrt(sums[2] * K_most * sums[4])) / volume
        self._noise_eta = 2.0 * EPSILON * float(sums[3] + c.drag_gg + viscous * np.sqrt(B_most * sums[4])) / volume
        of_rates = 2.0 * EPSILON * (2.0 + np.sqrt(K_most * norms / rates) + np.sqrt(B_most * norms))
        of_loads = 2.0 * EPSILON * (viscous * (1.0 + np.sqrt(B_most * norms)) + np.sqrt(B_most * sums[4]))
        self._noise_weights = weights * of_rates + rates * np.abs(loads) * of_loads / volume

    def rounding(self, omega):
        """What rounding can have changed in G' and in G'', (M,) each."""
        omega = np.asarray(omega, float)
        x = omega[:, None] / self.spectrum.rates
        storage = self._noise_G0 + np.sum(self._noise_weights * (x * x / (1.0 + x * x)), axis=1)
        # η_∞ is what is left of η₀ when the modes are taken away, so it carries the rounding of η₀, where that matters.
        fast = np.prod(x * x / (1.0 + x * x), axis=1) if len(self.spectrum.rates) else 1.0
        loss = self._noise_eta * omega * fast + np.sum(self._noise_weights * (x / (1.0 + x * x)), axis=1)
        return storage, loss + 4.0 * EPSILON * omega * self.spectrum.eta_inf

    def field(self, omega: float):
        """The non-affine field x(iω), complex (n_local,): x_qs − iω Σ_m h_m φ_m / (λ_m + iω)."""
        spectrum = self.spectrum
        return self.quasistatic - self.modes @ (1j * omega * self.loads / (spectrum.rates + 1j * omega))


def _graded_eigen(K, B):
    """Rates and B-orthonormal vectors of a small pencil whose K is graded and whose B is the identity but for rounding."""
    lower = np.linalg.cholesky(B)
    H = solve_triangular(lower, solve_triangular(lower, K, lower=True).T, lower=True)
    try:
        R = np.linalg.cholesky(0.5 * (H + H.T))
    except np.linalg.LinAlgError:
        raise ConvergenceError("the projected K is not positive definite: the packing is not a minimum") from None
    values, _, vectors, scaling, _, info = lapack.dgejsv(R.T, joba=0, jobu=3, jobv=0)
    if info != 0:
        raise ConvergenceError(f"one-sided Jacobi did not converge (info {info})")
    rates = (values * scaling[1] / scaling[0]) ** 2
    return rates, solve_triangular(lower.T, vectors, lower=False)

"""C*(ω) of several loads by the rational method: the solution of each load in its own space, with factors in common.

Between two loads the stationary value of the bilinear form is off by r_EᵀA⁻¹r_E′ whatever the spaces (`certificate`),
so the bound of each load bounds all pairs: |ΔC_EE′| ≤ √(bound_E bound_E′), and no larger common space is needed.
"""

import itertools

import numpy as np

from jampetsc.analysis.reduced_tensor import ReducedTensor
from jampetsc.response import tall
from jampetsc.response.assembly import ROW
from jampetsc.response.certificate import ROUNDING, Certified
from jampetsc.response.galerkin import Galerkin


class TensorProjection:
    """K and B between the solutions of several loads. Collective.

    galerkins   the `Galerkin` of each load, of pencils that differ in the load alone
    """

    def __init__(self, galerkins: list[Galerkin]):
        c, network = galerkins[0].pencil.compatibility, galerkins[0].network
        sizes = [1 + galerkin.modes.shape[1] for galerkin in galerkins]
        ends = np.cumsum([0, *sizes])
        columns = [slice(*pair) for pair in itertools.pairwise(ends)]
        motions, fields = np.empty((len(c.g), ends[-1])), np.empty((len(galerkins[0].quasistatic), ends[-1]))
        rates, forces = np.full(ends[-1], np.inf), np.zeros(ends[-1])
        for own, galerkin in zip(columns, galerkins, strict=True):
            fields[:, own] = np.column_stack((galerkin.quasistatic, galerkin.modes))
            for number in range(own.start, own.stop):
                motions[:, number] = c.motions(fields[:, number])
            motions[:, own.start] += galerkin.pencil.compatibility.g
            rates[own.start + 1 : own.stop] = galerkin.spectrum.rates
            forces[own.start + 1 : own.stop] = galerkin.loads
        K = network.sum(tall.gram(motions, c.w_K))
        B = network.sum(tall.gram(motions, c.w_B) + tall.gram(fields, c.drag))
        for one, first in zip(columns, galerkins, strict=True):
            for other, second in zip(columns, galerkins, strict=True):
                B[one.start, other.start] += c.fluid_gg(first.pencil.load, second.pencil.load)
        numbers = np.repeat(np.arange(len(sizes)), sizes)
        self.reduced = ReducedTensor(rates, forces, numbers, K / network.area, B / network.area)
        self._noise = self._noise_of(c, network, motions, fields, galerkins, ends[:-1])

    @staticmethod
    def _noise_of(c, network, motions, fields, galerkins, starts):
        """(sizes, reach), each (2, c): roots of Σ w a² in K and in B over V, and of the terms of the motions a."""
        sizes = network.sum(tall.squares(motions, np.array([c.size_K, c.w_B])))
        sizes[1] += network.sum(tall.squares(fields, c.drag[None])[0])
        reach = ROW * network.sum(tall.squares(fields, np.array([c.reach_K, c.reach_B])))
        for start, galerkin in zip(starts, galerkins, strict=True):
            own = galerkin.pencil.compatibility
            sizes[1, start] += own.drag_gg
            reach[:, start] += network.sum(np.array([c.size_K @ own.g**2, c.w_B @ own.g**2]))
        return np.sqrt(sizes / network.area), np.sqrt(reach / network.area)

    def certify(self, certificates: list[Certified]):
        """C (M, L, L), complex, and bounds on |ΔC|, (M, L, L), at the frequencies of the certificates of all loads."""
        omega = certificates[0].omega
        C, weights = self.reduced.modulus(omega), np.abs(self.reduced.weights(omega))
        rounding = np.zeros(C.shape)
        for part, factor in ((0, np.ones(len(omega))), (1, omega)):
            size, reach = (weights @ noise[part] for noise in self._noise)  # (M, L)
            terms = size[:, :, None] * (size + reach)[:, None, :]
            rounding += factor[:, None, None] * (terms + terms.transpose(0, 2, 1))
        errors = np.sqrt([certificate.error for certificate in certificates]).T
        bounds = errors[:, :, None] * errors[:, None, :] + ROUNDING * rounding
        for number, certificate in enumerate(certificates):
            C[:, number, number] = certificate.G
            bounds[:, number, number] = certificate.bounds[:, 0]
        return C, bounds

"""C*(ω) of several loads by the rational method: the solution of each load in its own space, with factors in common.

Between two loads the stationary value of the bilinear form is off by r_EᵀA⁻¹r_E′ whatever the spaces (`certificate`),
so the bound of each load bounds all pairs: |ΔC_EE′| ≤ √(bound_E bound_E′), and no larger common space is needed.
"""

import itertools

import numpy as np

from jampetsc.analysis.elasticity import ReducedTensor
from jampetsc.response import tall
from jampetsc.response.assembly import ROW
from jampetsc.response.certificate import ROUNDING, Certified
from jampetsc.response.galerkin import Galerkin


class TensorProjection:
    """K and B between the solutions of several loads. Collective.

    galerkins   the `Galerkin` of each load, of pencils that differ in the load alone
    """

    def __init__(self, galerkins: list[Galerkin]):
        solutions = [_Columns(galerkin) for galerkin in galerkins]
        network = galerkins[0].network
        local = [_between(*pair) for pair in itertools.combinations(solutions, 2)]
        between = [[network.sum(matrix) for matrix in pair] for pair in local]
        sizes = [len(one.rates) for one in solutions]
        K, B = ([[None] * len(sizes) for _ in sizes] for _ in range(2))
        for number, one in enumerate(solutions):
            K[number][number], B[number][number] = one.own
        numbers = itertools.combinations(range(len(sizes)), 2)
        for (first, second), blocks in zip(numbers, between, strict=True):
            loads = (galerkins[number].pencil.load for number in (first, second))
            blocks[1][0, 0] += galerkins[0].pencil.compatibility.fluid_gg(*loads)
            for matrix, block in zip((K, B), blocks, strict=True):
                matrix[first][second], matrix[second][first] = block, block.T
        self.reduced = ReducedTensor(
            np.concatenate([one.rates for one in solutions]),
            np.concatenate([one.forces for one in solutions]),
            np.repeat(np.arange(len(sizes)), sizes),
            np.block(K) / network.volume,
            np.block(B) / network.volume,
        )
        # (2, c) in K and in B: roots of Σ w a² over V, and of the terms of the motions a
        self._noise = [
            np.concatenate([getattr(one, name) for one in solutions], axis=1) / np.sqrt(network.volume)
            for name in ("sizes", "reach")
        ]

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


class _Columns:
    """The fields of one load, the quasistatic one and its modes, with their motions. Collective."""

    def __init__(self, galerkin: Galerkin):
        c, network, spectrum = galerkin.pencil.compatibility, galerkin.network, galerkin.spectrum
        self.compatibility, h = c, galerkin.loads
        self.fields = np.vstack((galerkin.quasistatic, galerkin.modes.T)).T
        self.motions = np.empty((self.fields.shape[1], len(c.g))).T
        for motion, field in zip(self.motions.T, self.fields.T, strict=True):
            motion[:] = c.motions(field)
        self.motions[:, 0] += c.g
        self.rates, self.forces = np.append(np.inf, spectrum.rates), np.append(0.0, h)
        # Modes are orthonormal in B, their rates are K; the quasistatic field has no force in K on them, h in B.
        volume = network.volume
        K, B = np.diag(np.append(spectrum.G0 * volume, spectrum.rates)), np.eye(len(self.rates))
        B[0, 0] = spectrum.eta_inf * volume + h @ h
        B[0, 1:] = B[1:, 0] = h
        self.own = K, B
        sizes = network.sum(tall.squares(self.motions, np.array([c.size_K, c.w_B])))
        sizes[1] += network.sum(tall.squares(self.fields, c.drag[None])[0])
        sizes[1, 0] += c.drag_gg
        reach = ROW[network.dimension] * network.sum(
            tall.squares(self.fields, np.array([c.reach_K, c.reach_B]))
        )
        reach[:, 0] += network.sum(np.array([c.size_K @ c.g**2, c.w_B @ c.g**2]))
        self.sizes, self.reach = np.sqrt(sizes), np.sqrt(reach)


def _between(first, second):
    """This rank's part of K and of B between the columns of two loads, what the fluid adds left out."""
    c = first.compatibility
    K, B = (tall.gram(first.motions, w, second.motions) for w in (c.w_K, c.w_B))
    return K, B + tall.gram(first.fields, c.drag, second.fields) if c.drag.any() else B

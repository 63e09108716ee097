"""Quasistatic response of a contact network to any affine strain: K factorised once, one solve per strain.

K acts on the displacements alone, without angles or damping; translations are pinned.
"""

import numpy as np

from jampetsc.laws.damping import UNDAMPED
from jampetsc.network.contact_network import Network
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.shifted import ShiftedFactor
from jampetsc.response.assembly import assemble
from jampetsc.response.minimum_check import require_unique_response
from jampetsc.response.refined_solve import Relaxed, relax

SOFT = 1e-11  # zero modes are counted unless the smallest eigenvalue of K scaled to a unit diagonal is above this


class ElasticResponse:
    """K of a network, factorised. Methods are collective; needs the real build of PETSc.

    Raises InputError, with their number, where K has negative modes, or zero modes other than translations.
    """

    def __init__(self, network: Network):
        self.network = network
        self.pencil = assemble(network, UNDAMPED)
        try:
            self.factor = ShiftedFactor(self.pencil.K.copy(), "K")
        except NotPositiveDefinite:
            require_unique_response(network)
            raise
        if not self.factor.prove() or self.factor.least_eigenvalue() < SOFT:
            require_unique_response(network)

    def shear(self) -> Relaxed:
        """Response to a unit simple shear u_x = γ y: motions a∥, a⊥ per contact; value = G₀ V."""
        return self._respond(self.pencil.compatibility.g, "response to shear")

    def compression(self) -> Relaxed:
        """Response to a unit isotropic expansion u = ε r: motions a∥, a⊥ per contact; value = d²U/dε²."""
        c = self.network.contacts
        stretch = c.distance[c.i < c.j]
        return self._respond(
            np.column_stack((stretch, np.zeros_like(stretch))).ravel(), "response to compression"
        )

    def _respond(self, g, what):
        c = self.pencil.compatibility
        return relax(c, c.w_K, self.factor.solve, g, what)

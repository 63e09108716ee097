"""Quasistatic response of a contact network to any affine strain: K factorised once, one solve per strain.

K acts on the displacements alone and has no use for angles or damping; translations are pinned.
"""

import numpy as np

from jampetsc.contacts.laws import UNDAMPED
from jampetsc.errors import InputError
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.mechanics.network import Network
from jampetsc.response.balance import Relaxed, relax
from jampetsc.solvers.cholesky import NotPositiveDefinite
from jampetsc.solvers.inertia import count_eigenvalues
from jampetsc.solvers.shifted import ShiftedFactor

SOFT = 1e-11  # smallest eigenvalue of K scaled to a unit diagonal below which zero modes are counted


class ElasticResponse:
    """K of a network, factorised. Methods are collective; needs the real build of PETSc.

    Raises InputError, with their number, where K has negative modes, or zero modes other than translations.
    """

    def __init__(self, network: Network):
        self.network = network
        self.pencil = assemble(network, UNDAMPED)
        self.compatibility = build_compatibility(self.pencil)
        try:
            self.factor = ShiftedFactor(self.pencil.K.copy(), "K")
        except NotPositiveDefinite:
            self._refuse()
            raise
        if not self.factor.prove() or self._softest() < SOFT:
            self._refuse()

    def _softest(self):
        """Estimate, from above, of the smallest eigenvalue of K scaled to a unit diagonal, by inverse
        iteration.
        """
        diagonal = self.pencil.K.getDiagonal()
        v = diagonal.duplicate()
        v.setArray(np.random.default_rng(self.network.first).standard_normal(v.getLocalSize()))
        growth = 0.0
        for _ in range(3):
            v.scale(1.0 / v.norm())
            v.pointwiseMult(v, diagonal)
            self.factor.solve(v, v)
            growth = v.norm()
        v.destroy()
        diagonal.destroy()
        return 1.0 / growth if np.isfinite(growth) else 0.0

    def _refuse(self):
        """Raise InputError if K, nothing pinned, has negative modes or more zero modes than translations."""
        free = assemble(self.network, UNDAMPED, pinned=False)
        inertia = count_eigenvalues(free.K, "K")
        translations = 2 * len(free.pieces.roots)
        free.destroy()
        if inertia.negative:
            raise InputError(
                f"K has {inertia.negative} negative mode{'s' * (inertia.negative > 1)}: not a minimum of "
                "the energy; quench "
                "it (`jampetsc pack --from`) or use --no-prestress"
            )
        floppy = inertia.zero - translations
        if floppy > 0:
            raise InputError(
                f"K has {floppy} floppy mode{'s' * (floppy > 1)} besides its translations: the response to "
                "strain is not "
                "unique; raise the pressure or finish the quench"
            )

    def shear(self) -> Relaxed:
        """Response to a unit simple shear u_x = γ y: motions a∥, a⊥ per contact; value = G₀ V."""
        return self._respond(self.compatibility.g, "response to shear")

    def compression(self) -> Relaxed:
        """Response to a unit isotropic expansion u = ε r: motions a∥, a⊥ per contact; value = d²U/dε²."""
        c = self.network.contacts
        stretch = c.distance[c.i < c.j]
        return self._respond(
            np.column_stack((stretch, np.zeros_like(stretch))).ravel(), "response to compression"
        )

    def _respond(self, g, what):
        return relax(self.compatibility, self.compatibility.w_K, self.factor.solve, g, what)

    def destroy(self):
        """Free the matrices and the factor."""
        self.factor.destroy()
        self.compatibility.destroy()
        self.pencil.destroy()

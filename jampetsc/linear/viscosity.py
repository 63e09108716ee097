"""The two limits of G''/ω without any frequency: η₀ of the quasistatic flow, η_∞ of the flow of least dissipation.

η₀ V γ² is the dissipation form of B at the quasistatic field, minimised over the angles (torques vanish as ω → 0):

    η₀ = (kτ₁/V) [ Σ a∥² + β min_θ Σ (a⊥ − ρ_i θ_i − ρ_j θ_j)² ]     damping by contacts, split as in BT eq. 22
    η₀ = (kτ₁/V) Σ |ũ_i|² + η_F                                      by the fluid

and the sum of both with their weights where both dissipate.

η_∞ V γ² is the minimum of B over all fields and angles.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.core.laws import Law
from jampetsc.errors import InputError
from jampetsc.linear.refined_solve import relax
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.network import Network
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.matrices import set_diagonal
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor


@dataclass(frozen=True, eq=False)
class Flow:
    """η₀ of one quasistatic field, in its parts, and how the disks turn in it. Viscosities in kτ₁."""

    parts: dict  # "normal" and "transverse" of contacts, "drag" and "fluid": those that the law has
    rotation: np.ndarray | None  # (n_local,) θ per unit strain where disks roll
    sliding: np.ndarray | None  # (contacts_local,) a⊥ᶜ where disks roll

    @property
    def eta0(self) -> float:
        """η₀."""
        return sum(self.parts.values())


class Viscosity:
    """B of one law on one network. Methods are collective; needs the real build of PETSc."""

    def __init__(self, network: Network, law: Law):
        self.network, self.law = network, law
        self.pencil = assemble(network, law)

    def quasistatic(self, displacement) -> Flow:
        """η₀ of the field `displacement` (n_local, 2), non-affine per unit strain.

        With drag, the mean of each piece must be zero; without, the displacements of pinned disks.
        """
        network, law, c = self.network, self.law, self.pencil.compatibility
        start = np.zeros((len(displacement), law.dofs))
        start[:, :2] = displacement
        parts = {}
        if law.drag or law.eta_f:
            drag = network.sum(float(c.drag @ start.ravel() ** 2))
            parts = {"drag": drag / network.area, "fluid": c.drag_gg / network.area}
        if not law.damps_contacts:
            return Flow(parts, None, None)
        if law.couples_rotations:
            flow = relax(c, c.w_B, self._turns(), c.g, "rotations of the quasistatic flow", start.ravel())
            motions, rotation = flow.motions, flow.x.reshape(-1, 3)[:, 2].copy()
        else:
            motions, rotation = (c.motions(start.ravel()) + c.g).reshape(-1, c.forms), None
        costs = network.sum(np.einsum("cf,cf->f", c.w_B.reshape(motions.shape), motions**2)) / network.area
        return Flow(
            {"normal": float(costs[0]), "transverse": float(costs[1:].sum()), **parts},
            rotation,
            None if rotation is None else motions[:, -1].copy(),
        )

    def _turns(self):
        """solve(rhs, out) that solves for the angles only, with B_θθ, one angle pinned in each bipartite piece."""
        PETSc = current().PETSc
        first, last = self.network.first, self.network.last
        rows = PETSc.IS().createStride(last - first, 3 * first + 2, 3, comm=self.network.comm)
        block = self.pencil.B.createSubMatrix(rows, rows)
        held = self.pencil.pins[self.pencil.pins % 3 == 2] // 3
        set_diagonal(block, held, self.law.sliding * self.network.damping(self.law))
        factor = self._factor(block)
        work = block.createVecRight()

        def solve(rhs, out):
            work.setArray(rhs.getArray()[2::3])
            factor.solve(work, work)
            out.zeroEntries()
            out.getArray()[2::3] = work.getArray()

        return solve

    def infinite(self) -> float:
        """η_∞, in kτ₁.

        Raises InputError where B has zero modes besides translations and gears.
        """
        c = self.pencil.compatibility
        if not self.law.damps_contacts:  # disks that follow the affine flow dissipate nothing but η_F
            return c.drag_gg / self.network.area
        block = self.pencil.B.copy()
        set_diagonal(block, self.pencil.pins, self.network.damping(self.law))
        factor = self._factor(block)
        relaxed = relax(c, c.w_B, factor.solve, c.g, "flow of least dissipation", drag=c.drag)
        return (relaxed.value + c.drag_gg) / self.network.area

    def _factor(self, block):
        try:
            return ShiftedFactor(block, f"B of {self.law}")
        except NotPositiveDefinite:
            raise InputError(
                f"B of {self.law} has moves without dissipation besides translations: η is not unique; "
                "raise the pressure or the weights of the law"
            ) from None

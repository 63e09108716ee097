"""The two limits of G''/ω without any frequency: η₀ of the quasistatic flow, η_∞ of the flow of least dissipation.

η₀ V γ² is the dissipation form of B at the quasistatic field, minimised over the angles (torques vanish as ω → 0):

    η₀ = (kτ₁/V) [ Σ a∥² + β min_θ Σ (a⊥ − ρ_i θ_i − ρ_j θ_j)² ]     damping by contacts, split as in BT eq. 22
    η₀ = (kτ₁/V) Σ |ũ_i|² + η_F                                      by the fluid

and the sum of both with their weights where both dissipate.

η_∞ V γ² is the minimum of B over all fields and angles.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor
from jampetsc.petsc.sparse_matrices import set_diagonal
from jampetsc.response.assembly import Pencil
from jampetsc.response.compatibility import along_and_across
from jampetsc.response.elastic import relax


@dataclass(frozen=True, eq=False)
class ViscousResponse:
    """η₀ of one quasistatic field, in its parts, and how the disks turn in it. Viscosities in kτ₁."""

    parts: dict  # "normal" and "transverse" of contacts, "drag" and "fluid": those that the law has
    rotation: np.ndarray | None  # (n_local,), in 3D (n_local, 3), θ per unit strain where disks roll
    sliding: np.ndarray | None  # (contacts_local,) a⊥ᶜ where disks roll, in 3D its length
    motions: np.ndarray  # (rows_local,) of the contacts
    field: np.ndarray  # (unknowns_local,)

    @property
    def eta0(self) -> float:
        """η₀."""
        return sum(self.parts.values())


def quasistatic_flow(pencil: Pencil, displacement) -> ViscousResponse:
    """η₀ of the field `displacement` (n_local, D), non-affine per unit strain, under the law of a pencil. Collective.

    With drag, the mean of each piece must be zero; without, the displacements of pinned disks.
    """
    network, law, c = pencil.network, pencil.law, pencil.compatibility
    dimension = pencil.dimension
    start = np.zeros((len(displacement), pencil.dofs))
    start[:, :dimension] = displacement
    parts = {}
    if law.drag or law.eta_f:
        drag = network.sum(float(c.drag @ start.ravel() ** 2))
        parts = {"drag": drag / network.volume, "fluid": c.drag_gg / network.volume}
    if not law.damps_contacts:
        return ViscousResponse(parts, None, None, c.motions(start.ravel()) + c.g, start.ravel())
    field = start.ravel()
    if law.couples_rotations:
        flow = relax(c, c.w_B, _turns(pencil), c.g, "rotations of the quasistatic flow", start.ravel())
        field, motions = flow.x, flow.motions
        rotation = pencil.split(field)[1]
        sliding = along_and_across(motions[:, [0, *range(dimension, c.forms)]])[1].copy()
    else:
        motions, rotation, sliding = (c.motions(start.ravel()) + c.g).reshape(-1, c.forms), None, None
    costs = network.sum(np.einsum("cf,cf->f", c.w_B.reshape(motions.shape), motions**2)) / network.volume
    return ViscousResponse(
        {"normal": float(costs[0]), "transverse": float(costs[1:].sum()), **parts},
        rotation,
        sliding,
        motions.ravel(),
        field,
    )


def _turns(pencil):
    """solve(rhs, out) that solves for the spins only, with B_θθ, the spins of a disk pinned in each bipartite piece."""
    PETSc, network, law = current().PETSc, pencil.network, pencil.law
    dofs, dimension = pencil.dofs, pencil.dimension
    spins = np.arange(dimension, dofs)
    rows = np.arange(network.first, network.last, dtype=PETSc.IntType)[:, None] * dofs + spins
    rows = PETSc.IS().createGeneral(rows.ravel().astype(PETSc.IntType), comm=network.comm)
    block = pencil.B.createSubMatrix(rows, rows)
    disks, component = np.divmod(pencil.pins, dofs)
    pinned = (disks * len(spins) + component - dimension)[component >= dimension]
    set_diagonal(block, pinned, law.sliding * network.damping(law))
    factor = _factor(block, law)
    work = block.createVecRight()

    def solve(rhs, out):
        work.setArray(rhs.getArray().reshape(-1, dofs)[:, dimension:].ravel())
        factor.solve(work, work)
        out.zeroEntries()
        out.getArray().reshape(-1, dofs)[:, dimension:] = work.getArray().reshape(-1, len(spins))

    return solve


def infinite_viscosity(pencil: Pencil) -> float:
    """η_∞ under law and load of a pencil, in kτ₁, as `infinite_viscosities`. Collective."""
    return float(infinite_viscosities(pencil, [pencil.load])[0, 0])


def infinite_viscosities(pencil: Pencil, loads):
    """η_∞ between loads under the law of a pencil, (L, L) in kτ₁. Collective.

    Raises InputError where B has zero modes besides translations and gears.
    """
    law, c = pencil.law, pencil.compatibility
    if not law.damps_contacts:  # disks that follow the affine flow dissipate nothing but η_F
        zero = np.zeros((len(loads), len(c.g))), np.zeros((len(loads), len(c.drag)))
        return dissipation_between(pencil, loads, *zero)
    block = pencil.B.copy()
    set_diagonal(block, pencil.pins, pencil.network.damping(law))
    factor = _factor(block, law)
    relaxed = [
        relax(c, c.w_B, factor.solve, c.under(load).g, "flow of least dissipation", drag=c.drag)
        for load in loads
    ]
    return dissipation_between(
        pencil, loads, [flow.motions.ravel() for flow in relaxed], [flow.x for flow in relaxed]
    )


def dissipation_between(pencil: Pencil, loads, motions, fields):
    """(aᵀ W_B a′ + xᵀ drag x′ + what the fluid adds)/V of pairs of loads, (L, L). Collective.

    motions, fields   a (rows_local,) and x (unknowns_local,) for each load
    """
    c, motions, fields = pencil.compatibility, np.asarray(motions), np.asarray(fields)
    value = pencil.network.sum((motions * c.w_B) @ motions.T + (fields * c.drag) @ fields.T)
    fluid = [[c.fluid_gg(load, other) for other in loads] for load in loads]
    return (value + fluid) / pencil.network.volume


def _factor(block, law):
    try:
        return ShiftedFactor(block, f"B of {law}")
    except NotPositiveDefinite:
        raise InputError(
            f"B of {law} has moves without dissipation besides translations: η is not unique; "
            "raise the pressure or the weights of the law"
        ) from None

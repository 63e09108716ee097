"""Quasistatic response of a contact network to any load: K factorised once, one solve per load.

K acts on the displacements alone, without angles or damping; translations are pinned. For weights w and an imposed
strain that moves the contacts by g, the field x that minimises

    E(x) = Σ_c w (C x + g)² + Σ drag x²

obeys r = Cᵀ w (C x + g) + drag x = 0. At the minimum E = Σ w g (C x + g) as well (the form of the load column,
k_γγ + k_γᵀx): their difference is xᵀr. `relax` refines such fields by a given factor and estimates their error.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.laws.damping import UNDAMPED
from jampetsc.laws.loads import Load
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.shifted import PREFIX, ShiftedFactor
from jampetsc.response.assembly import assemble
from jampetsc.response.compatibility import Compatibility
from jampetsc.response.contact_network import DistributedNetwork
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.minimum_check import require_unique_response

SOFT = 1e-11  # zero modes are counted unless the smallest eigenvalue of K scaled to a unit diagonal is above this
LARGEST_ERROR = 1e-8  # of a field, relative, in the energy norm: 1e-16 of the energy
LARGEST_DEFECT = 1e-8
FLOOR = 1e-5  # of the affine energy, least reference for a defect, as where nothing resists the strain


@dataclass(frozen=True, eq=False)
class Relaxed:
    """The minimising field. Arrays hold this rank's part."""

    x: np.ndarray  # (unknowns_local,)
    motions: np.ndarray  # (contacts_local, forms): C x + g
    value: float  # E on all ranks
    error: (
        float  # energy norm of ‖x − exact‖ over that of the motion at the start, estimated with the residual
    )
    defect: float  # |E − Σ w g a| / Σ |w| a², zero but for rounding


def relax(compatibility: Compatibility, weights, solve, g, what: str, start=None, drag=0.0) -> Relaxed:
    """Minimise from `start` (zero if None), with one step of refinement. Collective.

    weights, g   (rows_local,) per row of C
    solve        solve(rhs, out) with PETSc vectors: out ← A⁻¹ rhs, for the unknowns that may move
    what         names the field, for messages
    drag         (n_local,) per unknown, or a number

    Raises ConvergenceError where the field is not certain to 1e-8 in the energy norm, or where E in its two
    forms differs by more than 1e-8.
    """
    C, network = compatibility.C, compatibility.network
    x, a = C.createVecs()
    r, z = x.duplicate(), x.duplicate()
    if start is None:
        x.zeroEntries()
    else:
        x.setArray(start)
    energies, imposed = [], None
    for step in range(3):  # solve, refine, and estimate the error by a third step
        C.mult(x, a)
        a.getArray()[:] += g
        motions = a.getArray().copy()
        imposed = motions if imposed is None else imposed
        a.setArray(weights * motions)
        C.multTranspose(a, r)
        r.getArray()[:] += drag * x.getArray()
        solve(r, z)
        energies.append(abs(z.dot(r)))
        if step < 2:
            x.axpy(-1.0, z)
    size = np.abs(weights)
    field = x.getArray().copy()
    of_drag = np.sum(drag * field**2)
    value, final, initial = network.sum(
        np.array([weights @ motions**2 + of_drag, size @ motions**2 + of_drag, size @ imposed**2])
    )
    defect = abs(x.dot(r)) / (final + FLOOR * initial) if start is None else 0.0
    error = float(np.sqrt(energies[2] / initial))
    if not (error <= LARGEST_ERROR and defect <= LARGEST_DEFECT):
        raise ConvergenceError(
            f"{what}: only certain to {error:.1e}, its energy to {defect:.1e}: the matrix is too "
            "ill-conditioned; try another "
            "factorisation, such as -shift_pc_factor_mat_solver_type mumps"
        )
    return Relaxed(field, motions.reshape(-1, compatibility.forms), float(value), error, float(defect))


class ElasticResponse:
    """K of a network, factorised. Methods are collective; needs the real build of PETSc.

    Raises InputError, with their number, where K has negative modes, or zero modes other than translations.
    """

    def __init__(self, network: DistributedNetwork):
        self.network = network
        self.pencil = assemble(network, UNDAMPED)
        require_memory(network, self.pencil.unknowns, PREFIX)
        try:
            self.factor = ShiftedFactor(self.pencil.K.copy(), "K")
        except NotPositiveDefinite:
            require_unique_response(network)
            raise
        if not self.factor.prove() or self.factor.least_eigenvalue() < SOFT:
            require_unique_response(network)

    def respond(self, load: Load) -> Relaxed:
        """Response to a unit amplitude of a load: motions a∥, a⊥ per contact; value = M_E(0) V."""
        c = self.pencil.compatibility
        return relax(c, c.w_K, self.factor.solve, c.under(load).g, f"response to {load.name}")

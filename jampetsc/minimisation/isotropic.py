"""A cell whose sides relax too: the normal stresses are equal, and the packing is stable to every strain of its cell.

Along F = diag(e^x₁, …, e^−Σx) with D − 1 stretches x, the enthalpy of packings that are minimised at each x, with
volume and tilts of the cell free, has the slopes

    ∂H/∂x_a = V (σ_aa − σ_bb) ,     b the last axis,

which vanish at its minimum. With the Schur complement of the other strains, which `minimise` proves positive, positive
second derivatives there make the packing stable to all strains of its cell. Along a direction steps are secant
steps; with two stretches, directions are Newton's, with Powell's symmetric update of the second derivatives (Nonlinear
Programming, Academic Press 1970, p. 31).
"""

import math

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation.descent import Goal, stress_unit
from jampetsc.minimisation.minimise import Minimum, minimise
from jampetsc.minimisation.newton import is_definite, stress_floor
from jampetsc.packing.contacts import measure
from jampetsc.packing.elementary import expm1
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.strain import Strain

MAX_CHANGES = 60  # of the sides, for each stretch
MAX_STRETCH = 0.01  # in one of them
SLOPE_RATIO = 0.3  # of the slope along a direction to all slopes, below which another direction is taken
PROBE_RATIO = 1e-2  # stretch of the last differences, over p in units of k: contacts stay as they are


def stretched(disks: Packing, stretch) -> Packing:
    """The disks under F = diag(e^x₁, …, e^−Σx), x = `stretch` (D − 1,)."""
    xx, yy, zz = (expm1(x) for x in (*stretch, -math.fsum(stretch), 0.0)[:3])
    return deformed(disks, np.zeros(disks.base.shape), Strain(xx, 0.0, 0.0, 0.0, yy, 0.0, 0.0, 0.0, zz))


def stress_differences(disks: Packing):
    """(σ_aa − σ_bb of all axes a but the last, b, (D − 1,), what rounding may leave of them)."""
    state = measure(disks)
    stress = np.diag(state.stress)
    floor = 4.0 * stress_floor(stress_unit(disks), disks, state.contacts)
    return stress[:-1] - stress[-1], floor


def relax_sides(minimum: Minimum, goal: Goal, solver, *, tolerance: float, **settings) -> Minimum:
    """The minimum over the sides of the cell as well, downhill from `minimum`.

    goal, solver, tolerance, settings   as `minimise` has them; |σ_aa − σ_bb| ≤ 2 tolerance p, or limited by rounding

    Raises ConvergenceError where that is not reached.
    """

    def after(stretch):
        result = minimise(stretched(minimum.disks, stretch), goal, solver, tolerance=tolerance, **settings)
        return result, *stress_differences(result.disks)

    (differences, floor), unit = stress_differences(minimum.disks), stress_unit(minimum.disks)
    axes = np.eye(len(differences))
    slopes = 2.0 * max(minimum.modulus, minimum.pressure) * (axes + 1.0)  # of an isotropic solid
    way, stretch, changes = None, 0.0, MAX_CHANGES * len(axes)
    for _ in range(changes):
        probe = PROBE_RATIO * minimum.pressure / unit
        if np.abs(differences).max() <= max(2.0 * tolerance * minimum.pressure, floor):
            slopes = np.stack([(after(probe * axis)[1] - differences) / probe for axis in axes])
            slopes, way = 0.5 * (slopes + slopes.T), None
            if is_definite(slopes):
                return minimum
        if way is None or abs(np.sum(way * differences)) <= SLOPE_RATIO * math.hypot(*differences):
            way = _downhill(slopes, differences)
            slope = np.einsum("a,ab,b", way, slopes, way)
        difference = float(np.sum(way * differences))
        if slope > 0.0:
            stretch = -difference / slope
        else:  # downhill, farther than before
            stretch = -math.copysign(max(2.0 * abs(stretch), probe), difference)
        stretch = math.copysign(min(abs(stretch), MAX_STRETCH), stretch)
        previous = differences
        minimum, differences, floor = after(stretch * way)
        change = (differences - previous) / stretch
        slope, slopes = float(np.sum(way * change)), _updated(slopes, way, change)
    raise ConvergenceError(
        f"sides of the cell: normal stresses still differ by {np.abs(differences).max():.1e} after {changes} changes "
        f"(p = {minimum.pressure:.1e}). Choose another seed, or a larger tolerance."
    )


def _downhill(slopes, differences):
    """The direction of Newton's step, a unit vector (D − 1,), or the opposite one along axes whose slope falls."""
    stretch = np.zeros(len(differences))
    for slope, axis in zip(*_principal(slopes), strict=True):
        stretch -= axis * np.sum(axis * differences) / abs(slope)
    return stretch / math.hypot(*stretch)


def _updated(slopes, direction, change):
    """Symmetric second derivatives that are `change` along the unit vector `direction`, and else as before."""
    along = np.outer(direction, direction)
    across = np.eye(len(direction)) - along
    turned = np.outer(change, direction)
    kept = np.einsum("ab,bc,cd->ad", across, slopes, across)
    return kept + turned + turned.T - np.sum(direction * change) * along


def _principal(matrix):
    """(values, unit vectors) of a symmetric matrix of order one or two, (C,) and (C, C); without LAPACK's digits."""
    axes = np.eye(len(matrix))
    if len(matrix) == 2:
        difference, coupling = matrix[0, 0] - matrix[1, 1], 2.0 * matrix[0, 1]
        if length := math.sqrt(
            difference * difference + coupling * coupling
        ):  # half of the angle, from its cosine
            larger = math.sqrt(0.5 + 0.5 * abs(difference) / length)
            smaller = 0.5 * coupling / (length * larger)
            x, y = (larger, smaller) if difference >= 0.0 else (abs(smaller), math.copysign(larger, coupling))
            axes = np.array([[x, y], [-y, x]])
    return np.einsum("ia,ab,ib->i", axes, matrix, axes), axes

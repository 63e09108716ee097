"""A cell whose sides relax too: no stress difference σ_xx − σ_yy, and stable to every strain. In the plane.

Along F = diag(e^x, e^−x) the enthalpy of packings that are minimised at each x, with volume and shear of the cell free,
has the slope

    dH/dx = V (σ_xx − σ_yy) ,

so that its minimum is a zero that this difference crosses upwards. With the Schur complement of the other strains,
which `minimise` proves positive, a positive slope there makes the packing stable to all strains of its cell.
"""

import math

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimise.descent import Goal, stress_unit
from jampetsc.minimise.minimise import Minimum, minimise
from jampetsc.minimise.newton import STRESS_FLOOR
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.strain import Strain

MAX_CHANGES = 60  # changes of the sides
MAX_STRETCH = 0.01  # of one of them
PROBE_RATIO = 1e-2  # stretch of the last difference, over p in units of k: contacts stay as they are


def stretched(disks: Packing, stretch: float) -> Packing:
    """The disks under F = diag(e^x, e^−x), x = `stretch`."""
    grown = Strain(math.expm1(stretch), 0.0, 0.0, 0.0, math.expm1(-stretch), 0.0, 0.0, 0.0, 0.0)
    return deformed(disks, np.zeros(disks.base.shape), grown)


def stress_difference(disks: Packing) -> float:
    """σ_xx − σ_yy."""
    stress = measure(disks).stress
    return float(stress[0, 0] - stress[1, 1])


def relax_sides(minimum: Minimum, goal: Goal, solver, *, tolerance: float, **settings) -> Minimum:
    """The minimum over the sides of the cell as well, downhill from `minimum`.

    goal, solver, tolerance, settings   as `minimise` has them; |σ_xx − σ_yy| ≤ 2 tolerance p, or limited by rounding

    Raises ConvergenceError where that is not reached.
    """
    difference, stretch, unit = stress_difference(minimum.disks), 0.0, stress_unit(minimum.disks)
    slope = 4.0 * max(minimum.modulus, minimum.pressure)  # of an isotropic solid: 4 G
    for _ in range(MAX_CHANGES):
        probe, floor = (
            PROBE_RATIO * minimum.pressure / unit,
            4.0 * STRESS_FLOOR * unit / math.sqrt(minimum.disks.n),
        )
        if abs(difference) <= max(2.0 * tolerance * minimum.pressure, floor):
            if _difference_after(minimum, probe, goal, solver, tolerance, settings)[1] > difference:
                return minimum
            slope = -1.0  # a maximum of the enthalpy
        if slope > 0.0:
            stretch = -difference / slope
        else:  # downhill, farther than before
            stretch = -math.copysign(max(2.0 * abs(stretch), probe), difference)
        stretch = math.copysign(min(abs(stretch), MAX_STRETCH), stretch)
        previous = difference
        minimum, difference = _difference_after(minimum, stretch, goal, solver, tolerance, settings)
        slope = (difference - previous) / stretch
    raise ConvergenceError(
        f"sides of the cell: σ_xx − σ_yy = {difference:.1e} is left after {MAX_CHANGES} changes (p = "
        f"{minimum.pressure:.1e}). Choose another seed, or a larger tolerance."
    )


def _difference_after(minimum, stretch, goal, solver, tolerance, settings):
    """(Minimum, σ_xx − σ_yy) after a stretch of the sides."""
    minimum = minimise(stretched(minimum.disks, stretch), goal, solver, tolerance=tolerance, **settings)
    return minimum, stress_difference(minimum.disks)

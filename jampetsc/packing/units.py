"""Units of numbers: numbers are absolute, in the unit of length of the packing, the unit of k and that of τ₁."""

import numpy as np

from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

UNIT_ROUNDING = 1e-12  # largest relative difference that a change of units makes
POWERS = {0.5: "^½", 1.0: "", 1.5: "^(3/2)", 2.0: "²", 2.5: "^(5/2)", 3.0: "³"}  # of a length, in words


def stress_unit_of(radii, potential: Potential, dimension: int) -> float:
    """Stress of order one for radii (N,) of mean diameter d: k d^(α−D), with stiffnesses k/σ² k/d^D."""
    d = 2.0 * float(np.mean(radii))
    stiffness = float(potential.k) / float(potential.scale(np.array(d))) ** 2 * potential.reach(d)
    return stiffness / d ** (dimension - 2)


def name_stress_unit(potential: Potential | None, dimension: int) -> str:
    """The unit of stress, pressure and moduli by that of k, such as k, k/length or k/length²; None: of linear springs.

    An energy (k/α) δ^α over a volume is k times a length to the power α − D, (k/α) (δ/σ)^α over it to the power −D.
    """
    potential = potential or Potential()
    power = (potential.exponent if potential.stiffness == "constant" else 0.0) - dimension
    if not power:
        return "k"
    return f"k{'/' if power < 0 else ' '}length{POWERS.get(abs(power), f'^{abs(power):g}')}"


def is_within(value: float, low: float, high: float) -> bool:
    """Whether low ≤ value ≤ high, to rounding of a change of units."""
    return low * (1.0 - UNIT_ROUNDING) <= value <= high * (1.0 + UNIT_ROUNDING)


def units_text(stress_unit: str, k: float, tau1: float | None = None, diameter: float | None = None) -> str:
    """In which units the numbers of a result are.

    stress_unit   as `name_stress_unit` gives it
    tau1          unit of time; None: there are no times
    diameter      mean diameter, which tells the unit of length; None: not known
    """
    parts = [f"stress as {stress_unit} (k = {k:g})"]
    parts += [] if tau1 is None else [f"time as tau1 (tau1 = {tau1:g})"]
    parts += [] if diameter is None else [f"mean diameter {diameter:.6g}"]
    return ", ".join(parts)


def units_line(*units, **more) -> str:
    """The line of a summary that says in which units its numbers are; parameters as of `units_text`."""
    return f"  units: {units_text(*units, **more)}"


def mean_diameter(disks: Packing) -> float:
    """Mean diameter of the disks."""
    return 2.0 * float(np.mean(disks.radii))

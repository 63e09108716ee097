"""Uniform strain of a cell and its bonds: x → F x with F = 1 + E, E the displacement gradient.

E is kept, not F: what is rounded is then the change alone. An error of F, the same in every bond, would show in the
pressure. Functions take numbers or arrays; numba compiles the same ones for loops over pairs (see `bond`).
"""

import math
from typing import NamedTuple


class Strain(NamedTuple):
    """E = F − 1, rows x and y."""

    xx: float
    xy: float
    yx: float
    yy: float


UNSTRAINED = Strain(0.0, 0.0, 0.0, 0.0)


def simple_shear(shear):
    """E of F = [[1, g], [0, 1]], g = `shear`."""
    return Strain(0.0, shear, 0.0, 0.0)


def growth_and_shear(growth, shear):
    """E of F = e^ε [[1, g], [0, 1]], (ε, g) = (growth, shear): the two ways in which the cell of a quench moves."""
    change = math.expm1(growth)
    return Strain(change, math.exp(growth) * shear, 0.0, change)


def displace(strain, x, y):
    """E applied to a vector: (E_xx x + E_xy y, E_yx x + E_yy y)."""
    return strain.xx * x + strain.xy * y, strain.yx * x + strain.yy * y


def bond_vector(strain, r0x, r0y, dx, dy):
    """r = F (r0 + o_j − o_i), as (r_x, r_y), of a bond r0 of a neighbour list, with (dx, dy) = o_j − o_i.

    The one place of this formula. Another load is another E, a third axis one more component.
    """
    x, y = r0x + dx, r0y + dy
    return x + (strain.xx * x + strain.xy * y), y + (strain.yx * x + strain.yy * y)


def stretch(strain):
    """‖F‖, the larger singular value: ½ (√((F_xx + F_yy)² + (F_xy − F_yx)²) + √((F_xx − F_yy)² + (F_xy + F_yx)²))."""
    trace, turn = 2.0 + strain.xx + strain.yy, strain.xy - strain.yx
    uneven, skew = strain.xx - strain.yy, strain.xy + strain.yx
    return 0.5 * (math.sqrt(trace * trace + turn * turn) + math.sqrt(uneven * uneven + skew * skew))


def determinant(strain):
    """det F, the area of the cell in units of the one before."""
    return (1.0 + strain.xx) * (1.0 + strain.yy) - strain.xy * strain.yx


def strain_between(strain, earlier):
    """E of F F₀⁻¹: from an earlier strain, of F₀, to another."""
    area = (1.0 + earlier.xx) * (1.0 + earlier.yy) - earlier.xy * earlier.yx
    xx, xy, yx, yy = 1.0 + earlier.yy, -earlier.xy, -earlier.yx, 1.0 + earlier.xx  # F₀⁻¹ times det F₀
    dxx, dxy, dyx, dyy = (
        strain.xx - earlier.xx,
        strain.xy - earlier.xy,
        strain.yx - earlier.yx,
        strain.yy - earlier.yy,
    )
    return Strain(
        (dxx * xx + dxy * yx) / area,
        (dxx * xy + dxy * yy) / area,
        (dyx * xx + dyy * yx) / area,
        (dyx * xy + dyy * yy) / area,
    )

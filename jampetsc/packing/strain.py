"""Uniform strain of a cell and its bonds: x → F x with F = 1 + E, E the displacement gradient.

E is kept, not F: what is rounded is then the change alone. An error of F, the same in every bond, would show in the
pressure. A vector is a tuple of its D = 2 or 3 components, numbers or arrays; in a plane the third axis of E is unused.
numba compiles the same functions for loops over pairs (see `bond`), and knows the length of a tuple.
"""

import math
from typing import NamedTuple

import numpy as np

from jampetsc.packing.elementary import cosine_of_third, expm1


class Strain(NamedTuple):
    """E = F − 1, rows x, y and z."""

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float


UNSTRAINED = Strain(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def strain_of(gradient):
    """E of the rows (D, D) of a displacement gradient."""
    rows = np.zeros((3, 3))
    rows[: len(gradient), : len(gradient)] = gradient
    return Strain(*rows.ravel().tolist())


def strained(gradient, amplitude):
    """E of F = 1 + γ G, of a gradient G and its amplitude γ."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = gradient
    return Strain(
        amplitude * xx, amplitude * xy, amplitude * xz, amplitude * yx, amplitude * yy, amplitude * yz,
        amplitude * zx, amplitude * zy, amplitude * zz,
    )  # fmt: skip


def simple_shear(shear):
    """E of the flow along x with its gradient along y: F_xy = `shear`."""
    return Strain(0.0, shear, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def growth_and_shear(growth, shear):
    """E of F = e^ε [[1, g], [0, 1]] in the plane, (ε, g) = (growth, shear)."""
    change = expm1(growth)
    return Strain(change, (1.0 + change) * shear, 0.0, 0.0, change, 0.0, 0.0, 0.0, 0.0)


def growth_and_tilts(growth, xy, xz, yz):
    """E of F = e^ε [[1, g_xy, g_xz], [0, 1, g_yz], [0, 0, 1]]."""
    change = expm1(growth)
    stretch = 1.0 + change
    return Strain(change, stretch * xy, stretch * xz, 0.0, change, stretch * yz, 0.0, 0.0, change)


def cell_strain(box):
    """E of a cell that grows and shears: box = (ε, g) in the plane, in space (ε, g_xy, g_xz, g_yz)."""
    return growth_and_shear(*box) if len(box) == 2 else growth_and_tilts(*box)


def growth_of(growth, dimension):
    """E of F = e^ε in D dimensions."""
    return cell_strain((growth, 0.0) if dimension == 2 else (growth, 0.0, 0.0, 0.0))


def displace(strain, vector):
    """E applied to a vector."""
    if len(vector) == 3:
        x, y, z = vector
        return (
            strain.xx * x + strain.xy * y + strain.xz * z,
            strain.yx * x + strain.yy * y + strain.yz * z,
            strain.zx * x + strain.zy * y + strain.zz * z,
        )
    x, y = vector
    return strain.xx * x + strain.xy * y, strain.yx * x + strain.yy * y


def bond_vector(strain, r0, moved):
    """r = F (r0 + o_j − o_i) of a bond r0 of a neighbour list, with moved = o_j − o_i.

    The one place of this formula. Another load is another E.
    """
    if len(r0) == 3:
        x, y, z = r0[0] + moved[0], r0[1] + moved[1], r0[2] + moved[2]
        return (
            x + (strain.xx * x + strain.xy * y + strain.xz * z),
            y + (strain.yx * x + strain.yy * y + strain.yz * z),
            z + (strain.zx * x + strain.zy * y + strain.zz * z),
        )
    x, y = r0[0] + moved[0], r0[1] + moved[1]
    return x + (strain.xx * x + strain.xy * y), y + (strain.yx * x + strain.yy * y)


def volume_ratio(strain):
    """det F."""
    xx, yy, zz = 1.0 + strain.xx, 1.0 + strain.yy, 1.0 + strain.zz
    return (
        (xx * yy - strain.xy * strain.yx) * zz
        + strain.xz * (strain.yx * strain.zy - yy * strain.zx)
        + strain.yz * (strain.xy * strain.zx - xx * strain.zy)
    )


def norms(strain):
    """(‖F⁻¹‖, ‖F‖), by how much vectors may grow: 1 over the least, and the largest, of the singular values of F.

    Where z is apart, the singular values of the plane are ½ √((F_xx + F_yy)² + (F_xy − F_yx)²) ± ½ √((F_xx − F_yy)² +
    (F_xy + F_yx)²), the smaller one as det F over the larger. Else they are √(1 + λ), λ of the symmetric FᵀF − 1 by the
    cosines of O. K. Smith, Commun. ACM 4, 168 (1961).
    """
    xx, xy, xz, yx, yy, yz, zx, zy, zz = strain
    if xz == 0.0 and yz == 0.0 and zx == 0.0 and zy == 0.0:
        trace, turn = 2.0 + xx + yy, xy - yx
        uneven, skew = xx - yy, xy + yx
        largest = 0.5 * (math.sqrt(trace * trace + turn * turn) + math.sqrt(uneven * uneven + skew * skew))
        area = (1.0 + xx) * (1.0 + yy) - xy * yx
        return max(largest / area, 1.0 / (1.0 + zz)), max(largest, 1.0 + zz)
    a = 2.0 * xx + xx * xx + yx * yx + zx * zx
    b = 2.0 * yy + xy * xy + yy * yy + zy * zy
    c = 2.0 * zz + xz * xz + yz * yz + zz * zz
    ab = xy + yx + xx * xy + yx * yy + zx * zy
    ac = xz + zx + xx * xz + yx * yz + zx * zz
    bc = yz + zy + xy * xz + yy * yz + zy * zz
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    size = math.sqrt((a * a + b * b + c * c + 2.0 * (ab * ab + ac * ac + bc * bc)) / 6.0)
    cubic = a * (b * c - bc * bc) - ab * (ab * c - bc * ac) + ac * (ab * bc - b * ac)
    cosine = 0.5 * cubic / max(size * size * size, 1e-300)
    most = cosine_of_third(min(max(cosine, -1.0), 1.0))
    least = -0.5 * (most + math.sqrt(3.0 * (1.0 - most * most)))
    return 1.0 / math.sqrt(1.0 + mean + 2.0 * size * least), math.sqrt(1.0 + mean + 2.0 * size * most)


def gradient_over(gradient, strain):
    """The displacement gradient G F⁻¹ by distances of now of a gradient G by those before a strain, of F."""
    _, xy, xz, yx, _, yz, zx, zy, _ = strain
    xx, yy, zz = 1.0 + strain.xx, 1.0 + strain.yy, 1.0 + strain.zz
    volume = (xx * yy - xy * yx) * zz + xz * (yx * zy - yy * zx) + yz * (xy * zx - xx * zy)
    # columns of F⁻¹ times det F
    x = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    y = xz * zy - xy * zz, xx * zz - xz * zx, xy * zx - xx * zy
    z = xy * yz - xz * yy, xz * yx - xx * yz, xx * yy - xy * yx
    dxx, dxy, dxz, dyx, dyy, dyz, dzx, dzy, dzz = gradient
    return Strain(
        (dxx * x[0] + dxy * x[1] + dxz * x[2]) / volume,
        (dxx * y[0] + dxy * y[1] + dxz * y[2]) / volume,
        (dxx * z[0] + dxy * z[1] + dxz * z[2]) / volume,
        (dyx * x[0] + dyy * x[1] + dyz * x[2]) / volume,
        (dyx * y[0] + dyy * y[1] + dyz * y[2]) / volume,
        (dyx * z[0] + dyy * z[1] + dyz * z[2]) / volume,
        (dzx * x[0] + dzy * x[1] + dzz * x[2]) / volume,
        (dzx * y[0] + dzy * y[1] + dzz * y[2]) / volume,
        (dzx * z[0] + dzy * z[1] + dzz * z[2]) / volume,
    )


def strain_between(strain, earlier):
    """E of F F₀⁻¹: from an earlier strain, of F₀, to another."""
    change = Strain(
        strain.xx - earlier.xx, strain.xy - earlier.xy, strain.xz - earlier.xz,
        strain.yx - earlier.yx, strain.yy - earlier.yy, strain.yz - earlier.yz,
        strain.zx - earlier.zx, strain.zy - earlier.zy, strain.zz - earlier.zz,
    )  # fmt: skip
    return gradient_over(change, earlier)

"""Whether particles are disks in a plane or spheres: the one rule for arrays and for files of every program.

Particles with three coordinates are disks where z is the same for all, unless the user says otherwise. The tolerance
lets pass what single precision leaves of equal coordinates, and is far below any difference of spheres.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.cell import axes_of_cell, cell_of, check_periodic, read_numbers, rows_of_box

FLAT_TOLERANCE = 1e-6  # largest side of the cell: spread of z within which centres lie in one plane
DIMENSIONS = (2, 3)


@dataclass(frozen=True, eq=False)
class Geometry:
    """Positions and cell in D dimensions."""

    positions: np.ndarray  # (N, D)
    cell: np.ndarray  # (D, D) rows
    decision: str  # what was left out or turned, in words; empty where nothing was


def geometry_of(positions, cell, dimension=None, *, is_deep=True, may_turn=False) -> Geometry:
    """The geometry of positions (N, 2) or (N, 3) in a cell of any form of `Packing`.

    dimension   2 leaves z out whatever it is, 3 keeps it; None: 2 where z is the same for all, but for FLAT_TOLERANCE
    is_deep     whether a cell of three axes is periodic along the third one
    may_turn    whether rows in any orientation are allowed: they and the positions are turned, a₁ along x

    Positions of other shapes are returned as they are. Raises InputError for a cell that does not fit, and for centres
    at different z where the cell has two axes or is not periodic along z.
    """
    positions = read_numbers("positions", positions)
    if dimension not in (None, *DIMENSIONS):
        raise InputError(f"{named('dimension')} {dimension}: must be 2 or 3")
    if positions.ndim != 2 or positions.shape[1] != 3:
        if dimension == 3:
            raise InputError(f"{named('dimension')} 3: positions of shape {positions.shape}, must be (N, 3)")
        return _turned(positions, _plane_cell(cell, dimension), may_turn, "")
    axes, is_box = axes_of_cell(cell), hasattr(cell, "Lx")
    rows = rows_of_box(cell, axes) if is_box else cell_of(cell, axes or 3)
    if is_box and dimension is None and axes == 2:
        dimension = 2
    spread = _spread(positions[:, 2], rows)
    is_flat = spread <= FLAT_TOLERANCE * np.abs(rows).max()
    if (dimension or (2 if is_flat else 3)) == 2:
        _check_plane(rows, dimension)
        if is_box:
            check_periodic(cell, 2)
        why = "" if is_flat else f" though it spreads by {spread:.2g}"
        return _turned(positions[:, :2], rows[:2, :2], may_turn, f"in a plane: z is left out{why}")
    if is_box:
        check_periodic(cell, 3)
    if axes == 2 or not is_deep:
        lacks = "the cell has two axes" if axes == 2 else "the box is not periodic along z"
        raise InputError(
            f"centres spread by {spread:.6g} in z, but {lacks}. Give a cell that is periodic along z for spheres, "
            f"or leave z out by {named('dimension')} 2."
        )
    return _turned(positions, rows, may_turn, "in space, though z is the same for all" if is_flat else "")


def _spread(z, rows) -> float:
    """Largest difference of heights; in a cell with a straight third axis of nearest images."""
    if not len(z):
        return 0.0
    height = z - z[0]
    if len(rows) == 3 and rows[2, 2] > 0.0 and not rows[2, :2].any():
        height -= rows[2, 2] * np.rint(height / rows[2, 2])
    return float(np.ptp(height))


def _plane_cell(cell, dimension):
    """Rows (2, 2) beside positions with two coordinates, of a cell of two axes or of three."""
    shape = () if hasattr(cell, "Lx") else np.shape(read_numbers("cell", cell))
    if shape not in ((6,), (3, 3)):
        return cell_of(cell)
    rows = cell_of(cell, 3)
    _check_plane(rows, dimension)
    return rows[:2, :2]


def _check_plane(rows, dimension) -> None:
    """Raise InputError where rows (3, 3) of a cell lean out of the plane z = const, or its third one is not upright."""
    if len(rows) == 2:
        return
    leaning = np.abs(rows[:2, 2]).max()
    if dimension is None:  # a user who asks for a plane leaves the third axis out
        leaning = max(leaning, np.abs(rows[2, :2]).max())
    if leaning > FLAT_TOLERANCE * np.abs(rows).max():
        raise InputError(
            "the box is tilted out of the plane in which all centres lie. Give a box with a₁ and a₂ in that plane; "
            f"{named('dimension')} 3 says that they are spheres."
        )


def _turned(positions, rows, may_turn, decision) -> Geometry:
    """The geometry with rows (D, D) lower triangular, turned where that is allowed and needed."""
    is_upright = not np.triu(rows, 1).any() and (np.diag(rows) > 0.0).all()
    if not may_turn or is_upright or not np.isfinite(rows).all():
        return Geometry(positions, rows, decision)
    rotation, triangle = np.linalg.qr(rows.T)  # rows = triangleᵀ rotationᵀ
    signs = np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    signs[-1] = np.prod(signs[:-1]) * np.sign(np.linalg.det(rotation))  # a rotation, no mirror image
    cell = np.tril(triangle.T * signs)
    cell[-1] *= np.sign(cell[-1, -1]) or 1.0  # −a₃ spans the same lattice
    words = "the cell is turned, a₁ along x"
    return Geometry(positions @ (rotation * signs), cell, "; ".join(filter(None, (decision, words))))

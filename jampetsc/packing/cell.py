"""A periodic cell in the forms in which simulations and other programs have it."""

import numpy as np

from jampetsc.errors import InputError


def cell_of(cell):
    """Rows a₁, a₂ of a periodic cell, (2, 2), in one of the forms that `Packing` takes. Raises InputError."""
    if hasattr(cell, "Lx"):
        if getattr(cell, "dimensions", 2) != 2:
            raise InputError(f"cell {cell}: is three-dimensional: packings are two-dimensional here")
        if not all(np.atleast_1d(getattr(cell, "periodic", True))[:2]):
            raise InputError(f"cell {cell}: must be periodic in x and y")
        cell = (cell.Lx, cell.Ly, cell.xy)
    cell = read_numbers("cell", cell)
    if cell.shape == (2, 2):
        return cell
    if cell.ndim > 1 or not 1 <= cell.size <= 3:
        raise InputError(f"cell of shape {cell.shape}: need L, (Lx, Ly), (Lx, Ly, xy) or rows a₁, a₂ (2, 2)")
    if not np.isfinite(cell).all():
        raise InputError(f"cell {cell.tolist()}: must be finite")
    Lx, Ly, xy = np.append(cell, (cell.flat[0], 0.0) if cell.size == 1 else (0.0,))[:3]
    return np.array([[Lx, 0.0], [xy * Ly, Ly]])


def read_numbers(name, values):
    """A copy of `values` as an array of floats. Raises InputError, which names them `name`."""
    try:
        if np.iscomplexobj(values) or np.ma.is_masked(values):
            raise TypeError
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: must be an array of real numbers, none of them masked") from None

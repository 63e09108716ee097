"""A periodic cell in two or three dimensions, in the forms in which simulations and other programs have it."""

import itertools
import math

import numpy as np

from jampetsc.errors import InputError

ROWS = {
    2: "(Lx, 0) and (γ Ly, Ly) with Lx, Ly > 0",
    3: "(Lx, 0, 0), (xy, Ly, 0) and (xz, yz, Lz) with Lx, Ly, Lz > 0",
}
FORMS = {
    2: "L, (Lx, Ly), (Lx, Ly, xy) or rows a₁, a₂ (2, 2)",
    3: "L, (Lx, Ly, Lz), (Lx, Ly, Lz, xy, xz, yz) or rows a₁, a₂, a₃ (3, 3)",
}
MAX_COORDINATE = 2.0**28  # units of length, of cells and positions
SIDES = (-1, 0, 1)


def cell_of(cell, dimension: int = 2):
    """Rows of a periodic cell, (D, D), in one of the forms that `Packing` takes. Raises InputError.

    Tilts xy, xz, yz among numbers are lengths, a₂ = (xy, Ly). An object with Lx, Ly, … has ratios, as freud and
    HOOMD-blue define them: a₂ = (xy Ly, Ly).
    """
    if hasattr(cell, "Lx"):
        check_periodic(cell, dimension)
        return rows_of_box(cell, dimension)
    cell = read_numbers("cell", cell)
    if cell.shape == (dimension, dimension):
        return cell
    sizes = (1, 2, 3) if dimension == 2 else (1, 3, 6)
    if cell.ndim > 1 or cell.size not in sizes:
        raise InputError(f"cell of shape {cell.shape}: must be {FORMS[dimension]}")
    if not np.isfinite(cell).all():
        raise InputError(f"cell {cell.tolist()}: must be finite")
    sides = cell[:dimension] if cell.size > 1 else np.full(dimension, cell.flat[0])
    return _rows(sides, cell.flat[dimension:])


def _rows(sides, tilts):
    """Rows of a cell with these sides (D,) and tilts xy, xz, yz in units of length, or no tilts."""
    rows = np.diag(sides)
    for tilt, (column, row) in zip(tilts, itertools.combinations(range(len(sides)), 2), strict=False):
        rows[row, column] = tilt
    return rows


def check_periodic(box, dimension: int) -> None:
    """Raise InputError where an object with Lx, Ly, … such as freud.box.Box is not periodic along its axes."""
    if not all(np.atleast_1d(getattr(box, "periodic", True))[:dimension]):
        raise InputError(f"cell {box}: must be periodic in {'x and y' if dimension == 2 else 'x, y and z'}")


def rows_of_box(box, dimension: int):
    """Rows (D, D) of an object with Lx, Ly, … such as freud.box.Box."""
    names = ("Lx", "Ly", "xy") if dimension == 2 else ("Lx", "Ly", "Lz", "xy", "xz", "yz")
    numbers = read_numbers("cell", [getattr(box, name) for name in names])
    sides, ratios = numbers[:dimension], numbers[dimension:]
    heights = sides[[row for _, row in itertools.combinations(range(dimension), 2)]]
    return _rows(sides, ratios * heights)


def axes_of_cell(cell) -> int | None:
    """How many axes a cell beside positions with three coordinates has, 2 or 3; None where its form does not say.

    Three numbers are (Lx, Ly, Lz) there. An object with Lx, Ly, … has `dimensions`, or three axes with a depth Lz.
    """
    if hasattr(cell, "Lx"):
        return int(getattr(cell, "dimensions", 3 if getattr(cell, "Lz", 0.0) else 2))
    return {(2,): 2, (2, 2): 2, (3,): 3, (6,): 3, (3, 3): 3}.get(read_numbers("cell", cell).shape)


def check_cell(cell) -> None:
    """Raise InputError unless rows (D, D) are finite, lower triangular, not too long, and span a volume."""
    if not np.isfinite(cell).all():
        row = np.argwhere(~np.isfinite(cell))[0]
        raise InputError(f"cell[{', '.join(map(str, row))}]: {cell[tuple(row)]}, must be finite.")
    sides = np.diag(cell)
    if np.triu(cell, 1).any() or (sides <= 0).any():
        raise InputError(f"cell: {cell.tolist()}, must be rows {ROWS[len(cell)]}.")
    if np.abs(cell).max() > MAX_COORDINATE:
        raise InputError(
            "cell: beyond 2^28 units of length. Scale it to particles or bonds of size about one."
        )
    if not math.prod(sides) > 0:
        raise InputError(f"cell: {cell.tolist()}, has no volume in doubles. Scale it to sides of about one.")


def reduced_basis(cell):
    """(vectors (D, D), numbers (D, D) of int): shortest vectors of the lattice, rows numbers · cell, shortest first.

    Minkowski's reduction, by the greedy algorithm, exact in whole numbers: P. Nguyen and D. Stehlé, Low-dimensional
    lattice basis reduction revisited, ACM Trans. Algorithms 5, 46 (2009).
    """
    dimension = len(cell)
    ratios = [[side.as_integer_ratio() for side in row] for row in np.asarray(cell, float).tolist()]
    unit = max(part for row in ratios for _, part in row)  # powers of two
    basis = [
        np.array([*map(int, turns), *(whole * (unit // part) for whole, part in row)], object)
        for turns, row in zip(np.eye(dimension), ratios, strict=True)
    ]

    def inner(vector, other):
        return int(vector[dimension:] @ other[dimension:])

    def square(vector):
        return inner(vector, vector)

    row = 1
    while row < dimension:
        basis[: row + 1] = sorted(basis[: row + 1], key=square)
        *shorter, last = basis[: row + 1]
        for other in shorter:
            last = last - (2 * inner(other, last) + square(other)) // (2 * square(other)) * other
        last = min((last + sum(
            side * other for side, other in zip(sides, shorter, strict=True)
        ) for sides in itertools.product(SIDES, repeat=row)), key=square)  # fmt: skip
        if square(last) < square(basis[row]):
            basis[row], row = last, 1
        else:
            row += 1
    vectors = [[whole / unit for whole in row[dimension:]] for row in basis]
    return np.array(vectors), np.array([row[:dimension] for row in basis], object)


def read_numbers(name, values):
    """A copy of `values` as an array of floats. Raises InputError, which names them `name`."""
    try:
        if np.iscomplexobj(values) or np.ma.is_masked(values):
            raise TypeError
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: must be an array of real numbers, none of them masked") from None

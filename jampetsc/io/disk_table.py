"""What readers of other programs' files share: the table of particles, and checks of words, rows and numbers.

Errors do not name the file.
"""

import re
from dataclasses import dataclass, field

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.geometry import Geometry, geometry_of
from jampetsc.packing.potentials import EXPONENTS, SETTINGS

MAX_SHOWN_WORDS = 5  # of a row or column in a message


@dataclass(frozen=True, eq=False)
class DiskTable:
    """Particles as a file of another program has them."""

    columns: dict  # name in the file -> (N,) words or numbers
    positions: np.ndarray  # (N, 2) or (N, 3)
    box: object  # in a form that `packing.cell.cell_of` takes; None where the file has none
    potential: dict = field(
        default_factory=dict
    )  # name of SETTINGS of `packing.potentials`, or units -> what the file says
    index: int = 0  # number of the frame, from 0
    is_deep: bool = True  # whether a box of three axes repeats along z
    dimension: int | None = None  # D where the format states it
    may_turn: bool = False  # whether the format allows rows of a box in any orientation

    def geometry(self, box, dimension=None) -> Geometry:
        """`geometry_of` the particles in a box, in D = `dimension` if given. Raises InputError."""
        if None not in (dimension, self.dimension) and dimension != self.dimension:
            raise InputError(
                f"{named('dimension')} {dimension}: the file states D = {self.dimension}. Leave it out."
            )
        dimension = dimension or self.dimension
        return geometry_of(self.positions, box, dimension, is_deep=self.is_deep, may_turn=self.may_turn)


def potential_of(entries) -> dict:
    """The entries {key: value} of a file that are of SETTINGS, or units; none where `potential` is not one of jampetsc.

    Other programs may use these keys for something else.
    """
    potential = {name: entries[name] for name in (*SETTINGS, "units") if name in entries}
    return potential if potential.get("potential") in tuple(EXPONENTS) else {}


def potential_in(text) -> dict:
    """`potential_of` the words key=value of a text."""
    return potential_of({key: value.strip('"') for key, value in re.findall(r'(\w+)=("[^"]*"|\S+)', text)})


def shown(words) -> str:
    """The first of some words, for a message."""
    words = list(map(str, words))
    return " ".join(words[:MAX_SHOWN_WORDS]) + (" …" if len(words) > MAX_SHOWN_WORDS else "")


def to_numbers(words):
    """Words as an array of numbers. Raises InputError."""
    try:
        return np.asarray(words, float)
    except (TypeError, ValueError):
        raise InputError(f"{shown(words)}: not numbers. Correct the file.") from None


def to_whole_numbers(what, words) -> list:
    """Words as whole numbers, of which `what` is the name in a message. Raises InputError."""
    numbers = []
    for word in words:
        if re.fullmatch(r"[-+]?\d{1,19}", str(word)):
            numbers.append(int(word))
            continue
        number = float(to_numbers([word])[0])
        if not number.is_integer() or abs(number) > 2.0**53:  # inf and nan are no integers
            raise InputError(f"{what} {word}: must be a whole number. Correct the file.")
        numbers.append(int(number))
    return numbers


def is_number(word) -> bool:
    """Whether a word is a finite number."""
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", str(word), re.IGNORECASE) is not None


def check_index(index, count) -> int:
    """Number of a packing from 0; a negative `index` counts from the last one, −1. Raises InputError."""
    if not -count <= index < count:
        raise InputError(
            f"{named('index')} {index}: no such packing ({count}, numbered from 0). Choose another."
        )
    return index % count


def places_of(columns, names="xyz"):
    """(N, 2) or (N, 3) coordinates from the columns of these names, the last of which may be missing."""
    return np.column_stack([to_numbers(columns[name]) for name in names if name in columns])


def rows_of(body, count):
    """The words of the first `count` lines that are not empty. Raises InputError where there are fewer."""
    rows = [line.split() for line in body.splitlines() if line.strip()][:count]
    if len(rows) != count:
        raise InputError(f"{len(rows)} lines for {count} particles: truncated or edited. Get it again.")
    return rows


def columns_of(names, rows, surplus=(0,), remedy="Correct the file."):
    """{name: words of the column}, by `id` where there is one. Raises InputError.

    surplus   how many further columns, which are left out, a row may have
    """
    if not rows:
        raise InputError("no particles. Give a file with particles.")
    for row in rows:
        if len(row) - len(names) not in surplus:
            raise InputError(
                f"line {shown(row)!r}: not {' '.join(names)} ({len(row)} words for {len(names)}). {remedy}"
            )
    columns = dict(zip(names, zip(*rows, strict=False), strict=False))
    if "id" in columns:
        ids = to_whole_numbers("id", columns["id"])
        order = sorted(range(len(ids)), key=ids.__getitem__)
        columns = {name: [column[row] for row in order] for name, column in columns.items()}
    return columns


def numbers_in(body, rows, columns):
    """Numbers (rows, columns) of the first lines of a text. Raises InputError."""
    table = [to_numbers(row) for row in rows_of(body, rows)]
    if any(len(row) != columns for row in table):
        raise InputError(f"{body.strip()!r}: not {rows} lines of {columns} numbers. Correct the file.")
    return np.array(table)


def count_of(word) -> int:
    """A number of particles. Raises InputError."""
    if not re.fullmatch(r"\s*\d{1,18}\s*", word):
        raise InputError(f"{word.strip()!r}: not a number of particles. Correct the file.")
    return int(word)

"""Disks as a file of another program has them: columns by their names there, and what the file says of its forces."""

import re
from dataclasses import dataclass, field

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.potentials import EXPONENTS

RADII = ("radius", "radii", "diameter", "diameters")  # columns looked for; diameters are halved
TYPES = ("type", "types", "species", "element")  # columns looked for, for radii by type
LAW = ("potential", "stiffness", "k")  # what a file may say of its forces, see `packing.potentials`


@dataclass(frozen=True, eq=False)
class DiskTable:
    """Disks as a file of another program has them."""

    columns: dict  # name in the file -> (N,) words or numbers
    positions: np.ndarray  # (N, 2) or (N, 3)
    box: object  # in a form that `packing.from_arrays.cell_of` takes; None where the file has none
    law: dict = field(default_factory=dict)  # name of LAW, or units -> what the file says


def law_of(entries) -> dict:
    """The entries {key: value} of a file that are of LAW, or units; none where `potential` is not one of jampetsc.

    Other programs may use these keys for something else.
    """
    law = {name: entries[name] for name in (*LAW, "units") if name in entries}
    return law if law.get("potential") in EXPONENTS else {}


def law_in(text) -> dict:
    """`law_of` the words key=value of a text."""
    return law_of({key: value.strip('"') for key, value in re.findall(r'(\w+)=("[^"]*"|\S+)', text)})


def radii_in(columns, radius=None):
    """(N,) radii out of the columns of a file. Raises InputError.

    radius   name of their column, halved if it begins with diameter; a radius for each type, {type: radius} or
             "1=0.5,2=0.7"; None: one of RADII
    """
    if isinstance(radius, dict) or "=" in (radius or ""):
        return _radii_by_type(columns, radius)
    names = [name for name in columns if (name == radius if radius else name.lower() in RADII)]
    if not names:
        example = ",".join(f"{type}={size}" for type, size in zip(_types(columns), (0.5, 0.7), strict=False))
        raise InputError(
            f"no column {radius or 'radius or diameter'} among {', '.join(columns)}. "
            f"Name the column of the radii by {named('radius')}, or give "
            + (
                f"a radius for each type: {named('radius')} {example}"
                if example
                else "arrays to jampetsc.Packing"
            )
        )
    return numbers(columns[names[0]]) / (2.0 if names[0].lower().startswith("diameter") else 1.0)


def _radii_by_type(columns, radii):
    if not isinstance(radii, dict):
        radii = {type: radius for type, _, radius in (entry.partition("=") for entry in radii.split(","))}
    radii = {str(type).strip(): str(radius).strip() for type, radius in radii.items()}
    for type, radius in radii.items():
        if not (is_number(radius) and float(radius) > 0.0):
            raise InputError(
                f"{named('radius')} {type}={radius}: must be positive. Give TYPE=R, e.g. 1=0.5,2=0.7"
            )
    types = _types(columns)
    if not types:
        raise InputError(
            f"no column {' or '.join(TYPES)} among {', '.join(columns)}. Name the column of the radii by "
            f"{named('radius')}"
        )
    missing = [type for type in types if type not in radii]
    if missing:
        raise InputError(
            f"no radius for type {', '.join(missing[:5])}. Give one for each type by {named('radius')}, "
            f"which has {', '.join(radii)}"
        )
    return np.array([float(radii[str(type)]) for type in _type_column(columns)])


def _type_column(columns):
    return next((columns[name] for name in columns if name.lower() in TYPES), ())


def _types(columns) -> list:
    """The types of the disks, in words, sorted."""
    return sorted({str(type) for type in _type_column(columns)})


def numbers(words):
    """Words as an array of numbers. Raises InputError."""
    try:
        return np.asarray(words, float)
    except (TypeError, ValueError):
        shown = " ".join(map(str, list(words)[:5]))
        raise InputError(f"{shown}{' …' if len(words) > 5 else ''}: not numbers") from None


def is_number(word):
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", str(word), re.IGNORECASE) is not None

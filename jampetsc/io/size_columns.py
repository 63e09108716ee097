"""Radii out of the columns of a file of another program: a column of radii or diameters, or a radius for each type."""

import re

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.disk_table import is_number, shown, to_numbers

RADII = ("radius", "radii", "r", "diameter", "diameters")  # columns looked for; diameters are halved
TYPES = ("type", "types", "species", "element")  # columns looked for, for radii by type
HOLDS = ("radii", "diameters")  # what a column of sizes may hold


def radii_in(columns, radius=None, column_holds=None):
    """(radii (N,), what they were read from in words) out of the columns of a file. Raises InputError.

    radius         name of their column; a radius for each type, {type: radius} or "1=0.5,2=0.7"; None: one of RADII
    column_holds   one of HOLDS; None: what the name of the column says
    """
    if isinstance(radius, dict) or "=" in (radius or ""):
        if column_holds is not None:
            raise InputError(f"{named('column_holds')}: an option of a column of sizes. Leave it out.")
        return _radii_by_type(columns, radius), "by type"
    name = radius if radius in columns else None if radius else column_of_radii(columns)
    if name is None:
        example = ",".join(f"{type}={size}" for type, size in zip(_types(columns), (0.5, 0.7), strict=False))
        raise InputError(
            f"no column {radius or 'radius or diameter'} among {', '.join(columns)}. "
            f"Name the column of the radii by {named('radius')}, or give "
            + (
                f"a radius for each type: {named('radius')} {example}."
                if example
                else "arrays to jampetsc.Packing."
            )
        )
    holds = column_holds or _kind_of(name)
    if holds not in HOLDS:
        raise InputError(
            f"column {name}: radii or diameters? Give {named('column_holds')} radii or diameters."
            if column_holds is None
            else f"{named('column_holds')} {column_holds}: not supported. Choose one of {', '.join(HOLDS)}."
        )
    sizes = np.atleast_1d(to_numbers(columns[name]))
    return (sizes / 2.0, f"column {name}, halved") if holds == "diameters" else (sizes, f"column {name}")


def column_of_radii(columns) -> str | None:
    """The first column whose name is one of RADII, also as a variable, compute or fix of LAMMPS; None without one."""
    return next((name for name in columns if _plain(name) in RADII), None)


def _plain(name) -> str:
    """A name in lower case without the v_, c_, f_, i_ or d_ of LAMMPS."""
    return re.sub(r"^[vcfid]_(?=\w\w)", "", name.lower())


def _kind_of(name) -> str | None:
    """Which of HOLDS the name of a column says; None where it does not."""
    word = _plain(name)
    is_diameter = "diam" in word or word == "d"
    is_radius = re.search(r"(?<![a-z])rad", word) is not None or word == "r"
    return None if is_diameter == is_radius else HOLDS[is_diameter]


def _radii_by_type(columns, radii):
    if not isinstance(radii, dict):
        radii = {type: radius for type, _, radius in (entry.partition("=") for entry in radii.split(","))}
    radii = {str(type).strip(): str(radius).strip() for type, radius in radii.items()}
    for type, radius in radii.items():
        if not (is_number(radius) and float(radius) > 0.0):
            raise InputError(
                f"{named('radius')} {type}={radius}: must be positive. Give TYPE=R, e.g. 1=0.5,2=0.7."
            )
    types = _types(columns)
    if not types:
        raise InputError(
            f"no column {' or '.join(TYPES)} among {', '.join(columns)}. Name the column of the radii by "
            f"{named('radius')}."
        )
    missing = [type for type in types if type not in radii]
    if missing:
        raise InputError(
            f"no radius for type {shown(missing)}. Give one for each type by {named('radius')}, "
            f"which has {', '.join(radii)}."
        )
    return np.array([float(radii[str(type)]) for type in _type_column(columns)])


def _type_column(columns):
    name = next((name for name in columns if name.lower() in TYPES), None)
    return () if name is None else np.ravel(columns[name]).tolist()


def _types(columns) -> list:
    """The types of the disks, in words, sorted."""
    return sorted({str(type) for type in _type_column(columns)})

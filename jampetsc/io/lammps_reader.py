"""Particles and bonds of LAMMPS: dumps of styles atom and custom, and data files. Errors do not name the file."""

import re

import numpy as np

from jampetsc.errors import InputError
from jampetsc.io.disk_table import (
    DiskTable,
    check_index,
    columns_of,
    count_of,
    numbers_in,
    places_of,
    potential_in,
    rows_of,
    to_numbers,
    to_whole_numbers,
)

STYLES = {  # columns of Atoms in data files
    "sphere": "id type diameter density x y z",
    "bpm/sphere": "id mol type diameter density x y z",
    "atomic": "id type x y z",
    "charge": "id type q x y z",
    "bond": "id mol type x y z",
    "molecular": "id mol type x y z",
    "full": "id mol type q x y z",
}
IMAGE_COLUMNS = 3  # behind the columns of Atoms, if any
OTHER_DUMPS = {"ENTRIES": "local, which has pairs or bonds", "GRID": "grid, which has the cells of a grid"}


def read_lammps_dump(content, index):
    """Snapshot `index` of a LAMMPS dump: wrapped, unwrapped or scaled coordinates, disks in the order of their id.

    The box may be triclinic, restricted or general.
    """
    items = [item.partition("\n") for item in re.split(r"(?m)^ITEM: ", content.decode())[1:]]
    ends = [n for n, (title, _, _) in enumerate(items) if title.split()[:1] == ["ATOMS"]]
    if not ends:
        _refuse_other_dump(title.split()[0] for title, _, _ in items if title.split())
    frame = check_index(index, len(ends))
    sections = {
        title.split()[0]: (title.split(), body)
        for title, _, body in items[: ends[frame] + 1]
        if title.split()
    }
    if not {"NUMBER", "BOX"} <= set(sections):
        raise InputError("ITEM: NUMBER OF ATOMS or BOX BOUNDS missing: truncated or edited. Get it again.")
    cell, low, flags, is_general = _dump_box(*sections["BOX"])
    names = sections["ATOMS"][0][1:]
    columns = columns_of(names, rows_of(sections["ATOMS"][1], count_of(sections["NUMBER"][1])))
    for kind in ("", "u", "s", "su"):  # as they are, unwrapped, scaled by the cell
        if {f"x{kind}", f"y{kind}"} <= columns.keys():
            break
    else:
        raise InputError(
            f"no coordinates x y, xu yu, xs ys or xsu ysu among {', '.join(columns)}. Write them to the dump."
        )
    place = places_of(columns, [axis + kind for axis in "xyz"])
    if "s" in kind:
        axes = place.shape[1]
        place = place @ cell[:axes, :axes] + low[:axes]
    potential = potential_in(sections["UNITS"][1] if "UNITS" in sections else "")
    is_deep = flags[2:3] in ([], ["pp"])
    return DiskTable(columns, place, cell, potential, frame, is_deep, may_turn=is_general)


def _refuse_other_dump(titles):
    for title in titles:
        if title in OTHER_DUMPS:
            raise InputError(
                f"ITEM: {title}: a dump of style {OTHER_DUMPS[title]}. Give a dump of style custom of the particles, "
                "e.g. dump 1 all custom 1000 p.dump id type x y z radius."
            )
    raise InputError("no ITEM: ATOMS: truncated, or no dump of particles. Get it again.")


def _dump_box(words, body):
    """(cell rows (3, 3), lower corner (3,), flags of periodicity, whether rows may have any orientation)."""
    is_general, is_tilted = "abc" in words, "xy" in words
    flags = words[4 if is_general else 5 if is_tilted else 2 :]
    if any(flag != "pp" for flag in flags[:2]):
        raise InputError(
            f"ITEM: {' '.join(words)}: must be periodic (pp) in x and y. Walls and open boundaries are not supported; "
            "if nothing touches them, write pp there."
        )
    rows = numbers_in(body, 3, 4 if is_general else 3 if is_tilted else 2)
    if (
        is_general
    ):  # a row for each cell vector, and the origin, as general triclinic cells and OVITO have them
        return rows[:, :3], rows[:, 3], flags, True
    tilt = rows[:, 2] if is_tilted else np.zeros(3)  # xy, xz, yz
    ends = 0.0, tilt[0], tilt[1], tilt[0] + tilt[1]  # bounds are of the tilted box
    rows[0, :2] -= min(ends), max(ends)
    rows[1, :2] -= min(0.0, tilt[2]), max(0.0, tilt[2])
    cell = np.diag(rows[:, 1] - rows[:, 0])
    cell[1, 0], cell[2, :2] = tilt[0], tilt[1:]
    return cell, rows[:, 0], flags, False


def read_lammps_data(content, index):
    """A LAMMPS data file of one of STYLES, its box triclinic, restricted or general."""
    check_index(index, 1)
    title, _, text = content.decode().partition("\n")
    header, _, body = text.partition("\nAtoms")
    hint, _, body = body.partition("\n")
    style = hint.strip(" \t\r#")
    if style not in STYLES:
        raise InputError(
            f"Atoms # {style or '(no style)'}: must be one of {', '.join(STYLES)}. Write the style there, e.g. "
            f"'Atoms # sphere' of columns {STYLES['sphere']}"
        )

    def header_words(what, count, default=None):
        match = re.search(rf"(?m)^[ \t]*((?:\S+[ \t]+){{{count}}}){what}\b", header)
        if match is None and default is None:
            raise InputError(f"no {what} in the header: truncated or edited. Get it again.")
        return default if match is None else match[1].split()

    is_general = re.search(r"\bavec\b", header) is not None
    if is_general:
        cell = np.array([to_numbers(header_words(vector, 3)) for vector in ("avec", "bvec", "cvec")])
    else:
        (x0, x1), (y0, y1) = to_numbers(header_words("xlo xhi", 2)), to_numbers(header_words("ylo yhi", 2))
        z0, z1 = to_numbers(header_words("zlo zhi", 2, [0, 1]))
        xy, xz, yz = to_numbers(header_words("xy xz yz", 3, [0, 0, 0]))
        cell = np.array([[x1 - x0, 0.0, 0.0], [xy, y1 - y0, 0.0], [xz, yz, z1 - z0]])
    rows = [_without_comment(row) for row in rows_of(body, count_of(header_words("atoms", 1)[0]))]
    columns = columns_of(STYLES[style].split(), rows, surplus=(0, IMAGE_COLUMNS))
    return DiskTable(columns, places_of(columns), cell, potential_in(title), may_turn=is_general)


def _without_comment(words):
    """The words of a line before the one with which a comment begins."""
    return words[: next((n for n, word in enumerate(words) if word.startswith("#")), None)]


def lammps_bonds(text, ids) -> dict:
    """Arguments of `Network` about the bonds of a data file, and `rest`, lengths r₀ of springs. Raises InputError.

    ids   (N,) words, of the atoms in the order of the nodes
    """
    bonds = _section(text, "Bonds", 4)
    if bonds is None:
        raise InputError(
            "no section Bonds: id, type and two atoms of each bond. Add it, or give a file of bonds."
        )
    place = {number: row for row, number in enumerate(to_whole_numbers("id", ids))}
    if len(place) != len(ids):
        raise InputError("Atoms: two atoms have one id. Correct the file.")
    _, types, *ends = (to_whole_numbers("Bonds: atom or type", column) for column in zip(*bonds, strict=True))
    unknown = [number for number in (*ends[0], *ends[1]) if number not in place]
    if unknown:
        raise InputError(f"Bonds: atom {unknown[0]} is not among Atoms. Correct the number.")
    values = {"bonds": np.array([[place[number] for number in column] for column in ends]).T}
    coefficients = _section(text, "Bond Coeffs", 3)
    if coefficients is None:
        return values
    numbers = to_whole_numbers("Bond Coeffs: bond type", [row[0] for row in coefficients])
    by_type = dict(zip(numbers, to_numbers([row[1:] for row in coefficients]), strict=True))
    missing = [type for type in sorted(set(types)) if type not in by_type]
    if missing:
        raise InputError(f"Bond Coeffs: no line for bond type {missing[0]}. Add K and r0 of it.")
    K, rest = np.array([by_type[type] for type in types]).T
    return values | {"stiffness": 2.0 * K, "rest": rest}


def _section(text, title, width):
    """Words of the lines of a section of a data file; None where it is missing. Raises InputError."""
    match = re.search(rf"(?m)^[ \t]*{title}[ \t]*(?:#[ \t]*(\S*).*)?$", text)
    if match is None:
        return None
    style = match[1] or ""
    if title == "Bond Coeffs" and style not in ("", "harmonic"):
        raise InputError(
            f"Bond Coeffs # {style}: not supported, only harmonic, K (r - r0)^2. Give k and T as a text."
        )
    rows = []
    for line in text[match.end() :].splitlines():
        words = line.partition("#")[0].replace("harmonic", " ").split()
        if words and words[0][0].isalpha() and words[0].lower() not in ("inf", "nan"):  # the next section
            break
        if words:
            rows.append(words)
    wrong = next((row for row in rows if len(row) != width), None)
    if wrong or not rows:
        raise InputError(f"{title}: line {' '.join(wrong or [])!r}, must have {width} numbers.")
    return rows

"""Particles in columns of a text: x y r with or without a title line, csv, and XYZ, plain and extended.

Errors do not name the file.
"""

import re

from jampetsc.errors import InputError, named
from jampetsc.io.disk_table import (
    DiskTable,
    check_index,
    columns_of,
    count_of,
    is_number,
    places_of,
    potential_of,
    rows_of,
    to_numbers,
)

BARE_COLUMNS = {2: ("x", "y"), 3: ("x", "y", "radius")}  # of lines of numbers that no title names
XYZ_COLUMNS = "species:S:1:pos:R:3"  # Properties of a file without them
NAME_COLUMNS = f"Name the columns by {named('columns')}"


class TextTable:
    """Rows of words of a text, the names of its columns and its box, each None where the text has none."""

    def __init__(self, text: str):
        self.rows, self.names, self.box = [], None, None
        comment = None
        for line in text.splitlines():
            if box := re.match(r"[ \t#]*box\b(.*)", line, re.IGNORECASE):
                self.box = self.box or _divided(box[1])
                continue
            data, mark, more = line.partition("#")
            if words := _divided(data):
                if not self.rows and self.names is None and not all(map(is_number, words)):
                    self.names = _title(data)
                else:
                    self.rows.append(words)
            elif mark and not self.rows:
                comment = _title(more)
        if self.names is None and self.rows and comment and _is_title(comment, self.rows[0]):
            self.names = comment

    @property
    def is_table(self) -> bool:
        """Whether it begins like a table of numbers, with or without a title line."""
        first = self.rows[0] if self.rows else []
        fits = self.names is None or len(self.names) == len(first)
        return len(first) > 1 and fits and sum(map(is_number, first)) > 1 and (
            self.names is not None or all(map(is_number, first))
        )  # fmt: skip


def _divided(line) -> list:
    """Words of a line, between blanks, commas, semicolons, colons or equals signs, without quotes."""
    return [word.strip("\"'") for word in re.split(r"[,;:=\s]+", line) if word]


def _title(line) -> list:
    """Names of columns in a line: between commas, semicolons or tabs if it has any, else between blanks."""
    parts = re.split(r"[,;\t]", line) if re.search(r"[,;\t]", line.strip()) else line.split()
    return [_column_name(part) for part in parts if part.strip()]


def _column_name(text) -> str:
    name = text.strip().strip("\"'").strip()
    return name.lower() if name.lower() in ("x", "y", "z", "id") else name


def _is_title(names, row) -> bool:
    return len(names) == len(row) and {"x", "y"} <= set(names)


def read_xyr(content, index, columns=None):
    """Lines x y r, of nodes x y, or of columns that a title line, a comment above them or `columns` names; a line
    `box L`, `box Lx Ly`, `box Lx Ly xy`, or of three coordinates `box Lx Ly Lz`, which may be a comment, if any.
    """
    check_index(index, 1)
    table = TextTable(content.decode())
    if not table.rows:
        raise InputError("no particles. Give a file with particles.")
    width = len(table.rows[0])
    names = columns or table.names or BARE_COLUMNS.get(width)
    if names is None:
        raise InputError(
            f"lines of {width} numbers, which nothing names. {NAME_COLUMNS}, e.g. "
            f"{'x,y,z,r or id,x,y,r' if width == 4 else 'id,x,y,z,r,…'}; three are x y r."
        )
    particle_columns = columns_of(
        list(names), table.rows, remedy=f"Correct the file, or {_lowered(NAME_COLUMNS)}."
    )
    if not {"x", "y"} <= particle_columns.keys():
        raise InputError(
            f"no columns x and y among {', '.join(particle_columns)}. {NAME_COLUMNS}, e.g. x,y,r."
        )
    return DiskTable(
        particle_columns, places_of(particle_columns), None if table.box is None else to_numbers(table.box)
    )


def _lowered(sentence) -> str:
    return sentence[:1].lower() + sentence[1:]


def looks_like_xyz(text: str) -> bool:
    """Whether a text begins as XYZ: a number of particles, a comment, then a word with coordinates."""
    lines = text.splitlines()[:3]
    if not lines or not re.fullmatch(r"\s*\d+\s*", lines[0]):
        return False
    if len(lines) > 1 and re.search(r"\b(Lattice|Properties)=", lines[1]):
        return True
    words = lines[2].split() if len(lines) > 2 else []
    return len(words) > 2 and all(map(is_number, words[1:3]))


def read_xyz(content, index, columns=None):
    """Frame `index` of an XYZ file: of extended XYZ Properties with pos, and Lattice if it has one; of plain XYZ
    species x y z, or the columns that `columns` names.
    """
    lines, starts = content.decode().rstrip().splitlines(), []
    at = 0
    while at < len(lines):
        starts.append(at)
        at += 2 + count_of(lines[at])
    frame = check_index(index, len(starts))
    first = starts[frame]
    if first + 1 >= len(lines):
        raise InputError(f"line {first + 2}: missing. Get the file again.")
    entries = _entries(lines[first + 1])
    names, count = list(columns or _names_of(entries.get("Properties", XYZ_COLUMNS))), count_of(lines[first])
    rows = rows_of("\n".join(lines[first + 2 : first + 2 + count]), count)
    particle_columns = columns_of(names, rows, remedy=f"{NAME_COLUMNS}, e.g. species,x,y,z,r.")
    if not {"x", "y"} <= set(particle_columns):
        raise InputError(f"no pos among the columns {', '.join(particle_columns)}. Add it to the file.")
    potential, place = potential_of(entries), places_of(particle_columns)
    if "Lattice" not in entries:
        return DiskTable(particle_columns, place, None, potential, frame)
    lattice = to_numbers(re.findall(r"[^\s,\[\]]+", entries["Lattice"]))
    if lattice.shape != (9,):
        raise InputError(f'Lattice="{entries["Lattice"]}": must be nine numbers, the rows a₁, a₂ and a₃')
    periodic = [flag[0] in "Tt1" for flag in re.findall(r"\w+", entries.get("pbc", "T"))]
    periodic = periodic * 3 if len(periodic) == 1 else periodic
    if not periodic or not all(periodic[:2]):
        raise InputError(
            f'pbc="{entries["pbc"]}": must be periodic in x and y. Walls and open boundaries are not supported; if '
            "nothing touches them, write T T F for disks."
        )
    return DiskTable(
        particle_columns, place, lattice.reshape(3, 3), potential, frame, all(periodic), may_turn=True
    )


def _entries(line) -> dict:
    """{key: value} of the words key=value of a line; a value may be in quotes or brackets."""
    pairs = re.findall(r"([\w.-]+)=(\"[^\"]*\"|'[^']*'|\[[^=]*\]|\{[^}]*\}|\S+)", line)
    return {key: value.strip("\"'") for key, value in pairs}


def _names_of(properties) -> list:
    """Names of columns of Properties: x y z of pos, NAME0, NAME1, … of other vectors."""
    names, words = [], properties.split(":")
    for name, width in zip(words[::3], map(count_of, words[2::3]), strict=False):
        several = "xyz"[:width] if name == "pos" else [f"{name}{column}" for column in range(width)]
        names += several if width > 1 else [name]
    return names

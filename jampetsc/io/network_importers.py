"""Networks of other programs: nodes as `exchange` reads them, with bonds of the same file or of a text of columns."""

import os
import re
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.exchange import check_uncompressed, format_of, is_number, to_numbers
from jampetsc.io.importers import RADII, box_of, radii_in, read_content, read_table
from jampetsc.packing.spring_network import Network

BOND_ARRAYS = ("stiffness", "tension", "images")  # of npz, beside bonds
BOND_COLUMNS = ("stiffness", "tension")  # of a text of bonds, behind both nodes


def import_network(path, bonds=None, index=0, *, format=None, radius=None, box=None, k=None) -> Network:
    """Read a network of another program.

    path     file of the nodes, in a format of `exchange.READERS`
    bonds    file of the bonds: `path` itself, which is LAMMPS data with Bonds or npz with bonds; or lines i j, i j k or
             i j k T, nodes numbered from 0; None: `path`
    index    number of the frame, from 0
    format   of `path`; None: recognised by the content
    radius   as for `import_packing`; None: radius or diameter where the file has them, else no radii
    box      as for `Packing`, for a file that has none
    k        unit of stiffness; None: what the file says, or 1

    LAMMPS' bond style harmonic has the energy K (r − r₀)²: k = 2K, T = 2K (r − r₀). Each bond leads to the nearest
    image. The record has as `assumed` which of stiffness (1) and tension (0) the files do not say. Raises InputError
    for files that cannot be read, and as `Network`.
    """
    bonds = path if bonds is None else bonds
    is_one_file = os.path.realpath(path) == os.path.realpath(bonds)
    content = read_content(path)
    with about(path):
        check_uncompressed(content, path)
        format = format or format_of(content)
        if format is None:
            raise InputError(
                f"not a format with nodes that jampetsc reads. {named('format')} says which it is."
            )
        table = read_table(content, index, format)
        has_radii = radius or any(name.lower() in RADII for name in table.columns)
        cell = box_of(table, box)
        positions, box = table.places()
        nodes = {
            "positions": positions,
            "cell": cell if box is None else box,
            "radii": radii_in(table.columns, radius) if has_radii else None,
        }
        k = table.law.get("k", 1.0) if k is None else k
        if is_one_file:
            values = _values_of(content, format, table)
    if not is_one_file:
        with about(bonds):
            values = _columns_of(read_content(bonds))
    assumed = ", ".join(
        name for name in ("stiffness", "tension") if name not in values and "rest" not in values
    )
    record = {"protocol": f"{format} with bonds", "imported_from": Path(path).name}
    record |= {"imported_bonds": Path(bonds).name, "imported_index": index}
    record |= {"assumed": assumed} if assumed else {}
    with about(bonds):
        rest = values.pop("rest", None)
        network = Network(**nodes, **values, k=k, record=record)
        if rest is None:
            return network
        values["tension"] = values["stiffness"] * (network.linear_bonds.distance - rest)
        return Network(**nodes, **values | {"images": network.images}, k=k, record=record)


def _values_of(content, format, table):
    """Arguments of `Network` about the bonds of the file that has its nodes, and `rest`, lengths r₀ of springs."""
    if format == "npz" and "bonds" in table.columns:
        arrays = table.law | table.columns
        return {name: arrays[name] for name in ("bonds", *BOND_ARRAYS) if name in arrays}
    if format == "lammps-data":
        return _lammps_bonds(content.decode(), to_numbers(table.columns["id"]))
    raise InputError(
        f"{format}: holds no bonds. Give {named('bonds')} a text file of lines i j: two nodes of each, from 0."
    )


def _lammps_bonds(text, ids):
    bonds = _section(text, "Bonds", 4)
    if bonds is None:
        raise InputError(
            "no section Bonds: id, type and two atoms of each bond. Add it, or give a file of bonds."
        )
    place = {int(number): row for row, number in enumerate(ids)}
    pairs = bonds[:, 2:4].astype(int)
    unknown = [number for number in pairs.ravel().tolist() if number not in place]
    if unknown:
        raise InputError(f"Bonds: atom {unknown[0]} is not among Atoms. Correct the number.")
    values = {"bonds": np.array([place[number] for number in pairs.ravel().tolist()]).reshape(-1, 2)}
    coefficients = _section(text, "Bond Coeffs", 3)
    if coefficients is None:
        return values
    by_type = {int(type): (2.0 * K, rest) for type, K, rest in coefficients[:, :3]}
    missing = [type for type in np.unique(bonds[:, 1]).astype(int).tolist() if type not in by_type]
    if missing:
        raise InputError(f"Bond Coeffs: no line for bond type {missing[0]}. Add K and r0 of it.")
    stiffness, rest = np.array([by_type[int(type)] for type in bonds[:, 1]]).T
    return values | {"stiffness": stiffness, "rest": rest}


def _section(text, title, width):
    """Numbers (rows, width) of a section of a LAMMPS data file; None where it is missing. Raises InputError."""
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
        if words and words[0][0].isalpha():  # the next section
            break
        if words:
            rows.append(words)
    wrong = next((row for row in rows if len(row) < width), None)
    if wrong or not rows:
        raise InputError(f"{title}: line {' '.join(wrong or [])!r}, must have {width} numbers.")
    return np.array([to_numbers(row[:width]) for row in rows])


def _columns_of(content):
    """Arguments of `Network` about bonds: lines i j, i j k or i j k T; comments begin with #. Raises InputError."""
    text = re.sub("#.*", "", content.decode(errors="replace")).replace(",", " ")
    numbered = [(n, line.split()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    rows = [row for _, row in numbered]
    width = len(rows[0]) if rows else 0
    if not 2 <= width <= 2 + len(BOND_COLUMNS):
        raise InputError("holds no lines i j, i j k or i j k T of bonds. Nodes are numbered from 0.")
    for number, row in numbered:
        if len(row) != width or not all(map(is_number, row)):
            raise InputError(
                f"line {number}: {' '.join(row)!r}, must have {width} numbers, as the first one."
            )
    table = np.array([to_numbers(row) for row in rows])
    return {"bonds": table[:, :2]} | dict(zip(BOND_COLUMNS, table[:, 2:].T, strict=False))

"""Networks of other programs: nodes as `exchange` reads them, with bonds of the same file or of a text of columns."""

import os
import re
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.disk_table import is_number, to_numbers
from jampetsc.io.exchange import check_uncompressed, format_of, read_table, refuse_unknown
from jampetsc.io.importers import box_of, read_content
from jampetsc.io.lammps_reader import lammps_bonds
from jampetsc.io.size_columns import column_of_radii, radii_in
from jampetsc.packing.spring_network import Network

BOND_ARRAYS = ("stiffness", "tension", "images")  # of npz, beside bonds
BOND_COLUMNS = ("stiffness", "tension")  # of a text of bonds, behind both nodes


def import_network(
    path,
    bonds=None,
    index=0,
    *,
    format=None,
    radius=None,
    column_holds=None,
    columns=None,
    box=None,
    dimension=None,
    k=None,
) -> Network:
    """Read a network of another program.

    path     file of the nodes, in a format of `exchange.READERS`
    bonds    file of the bonds: `path` itself, which is LAMMPS data with Bonds or npz with bonds; or lines i j, i j k or
             i j k T, nodes numbered from 0; None: `path`
    index    number of the frame, from 0; −1 is the last one
    format   of `path`; None: recognised by the content
    radius   as for `import_packing`; None: radius or diameter where the file has them, else no radii
    column_holds, columns, dimension   as for `import_packing`
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
        format = format or format_of(content) or refuse_unknown(content, ())
        table = read_table(content, index, format, columns)
        geometry = table.geometry(box_of(table, box), dimension)
        has_radii = radius or column_of_radii(table.columns)
        nodes = {
            "positions": geometry.positions,
            "cell": geometry.cell,
            "dimension": len(geometry.cell),
            "radii": radii_in(table.columns, radius, column_holds)[0] if has_radii else None,
        }
        k = table.potential.get("k", 1.0) if k is None else k
        if is_one_file:
            values = _values_of(content, format, table)
    if not is_one_file:
        content = read_content(bonds)
        with about(bonds):
            values = _columns_of(content)
    assumed = ", ".join(
        name for name in ("stiffness", "tension") if name not in values and "rest" not in values
    )
    record = {"protocol": f"{format} with bonds", "imported_from": Path(path).name}
    record |= {"imported_bonds": Path(bonds).name, "imported_index": table.index}
    record |= {"geometry": geometry.decision} if geometry.decision else {}
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
        arrays = table.potential | table.columns
        return {name: arrays[name] for name in ("bonds", *BOND_ARRAYS) if name in arrays}
    if format == "lammps-data":
        return lammps_bonds(content.decode(), table.columns["id"])
    raise InputError(
        f"{format}: holds no bonds. Give {named('bonds')} a text file of lines i j: two nodes of each, from 0."
    )


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

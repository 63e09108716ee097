"""Packings of other programs, recognised by their content: the formats of `exchange`, and two published ones.

jamBashbulk writes `N = …, L1 = {…}, L2 = {…}, P = …` and a line `x, y, r` per disk; U = ½ δ² (k = 1).
jax-md's data files hold many packings; positions are fractions of the box, U = ½ (1 − r/σ)².
"""

import itertools
import re
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.atomic import open_regular
from jampetsc.io.checksums import SIGNATURE
from jampetsc.io.exchange import (
    LAW,
    READERS,
    check_index,
    check_uncompressed,
    format_of,
    is_number,
    to_numbers,
)
from jampetsc.io.hdf5 import open_file, values
from jampetsc.packing.packing import PLANE_TOLERANCE, Packing
from jampetsc.packing.potentials import Potential

RADII = ("radius", "radii", "diameter", "diameters")  # columns looked for; diameters are halved
TYPES = ("type", "types", "species", "element")  # columns looked for, for radii by type
_NUMBER = r"([-+.\deE]+|[-+]?nan|[-+]?inf)"
_MAX_TEXT_BYTES = 1 << 29  # bytes of text, about ten million disks
_PUBLISHED_TOLERANCE = 1e-6  # relative difference from a stored value that still counts as the same packing
# of jax-md by dimension, for a symmetric linear strain
_MODULUS_COMPONENTS = {
    2: "xxxx yyyy xyxy xxyy xxxy yyxy".split(),
    3: "xxxx yyyy zzzz yzyz xzxz xyxy yyzz xxzz xxyy xxyz xxxz xxxy yyyz yyxz yyxy zzyz xzzz xyzz yzxz xyyz "
    "xyxz".split(),
}


def import_packing(
    path, index=0, *, format=None, radius=None, box=None, potential=None, stiffness=None, k=None
) -> Packing:
    """Read packing number `index` of a file of another program.

    path     of the file
    index    number of the packing, or frame, in the file, from 0
    format   one of `exchange.READERS`; None: recognised by the content
    radius   column or array of radii, halved if its name begins with diameter; radii by type, {1: 0.5, 2: 0.7} or
             "1=0.5,2=0.7"; None: radius or diameter
    box      as the cell of `Packing`, for a file that has none
    potential, stiffness, k   as for `Packing`; None: what the file says, or else the defaults of `Packing`. LAMMPS'
             pair style harmonic/cut has the energy K δ²: k = 2K

    Returns a Packing, in the unit of length of the file. Its record has pressure, phi, energy and max_force as computed
    here, the numbers of a published file as published_pressure, published_energy, …, and as `assumed` which of
    potential, stiffness and k neither the file nor the caller says.

    Centres with the same z are disks, others spheres. Raises InputError for an unknown format, a compressed or damaged
    file, a wrong index, a packing that is not periodic, or whose pressure or energy is not the one in the file.
    """
    content = read_content(path, whole=format is not None)
    law = {"potential": potential, "stiffness": stiffness, "k": k}
    law = {name: value for name, value in law.items() if value is not None}
    format = format or format_of(content)
    with about(path):
        check_uncompressed(content, path)
        if format:
            disks = _read_exchanged(content, index, format, radius, box, law)
        elif law or radius or box is not None:
            raise InputError(
                "radii, box and potential are fixed by its program. Leave out the options for them."
            )
        elif content != SIGNATURE:
            disks = _checked(_read_jambashbulk(content.decode(errors="replace"), index))
    if not format and content == SIGNATURE:
        with open_file(path) as h5, about(path):  # what `open_file` raises names the file
            disks = _checked(_read_jaxmd(h5, index))
    return disks.with_record(imported_from=Path(path).name, imported_index=index)


def read_content(path, whole=True) -> bytes:
    """The bytes of a file of another program; of HDF5 only its signature unless `whole`. Raises InputError."""
    try:
        with open_regular(path) as file:
            content = file.read(len(SIGNATURE))
            if whole or content != SIGNATURE:
                content += file.read(_MAX_TEXT_BYTES)
    except OSError as error:
        raise InputError(
            f"{path}: not readable ({error.strerror}). Check its name and permissions."
        ) from None
    if len(content) > _MAX_TEXT_BYTES:
        raise InputError(
            f"{path}: too large (at most {_MAX_TEXT_BYTES >> 20} MB). Cut the packing out of it."
        )
    return content


def read_table(content, index, format):
    """The `DiskTable` of a file in a format of READERS. Raises InputError."""
    try:
        return READERS[format](content, index)
    except UnicodeDecodeError:
        raise InputError(f"{format}: not a text file. Give another {named('format')}.") from None


def _read_exchanged(content, index, format, radius, box, law):
    table = read_table(content, index, format)
    cell = box_of(table, box)
    radii, law = radii_in(table.columns, radius), table.law | law
    positions, box = table.places(PLANE_TOLERANCE * float(np.max(radii, initial=0.0)))
    record = {"protocol": format} | ({"units": law.pop("units")} if "units" in law else {})
    assumed = ", ".join(name for name in LAW if name not in law)
    disks = Packing(positions, radii, cell if box is None else box, **law)
    return disks.with_record(**record, **({"assumed": assumed} if assumed else {}))


def box_of(table, box):
    """The box of a file, or the one given for a file without. Raises InputError for both or none."""
    if (table.box is None) == (box is None):
        raise InputError(
            f"no box. Give {named('box')}, as L, Lx,Ly or Lx,Ly,xy, of spheres Lx,Ly,Lz."
            if box is None
            else f"a box in the file. Leave out {named('box')}."
        )
    return table.box if box is None else box


def _checked(disks):
    """The disks with measurements. Raises InputError if pressure or energy are not the published ones."""
    disks = disks.with_measurements()
    for name in ("pressure", "energy"):
        value, published = disks.record[name], disks.record.get(f"published_{name}")
        if published is not None and not abs(value - published) <= _PUBLISHED_TOLERANCE * abs(published):
            raise InputError(
                f"{name} is {value:.9g} with these positions but stored as {published:.9g}: "
                "another potential or unit than assumed, or a damaged file. Get it again."
            )
    return disks


def _read_jambashbulk(text, index):
    packings = re.split(r"(?m)^(?=[ \t]*N\s*=)", re.sub(r"(?m)^\s*#.*$", "", text))[1:]
    if not packings or "L1" not in packings[0]:
        raise InputError(f"none of {', '.join(READERS)}, jamBashbulk, jax-md. Give its {named('format')}.")
    packing = packings[check_index(index, len(packings))]

    def header_numbers(name, pattern=_NUMBER):
        match = re.search(rf"\b{name}\s*=\s*{pattern}", packing)
        if match is None:
            raise InputError(f"no {name} = … in the header: truncated or edited. Get it again.")
        return to_numbers(match.groups())

    cell = [header_numbers(name, rf"\{{\s*{_NUMBER}\s*,\s*{_NUMBER}\s*\}}") for name in ("L1", "L2")]
    (n,), (pressure,) = header_numbers("N", r"(\d+)"), header_numbers("P")
    body = re.search(r"\{([^{}]*)(\}?)\s*\Z", packing)
    rows = re.findall(rf"{_NUMBER}\s*,\s*{_NUMBER}\s*,\s*{_NUMBER}", body[1]) if body else []
    if len(rows) != n or not body[2]:
        raise InputError(
            f"{len(rows)} lines x, y, r for N = {n:g} particles: truncated or edited. Get it again."
        )
    table = np.array([to_numbers(row) for row in rows])
    return Packing.from_positions(
        table[:, :2],
        table[:, 2],
        cell,
        Potential("harmonic", "constant", 1.0),
        record={"protocol": "jamBashbulk", "published_pressure": float(pressure)},
    )


def _read_jaxmd(h5, index):
    if str(h5.attrs.get("format", "")).startswith("jampetsc"):
        raise InputError(f"already a {h5.attrs['format']} file. Use it without import.")
    missing = [name for name in ("pos", "rad", "box") if name not in h5]
    if missing:
        raise InputError(
            f"no variable {', '.join(missing)}, hence not a packing of jax-md. Give another file."
        )
    check_index(index, len(h5["pos"]))
    names = ("pos", "rad", "box", "Energy", "Stress", "Cijkl")
    data = {name: np.asarray(values(h5[name], index), float) for name in names if name in h5}
    dimension = {(4,): 2, (9,): 3}.get(data["box"].shape, 0)
    if not dimension or data["pos"].shape != (dimension * len(data["rad"]),):
        raise InputError(
            f"{data['pos'].size} coordinates for {data['rad'].size} particles in a box of {data['box'].size} numbers: "
            "neither two- nor three-dimensional. Get it again."
        )
    # jax-md maps a fraction s to box · s: cell vectors are its columns
    cell = data["box"].reshape(dimension, dimension).T
    published = {"published_energy": float(data["Energy"])} if "Energy" in data else {}
    if "Stress" in data:
        names = ("".join(pair) for pair in itertools.product("xyz"[:dimension], repeat=2))
        stress = dict(zip(names, data["Stress"].tolist(), strict=True))
        published |= {f"published_stress_{name}": value for name, value in stress.items()}
        published["published_pressure"] = -sum(stress[2 * axis] for axis in "xyz"[:dimension]) / dimension
    if "Cijkl" in data:
        published |= {
            f"published_C_{name}": c
            for name, c in zip(_MODULUS_COMPONENTS[dimension], data["Cijkl"].tolist(), strict=True)
        }
    return Packing.from_positions(
        data["pos"].reshape(-1, dimension) @ cell,
        data["rad"],
        cell,
        Potential("harmonic", "inverse-square-diameter", 1.0),
        record={"protocol": "jax-md", **published},
    )


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
    return to_numbers(columns[names[0]]) / (2.0 if names[0].lower().startswith("diameter") else 1.0)


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
            f"no radius for type {', '.join(missing[:5])}. Give one for each type by {named('radius')}, "
            f"which has {', '.join(radii)}."
        )
    return np.array([float(radii[str(type)]) for type in _type_column(columns)])


def _type_column(columns):
    return next((columns[name] for name in columns if name.lower() in TYPES), ())


def _types(columns) -> list:
    """The types of the disks, in words, sorted."""
    return sorted({str(type) for type in _type_column(columns)})

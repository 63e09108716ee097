"""Disks as simulation programs write them: LAMMPS data and dump, extended XYZ, GSD, columns x y r, numpy's npz.

Every reader gives a `DiskTable`. Errors do not name the file.
"""

import io
import re
import shlex
import zipfile
import zlib
from dataclasses import dataclass, field

import numpy as np

from jampetsc.errors import InputError, MissingPackage, named
from jampetsc.packing.potentials import EXPONENTS

LAW = ("potential", "stiffness", "k")  # entries of a file on its forces, see `packing.potentials`
STYLES = {  # columns of Atoms in LAMMPS data files
    "sphere": "id type diameter density x y z",
    "bpm/sphere": "id mol type diameter density x y z",
    "atomic": "id type x y z",
    "charge": "id type q x y z",
    "bond": "id mol type x y z",
    "molecular": "id mol type x y z",
    "full": "id mol type q x y z",
}
FLAT_BOX = "the box is tilted out of the plane in which all centres lie"
COMPRESSIONS = {  # first bytes -> (program, command that decompresses)
    b"\x1f\x8b": ("gzip", "gunzip --keep"),
    b"\x1f\x9d": ("compress", "uncompress"),
    b"BZh": ("bzip2", "bunzip2 --keep"),
    b"\xfd7zXZ\x00": ("xz", "unxz --keep"),
    b"\x28\xb5\x2f\xfd": ("zstd", "unzstd"),
    b"\x04\x22\x4d\x18": ("lz4", "unlz4"),
    b"7z\xbc\xaf\x27\x1c": ("7z", "7z x"),
}


@dataclass(frozen=True, eq=False)
class DiskTable:
    """Disks as a file of another program has them."""

    columns: dict  # name in the file -> (N,) words or numbers
    positions: np.ndarray  # (N, 2) or (N, 3)
    box: object  # in a form that `packing.cell.cell_of` takes; None where the file has none
    law: dict = field(default_factory=dict)  # name of LAW, or units -> what the file says
    # of a box (3, 3), as programs have it for disks as well: whether it repeats along z; None: positions say D
    is_deep: bool | None = None

    def places(self, tolerance: float = 0.0):
        """(positions (N, D), box): disks in a plane where z is the same for all, but for the tolerance.

        Raises InputError for a box that does not fit.
        """
        positions = np.asarray(self.positions, float)
        if self.is_deep is None:
            return positions, self.box
        spread = np.ptp(positions[:, 2]) if positions.shape[1] == 3 else 0.0
        if spread <= tolerance:
            if self.box[2, :2].any() or self.box[:2, 2].any():
                raise InputError(FLAT_BOX)
            return positions[:, :2], self.box[:2, :2]
        if not self.is_deep:
            raise InputError(
                f"centres spread by {spread:.6g} in z, along which the box is not periodic. Give disks in one plane, "
                "or spheres in a periodic box."
            )
        return positions, self.box


def force_law_of(entries) -> dict:
    """The entries {key: value} of a file that are of LAW, or units; none where `potential` is not one of jampetsc.

    Other programs may use these keys for something else.
    """
    law = {name: entries[name] for name in (*LAW, "units") if name in entries}
    return law if law.get("potential") in EXPONENTS else {}


def law_in(text) -> dict:
    """`force_law_of` the words key=value of a text."""
    return force_law_of({key: value.strip('"') for key, value in re.findall(r'(\w+)=("[^"]*"|\S+)', text)})


def to_numbers(words):
    """Words as an array of numbers. Raises InputError."""
    try:
        return np.asarray(words, float)
    except (TypeError, ValueError):
        shown = " ".join(map(str, list(words)[:5]))
        raise InputError(f"{shown}{' …' if len(words) > 5 else ''}: not numbers. Correct the file.") from None


def is_number(word):
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", str(word), re.IGNORECASE) is not None


def check_uncompressed(content, path):
    """Raise InputError, with the command that decompresses the file, where a program has compressed it."""
    compressions = dict(COMPRESSIONS)
    first_name = content[30 : 30 + int.from_bytes(content[26:28], "little")]
    if first_name and not first_name.endswith(b".npy"):  # otherwise a zip file of numpy
        compressions[b"PK"] = "zip", "unzip"
    for start, (program, command) in compressions.items():
        if content.startswith(start):
            raise InputError(
                f"compressed by {program}. Decompress it first: {command} {shlex.quote(str(path))}"
            )


def check_index(index, count):
    """`index`, if it is less than the number of packings. Raises InputError."""
    if not 0 <= index < count:
        raise InputError(
            f"{named('index')} {index}: no such packing ({count}, numbered from 0). Choose another."
        )
    return index


def _places(columns, names="xyz"):
    """(N, 2) or (N, 3) coordinates from the columns of these names, the last of which may be missing."""
    return np.column_stack([to_numbers(columns[name]) for name in names if name in columns])


def read_lammps_dump(content, index):
    """Snapshot `index` of a LAMMPS dump: wrapped, unwrapped or scaled coordinates, disks in the order of their id."""
    items = [item.partition("\n") for item in re.split(r"(?m)^ITEM: ", content.decode())[1:]]
    ends = [n for n, (title, _, _) in enumerate(items) if title.startswith("ATOMS")]
    end = ends[check_index(index, len(ends))]
    sections = {title.split()[0]: (title.split(), body) for title, _, body in items[: end + 1]}
    if not {"NUMBER", "BOX"} <= set(sections):
        raise InputError("ITEM: NUMBER OF ATOMS or BOX BOUNDS missing: truncated or edited. Get it again.")
    words, body = sections["BOX"]
    general, tilted = "abc" in words, "xy" in words
    flags = words[4 if general else 5 if tilted else 2 :]
    if any(flag != "pp" for flag in flags[:2]):
        raise InputError(f"ITEM: {' '.join(words)}: must be periodic (pp) in x and y")
    rows = _table(body, 3, 4 if general else 3 if tilted else 2)
    if general:  # a row for each cell vector, and the origin, as OVITO writes them
        cell, low = rows[:, :3], rows[:, 3]
    else:  # bounds of the tilted box
        tilt = rows[:, 2] if tilted else np.zeros(3)  # xy, xz, yz
        ends = 0.0, tilt[0], tilt[1], tilt[0] + tilt[1]
        rows[0, :2] -= min(ends), max(ends)
        rows[1, :2] -= min(0.0, tilt[2]), max(0.0, tilt[2])
        cell, low = np.diag(rows[:, 1] - rows[:, 0]), rows[:, 0]
        cell[1, 0], cell[2, :2] = tilt[0], tilt[1:]
    columns = _columns(sections["ATOMS"][0][1:], _rows(sections["ATOMS"][1], _count(sections["NUMBER"][1])))
    for kind in ("", "u", "s", "su"):  # as they are, unwrapped, scaled by the cell
        if {f"x{kind}", f"y{kind}"} <= columns.keys():
            break
    else:
        raise InputError(
            f"no coordinates x y, xu yu, xs ys or xsu ysu among {', '.join(columns)}. Write them to the dump."
        )
    place = _places(columns, [axis + kind for axis in "xyz"])
    if "s" in kind:
        axes = place.shape[1]
        place = place @ cell[:axes, :axes] + low[:axes]
    law = law_in(sections["UNITS"][1] if "UNITS" in sections else "")
    return DiskTable(columns, place, cell, law, flags[2:3] in ([], ["pp"]))


def read_lammps_data(content, index):
    """A LAMMPS data file of one of STYLES."""
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

    if re.search(r"\bavec\b", header):  # cell vectors, as OVITO writes them
        cell = np.array([to_numbers(header_words(vector, 3)) for vector in ("avec", "bvec", "cvec")])
    else:
        (x0, x1), (y0, y1) = to_numbers(header_words("xlo xhi", 2)), to_numbers(header_words("ylo yhi", 2))
        z0, z1 = to_numbers(header_words("zlo zhi", 2, [0, 1]))
        xy, xz, yz = to_numbers(header_words("xy xz yz", 3, [0, 0, 0]))
        cell = np.array([[x1 - x0, 0.0, 0.0], [xy, y1 - y0, 0.0], [xz, yz, z1 - z0]])
    rows = _rows(body, _count(header_words("atoms", 1)[0]))
    columns = _columns(STYLES[style].split(), rows)
    return DiskTable(columns, _places(columns), cell, law_in(title), True)


def read_extxyz(content, index):
    """Frame `index` of an extended XYZ file: Properties with pos, and Lattice if it has one."""
    lines, starts = content.decode().rstrip().splitlines(), []
    at = 0
    while at < len(lines):
        starts.append(at)
        at += 2 + _count(lines[at])
    first = starts[check_index(index, len(starts))]
    try:
        words = shlex.split(lines[first + 1])
    except (IndexError, ValueError):
        raise InputError(f"line {first + 2}: not key=value of extended XYZ. Correct the file.") from None
    entries = {key: value for key, _, value in (word.partition("=") for word in words)}
    names = []
    properties = entries.get("Properties", "species:S:1:pos:R:3").split(":")
    for name, width in zip(properties[::3], map(_count, properties[2::3]), strict=False):
        several = "xyz"[:width] if name == "pos" else [f"{name}{column}" for column in range(width)]
        names += several if width > 1 else [name]
    count = _count(lines[first])
    columns = _columns(names, _rows("\n".join(lines[first + 2 : first + 2 + count]), count))
    if not {"x", "y"} <= set(columns):
        raise InputError(f"no pos among the Properties {', '.join(properties[::3])}. Add it to the file.")
    law, place = force_law_of(entries), _places(columns)
    if "Lattice" not in entries:
        return DiskTable(columns, place, None, law)
    lattice = to_numbers(entries["Lattice"].split())
    if lattice.shape != (9,):
        raise InputError(f'Lattice="{entries["Lattice"]}": must be nine numbers, the rows a₁, a₂ and a₃')
    periodic = [flag[0] in "Tt1" for flag in entries.get("pbc", "T T T").split()]
    if not all(periodic[:2]):
        raise InputError(f'pbc="{entries["pbc"]}": must be periodic in x and y')
    return DiskTable(columns, place, lattice.reshape(3, 3), law, all(periodic))


def read_xyr(content, index):
    """Lines x y r, of nodes x y; a line `box L`, `box Lx Ly` or `box Lx Ly xy`, which may be a comment (#), if any."""
    check_index(index, 1)
    rows, box = _xyr(content.decode())
    width = 2 if all(len(row) == 2 for row in rows) else 3
    columns = _columns(("x", "y", "radius")[:width], rows)
    return DiskTable(columns, _places(columns), None if box is None else to_numbers(box[1].split()))


def _xyr(text):
    """(rows of words, match of the line of the box or None)."""
    text = re.sub("[,;:=]", " ", text)
    box = re.search(r"(?mi)^[ \t#]*box\b(.*)$", text)
    rows = [line.split() for line in re.sub(r"(?mi)#.*|^[ \t]*box\b.*", "", text).splitlines()]
    return [row for row in rows if row], box


def read_npz(content, index):
    """Arrays positions, radii or diameters, and box or cell of numpy.savez."""
    check_index(index, 1)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = dict(file)
    except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"not arrays of numpy.savez, or damaged ({error}). Get it again.") from None
    if "positions" not in arrays:
        raise InputError(f"no array positions among {', '.join(arrays)}. Add it to the file.")
    law = {name: arrays.pop(name).item() for name in (*LAW, "units") if np.ndim(arrays.get(name, [])) == 0}
    return DiskTable(arrays, arrays["positions"], arrays.get("box", arrays.get("cell")), law)


def read_gsd(content, index):
    """Frame `index` of a GSD file of HOOMD-blue, read by the package gsd."""
    try:
        import gsd.hoomd
        import gsd.pygsd
    except ImportError:
        raise MissingPackage("GSD", "gsd") from None
    try:
        frames = gsd.hoomd.HOOMDTrajectory(gsd.pygsd.GSDFile(io.BytesIO(content)))
        frame = frames[check_index(index, len(frames))]
    except InputError:
        raise
    except (OSError, RuntimeError, LookupError, ValueError) as error:
        raise InputError(f"not a file of GSD, or damaged ({error or 'truncated'}). Get it again.") from None
    box = np.asarray(frame.configuration.box, float)
    logged = frame.log.get("configuration/box", box)  # the same in double precision, in exports of jampetsc
    Lx, Ly, Lz, xy, xz, yz = logged if np.array_equal(np.asarray(logged, np.float32), box) else box
    cell = np.array([[Lx, 0.0, 0.0], [xy * Ly, Ly, 0.0], [xz * Lz, yz * Lz, Lz]])
    particles = frame.particles
    columns = {"diameter": particles.diameter, "type": [particles.types[row] for row in particles.typeid]}
    texts = {n: v.tobytes().decode(errors="replace") for n, v in frame.log.items() if v.dtype == np.uint8}
    values = {n: v.item() for n, v in frame.log.items() if v.size == 1}
    is_deep = frame.configuration.dimensions != 2 and Lz > 0.0
    return DiskTable(columns, particles.position, cell, force_law_of(values | texts), is_deep)


READERS = {
    "lammps-data": read_lammps_data,
    "lammps-dump": read_lammps_dump,
    "extxyz": read_extxyz,
    "gsd": read_gsd,
    "xyr": read_xyr,
    "npz": read_npz,
}


def format_of(content) -> str | None:
    """Which of READERS reads this content; None where it looks like none of them."""
    if content.startswith(b"\xdf\x65" * 4):
        return "gsd"
    if content.startswith(b"PK"):
        return "npz"
    text = content[: 1 << 16].decode(errors="replace")
    looks = {
        "lammps-dump": r"\s*ITEM: ",
        "extxyz": r"\s*\d+[ \t]*\r?\n.*\b(Lattice|Properties)=",
        "lammps-data": r"(?s).*\b(xlo[ \t]+xhi|avec)\b",
    }
    format = next((name for name, look in looks.items() if re.match(look, text)), None)
    first = _xyr(text)[0][:1]
    return (
        "xyr"
        if format is None and first and len(first[0]) in (2, 3) and all(map(is_number, first[0]))
        else format
    )


def _rows(body, count):
    """The words of the first `count` lines that are not empty. Raises InputError where there are fewer."""
    rows = [line.split() for line in body.splitlines() if line.strip()][:count]
    if len(rows) != count:
        raise InputError(f"{len(rows)} lines for {count} particles: truncated or edited. Get it again.")
    return rows


def _columns(names, rows):
    """{name: words of the column}, by `id` where there is one; further columns are left out. Raises InputError."""
    if not rows:
        raise InputError("no particles. Give a file with particles.")
    for row in rows:
        if len(row) < len(names):
            raise InputError(f"line {' '.join(row)!r}: not {' '.join(names)}. Correct the file.")
    columns = dict(zip(names, zip(*rows, strict=False), strict=False))
    if "id" in columns:
        order = np.argsort(to_numbers(columns["id"]), kind="stable")
        columns = {name: [column[row] for row in order] for name, column in columns.items()}
    return columns


def _table(body, rows, columns):
    table = [to_numbers(row) for row in _rows(body, rows)]
    if any(len(row) != columns for row in table):
        raise InputError(f"{body.strip()!r}: not {rows} lines of {columns} numbers. Correct the file.")
    return np.array(table)


def _count(word):
    if not re.fullmatch(r"\s*\d+\s*", word):
        raise InputError(f"{word.strip()!r}: not a number of particles. Correct the file.")
    return int(word)

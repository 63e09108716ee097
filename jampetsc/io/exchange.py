"""Formats of simulation programs by their names, and which of them a content is.

Every reader gives a `DiskTable`. Errors do not name the file.
"""

import io
import re
import shlex
import zipfile
import zlib

import numpy as np

from jampetsc.errors import InputError, MissingPackage, named
from jampetsc.io.column_reader import TextTable, looks_like_xyz, read_xyr, read_xyz
from jampetsc.io.disk_table import DiskTable, check_index, potential_of
from jampetsc.io.lammps_reader import read_lammps_data, read_lammps_dump
from jampetsc.packing.potentials import SETTINGS

_HEAD_BYTES = 1 << 16  # by which a format is recognised
MAX_UNPACKED_BYTES = 1 << 29  # of all arrays of an npz file
# of zipfile and numpy
DAMAGE_ERRORS = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    LookupError,
)
DAMAGE_ERRORS += (ArithmeticError, zipfile.BadZipFile, zlib.error)
GSD_COUNTS = tuple(
    f"{kind}/N" for kind in ("particles", "bonds", "angles", "dihedrals", "impropers", "constraints", "pairs")
)
COMPRESSIONS = {  # first bytes -> (program, command that decompresses)
    b"\x1f\x8b": ("gzip", "gunzip --keep"),
    b"\x1f\x9d": ("compress", "uncompress"),
    b"BZh": ("bzip2", "bunzip2 --keep"),
    b"\xfd7zXZ\x00": ("xz", "unxz --keep"),
    b"\x28\xb5\x2f\xfd": ("zstd", "unzstd"),
    b"\x04\x22\x4d\x18": ("lz4", "unlz4"),
    b"7z\xbc\xaf\x27\x1c": ("7z", "7z x"),
}
SAVEZ = "numpy.savez('p.npz', positions=…, radii=…, box=…)"
OTHER_FORMATS = {  # beginning -> (what it is, what to do)
    rb"MATLAB ": (
        "a file of MATLAB",
        f"In MATLAB writematrix([x y r], 'p.txt'), or in python scipy.io.loadmat and {SAVEZ}.",
    ),
    rb"\x93NUMPY": ("one array of numpy.save", f"Save arrays by name: {SAVEZ}."),
    rb"\x80[\x02-\x05]": ("a pickle of python", f"Save its arrays by {SAVEZ}."),
    rb"CDF[\x01\x02\x05]": ("netCDF 3, as of LAMMPS' dump netcdf", "Write a dump of style custom instead."),
    rb"\s*<(\?xml|VTKFile)": ("XML, as of VTK", "Give the table of points as csv with x, y and radius."),
    rb"# vtk ": ("a legacy file of VTK", "Give the table of points as csv with x, y and radius."),
    rb"---\s*\ncreator: LAMMPS": ("a dump of style yaml of LAMMPS", "Write a dump of style custom instead."),
    rb"LammpS RestartT": ("a restart file of LAMMPS", "Write it as data: lammps -restart2data FILE p.data."),
    rb"%PDF|\x89PNG|\xff\xd8\xff": ("a picture or document", "Give the file of the packing."),
}


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


def read_npz(content, index):
    """Arrays positions, radii or diameters, and box or cell of numpy.savez."""
    check_index(index, 1)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MAX_UNPACKED_BYTES:
            raise InputError(
                f"{size / 2**20:.0f} MB unpacked (at most {MAX_UNPACKED_BYTES >> 20}). Save fewer arrays."
            )
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {name: value for name, value in file.items() if isinstance(value, np.ndarray)}
    except InputError:
        raise
    except DAMAGE_ERRORS as error:
        words = " ".join(str(error).split())
        raise InputError(f"not arrays of numpy.savez, or damaged ({words}). Get it again.") from None
    if "positions" not in arrays:
        raise InputError(f"no array positions among {', '.join(arrays)}. Add it to the file.")
    potential = {
        name: arrays.pop(name).item() for name in (*SETTINGS, "units") if np.ndim(arrays.get(name, [])) == 0
    }
    return DiskTable(arrays, arrays["positions"], arrays.get("box", arrays.get("cell")), potential)


def read_gsd(content, index):
    """Frame `index` of a GSD file of HOOMD-blue, read by the package gsd."""
    try:
        import gsd.hoomd
        import gsd.pygsd
    except ImportError:
        raise MissingPackage("GSD", "gsd") from None
    try:
        file = gsd.pygsd.GSDFile(io.BytesIO(content))
        frames = gsd.hoomd.HOOMDTrajectory(file)
        number = check_index(index, len(frames))
        _check_counts(file, {0, number}, len(content))
        frame = frames[number]
        types = [frame.particles.types[row] for row in frame.particles.typeid]
    except InputError:
        raise
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, ArithmeticError) as error:
        raise InputError(f"not a file of GSD, or damaged ({error or 'truncated'}). Get it again.") from None
    box = np.asarray(frame.configuration.box, float)
    logged = frame.log.get("configuration/box", box)  # the same in double precision, in exports of jampetsc
    Lx, Ly, Lz, xy, xz, yz = logged if np.array_equal(np.asarray(logged, np.float32), box) else box
    cell = np.array([[Lx, 0.0, 0.0], [xy * Ly, Ly, 0.0], [xz * Lz, yz * Lz, Lz]])
    particles = frame.particles
    columns = {"diameter": particles.diameter, "type": types}
    texts = {n: v.tobytes().decode(errors="replace") for n, v in frame.log.items() if v.dtype == np.uint8}
    values = {n: v.item() for n, v in frame.log.items() if v.size == 1}
    is_plane = frame.configuration.dimensions == 2 or not Lz > 0.0
    potential, D = potential_of(values | texts), 2 if is_plane else None
    return DiskTable(columns, particles.position, cell, potential, number, dimension=D)


def _check_counts(file, frames, size) -> None:
    """Raise InputError where a GSD file claims more particles or bonds than its `size` in bytes can hold."""
    for frame in frames:
        for name in GSD_COUNTS:
            count = int(file.read_chunk(frame, name)[0]) if file.chunk_exists(frame, name) else 0
            if count > size:
                raise InputError(f"{name} = {count}: more than the file holds. Get it again.")


READERS = {
    "lammps-data": read_lammps_data,
    "lammps-dump": read_lammps_dump,
    "extxyz": read_xyz,
    "gsd": read_gsd,
    "xyr": read_xyr,
    "npz": read_npz,
}
NAMED_BY_OPTION = ("xyr", "extxyz")  # formats whose columns `columns` may name


def read_table(content, index, format, columns=None) -> DiskTable:
    """The table of a file in a format of READERS. Raises InputError.

    columns   names of its columns, "x,y,r" or a sequence; None: as the file has them
    """
    options = {}
    if columns is not None:
        if format not in NAMED_BY_OPTION:
            raise InputError(
                f"{named('columns')}: an option of {' and '.join(NAMED_BY_OPTION)}, not of {format}. Leave it out."
            )
        words = columns.split(",") if isinstance(columns, str) else columns
        options["columns"] = [str(word).strip() for word in words]
    try:
        return READERS[format](content, index, **options)
    except UnicodeDecodeError:
        raise InputError(f"{format}: not a text file. Give another {named('format')}.") from None


def format_of(content) -> str | None:
    """Which of READERS reads this content; None where it looks like none of them."""
    if content.startswith(b"\xdf\x65" * 4):
        return "gsd"
    if content.startswith(b"PK"):
        return "npz"
    text = content[:_HEAD_BYTES].decode(errors="replace")
    if len(content) > _HEAD_BYTES:
        text = text.rpartition("\n")[0]  # whole lines
    if re.match(r"\s*ITEM: ", text):
        return "lammps-dump"
    if looks_like_xyz(text):
        return "extxyz"
    if re.search(r"\b(xlo[ \t]+xhi|avec)\b", text):
        return "lammps-data"
    return "xyr" if TextTable(text).is_table else None


def refuse_unknown(content, other_names):
    """Raise InputError that names the format of a content that no reader takes, where it is a common one.

    other_names   formats without a name of READERS, for the message
    """
    for start, (what, remedy) in OTHER_FORMATS.items():
        if re.match(start, content):
            raise InputError(f"{what}: not supported. {remedy}")
    raise InputError(
        f"none of {', '.join((*READERS, *other_names))}. Give its {named('format')}, or lines x y r, or a table whose "
        f"title line names x, y and r; {SAVEZ} for arrays."
    )

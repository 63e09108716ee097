"""The packing file: positions, radii and cell in HDF5, with how the packing was made as attributes.

Datasets `positions` (N, 2), `radii` (N,), `cell` (2, 2) rows a1, a2, and the parts one double cannot hold,
`positions_low` (N, 2) and `cell_low` (2, 2), which may be missing. Attributes `format`, `format_version`,
`potential`, `stiffness`, `k` (1 if missing), then the record: pressure, phi, energy, max_force, seed, …
"""

import hashlib
from pathlib import Path

import h5py
import numpy as np

from jampetsc.contacts.disks import Disks, join
from jampetsc.contacts.potentials import EXPONENTS, STIFFNESSES, Potential
from jampetsc.errors import InputError
from jampetsc.storage.atomic import OutputFile
from jampetsc.storage.hdf5 import attributes, check_format, open_file, reading

FORMAT = "jampetsc-packing"
FORMAT_VERSION = "1.0"
_HEADER = ("format", "format_version", "potential", "stiffness", "k")


def write_packing(path, disks: Disks) -> None:
    """Write `disks` with its record (scalars and strings; None is left out), atomically, to the last bit.

    Raises InputError or JampetscError if the file cannot be written.
    """
    positions, positions_low = join(disks.base, disks.offset)
    cell, cell_low = join(disks.cell_base, disks.cell_offset)
    datasets = {"positions": positions, "positions_low": positions_low, "radii": disks.radii}
    datasets |= {"cell": cell, "cell_low": cell_low}
    header = (
        FORMAT,
        FORMAT_VERSION,
        disks.potential.kind,
        disks.potential.stiffness,
        float(disks.potential.k),
    )
    record = {
        name: value for name, value in disks.record.items() if value is not None and name not in _HEADER
    }
    with OutputFile(path) as h5:
        h5.attrs.update(dict(zip(_HEADER, header, strict=True)) | record)
        for name, array in datasets.items():
            h5.create_dataset(name, data=array)


def read_packing(path) -> Disks:
    """Read a packing file. Raises InputError naming the file, what is wrong with it and the remedy."""
    with open_file(path) as h5:
        return packing_from(h5, path)


def packing_from(h5, path) -> Disks:
    """Disks from an open packing file; `path` is for messages. Raises InputError."""
    with reading(path):
        attrs = attributes(h5)
    check_format(path, attrs, FORMAT)
    arrays = {name: _array(h5, path, name) for name in ("positions", "radii", "cell")}
    arrays |= {name: _array(h5, path, name) for name in ("positions_low", "cell_low") if name in h5}
    if not np.isfinite(arrays.get("cell_low", 0.0)).all():
        raise InputError(f"{path}: cell_low {arrays['cell_low'].tolist()}: must be finite")
    for name, choices in (("potential", EXPONENTS), ("stiffness", STIFFNESSES)):
        if attrs.get(name) not in choices:
            found = f"attribute {name} = {attrs[name]!r}" if name in attrs else f"attribute {name} is missing"
            raise InputError(f"{path}: {found}: must be one of {', '.join(choices)}")
    try:
        stiffness = float(attrs.get("k", 1.0))
    except (TypeError, ValueError):
        raise InputError(f"{path}: attribute k = {attrs['k']!r}: must be a positive number") from None
    record = {name: value for name, value in attrs.items() if name not in _HEADER}
    try:
        potential = Potential(attrs["potential"], attrs["stiffness"], stiffness)
        return Disks.from_positions(**arrays, potential=potential, record=record)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _array(h5, path, name):
    if not isinstance(h5.get(name), h5py.Dataset):
        raise InputError(f"{path}: dataset {name} is missing: a packing needs positions, radii and cell")
    with reading(path):
        data = h5[name]
        if data.dtype.kind not in "fiu":
            raise InputError(f"{path}: dataset {name} holds {data.dtype}: must be real numbers")
        return data[...].astype(float)


def packing_identity(path) -> tuple[str, str]:
    """(name, sha256) of a packing file, by which results refer to it.

    Raises InputError if it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    return Path(path).name, digest.hexdigest()


def is_complete(path, **record) -> bool:
    """Whether `path` is a sound packing file whose record agrees with every entry given here."""
    try:
        found = read_packing(path).record
    except InputError:
        return False
    return all(name in found and found[name] == value for name, value in record.items())

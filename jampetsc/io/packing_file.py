"""Files of packings and networks in HDF5, with how they were made as attributes.

A packing has datasets `positions` (N, D), `radii` (N,), `cell` (D, D) rows a1, a2, …, and the parts one double cannot
hold, `positions_low` (N, D) and `cell_low` (D, D), which may be missing. Attributes are `format`, `format_version`,
the entries of `Potential.record` (`k` is 1 if missing), then the record: pressure, phi, energy, max_force, seed, … A
network has its nodes, bonds and their stiffnesses.
"""

import os
from pathlib import Path

from jampetsc.collective import on_root
from jampetsc.errors import InputError, about
from jampetsc.io.formats import check_file
from jampetsc.io.hdf5 import (
    OutputFile,
    attributes,
    check_format,
    open_file,
    set_attributes,
    store,
    values,
)
from jampetsc.io.outputs import check_replaced
from jampetsc.packing.packing import Packing
from jampetsc.packing.particles import join
from jampetsc.packing.potentials import SETTINGS, Potential
from jampetsc.packing.spring_network import Network
from jampetsc.version import FORMAT_VERSION

FORMAT = "jampetsc-packing"
ARRAYS = ("positions", "radii", "cell", "positions_low", "cell_low")
_HEADER = ("format", "format_version", *SETTINGS)
_FILE_ATTRIBUTES = (*_HEADER, "request")  # attributes that are no record of the disks
NETWORK_FORMAT = "jampetsc-network"
NETWORK_ARRAYS = ("positions", "bonds", "images", "cell", "stiffness", "tension")
_NETWORK_HEADER = (
    "format",
    "format_version",
    "k",
    "request",
)  # attributes that are no record of the network


def write_packing(path, disks: Packing, request=None) -> None:
    """Write `disks` with its record (scalars and strings; None is left out), atomically, to the last bit.

    request   settings of the run, a `request.Request`, where the record does not have them

    Raises InputError or JampetscError if the file cannot be written.
    """
    positions, positions_low = join(disks.base, disks.offset)
    cell, cell_low = join(disks.cell_base, disks.cell_offset)
    datasets = {"positions": positions, "positions_low": positions_low, "radii": disks.radii}
    datasets |= {"cell": cell, "cell_low": cell_low}
    header = {"format": FORMAT, "format_version": FORMAT_VERSION} | disks.potential.record
    record = {name: value for name, value in disks.record.items() if name not in _FILE_ATTRIBUTES}
    check_replaced(path, FORMAT)
    with OutputFile(path) as h5:
        set_attributes(h5, header | record)
        set_attributes(h5, {"request": request and request.text})
        for name, array in datasets.items():
            store(h5, name, array)


def read_packing(path) -> Packing:
    """Read a packing file. Raises InputError naming the file, what is wrong with it and the remedy."""
    with open_file(path) as h5:
        return packing_from(h5, path)


def source_name(source) -> str:
    """Name of a packing or a network in messages: its file, or "the packing", "the network" in memory."""
    if isinstance(source, str | os.PathLike):
        return str(source)
    return "the packing" if isinstance(source, Packing) else "the network"


def read_identified(source, comm=None, read=read_packing) -> tuple[Packing, tuple[str | None, str]]:
    """A packing and its identity, by which results refer to it: (name of the file, `Packing.fingerprint`).

    source   a file, or a Packing, the same on all ranks, which is returned with the name None
    read     read(path); `read_source` where networks are read too
    comm     mpi4py communicator, whose rank 0 alone reads the file, so that all ranks have the same packing even if the
           file is replaced meanwhile; None: one process

    Collective. Raises InputError as `read`, on all ranks.
    """
    if not isinstance(source, str | os.PathLike):
        return source, (None, source.fingerprint)
    name, loaded = on_root(comm, lambda: (Path(source).name, read(source)))
    return loaded, (name, loaded.fingerprint)


def check_packing(path) -> None:
    """Raise InputError unless `path` has the header of a packing file: a check before long work."""
    with open_file(path) as h5:
        check_file(h5, path, FORMAT)


def packing_from(h5, path) -> Packing:
    """The packing of an open file; `path` is for messages. Raises InputError."""
    _, attrs, datasets = check_file(h5, path, FORMAT)
    for name in ("positions", "radii", "cell"):
        if name not in datasets:
            raise InputError(
                f"{path}: dataset {name}: missing. Give a packing with positions, radii and cell."
            )
    arrays = {name: values(datasets[name]).astype(float) for name in ARRAYS if name in datasets}
    record = {name: value for name, value in attrs.items() if name not in _FILE_ATTRIBUTES}
    with about(path):
        return Packing.from_positions(**arrays, potential=Potential.of_record(attrs), record=record)


def write_network(path, network: Network, request=None) -> None:
    """Write a network with its record (scalars and strings; None is left out), atomically, to the last bit.

    request   settings of the run, a `request.Request`, where the record does not have them

    Raises InputError or JampetscError if the file cannot be written.
    """
    record = {name: value for name, value in network.record.items() if name not in _NETWORK_HEADER}
    check_replaced(path, NETWORK_FORMAT)
    with OutputFile(path) as h5:
        set_attributes(
            h5, {"format": NETWORK_FORMAT, "format_version": FORMAT_VERSION, "k": network.k} | record
        )
        set_attributes(h5, {"request": request and request.text})
        for name in NETWORK_ARRAYS:
            store(h5, name, getattr(network, name))
        if network.radii is not None:
            store(h5, "radii", network.radii)


def network_from(h5, path) -> Network:
    """The network of an open file; `path` is for messages. Raises InputError."""
    _, attrs, datasets = check_file(h5, path, NETWORK_FORMAT)
    for name in NETWORK_ARRAYS:
        if name not in datasets:
            raise InputError(
                f"{path}: dataset {name} is missing: a network needs {', '.join(NETWORK_ARRAYS)}"
            )
    arrays = {name: values(datasets[name]) for name in (*NETWORK_ARRAYS, "radii") if name in datasets}
    record = {name: value for name, value in attrs.items() if name not in _NETWORK_HEADER}
    dimension = arrays["positions"].shape[1]  # in the file, not to be decided again
    with about(path):
        return Network(**arrays, k=attrs.get("k", 1.0), record=record, dimension=dimension)


def read_source(path) -> Packing | Network:
    """The packing or the network of a file. Raises InputError for a file of another format."""
    with open_file(path) as h5:
        if check_format(path, attributes(h5)) == NETWORK_FORMAT:
            return network_from(h5, path)
        return packing_from(h5, path)

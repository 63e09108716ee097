"""The network file: nodes, bonds and their stiffnesses in HDF5, with how the network was made as attributes."""

from jampetsc.errors import InputError, about
from jampetsc.io import packing_file
from jampetsc.io.formats import check_file
from jampetsc.io.hdf5 import (
    FORMAT_VERSION,
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
from jampetsc.packing.spring_network import Network

FORMAT = "jampetsc-network"
ARRAYS = ("positions", "bonds", "images", "cell", "stiffness", "tension")
_FILE_ATTRIBUTES = (
    "format",
    "format_version",
    "k",
    "request",
)  # attributes that are no record of the network


def write_network(path, network: Network, request=None) -> None:
    """Write a network with its record (scalars and strings; None is left out), atomically, to the last bit.

    request   what was asked for, where the record does not say it

    Raises InputError or JampetscError if the file cannot be written.
    """
    record = {name: value for name, value in network.record.items() if name not in _FILE_ATTRIBUTES}
    check_replaced(path, FORMAT)
    with OutputFile(path) as h5:
        set_attributes(h5, {"format": FORMAT, "format_version": FORMAT_VERSION, "k": network.k} | record)
        set_attributes(h5, {"request": request and request.text})
        for name in ARRAYS:
            store(h5, name, getattr(network, name))
        if network.radii is not None:
            store(h5, "radii", network.radii)


def network_from(h5, path) -> Network:
    """The network of an open file; `path` is for messages. Raises InputError."""
    _, attrs, datasets = check_file(h5, path, FORMAT)
    for name in ARRAYS:
        if name not in datasets:
            raise InputError(f"{path}: dataset {name} is missing: a network needs {', '.join(ARRAYS)}")
    arrays = {name: values(datasets[name]) for name in (*ARRAYS, "radii") if name in datasets}
    record = {name: value for name, value in attrs.items() if name not in _FILE_ATTRIBUTES}
    with about(path):
        return Network(**arrays, k=attrs.get("k", 1.0), record=record)


def read_source(path) -> Packing | Network:
    """The packing or the network of a file. Raises InputError for a file of another format."""
    with open_file(path) as h5:
        if check_format(path, attributes(h5)) == FORMAT:
            return network_from(h5, path)
        return packing_file.packing_from(h5, path)

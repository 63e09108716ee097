"""Networks for other programs: LAMMPS data with harmonic bonds, VTK PolyData, numpy's npz.

LAMMPS' bond style harmonic has the energy K (r − r₀)²: K = k/2, and r₀ = r − T/k gives the tension T.
"""

import io
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import write_whole
from jampetsc.io.exporters import format_rows, poly_data
from jampetsc.io.frames import NetworkFrame
from jampetsc.packing.neighbours import fractional


def write_network_export(out, frame: NetworkFrame) -> None:
    """Write a network in the format of the ending of `out`. Raises InputError for an ending without bonds, and for one
    without vectors where the frame has some.
    """
    ending = Path(out).suffix.lower()
    if ending not in _FORMATS:
        raise InputError(
            f"{named('out')} {out}: not a format with bonds of a network. Choose the ending {', '.join(_FORMATS)}."
        )
    if frame.columns and ending == ".data":
        raise InputError(
            f"{named('out')} {out}: this format has no motion of nodes. Choose the ending .vtp, .npz."
        )
    write_whole(out, _FORMATS[ending](frame))


def _data(frame: NetworkFrame) -> bytes:
    """LAMMPS data, atom style bond, or bpm/sphere with radii; a bond type for each pair (K, r₀)."""
    network = frame.network
    bonds, n = network.linear_bonds, network.n
    positions, (ax, _), (bx, by) = _wrapped(network), *network.cell.tolist()
    coefficients = np.column_stack(
        (bonds.stiffness / 2.0, bonds.distance - network.tension / bonds.stiffness)
    )
    types, type_of = np.unique(coefficients, axis=0, return_inverse=True)
    half = 0.5 * float(bonds.distance.max())
    ones, sizes = np.ones(n, int), () if network.radii is None else (2.0 * network.radii, np.ones(n))
    atoms = (np.arange(1, n + 1), ones, ones, *sizes, *positions.T, np.zeros(n))
    rows = (np.arange(1, len(bonds) + 1), type_of.ravel() + 1, bonds.i + 1, bonds.j + 1)
    return (
        f"LAMMPS data file of jampetsc: a network of springs\n\n{n} atoms\n{len(bonds)} bonds\n1 atom types\n"
        f"{len(types)} bond types\n\n0.0 {ax!r} xlo xhi\n0.0 {by!r} ylo yhi\n{-half!r} {half!r} zlo zhi\n"
        f"{bx!r} 0.0 0.0 xy xz yz\n\nBond Coeffs # harmonic\n\n"
        f"{format_rows((np.arange(1, len(types) + 1), *types.T))}\n"
        f"Atoms # {'bond' if network.radii is None else 'bpm/sphere'}\n\n{format_rows(atoms)}\n"
        f"Bonds\n\n{format_rows(rows)}"
    ).encode()


def _wrapped(network):
    return network.positions - np.floor(fractional(network.positions, network.cell)) @ network.cell


def _vtp(frame: NetworkFrame) -> bytes:
    """VTK XML PolyData: a point per node, a line per bond, as `exporters` writes packings."""
    network = frame.network
    bonds, positions = network.linear_bonds, _wrapped(network)
    columns = {"bonds": np.bincount(network.bonds.ravel(), minlength=network.n)}
    columns |= ({} if network.radii is None else {"radius": network.radii}) | frame.columns
    lines = {"stiffness": bonds.stiffness, "tension": network.tension, "length": bonds.distance}
    return poly_data(positions, network.cell, bonds, columns, lines, {"k": network.k} | frame.facts)


def _npz(frame: NetworkFrame) -> bytes:
    network, file = frame.network, io.BytesIO()
    arrays = {
        name: getattr(network, name)
        for name in ("positions", "bonds", "images", "cell", "stiffness", "tension")
    }
    arrays |= {} if network.radii is None else {"radii": network.radii}
    np.savez(file, **arrays, **frame.columns, **frame.facts, k=network.k)
    return file.getvalue()


_FORMATS = {".data": _data, ".vtp": _vtp, ".npz": _npz}

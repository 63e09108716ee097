"""Files for other programs: extended XYZ, LAMMPS dump and data, VTK PolyData, numpy's npz, HOOMD's GSD.

Coordinates are one double each (one single in GSD before gsd 5); forces and stresses were found with all digits before.
Every format carries `Frame.potential`, so that a reader finds the same forces. Networks go to data, vtp and npz:
LAMMPS' bond style harmonic has the energy K (r − r₀)², so K = k/2, and r₀ = r − T/k gives the tension T.
"""

import importlib
import io
import tempfile
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, MissingPackage, named
from jampetsc.io.atomic import NewFile, write_whole
from jampetsc.io.frames import Frame, NetworkFrame
from jampetsc.packing.neighbours import fractional, lengths

SERIES = (".xyz", ".dump", ".gsd")  # hold many frames
MAX_SIZE_TYPES = 10  # with no more different radii than this, each is a type of its own


def check_format(out) -> str:
    """The ending of `out`. Raises InputError for one of no format, and for GSD without its package."""
    ending = Path(out).suffix.lower()
    if ending not in (*_FORMATS, ".gsd"):
        raise InputError(f"{named('out')} {out}: unknown ending. Give it one of .gsd, {', '.join(_FORMATS)}.")
    if ending == ".gsd":
        _gsd()
    return ending


def write_frames(out, frames) -> int:
    """Write frames, an iterable of Frame, complete or not at all; returns their number.

    Raises InputError for more than one where the format holds one, and as `check_format`.
    """
    ending, count = check_format(out), 0
    with NewFile(out) as file:
        if ending == ".gsd":
            return _write_gsd(file.stream, frames)
        for frame in frames:
            count += 1
            if count > 1 and ending not in SERIES:
                raise InputError(
                    f"{out}: several frames, but this format holds one. Use {', '.join(SERIES)}."
                )
            file.stream.write(_FORMATS[ending](frame, count - 1))
    return count


def types_of(radii):
    """(N,) types 1, 2, … of disks in the order of their radii; all 1 where sizes are many."""
    sizes, type = np.unique(radii, return_inverse=True)
    return type + 1 if len(sizes) <= MAX_SIZE_TYPES else np.ones(len(radii), int)


def format_rows(columns, start="") -> str:
    """Rows of columns (N,) and (N, d) as lines of text, which begin with `start`; numbers to the last bit."""
    parts = [part for values in columns for part in (values.T if values.ndim == 2 else [values])]
    rows = zip(*(part.tolist() for part in parts), strict=True)
    return "".join(f"{start}{' '.join(map(repr, row))}\n" for row in rows)


def _words(entries) -> str:
    """Entries as words key=value, texts with spaces in quotes; numbers to the last bit."""
    return " ".join(
        f'{key}="{value}"' if " " in str(value) else f"{key}={value}" for key, value in entries.items()
    )


def _deep_cell(cell, depth: float):
    """Rows (3, 3) of a cell (D, D); in two dimensions it gets this depth."""
    if len(cell) == 3:
        return cell
    deep = np.zeros((3, 3))
    deep[:2, :2], deep[2, 2] = cell, depth
    return deep


def _frame_cell(frame):
    """Rows (3, 3) of the cell; a cell of disks is a diameter deep."""
    return _deep_cell(frame.disks.cell, 2.0 * float(frame.disks.radii.max()))


def _box_bounds(cell, dimension: int):
    """Ends (3, 2) of a cell (3, 3) along x, y and z from its origin; disks lie in the middle of its depth."""
    ends = np.column_stack((np.zeros(3), np.diag(cell)))
    if dimension == 2:
        ends[2] -= cell[2, 2] / 2
    return ends


def _spatial(vectors):
    """Vectors (N, D) in three dimensions, (N, 3)."""
    return (
        vectors
        if vectors.shape[1] == 3
        else np.column_stack((vectors, np.zeros(len(vectors), vectors.dtype)))
    )


def _solid(columns):
    """The columns with their vectors in three dimensions."""
    return {name: _spatial(values) if values.ndim == 2 else values for name, values in columns.items()}


def _xyz(frame: Frame, number) -> bytes:
    """Extended XYZ, as ASE and OVITO read it; every disk is an X."""
    within = np.tril(np.ones((3, 3), bool))
    within[2, :2] = frame.disks.dimension == 3
    sides = zip(_frame_cell(frame).ravel().tolist(), within.ravel(), strict=True)
    lattice = " ".join(repr(side) if is_given else "0" for side, is_given in sides)
    columns = {"id": np.arange(1, frame.disks.n + 1), "pos": frame.disks.positions} | frame.columns
    properties, columns = "species:S:1", _solid(columns)
    for name, values in columns.items():
        kind = "I" if values.dtype.kind == "i" else "R"
        properties += f":{'velo' if name == 'velocity' else name}:{kind}:{values[0].size}"
    head = (
        f'{frame.disks.n}\nLattice="{lattice}" Properties={properties} '
        f'pbc="T T {"TF"[frame.disks.dimension == 2]}" {_words({"frame": number} | frame.potential | frame.facts)}\n'
    )
    return (head + format_rows(columns.values(), "X ")).encode()


def _dump(frame: Frame, number) -> bytes:
    """A frame of a LAMMPS dump: x, y, z inside the cell, velocities as vx, …; the first one tells the units."""
    n, axes, cell = frame.disks.n, "xyz"[: frame.disks.dimension], _frame_cell(frame)
    columns = {"id": np.arange(1, n + 1), "type": types_of(frame.disks.radii)}
    columns |= dict(zip("xyz", _spatial(frame.disks.positions).T, strict=True)) | frame.columns
    columns.pop("unwrapped", None)  # xu and yu, which readers take for x and y: these and ix, iy say it
    own = {"velocity": "v{}", "image": "i{}", "spin": "omega{}"}
    names = " ".join(
        " ".join(own.get(name, f"{name}_{{}}").format(axis) for axis in axes)
        if values.ndim == 2
        else {"spin": "omegaz"}.get(name, name)
        for name, values in columns.items()
    )
    units = "" if number else f"ITEM: UNITS\nlj {_words(frame.potential)}\n"
    xy, xz, yz = cell[1, 0], cell[2, 0], cell[2, 1]
    bounds, flags = _box_bounds(cell, frame.disks.dimension), "pp pp ff" if len(axes) == 2 else "pp pp pp"
    bounds[0] += min(0.0, xy, xz, xy + xz), max(0.0, xy, xz, xy + xz)
    bounds[1] += min(0.0, yz), max(0.0, yz)
    head = (
        f"{units}ITEM: TIMESTEP\n{number}\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS xy xz yz {flags}\n"
        f"{format_rows([bounds, np.array([xy, xz, yz])])}ITEM: ATOMS {names}\n"
    )
    return (head + format_rows(columns.values())).encode()


def _data(frame: Frame, number) -> bytes:
    """LAMMPS data, atom style bpm/sphere of density 1, contacts as bonds; force and overlap as comments."""
    disks, c, types = frame.disks, frame.contacts, types_of(frame.disks.radii)
    ones = np.ones(disks.n, int)
    atoms = (
        np.arange(1, disks.n + 1),
        ones,
        types,
        2 * disks.radii,
        1.0 * ones,
        *_spatial(disks.positions).T,
    )
    ends = zip(*(a.tolist() for a in (c.i + 1, c.j + 1, c.force, c.overlap)), strict=True)
    bonds = "".join(f"{row} 1 {i} {j} # {f!r} {d!r}\n" for row, (i, j, f, d) in enumerate(ends, 1))
    return (
        f"LAMMPS data file of jampetsc, bonds are contacts: # force overlap; units = lj, {_words(frame.potential)}\n\n"
        f"{disks.n} atoms\n{len(c)} bonds\n{types.max()} atom types\n1 bond types\n\n"
        f"{_lammps_box(_frame_cell(frame), disks.dimension)}\n"
        f"Atoms # bpm/sphere\n\n{format_rows(atoms)}" + (f"\nBonds\n\n{bonds}" if bonds else "")
    ).encode()


def _lammps_box(cell, dimension: int) -> str:
    """The lines of a cell (3, 3) in the header of LAMMPS data."""
    ends = zip("xyz", _box_bounds(cell, dimension).tolist(), strict=True)
    lines = [f"{low!r} {high!r} {axis}lo {axis}hi" for axis, (low, high) in ends]
    tilts = " ".join(map(repr, cell[[1, 2, 2], [0, 0, 1]].tolist()))
    return "\n".join([*lines, f"{tilts} xy xz yz", ""])


def _vtp(frame: Frame, number) -> bytes:
    """VTK XML PolyData: a point per disk, a line per contact."""
    disks, c = frame.disks, frame.contacts
    bonds = {"force": c.force, "overlap": c.overlap, "bearing": frame.bearing.astype(int)}
    return poly_data(disks.positions, disks.cell, c, frame.columns, bonds, frame.potential | frame.facts)


def poly_data(positions, cell, c, columns, bonds, facts) -> bytes:
    """VTK XML PolyData of N points, with columns {name: (N, …)}, and M bonds c, with values {name: (M,)}.

    A line that leaves the cell ends on an image of its disk, a point of its own behind the N disks (`image` is 1).
    """
    n = len(positions)
    end = positions[c.i] + c.r
    across = lengths(end - positions[c.j]) > 0.5 * np.diag(cell).min()
    point = c.j.copy()
    point[across] = n + np.arange(np.count_nonzero(across))
    disk = np.r_[np.arange(n), c.j[across]]
    points = np.vstack((positions, end[across]))
    columns = {name: values[disk] for name, values in columns.items()}
    columns = {"disk": disk, "image": (np.arange(len(disk)) >= n).astype(int)} | columns
    lines = {"connectivity": np.column_stack((c.i, point)).ravel(), "offsets": 2 * np.arange(1, len(c) + 1)}
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian">\n<PolyData>\n'
        f"<FieldData>\n{_array('cell', _spatial(cell), tuples=True)}{_field_data(facts)}"
        "</FieldData>\n"
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="0" NumberOfLines="{len(c)}" NumberOfStrips="0" '
        f'NumberOfPolys="0">\n<Points>\n{_array("points", _spatial(points))}</Points>\n'
        f"<PointData>\n{_arrays(columns)}</PointData>\n<CellData>\n{_arrays(bonds)}</CellData>\n"
        f"<Lines>\n{_arrays(lines)}</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    ).encode()


def _arrays(columns):
    return "".join(_array(name, values) for name, values in _solid(columns).items())


def _field_data(entries):
    """Entries as arrays of one tuple; a text is the codes of its characters and a zero."""
    arrays = []
    for name, value in entries.items():
        if isinstance(value, str):
            codes = np.array([*value.encode(), 0])
            head = f'<DataArray type="String" Name="{name}" NumberOfTuples="1" format="ascii">'
            arrays.append(f"{head}\n{format_rows([codes])}</DataArray>\n")
        else:
            arrays.append(_array(name, np.array([value]), tuples=True))
    return "".join(arrays)


def _array(name, values, tuples=False):
    """A DataArray element in ascii; with the number of its tuples where nothing else tells it."""
    kind = "Int64" if values.dtype.kind == "i" else "Float64"
    size = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    size += f' NumberOfTuples="{len(values)}"' if tuples else ""
    return (
        f'<DataArray type="{kind}" Name="{name}"{size} format="ascii">\n{format_rows([values])}</DataArray>\n'
    )


def _npz(frame: Frame, number) -> bytes:
    disks, c, file = frame.disks, frame.contacts, io.BytesIO()
    contacts = {"pairs": np.column_stack((c.i, c.j)), "bonds": c.r, "force": c.force, "overlap": c.overlap}
    np.savez(
        file,
        **frame.potential,
        positions=disks.positions,
        cell=disks.cell,
        **frame.columns,
        **{f"contact_{name}": values for name, values in contacts.items()},
        contact_bearing=frame.bearing,
        **frame.facts,
    )
    return file.getvalue()


def _gsd():
    """The module gsd.hoomd. Raises MissingPackage where it is not installed."""
    try:
        return importlib.import_module("gsd.hoomd")
    except ImportError:
        raise MissingPackage(".gsd", "gsd") from None


def _write_gsd(stream, frames) -> int:
    """HOOMD frames, the middle of the cell at the origin; potential, columns and forces are in their log."""
    hoomd, count = _gsd(), 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.gsd"
        with _open_gsd(hoomd, str(path)) as file:
            for frame in frames:
                file.append(_gsd_frame(hoomd, frame, count))
                count += 1
        stream.write(path.read_bytes())
    return count


def _open_gsd(hoomd, path):
    """A new GSD file, in double precision if the package has it."""
    try:
        return hoomd.open(path, "w", precision="double")
    except TypeError:  # gsd < 5
        return hoomd.open(path, "w")


def _gsd_frame(hoomd, frame, number):
    disks, c, snapshot = frame.disks, frame.contacts, hoomd.Frame()
    (Lx, _, _), (xy, Ly, _), (xz, yz, Lz) = _deep_cell(disks.cell, 0.0).tolist()
    types = types_of(disks.radii)
    snapshot.configuration.step, snapshot.configuration.dimensions = number, disks.dimension
    snapshot.configuration.box = [Lx, Ly, Lz, xy / Ly, xz / (Lz or 1.0), yz / (Lz or 1.0)]
    snapshot.particles.N, snapshot.bonds.N = disks.n, len(c)
    snapshot.particles.position = _spatial(disks.positions - disks.cell.sum(axis=0) / 2)
    snapshot.particles.diameter, snapshot.particles.typeid = 2 * disks.radii, types - 1
    snapshot.particles.types = [f"size {size}" for size in range(1, types.max() + 1)]
    if "velocity" in frame.columns:
        snapshot.particles.velocity = _spatial(frame.columns["velocity"])
    if "image" in frame.columns:
        snapshot.particles.image = _spatial(frame.columns["image"])
    snapshot.bonds.types, snapshot.bonds.typeid = ["bond"], np.zeros(len(c), int)
    snapshot.bonds.group = np.column_stack((c.i, c.j))
    snapshot.log = {f"particles/{name}": values for name, values in frame.columns.items()}
    snapshot.log |= {"bonds/force": c.force, "bonds/overlap": c.overlap}
    for name, value in (frame.potential | frame.facts).items():  # a text as its bytes
        snapshot.log[name] = (
            np.frombuffer(value.encode(), np.uint8) if isinstance(value, str) else np.array([value])
        )
    snapshot.log["configuration/box"] = np.array(
        snapshot.configuration.box
    )  # gsd rounds a box to single precision
    return snapshot


_FORMATS = {".npz": _npz, ".xyz": _xyz, ".dump": _dump, ".data": _data, ".vtp": _vtp}


def write_network_export(out, frame: NetworkFrame) -> None:
    """Write a network in the format of the ending of `out`. Raises InputError for an ending without bonds, and for one
    without vectors where the frame has some.
    """
    ending = Path(out).suffix.lower()
    if ending not in _NETWORK_FORMATS:
        raise InputError(
            f"{named('out')} {out}: not a format with bonds. Choose the ending {', '.join(_NETWORK_FORMATS)}."
        )
    if frame.columns and ending == ".data":
        raise InputError(
            f"{named('out')} {out}: this format has no motion of nodes. Choose the ending .vtp, .npz."
        )
    write_whole(out, _NETWORK_FORMATS[ending](frame))


def _network_data(frame: NetworkFrame) -> bytes:
    """LAMMPS data, atom style bond, or bpm/sphere with radii; a bond type for each pair (K, r₀)."""
    network = frame.network
    bonds, n = network.linear_bonds, network.n
    coefficients = np.column_stack(
        (bonds.stiffness / 2.0, bonds.distance - network.tension / bonds.stiffness)
    )
    types, type_of = np.unique(coefficients, axis=0, return_inverse=True)
    cell = _deep_cell(network.cell, float(bonds.distance.max()))
    ones, sizes = np.ones(n, int), () if network.radii is None else (2.0 * network.radii, np.ones(n))
    atoms = (np.arange(1, n + 1), ones, ones, *sizes, *_spatial(_wrapped_nodes(network)).T)
    rows = (np.arange(1, len(bonds) + 1), type_of.ravel() + 1, bonds.i + 1, bonds.j + 1)
    return (
        f"LAMMPS data file of jampetsc: a network of springs\n\n{n} atoms\n{len(bonds)} bonds\n1 atom types\n"
        f"{len(types)} bond types\n\n{_lammps_box(cell, network.dimension)}\nBond Coeffs # harmonic\n\n"
        f"{format_rows((np.arange(1, len(types) + 1), *types.T))}\n"
        f"Atoms # {'bond' if network.radii is None else 'bpm/sphere'}\n\n{format_rows(atoms)}\n"
        f"Bonds\n\n{format_rows(rows)}"
    ).encode()


def _wrapped_nodes(network):
    return network.positions - np.floor(fractional(network.positions, network.cell)) @ network.cell


def _network_vtp(frame: NetworkFrame) -> bytes:
    """VTK XML PolyData: a point per node, a line per bond, as `exporters` writes packings."""
    network = frame.network
    bonds, positions = network.linear_bonds, _wrapped_nodes(network)
    columns = {"bonds": np.bincount(network.bonds.ravel(), minlength=network.n)}
    columns |= ({} if network.radii is None else {"radius": network.radii}) | frame.columns
    lines = {"stiffness": bonds.stiffness, "tension": network.tension, "length": bonds.distance}
    return poly_data(positions, network.cell, bonds, columns, lines, {"k": network.k} | frame.facts)


def _network_npz(frame: NetworkFrame) -> bytes:
    network, file = frame.network, io.BytesIO()
    arrays = {
        name: getattr(network, name)
        for name in ("positions", "bonds", "images", "cell", "stiffness", "tension")
    }
    arrays |= {} if network.radii is None else {"radii": network.radii}
    np.savez(file, **arrays, **frame.columns, **frame.facts, k=network.k)
    return file.getvalue()


_NETWORK_FORMATS = {".data": _network_data, ".vtp": _network_vtp, ".npz": _network_npz}

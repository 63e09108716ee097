"""Disks with a third coordinate, turned cells and columns without clear names, in files of other programs."""

import importlib.util
import io
import logging
import struct
import zipfile

import h5py
import numpy as np
import pytest
from samples import published
from spheres import few_spheres

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.column_reader import TextTable
from jampetsc.io.exchange import MAX_UNPACKED_BYTES, format_of
from jampetsc.io.exporters import write_frames
from jampetsc.io.frames import packing_frame
from jampetsc.io.network_importers import import_network
from jampetsc.packing.contacts import find_contacts, measure
from jampetsc.progress import LOG

DISKS = published().folded()
X, R, (A1, A2) = DISKS.positions, DISKS.radii, DISKS.cell
NOISE = 1e-7 * A1[0] * np.random.default_rng(3).uniform(-1, 1, 16)  # what single precision leaves of equal z
DEPTH = 5.0


def rows(*columns):
    """Lines of columns, numbers to the last bit."""
    return "".join(" ".join(map(str, row)) + "\n" for row in zip(*(np.asarray(c).tolist() for c in columns)))  # noqa: B905


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def dump(positions, radii, cell, box=None):
    """A snapshot of `dump custom` in a box (3, 3), its bounds or the lines `box`."""
    xy, xz, yz = cell[1, 0], cell[2, 0], cell[2, 1]
    ends = np.column_stack((np.zeros(3), np.diag(cell)))
    ends[0] += min(0, xy, xz, xy + xz), max(0, xy, xz, xy + xz)
    ends[1] += min(0, yz), max(0, yz)
    lines = box or f"xy xz yz pp pp pp\n{rows(*ends.T, (xy, xz, yz))}"
    return (
        f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{len(radii)}\nITEM: BOX BOUNDS {lines}"
        f"ITEM: ATOMS id x y z radius\n{rows(np.arange(len(radii)), *positions.T, radii)}"
    )


def data(positions, radii, cell, box=None):
    """A data file in a box (3, 3), or with the header lines `box`."""
    bounds = "".join(
        f"0 {side!r} {axis}lo {axis}hi\n" for side, axis in zip(np.diag(cell).tolist(), "xyz", strict=True)
    )
    bounds += " ".join(map(repr, cell[[1, 2, 2], [0, 0, 1]].tolist())) + " xy xz yz\n"
    n, one = np.arange(1, len(radii) + 1), np.ones(len(radii), int)
    return f"LAMMPS\n\n{len(n)} atoms\n\n{box or bounds}\nAtoms # sphere\n\n" + rows(
        n, one, 2 * radii, one, *positions.T
    )


def extxyz(positions, radii, cell, more=""):
    lattice = " ".join(map(repr, cell.ravel().tolist()))
    body = rows(["A"] * len(radii), *positions.T, radii)
    return f'{len(radii)}\nLattice="{lattice}" Properties=species:S:1:pos:R:3:radius:R:1 {more}\n{body}'


def deep(cell=DISKS.cell):
    rows3 = np.diag([0.0, 0.0, DEPTH])
    rows3[:2, :2] = cell
    return rows3


FLAT = np.column_stack((X, NOISE))
WRITERS = {
    "lammps-dump": lambda: dump(FLAT, R, deep()),
    "lammps-data": lambda: data(FLAT, R, deep()),
    "extxyz": lambda: extxyz(FLAT, R, deep()),
    "xyr": lambda: f"box {A1[0]:.17g} {A2[1]:.17g} {DEPTH} {A2[0]:.17g} 0 0\n# x y z r\n" + rows(*FLAT.T, R),
    "npz": lambda: npz(positions=FLAT, radii=R, box=deep()),
}


def written(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def is_the_published(packing):
    assert packing.dimension == 2
    np.testing.assert_allclose(packing.cell, DISKS.cell, atol=1e-14)
    assert packing.pressure == pytest.approx(DISKS.pressure, rel=1e-9)
    assert packing.phi == pytest.approx(DISKS.phi, rel=1e-12)
    return True


@pytest.mark.parametrize("format", WRITERS)
def test_disks_with_noise_in_z_are_disks_in_every_format(tmp_path, format):
    path = written(tmp_path / "p", WRITERS[format]())
    packing = jampetsc.import_packing(path)
    assert is_the_published(packing) and packing.record["protocol"] == format
    assert packing.record["geometry"] == "in a plane: z is left out"
    assert jampetsc.import_packing(path, dimension=3).dimension == 3
    high = FLAT + np.array([0.0, 0.0, DEPTH / 2])
    for name, noise in (("low", 0.0), ("far", 1.0)):  # z that differs is left out on request
        far = npz(positions=high + noise * np.eye(1, 3, 2) * np.arange(16)[:, None] / 16, radii=R, box=deep())
        assert is_the_published(jampetsc.import_packing(written(tmp_path / name, far), dimension=2))


@pytest.mark.skipif(importlib.util.find_spec("ase") is None, reason="ase is optional")
def test_disks_with_noise_in_z_that_ase_writes(tmp_path):
    import ase
    import ase.io

    atoms = ase.Atoms("X" * 16, positions=FLAT, cell=deep(), pbc=(True, True, False))
    atoms.arrays["radius"] = R
    ase.io.write(tmp_path / "p.xyz", atoms, format="extxyz")
    packing = jampetsc.import_packing(tmp_path / "p.xyz")
    assert packing.dimension == 2 and packing.pressure == pytest.approx(DISKS.pressure, rel=1e-4)


@pytest.mark.skipif(importlib.util.find_spec("ovito") is None, reason="ovito is optional")
def test_disks_with_noise_in_z_that_ovito_writes(tmp_path):
    from ovito.io import export_file, import_file

    pipeline = import_file(str(written(tmp_path / "p.xyz", extxyz(FLAT, R, deep()))))
    columns = ["Particle Type", "Position.X", "Position.Y", "Position.Z", "Radius"]
    export_file(pipeline, str(tmp_path / "o.dump"), "lammps/dump", columns=columns, precision=17)
    packing = jampetsc.import_packing(tmp_path / "o.dump")
    assert packing.dimension == 2 and packing.pressure == pytest.approx(DISKS.pressure, rel=1e-4)


@pytest.mark.skipif(importlib.util.find_spec("gsd") is None, reason="gsd is optional")
@pytest.mark.parametrize(("dimensions", "depth"), [(2, 0.0), (2, DEPTH), (3, DEPTH)])
def test_gsd_of_two_dimensions_has_no_z(tmp_path, dimensions, depth):
    import gsd.hoomd

    frame = gsd.hoomd.Frame()
    (Lx, _), (xy, Ly) = DISKS.cell
    frame.configuration.box, frame.configuration.dimensions = [Lx, Ly, depth, xy / Ly, 0, 0], dimensions
    frame.particles.N, frame.particles.diameter = 16, 2 * R
    frame.particles.position = FLAT if dimensions == 3 else FLAT + [[0, 0, 0.1]] * np.arange(16)[:, None]
    with gsd.hoomd.open(tmp_path / "p.gsd", "w") as file:
        file.append(frame)
    packing = jampetsc.import_packing(tmp_path / "p.gsd", -1)
    assert packing.dimension == 2 and packing.pressure == pytest.approx(DISKS.pressure, rel=1e-3)
    if dimensions == 2:
        with pytest.raises(InputError, match="dimension 3: the file states D = 2"):
            jampetsc.import_packing(tmp_path / "p.gsd", dimension=3)


@pytest.mark.skipif(importlib.util.find_spec("gsd") is None, reason="gsd is optional")
def test_gsd_that_claims_more_than_it_holds(tmp_path):
    """A damaged count would be gigabytes of memory."""
    write_frames(tmp_path / "p.gsd", [packing_frame(DISKS)])
    content = (tmp_path / "p.gsd").read_bytes()
    import gsd.hoomd
    import gsd.pygsd

    with gsd.hoomd.open(tmp_path / "many.gsd", "w") as file:
        frame = gsd.hoomd.Frame()
        frame.particles.N = 10**5
        file.append(frame)
    with pytest.raises(InputError, match=r"many\.gsd: particles/N = 100000: more than the file holds"):
        jampetsc.import_packing(tmp_path / "many.gsd")
    rng = np.random.default_rng(1)
    for _ in range(20):  # never anything but one line
        at = int(rng.integers(len(content)))
        damaged = content[:at] + bytes(rng.integers(0, 256, 3).astype(np.uint8)) + content[at + 3 :]
        try:
            jampetsc.import_packing(written(tmp_path / "q.gsd", damaged))
        except InputError as error:
            assert "\n" not in str(error)


def rotation(dimension, seed=5):
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(dimension, dimension)))[0]
    return Q * [*[1.0] * (dimension - 1), np.linalg.det(Q)]


TURNED = {  # format -> file of positions, radii and a cell of any orientation
    "lammps-dump": lambda x, r, cell: dump(x, r, cell, "abc origin pp pp pp\n" + rows(*cell.T, np.zeros(3))),
    "lammps-data": lambda x, r, cell: data(
        x,
        r,
        cell,
        "".join(
            f"{' '.join(map(repr, row))} {name}vec\n" for row, name in zip(cell.tolist(), "abc", strict=True)
        )
        + "0 0 0 abc origin\n",
    ),
    "extxyz": extxyz,
}


@pytest.mark.parametrize("format", TURNED)
def test_turned_cells_hold_the_same_packing(tmp_path, format):
    """Invariants of the stress, and distances of contacts; disks are turned in their plane."""
    spheres, Q = few_spheres(), rotation(3)
    turned = TURNED[format](spheres.positions @ Q, spheres.radii, spheres.cell @ Q)
    packing = jampetsc.import_packing(written(tmp_path / "p", turned))
    assert packing.dimension == 3 and "a₁ along x" in packing.record["geometry"]
    np.testing.assert_allclose(packing.cell, spheres.cell, atol=1e-12)
    np.testing.assert_allclose(packing.stress, spheres.stress, atol=1e-12)
    np.testing.assert_allclose(
        np.sort(find_contacts(packing).distance), np.sort(find_contacts(spheres).distance), rtol=1e-12
    )
    Q = np.eye(3)
    Q[:2, :2] = rotation(2)
    flat = TURNED[format](FLAT @ Q, R, deep() @ Q)
    assert is_the_published(jampetsc.import_packing(written(tmp_path / "flat", flat)))


def test_the_last_frame_is_minus_one(tmp_path):
    text = extxyz(FLAT, R, deep()) + extxyz(-FLAT, R, deep())
    path = written(tmp_path / "p.xyz", text)
    last = jampetsc.import_packing(path, -1)
    np.testing.assert_array_equal(last.positions, -X)
    assert last.record["imported_index"] == 1
    assert cli.main(["import", str(path), "--frame", "-1", "--out", str(tmp_path / "p.h5")]) == 0
    assert jampetsc.load(tmp_path / "p.h5").fingerprint == last.fingerprint
    with pytest.raises(InputError, match=r"index -3: no such packing \(2, numbered from 0\)"):
        jampetsc.import_packing(path, -3)


BOX = (A1[0], A2[1], A2[0])
TABLES = {  # what a text looks like -> (content, options)
    "csv with a title": ('"x","y","radius"\n' + rows(*X.T, R).replace(" ", ","), {}),
    "a title with diameters": (
        "ID; Y; X; Diameter\n" + rows(np.arange(16), X[:, 1], X[:, 0], 2 * R).replace(" ", ";"),
        {},
    ),
    "a comment as title": ("# x y z r\n" + rows(*FLAT.T, R), {"box": (*np.diag(deep()), A2[0], 0, 0)}),
    "named by an option": (rows(np.arange(16), *X.T, R), {"columns": "id,x,y,r"}),
    "named in python": (rows(*FLAT.T, 2 * R), {"columns": ["x", "y", "z", "d"], "radius": "d"}),
    "plain xyz": ("16\nsome words\n" + rows(np.where(R > 1.2, "B", "A"), *FLAT.T), {"radius": "A=1,B=1.4"}),
    "plain xyz with radii": ("16\n\n" + rows(["A"] * 16, *FLAT.T, R), {"columns": "species,x,y,z,r"}),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_text_are_read_by_the_names_of_their_columns(tmp_path, name):
    content, options = TABLES[name]
    box = (
        BOX
        if options.get("columns") != ["x", "y", "z", "d"] and "xyz" not in name
        else (*np.diag(deep()), A2[0], 0, 0)
    )
    path = written(tmp_path / "table.txt", content)
    assert is_the_published(jampetsc.import_packing(path, **{"box": box} | options))


FOUR = r"lines of 4 numbers, which nothing names\. Name the columns by columns, e\.g\. x,y,z,r or id,x,y,r"
UNNAMED = {  # what a file is -> (content, options, message)
    "x y z r": (rows(*FLAT.T, R), {"box": 9}, FOUR),
    "x y z r as xyr": (rows(*FLAT.T, R), {"box": 9, "format": "xyr"}, FOUR),
    "id x y r": (rows(np.arange(16), *X.T, R), {"box": 9}, FOUR),
    "surplus columns": (rows(*X.T, R), {"box": 9, "columns": "x,y"}, r"not x y \(3 words for 2\)"),
    "no x": ("a,b,r\n1,2,3\n", {"box": 9}, "no columns x and y among a, b, r. Name the columns"),
    "surplus in plain xyz": ("1\n\nA 1 2 3 4\n", {}, r"not species x y z \(5 words for 4\)\. Name the columns by"),
    "columns of a dump": (dump(FLAT, R, deep()), {"columns": "x,y"}, "columns: an option of xyr and extxyz, not of"),
    "mat": (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", {}, r"a file of MATLAB: not supported\. In MATLAB writematrix"),
    "npy": (b"\x93NUMPY\x01\x00", {}, r"one array of numpy.save: not supported\. Save arrays by name: numpy.savez"),
    "pickle": (b"\x80\x04\x95", {}, "a pickle of python: not supported"),
    "vtk": ('<?xml version="1.0"?>', {}, "XML, as of VTK: not supported"),
    "yaml": ("---\ncreator: LAMMPS\n", {}, "style yaml of LAMMPS: not supported"),
    "words": ("a letter\nto a friend\n", {"box": 9, "radius": "r", "k": 2.0}, "none of lammps-data, .* title line"),
    "bytes": (bytes(range(128, 256)), {"radius": "r"}, "none of lammps-data, .* Give its format"),
    "no particles": ("# x y r\n", {"format": "xyr", "box": 9}, "no particles"),
    "dump local": (
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ENTRIES\n1\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\nITEM: ENTRIES i\n1\n",
        {},
        "ITEM: ENTRIES: a dump of style local, .* Give a dump of style custom",
    ),
    "no atoms": ("ITEM: TIMESTEP\n0\n", {}, "no ITEM: ATOMS: truncated"),
    "open boundaries": (extxyz(FLAT, R, deep(), 'pbc="F F F"'), {}, r'pbc="F F F": must be periodic in x and y\.'),
    "no flags": (extxyz(FLAT, R, deep(), "pbc=[]"), {}, "must be periodic in x and y"),
    "a dimension of jamBashbulk": ("N = 1, L1 = {1,0}", {"dimension": 2, "k": 1.0}, "dimension, k: fixed in files of"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNNAMED)
def test_contents_that_are_not_read_are_named(tmp_path, name):
    content, options, message = UNNAMED[name]
    with pytest.raises(InputError, match=message) as error:
        jampetsc.import_packing(written(tmp_path / "p.any", content), **options)
    assert str(error.value).startswith(f"{tmp_path}/p.any: ") and "\n" not in str(error.value)


@pytest.mark.parametrize("pbc", ["[T,T,F]", "[T, T, F]", '"T T F"', "T", "[True, True, False]"])
def test_flags_of_periodicity_in_every_spelling(tmp_path, pbc):
    """Also of a box without depth, as of disks that are periodic in x and y alone."""
    assert is_the_published(
        jampetsc.import_packing(written(tmp_path / "p.xyz", extxyz(FLAT, R, deep(), f"pbc={pbc}")))
    )


@pytest.fixture
def warnings_of():
    """Lines that the program warns of."""
    handler, lines = logging.Handler(logging.WARNING), []
    handler.emit = lambda record: lines.append(record.getMessage())
    LOG.addHandler(handler)
    yield lines
    LOG.removeHandler(handler)


SIZES = {  # column, what it holds and says -> φ over the right one, or the message
    ("radius", None): 1,
    ("v_radius", None): 1,
    ("R", None): 1,
    ("diameter", None): 1,
    ("v_diameter", None): 1,
    ("ParticleDiam", None): 1,
    ("d", None): 1,
    ("diameter", "radii"): 4,
    ("Dn", "diameters"): 1,
    ("Dn", "radii"): 4,
    ("Dn", None): "column Dn: radii or diameters\\? Give column_holds radii or diameters",
    ("gradient", None): "column gradient: radii or diameters",
    ("size", "half"): "column_holds half: not supported. Choose one of radii, diameters",
}


@pytest.mark.parametrize(("column", "holds"), SIZES)
def test_diameters_are_halved_where_the_name_or_the_option_says_so(tmp_path, column, holds, warnings_of):
    expected = SIZES[column, holds]
    sizes = R if column in ("radius", "v_radius", "R") else 2 * R
    path = written(tmp_path / "p.xyz", extxyz(FLAT, sizes, deep()).replace(":radius:", f":{column}:"))
    if isinstance(expected, str):
        with pytest.raises(InputError, match=expected):
            jampetsc.import_packing(path, radius=column, column_holds=holds)
        return
    packing = jampetsc.import_packing(path, radius=column, column_holds=holds)
    assert packing.phi == pytest.approx(expected * DISKS.phi)
    assert ("halved" in packing.record["sizes_from"]) == (sizes is not R and expected == 1)
    if expected == 4:
        assert "implausible sizes: phi = 3.26, Z = " in packing.record["notes"]
        assert warnings_of == [f"{path}: {packing.record['notes']}"]
    else:
        assert "notes" not in packing.record and not warnings_of


def test_the_summary_has_phi_and_Z_and_no_command_for_implausible_sizes(tmp_path, capsys):
    path = written(tmp_path / "p.xyz", extxyz(FLAT, 2 * R, deep()))
    assert cli.main(["import", str(path), "--out", str(tmp_path / "p.h5")]) == 0
    printed, warned = capsys.readouterr()
    assert (
        "phi = 3.25979627" in printed
        and "Z = 1" in printed
        and "geometry  in a plane: z is left out (otherwise" in printed
    )
    assert "friction, which is not supported" in printed and "jampetsc pack" not in printed
    assert "Were these diameters, not radii? Import with --column-holds diameters" in warned
    words = ["--column-holds", "diameters", "--out", str(tmp_path / "right.h5")]
    assert cli.main(["import", str(path), *words]) == 0
    printed, warned = capsys.readouterr()
    assert "phi = 0.814949066" in printed and "(column radius, halved)" in printed and not warned


def test_an_archive_that_unpacks_to_more_than_a_packing_is_not_read(tmp_path):
    """A gigabyte of zeros is a megabyte of zip; here its directory says so. Members that are no arrays are left out."""
    content = npz(positions=np.zeros(1234))
    size = struct.pack("<I", 1234 * 8 + 128)
    assert content.count(size) >= 2
    bomb = content.replace(size, struct.pack("<I", MAX_UNPACKED_BYTES + 2**20))
    with pytest.raises(InputError, match=r"p\.npz: 513 MB unpacked \(at most 512\)"):
        jampetsc.import_packing(written(tmp_path / "p.npz", bomb))
    with zipfile.ZipFile(tmp_path / "q.npz", "w") as archive:
        for name in ("a.npy", "positions", "k"):
            archive.writestr(name, b"no array")
    with pytest.raises(InputError, match=r"q\.npz: (no array positions|not arrays of numpy.savez)"):
        jampetsc.import_packing(tmp_path / "q.npz")


IDS = {  # of the first atom, of a bond's end, of a bond's type, of the type of its coefficients
    "1": (("inf", "nan", "1e300", "0.5", "x"), "id "),
    "30 10": (("inf 10", "nan 10", "1e300 10", "30 0.5"), "Bonds: atom or type "),
    "1 1 30": (("1 nan 30", "1 inf 30"), "Bonds: atom or type "),
    "1 0.5 1.0": (("nan 0.5 1.0", "inf 0.5 1.0"), "Bond Coeffs: bond type "),
}


@pytest.mark.parametrize("place", IDS)
def test_numbers_of_atoms_are_whole_numbers(tmp_path, place):
    text = (
        "LAMMPS\n\n2 atoms\n1 bonds\n0 4 xlo xhi\n0 5 ylo yhi\n\nBond Coeffs # harmonic\n\n1 0.5 1.0\n\n"
        "Atoms # bond\n\n30 1 1 0 0 0\n10 1 1 3.5 0 0\n\nBonds\n\n1 1 30 10\n"
    )
    words, name = IDS[place]
    for word in words:
        new = text.replace("30 1 1 0 0 0", f"{word} 1 1 0 0 0") if place == "1" else text.replace(place, word)
        assert new != text
        with pytest.raises(
            InputError, match=rf"p\.data: ({name}|{word.split()[0]})(\S* )?.*(whole|not) number"
        ):
            import_network(written(tmp_path / "p.data", new))
    twice = text.replace("10 1 1 3.5", "30 1 1 3.5")
    with pytest.raises(InputError, match="two atoms have one id"):
        import_network(written(tmp_path / "p.data", twice))


def test_hdf5_of_odd_variables_is_no_packing_of_jaxmd(tmp_path):
    with h5py.File(tmp_path / "p.nc", "w") as h5:
        h5["pos"], h5["rad"] = 1.0, 1.0
        h5.create_group("box")
    with pytest.raises(InputError, match="pos, rad or box: not arrays"):
        jampetsc.import_packing(tmp_path / "p.nc")


def test_a_network_in_a_plane_may_have_three_coordinates(tmp_path):
    bonds = [[0, 1], [1, 2], [2, 3]]
    path = written(tmp_path / "n.npz", npz(positions=FLAT, bonds=bonds, box=deep(), images=np.zeros((3, 3))))
    network = import_network(path)
    assert network.dimension == 2 and network.record["geometry"] == "in a plane: z is left out"
    np.testing.assert_array_equal(network.positions, X)
    assert import_network(path, dimension=3).dimension == 3
    written(tmp_path / "n.npz", npz(positions=FLAT, bonds=bonds, box=deep(), images=[[0, 0, 1]] * 3))
    with pytest.raises(InputError, match=r"images: shape \(3, 3\)"):
        import_network(path)


@pytest.mark.parametrize(
    "style", ["harmonic/cut", "gran/hooke", "gran/hooke/history", "gran/hertz", "gran/hertz/history"]
)
def test_forces_are_those_of_the_pair_style_of_lammps(tmp_path, style):
    """Force by the formulas of its manual, in units of 1e-3 of a length, kn of gran/hertz a pressure."""
    stiffness, unit, radius = 7e3, 1e-3, 0.55e-3
    places = unit * np.array([[0.0, 0.0], [1.0, 0.1], [3.0, 0.2]])
    text = extxyz(places @ np.eye(2, 3), np.full(3, radius), unit * np.diag([4.0, 4.0, 1.0]))
    packing = jampetsc.import_packing(written(tmp_path / "p", text), pair_style=f"{style} {stiffness}")
    (contact,) = (c for c in [find_contacts(packing)])
    pairs = dict(zip(zip(contact.i.tolist(), contact.j.tolist(), strict=True), contact.force, strict=True))
    delta = 2 * radius - np.hypot(1.0, 0.1) * unit
    reduced = radius * radius / (radius + radius)
    force = {
        "harmonic/cut": 2.0 * stiffness * delta,  # −d/dr K (r − r_c)²
        "gran/hooke": stiffness * delta,
        "gran/hertz": stiffness * np.sqrt(reduced) * delta**1.5,
    }[style.removesuffix("/history")]
    assert pairs[0, 1] == pytest.approx(force, rel=1e-9) and "assumed" not in packing.record


def test_pair_styles_that_are_refused(tmp_path):
    path = written(tmp_path / "p.xyz", extxyz(FLAT, R, deep()))
    for text, message in (
        (
            "gran/hertz 8",
            r"radii 1 to 1.4\)\. For a similar one give potential hertzian and a k from 5.65685 to 6.69328",
        ),
        ("lj/cut 1", "pair_style lj/cut: not supported. Choose one of harmonic/cut, gran/hooke, gran/hertz"),
        ("gran/hooke", "needs its stiffness, a positive number. Give e.g. 'gran/hooke 100'"),
        ("gran/hooke -1", "needs its stiffness"),
        ("", "not supported"),
    ):
        with pytest.raises(InputError, match=message):
            jampetsc.import_packing(path, pair_style=text)
    with pytest.raises(InputError, match="pair_style, k: both given"):
        jampetsc.import_packing(path, pair_style="gran/hooke 1", k=2.0)


def test_how_a_text_is_recognised():
    assert format_of(b"1 2 3\n") == format_of(b"x;y;r\n1;2;3") == format_of(b"# no title\n1,2,3,4\n") == "xyr"
    assert format_of(b"3\n\nA 1 2 3\n") == format_of(b"3\nLattice=x\n") == "extxyz"
    assert format_of(b"3\nwords\n") is format_of(b"") is format_of(b"7\n8\n") is None
    table = TextTable("box 3, 4\n# x y\n'x', \"y\"\n1 2 # of nothing\n")
    assert (table.names, table.rows, table.box) == (["x", "y"], [["1", "2"]], ["3", "4"])


@pytest.mark.parametrize("ending", ["xyz", "dump", "data", "npz"])
def test_exports_come_back_whatever_their_depth(tmp_path, ending):
    write_frames(tmp_path / f"p.{ending}", [packing_frame(DISKS)])
    packing = jampetsc.import_packing(tmp_path / f"p.{ending}")
    assert is_the_published(packing) and measure(packing).coordination == DISKS.coordination

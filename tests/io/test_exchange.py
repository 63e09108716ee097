"""Packings of other programs and of arrays: written by hand as formats have them, they come back with the same G*."""

import bz2
import gzip
import importlib.util
import io
import lzma
import re
import shlex
import zipfile
from pathlib import Path

import numpy as np
import pytest
from dense import Reference
from samples import Box, physics, polydisperse, published

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_packing
from jampetsc.packing.cell import cell_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.potentials import Potential

DISKS = published()
X, R, (A1, A2) = DISKS.positions, DISKS.radii, DISKS.cell
(LX, _), (TILT, LY) = DISKS.cell
LOW = (1.5, -4.0)  # corner of a box
ORDER = np.random.default_rng(1).permutation(16)
LAW = physics()


@pytest.fixture(scope="module")
def expected():
    reference = Reference(DISKS, LAW)
    return reference, reference.modulus(1e-2)


def table(*columns, order=range(16)):
    """Lines of the columns, numbers to the last bit."""
    rows = np.column_stack([np.asarray(column, object) for column in columns])[list(order)]
    return "".join(" ".join(f"{x:.17g}" for x in row) + "\n" for row in rows)


def dump(names, *columns, tilt=TILT, low=(0.0, 0.0), flags="pp pp pp", step=0, types=None):
    """A snapshot as LAMMPS' `dump custom` has it: bounds of the tilted box, disks in any order."""
    (x, y), ids = low, np.arange(1, 17)
    bounds = [(x + min(0, tilt), x + max(0, tilt) + LX, tilt), (y, y + LY, 0), (-0.5, 0.5, 0)]
    return (
        f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n16\nITEM: BOX BOUNDS xy xz yz {flags}\n"
        + "".join(" ".join(f"{value:.17g}" for value in row) + "\n" for row in bounds)
        + f"ITEM: ATOMS id type {names}\n"
        + table(ids, np.ones(16, int) if types is None else types, *columns, order=ORDER)
    )


def general(text, low=(0.0, 0.0), flags="pp pp pp", lean=0.0):
    """The same snapshot with the box as OVITO has it: cell vectors, and the origin behind them."""
    rows = [(LX, 0, 0, low[0]), (TILT - LX, LY, lean, low[1]), (0, 0, 1, -0.5)]
    box = f"abc origin {flags}\n" + "".join(" ".join(f"{x:.17g}" for x in row) + "\n" for row in rows)
    return re.sub(r"xy xz yz pp pp pp\n(.*\n){3}", box, text)


def unwrapped():
    """Whole cell vectors away, another one for every disk; in the cell with a₂ − a₁ for a₂."""
    turns = np.random.default_rng(2).integers(-1, 2, (16, 2))
    return X + turns[:, :1] * A1 + turns[:, 1:] * A2


def data(style="sphere", tilt=f"{TILT:.17g} 0 0 xy xz yz\n", z=None):
    """As LAMMPS' write_data has it, with images."""
    zero, one = np.zeros(16, int), np.ones(16)
    places = (*np.add(X, (3, -2)).T, zero if z is None else z)
    columns = (np.arange(1, 17), one, 2 * R, one, *places, zero, zero, zero)
    return (
        "LAMMPS data file via write_data, version 2 Aug 2023, timestep = 0, units = lj\n\n16 atoms\n1 atom types\n\n"
        f"3 {3 + LX:.17g} xlo xhi\n-2 {LY - 2:.17g} ylo yhi\n-0.5 0.5 zlo zhi\n{tilt}\n"
        f"Atoms # {style}\n\n{table(*columns, order=ORDER)}\nVelocities\n\n{table(np.arange(1, 17), *[zero] * 6)}"
    )


def atomic():
    """The same data file of points with types."""
    rows = table(np.arange(1, 17), TYPES, *X.T, 0 * R, order=ORDER)
    return data().partition("Atoms")[0] + f"Atoms # atomic\n\n{rows}"


def vectors(text, lean=0):
    """The same data file with the box as OVITO has it."""
    box = f"{LX:.17g} 0 0 avec\n{TILT:.17g} {LY:.17g} {lean} bvec\n0 0 1 cvec\n3 -2 0 abc origin\n"
    return re.sub(r"3 .* xlo xhi\n(.*\n){3}", box, text)


def extxyz(more="", radii=R, lattice=f"{LX:.17g} 0 0 {TILT:.17g} {LY:.17g} 0 0 0 1"):
    names = "Properties=species:S:1:pos:R:3:velo:R:2:radius:R:1"
    rows = table(*X.T, np.zeros(16), *X.T, radii).splitlines()
    return f'16\nLattice="{lattice}" {names} {more}\n' + "".join(f"A {row}\n" for row in rows)


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


TYPES = np.where(R > 1.2, 2, 1)
FRACTIONS = X @ np.linalg.inv([A1, A2 - A1])
XYR = table(*X.T, R)
FILES = {  # name -> (content, what is told to `import_packing`)
    "lammps-dump x y": (dump("x y z diameter", *X.T, 0 * R, 2 * R), {}),
    "lammps-dump xu yu": (
        dump("x_of y_of radius", *X.T, R) + dump("xu yu r", *unwrapped().T, R, tilt=TILT - LX, step=1),
        {"index": 1, "radius": "r"},
    ),
    "lammps-dump xs ys": (dump("radius xs ys zs", R, *FRACTIONS.T, 0 * R + 0.5, low=LOW, tilt=TILT - LX), {}),
    "lammps-dump of types": (dump("x y", *X.T, types=TYPES), {"radius": "1=1, 2=1.4"}),
    "lammps-dump xs ys of cell vectors": (general(dump("radius xs ys", R, *FRACTIONS.T), LOW), {}),
    "lammps-data": (data(), {}),
    "lammps-data of cell vectors": (vectors(data()), {}),
    "lammps-data of types": (atomic(), {"radius": {1: 1.0, 2: 1.4}}),
    "extxyz": (extxyz(radii=2 * R) + extxyz('pbc="T T F" Time=1 Note="two words"') + "\n", {"index": 1}),
    "xyr": (f"# x y r\n# box: {LX:.17g}, {LY:.17g}, {TILT:.17g}\n{XYR.replace(' ', ',  ')}", {}),
    "xyr without a box": (XYR, {"box": (LX, LY, TILT)}),
    "npz": (npz(positions=X, diameters=2 * R, cell=DISKS.cell), {}),
    "npz of its potential": (
        npz(positions=X, radii=R, cell=DISKS.cell, potential="hertzian", stiffness="constant", k=3.0),
        {"potential": "harmonic", "k": 1.0},
    ),
    "extxyz of another potential": (extxyz("potential=-3.5 stiffness=2 k=7"), {}),  # not jampetsc's words
    "npz without a box": (
        npz(positions=X, sizes=R),
        {"radius": "sizes", "column_holds": "radii", "box": DISKS.cell},
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_a_packing_comes_back_with_its_modulus(tmp_path, expected, name):
    content, told = FILES[name]
    path = tmp_path / "packing.any"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    disks = jampetsc.import_packing(path, **told)
    assert disks.record["protocol"] == name.split()[0] and disks.record["imported_from"] == "packing.any"
    assert disks.record["imported_index"] == told.get("index", 0)
    if "xs" in name:
        assert disks.positions == pytest.approx(X + LOW, rel=1e-12)
    same(disks, expected, 1e-9)


def same(disks, expected, tolerance):
    state, (reference, modulus) = measure(disks), expected
    pairs = [
        {frozenset(pair) for pair in zip(c.i, c.j, strict=True)}
        for c in (measure(DISKS).contacts, state.contacts)
    ]
    assert pairs[0] == pairs[1] and disks.radii == pytest.approx(R, rel=1e-6)  # in their order
    assert disks.record["energy"] == pytest.approx(float(reference.energy), rel=tolerance)
    assert disks.record["pressure"] == pytest.approx(float(reference.pressure), rel=tolerance)
    found = Reference(disks.folded(), LAW).modulus(1e-2)
    assert abs(found - modulus) <= 100 * tolerance * abs(modulus)


@pytest.mark.parametrize("name", ["lammps-dump", "lammps-data", "extxyz", "xyr"])
def test_a_square_box_and_the_potential_that_is_told(tmp_path, name):
    """Published energy and stress of 64 polydisperse disks."""
    disks, record = polydisperse()
    x, r, L, n = disks.positions, disks.radii, disks.cell[0, 0], np.arange(64)
    bounds = f"0 {L:.17g}", f"0 {L:.17g}", "-0.5 0.5"
    columns = table(n, n, 2 * r, n, *x.T, 0 * r, order=range(64))
    text = {
        "lammps-dump": "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n64\nITEM: BOX BOUNDS\n{}\n{}\n{}\n"
        "ITEM: ATOMS id type diameter q x y z\n",
        "lammps-data": "\n64 atoms\n{} xlo xhi\n{} ylo yhi\n{} zlo zhi\n\nAtoms # sphere\n\n",
        "extxyz": f'64\nLattice="{L:.17g} 0 0 0 {L:.17g} 0 0 0 1" '
        "Properties=id:I:1:species:S:1:diameter:R:1:q:R:1:pos:R:3\n",
        "xyr": f"box {L:.17g}\n",
    }[name].format(*bounds) + (columns if name != "xyr" else table(*x.T, r, order=range(64)))
    (tmp_path / "p").write_text(text)
    found = jampetsc.import_packing(tmp_path / "p", stiffness="inverse-square-diameter")
    assert found.record["energy"] == pytest.approx(record["Energy"], rel=1e-12)
    assert found.record["pressure"] == pytest.approx(
        -(record["Stress"][0] + record["Stress"][3]) / 2, rel=1e-12
    )


def test_gsd_is_read_by_its_package(tmp_path, expected):
    """Positions have 24 bits there. Without the package the refusal says how to get it."""
    path = tmp_path / "p.gsd"
    if importlib.util.find_spec("gsd") is None:
        path.write_bytes(b"\xdf\x65" * 4)
        with pytest.raises(
            InputError, match=r"p\.gsd: GSD: requires the package gsd\. Run: .* -m pip install gsd"
        ):
            jampetsc.import_packing(path)
        return
    import gsd.hoomd

    frame = gsd.hoomd.Frame()
    frame.configuration.box, frame.configuration.dimensions = [LX, LY, 0, TILT / LY, 0, 0], 2
    frame.particles.N, frame.particles.diameter = 16, 2 * R
    with gsd.hoomd.open(path, "w") as file:
        for flipped in (1, -1):
            frame.particles.position = np.column_stack((flipped * X, 0 * R))
            file.append(frame)
    same(jampetsc.import_packing(path, 1), expected, 1e-3)
    same(jampetsc.import_packing(path, 0), expected, 1e-3)
    with pytest.raises(InputError, match=r"p\.gsd: index 99: no such packing \(2, numbered from 0\)"):
        jampetsc.import_packing(path, 99)
    for cut in (100, 300):
        (tmp_path / "cut.gsd").write_bytes(path.read_bytes()[:cut])
        with pytest.raises(InputError, match="not a file of GSD, or damaged"):
            jampetsc.import_packing(tmp_path / "cut.gsd")


def zipped(content):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("dump.lammpstrj", content)
    return stream.getvalue()


TEXT = dump("x y radius", *X.T, R)
REFUSED = {  # what is wrong -> (content, what is told, the message)
    "spread in z": (
        dump("x y z radius", *X.T, R, R, flags="pp pp ff"),
        {},
        "centres spread by 0.4 in z, but the box is not periodic along z.* or leave z out by dimension 2",
    ),
    "spread in z of data": (data(z=R), {}, "repeats at a distance of 1 with a particle"),
    "walls": (dump("x y radius", *X.T, R, flags="pp ff pp"), {}, r"must be periodic \(pp\) in x and y"),
    "walls of xyz": (extxyz('pbc="T F F"'), {}, 'pbc="T F F": must be periodic'),
    "tilted in z": (TEXT.replace("-0.5 0.5 0\n", "-0.5 0.5 1\n"), {}, "tilted out of the plane"),
    "tilted data": (data(tilt="0 1 0 xy xz yz\n"), {}, "tilted out of the plane"),
    "leaning data": (vectors(data(), lean=1), {}, "tilted out of the plane"),
    "tilted lattice": (extxyz(lattice="9 0 1 0 9 0 0 0 1"), {}, "tilted out of the plane"),
    "turned box of arrays": (  # of which no program says that rows are its vectors
        npz(positions=X, radii=R, box=[[9, 1], [0, 9]]),
        {},
        r"must be rows \(Lx, 0\)",
    ),
    "cell vector out of the plane": (general(TEXT, lean=1.0), {}, "tilted out of the plane"),
    "walls of cell vectors": (general(TEXT, flags="ff pp pp"), {}, r"must be periodic \(pp\) in x and y"),
    "cut off": (TEXT[:-300], {}, "lines for 16 particles: truncated"),
    "line cut off": (TEXT[:-25], {}, "not id type x y radius"),
    "no radii": (
        TEXT.replace("radius", "q"),
        {},
        r"no column radius or diameter among id, type, x, y, q\. Name the column of the radii by radius, or give a "
        r"radius for each type: radius 1=0\.5\.$",
    ),
    "no such column": (
        TEXT,
        {"radius": "size"},
        r"no column size among id, type, x, y, radius\. Name the column",
    ),
    "no radii of arrays": (
        npz(positions=X, box=9.0),
        {},
        "among positions, box.* give arrays to jampetsc.Packing",
    ),
    "no radius of a type": (
        TEXT,
        {"radius": "2=1"},
        "no radius for type 1. Give one for each type by radius, which",
    ),
    "no radius in a type": (TEXT, {"radius": "1=0.5,2"}, r"radius 2=: must be positive. Give TYPE=R"),
    "negative radius of a type": (TEXT, {"radius": {1: -0.5}}, r"radius 1=-0.5: must be positive"),
    "no types": (npz(positions=X, box=9.0), {"radius": "1=0.5"}, "no column type or .* among positions, box"),
    "no coordinates": (TEXT.replace("x y", "a b"), {}, "no coordinates x y, xu yu, xs ys or xsu ysu"),
    "no numbers": (TEXT.replace("x y radius", "x radius y").replace("9.", "z"), {}, "not numbers"),
    "no frame": (TEXT, {"index": 1}, r"index 1: no such packing \(1, numbered from 0\)"),
    "points": (data("atomic"), {}, r"not id type x y z \(10 words for 5\)"),
    "ellipses": (
        data("ellipsoid"),
        {},
        "Atoms # ellipsoid: must be one of sphere, .* Write the style there, e.g.",
    ),
    "no hint": (data("").replace(" # ", ""), {}, r"\(no style\): must be one of sphere"),
    "no bounds": (data().replace("ylo yhi", ""), {}, "no ylo yhi in the header"),
    "short xyz": (extxyz()[:-60], {}, "lines for 16 particles|line 'A"),
    "xyz of no count": (extxyz() + "x\n", {}, "'x': not a number of particles"),
    "no box": (XYR, {}, "no box. Give box, as L, Lx,Ly or Lx,Ly,xy"),
    "two boxes": (TEXT, {"box": 10.0}, "a box in the file. Leave out box"),
    "box of words": (f"box a b\n{XYR}", {}, "a b: not numbers"),
    "negative": (f"box 9\n{XYR.replace(' 1.3', ' -1.3')}", {}, r"radii\[8\] = -1.4: must be positive"),
    "small box": (f"box 1.9\n{XYR}", {}, "a particle would touch its own image"),
    "one place": (f"box 99\n{XYR}{XYR}", {}, r"particles \d+ and \d+ are in one place"),
    "npz of others": (npz(x=X), {}, "no array positions among x|no radius"),
    "objects": (npz(positions=np.array([None])), {}, "not arrays of numpy.savez, or damaged"),
    "zip": (b"PK\x03\x04 and so on", {}, "not arrays of numpy.savez, or damaged"),
    "not as told": (
        TEXT,
        {"format": "xyr"},
        "line '0': not ITEM: TIMESTEP .* or name the columns by",
    ),
    "no text": (b"\xff\xfe\xff" * 9, {"format": "extxyz"}, "extxyz: not a text file"),
    "potential": (
        TEXT,
        {"potential": "lj"},
        "potential 'lj': not supported. Choose one of harmonic, hertzian, power",
    ),
    "exponent of harmonic": (TEXT, {"exponent": 3.0}, "exponent 3.0: of the potential power alone"),
    "no exponent": (TEXT, {"potential": "power"}, "exponent: missing. Give that of the potential power"),
    "small exponent": (
        TEXT,
        {"potential": "power", "exponent": 1.0},
        "exponent 1.0: must be a number from 2 to 10",
    ),
    **{
        program: (
            compress(TEXT.encode()),
            told,
            f"compressed by {program}. Decompress it first: {command} .*any$",
        )
        for program, compress, told, command in (
            ("gzip", gzip.compress, {}, "gunzip --keep"),
            ("bzip2", bz2.compress, {}, "bunzip2 --keep"),
            ("xz", lzma.compress, {"format": "lammps-dump"}, "unxz --keep"),
            ("zip", zipped, {}, "unzip"),
            ("zstd", b"\x28\xb5\x2f\xfd".__add__, {}, "unzstd"),
        )
    },
}


@pytest.mark.parametrize("wrong", REFUSED)
def test_what_is_no_packing_in_the_plane_is_refused_in_one_line(tmp_path, wrong):
    content, told, message = REFUSED[wrong]
    path = tmp_path / "packing.any"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=message) as refused:
        jampetsc.import_packing(path, **told)
    assert str(refused.value).startswith(f"{path}: ") and "\n" not in str(refused.value)


def test_forms_of_a_box():
    box = Box(10, 9, xy=0.5, periodic=[True, True, False])
    assert cell_of(box).tolist() == [[10, 0], [4.5, 9]]
    assert cell_of(10).tolist() == [[10, 0], [0, 10]]
    assert cell_of([10.0, 9.0]).tolist() == [[10, 0], [0, 9]]
    assert cell_of((10, 9, -0.5)).tolist() == [[10, 0], [-0.5, 9]]
    assert cell_of([[10, 0], [3, 9]]).tolist() == [[10, 0], [3, 9]]


def test_arrays_are_a_packing(expected):
    disks = jampetsc.Packing(np.column_stack((X, 0 * R)), R.tolist(), DISKS.cell)
    same(disks, expected, 1e-12)
    assert disks.record["max_force"] < 1e-10 and disks.record["phi"] == DISKS.phi
    hertzian = jampetsc.Packing(X, R, (LX, LY, TILT), "hertzian", stiffness="inverse-square-diameter", k=100)
    assert hertzian.potential == Potential("hertzian", "inverse-square-diameter", 100.0)
    radii = R.copy()
    disks = jampetsc.Packing(X, radii, DISKS.cell)
    radii *= 2.0
    assert np.array_equal(disks.radii, R)  # it has its own
    for k, message in (("stiff", "k: must be"), ([1, 2], r"k of shape \(2,\): must be one number")):
        with pytest.raises(InputError, match=message):
            jampetsc.Packing(X, R, DISKS.cell, k=k)


@pytest.mark.parametrize(
    ("positions", "radii", "box", "message"),
    [
        (X[:, :1], R, 10, r"positions \(16, 1\), radii \(16,\)"),
        (X, R[:-1], 10, r"radii \(15,\)"),
        (X, R, (1, 2, 3, 4), r"cell of shape \(4,\): must be L, \(Lx, Ly\)"),
        (X, R, np.ones((3, 3)), "tilted out of the plane"),
        (X, R, "wide", "cell: must be an array of real numbers"),
        (X, ["a"] * 16, 10, "radii: must be an array of real numbers"),
        (X * (1 + 1j), R, 10, "positions: must be an array of real numbers"),
        (
            np.ma.masked_greater(X, 3.0),
            R,
            10,
            "positions: must be an array of real numbers, none of them masked",
        ),
        (X, [10**400] * 16, 10, "radii: must be an array of real numbers"),
        (X * np.nan, R, 10, r"positions\[0\] = .*must be finite"),
        (X, R, np.inf, "cell inf: must be finite"),
        (X, -R, 10, r"radii\[0\] = -1.0: must be positive"),
        (X, R, -10, "must be rows"),
        (X, R, 2.5, "a particle would touch its own image"),
        (np.column_stack((X, X)), R, 10, r"positions \(16, 4\)"),
        (np.column_stack((X, R)), R, (10, 9), "centres spread by 0.4 in z"),
        (X[[0, *range(15)]], R, 10, "particles 0 and 1 are in one place"),
        (X, R, Box(9, 9, periodic=(True, False, True)), "must be periodic in x and"),
    ],
)
def test_arrays_that_are_no_packing(positions, radii, box, message):
    with pytest.raises(InputError, match=message):
        jampetsc.Packing(positions, radii, box)


def test_the_command_says_units_and_whether_forces_balance(tmp_path, capsys):
    (tmp_path / "p.txt").write_text(XYR)

    def imported(*words):
        words = (f"{tmp_path}/p.txt", "--out", f"{tmp_path}/p.h5", "--overwrite", *words)
        assert cli.dispatch(["import", *words]) == 0
        return capsys.readouterr().out

    box = ("--box", f"{LX:.17g},{LY:.17g},{TILT:.17g}")
    said = imported(*box)
    assert "16 disks, phi = 0.814949066, read as xyr" in said and "balanced" not in said
    assert f"lengths as in {tmp_path}/p.txt; U = (k/2) δ^2, k = 1" in said and "radii     1 to 1.4" in said
    assert "  assumed   potential, stiffness, k: not in " in said
    assert ".txt. If they differ, give --potential, --stiffness, --k\n" in said + "\n"
    law = ("--potential", "hertzian", "--stiffness", "inverse-square-diameter", "--k", "3")
    said = imported(*box, *law, "--format", "xyr", "--frame", "0")
    assert "U = (k/2.5) (δ/σ)^2.5, k = 3" in said and "assumed  " not in said
    assert "forces    not balanced, max|F|/(p d) = " in said
    notes = jampetsc.load(tmp_path / "p.h5").record["notes"]
    assert notes.startswith("forces are not balanced: max|F|/(p d) = ")
    (tmp_path / "p.txt").write_text(TEXT)
    assert "give --potential, --stiffness, --k; LAMMPS' harmonic/cut K means k = 2K" in imported()
    (tmp_path / "p.txt").write_text(XYR)
    imported(*box, *law)
    assert read_packing(tmp_path / "p.h5").potential == Potential("hertzian", "inverse-square-diameter", 3.0)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_the_command_that_minimises_is_run_as_it_is_printed(session, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("moved.txt").write_text(f"box {LX} {LY} {TILT}\n" + table(*X.T, 1.05 * R))
    assert cli.dispatch(["import", "moved.txt", "--out", "own packing.h5"]) == 0
    said = capsys.readouterr().out
    command = said.partition("To minimise the energy: jampetsc ")[2]
    assert "--out 'own packing-minimum.h5'" in command
    assert cli.dispatch(shlex.split(command)) == 0
    start, found = read_packing("own packing.h5"), read_packing("own packing-minimum.h5")
    assert found.phi == pytest.approx(start.phi, rel=1e-12) and found.record["negative_modes"] == 0
    assert measure(found).max_force < 1e-10 < 1e-3 < measure(start).max_force

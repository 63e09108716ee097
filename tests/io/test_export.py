"""`jampetsc export`: what is in the files, read by what imports them, and the stress of a disk."""

import re
import xml.etree.ElementTree as ElementTree
from importlib.util import find_spec

import numpy as np
import pytest
import samples
from dense import all_pairs

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.disk_motion import snapshot
from jampetsc.io.exchange import READERS
from jampetsc.io.exporters import write_frames
from jampetsc.io.frames import packing_frame
from jampetsc.io.packing_file import write_packing
from jampetsc.packing.contacts import assigned_volumes, disk_stresses, find_contacts, measure
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential


def export(words):
    assert cli.dispatch(["export", *words.split()]) == 0


def frames_of(path):
    """[({name of column: values}, cell (2, 2), {name: number of the whole}), …] of the frames of a text file."""
    found, text = [], path.read_text()
    starts = {".xyz": "Lattice=", ".dump": "ITEM: TIMESTEP", ".data": "LAMMPS data"}
    formats = {".xyz": "extxyz", ".dump": "lammps-dump", ".data": "lammps-data"}
    for index, part in enumerate(text.split(starts[path.suffix])[1:]):
        table = READERS[formats[path.suffix]](text.encode(), index)
        numbers = {
            name: np.asarray(column, float) for name, column in table.columns.items() if name != "species"
        }
        facts = re.findall(r"(\w+)=([-+.\de]+)", part.partition("\n")[0])
        found.append((numbers, table.geometry(table.box).cell, {name: float(value) for name, value in facts}))
    return found


def pair(columns, name):
    """The vectors (N, 2) of a column of extended XYZ."""
    return np.column_stack((columns[f"{name}0"], columns[f"{name}1"]))


def vtp(path):
    """{name: values} of all arrays of a VTK PolyData file."""
    arrays = {}
    for item in ElementTree.parse(path).iter("DataArray"):
        if item.get("type") == "String":
            arrays[item.get("Name")] = bytes(map(int, item.text.split())).decode().rstrip("\0")
            continue
        values = np.array(item.text.split(), {"Int64": int, "Float64": float}[item.get("type")])
        size = item.get("NumberOfComponents")
        arrays[item.get("Name")] = values.reshape(-1, int(size)) if size else values
    return arrays


@pytest.mark.parametrize("sample", ["published", "k = 2.5", "isostatic", "two images"])
def test_stresses_of_disks_are_halves_of_the_virials_of_their_contacts(sample):
    disks, k = samples.SAMPLES[sample](), samples.SAMPLES[sample]().potential.k
    areas, stress = assigned_volumes(disks), disk_stresses(disks, find_contacts(disks))
    wanted = np.zeros((disks.n, 2, 2))
    for i, j, r in zip(*all_pairs(disks.positions, disks.radii, disks.cell), strict=True):
        r = np.asarray(r, float)
        force = k * (disks.radii[i] + disks.radii[j] - np.hypot(*r)) * r / np.hypot(*r)
        for one in (i, j):
            wanted[one] -= np.outer(force, r) / (2 * areas[one])
    np.testing.assert_allclose(stress, wanted, atol=1e-12 * k if sample != "isostatic" else 1e-14)


def inside(cell, positions):
    """Whether the fractional coordinates lie between 0 and 1."""
    fractions = positions @ np.linalg.inv(cell)
    return (fractions > -1e-9).all() and (fractions < 1 + 1e-9).all()


@pytest.mark.parametrize("sample", ["isostatic", "strips"])
def test_a_packing_in_every_format(tmp_path, monkeypatch, sample):
    monkeypatch.chdir(tmp_path)
    disks = samples.SAMPLES[sample]()
    write_packing("p.h5", disks)
    for ending in ("xyz", "dump", "data", "vtp", "npz"):
        for _ in range(2):  # the second in the place of the first
            export(f"p.h5 --out p.{ending}")
    state, contacts = measure(disks), find_contacts(disks)
    held = np.load("p.npz")
    ((columns, lattice, facts),), ((rows, cell, _),), ((atoms, box, _),) = (
        frames_of(tmp_path / f"p.{ending}") for ending in ("xyz", "dump", "data")
    )
    arrays = vtp(tmp_path / "p.vtp")

    shifts = (disks.positions - held["positions"]) @ np.linalg.inv(held["cell"])
    np.testing.assert_allclose(shifts, shifts.round(), atol=1e-9)  # by cell vectors: the lattice is the same
    turns = (disks.cell @ np.linalg.inv(held["cell"])).round()
    np.testing.assert_allclose(turns @ held["cell"], disks.cell, atol=1e-12)
    assert abs(held["cell"][1, 0]) <= held["cell"][0, 0] / 2 and inside(held["cell"], held["positions"])
    for other in (lattice, cell, box, arrays["cell"][:, :2]):
        np.testing.assert_allclose(other, held["cell"], rtol=1e-14)
    places = [np.column_stack((one["x"], one["y"])) for one in (columns, rows, atoms)]
    for other in (*places, arrays["points"][: disks.n, :2]):
        np.testing.assert_array_equal(other, held["positions"])

    number = np.bincount(np.r_[state.contacts.i, state.contacts.j], minlength=disks.n)
    for found in (columns, rows, held, {name: values[: disks.n] for name, values in arrays.items()}):
        np.testing.assert_array_equal(found["radius"], disks.radii)
        np.testing.assert_array_equal(found["rattler"], state.rattlers)
        np.testing.assert_array_equal(found["coordination"], number)
        normal = (found["stress_xx"] + found["stress_yy"]) @ found["area"]
        assert -normal / 2 / disks.volume == pytest.approx(state.pressure, rel=1e-12)
    np.testing.assert_array_equal(atoms["diameter"], 2 * disks.radii)
    assert facts["pressure"] == arrays["pressure"][0] == state.pressure
    for name in ("xyz", "dump", "data", "npz"):
        again = jampetsc.import_packing(tmp_path / f"p.{name}")
        assert again.potential == disks.potential and "assumed" not in again.record
    law = disks.potential
    assert (arrays["potential"], arrays["stiffness"], arrays["k"][0]) == (law.kind, law.stiffness, law.k)

    assert held["contact_bearing"].sum() == len(state.contacts)
    np.testing.assert_array_equal(held["contact_overlap"], contacts.overlap)
    lines = (tmp_path / "p.data").read_text().partition("\nBonds\n\n")[2].splitlines()
    bonds = np.array([line.replace("#", "").split()[2:] for line in lines], float)
    np.testing.assert_array_equal(bonds[:, :2].astype(int) - 1, held["contact_pairs"])
    np.testing.assert_array_equal(bonds[:, 2:].T, (contacts.force, contacts.overlap))
    i, j = arrays["connectivity"].reshape(-1, 2).T
    length = np.linalg.norm(arrays["points"][j] - arrays["points"][i], axis=1)
    overlap = arrays["radius"][i] + arrays["radius"][j] - length
    np.testing.assert_allclose(overlap, contacts.overlap, atol=1e-13)
    np.testing.assert_array_equal(arrays["force"], contacts.force)
    np.testing.assert_array_equal(arrays["disk"][j], contacts.j)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_motion_is_shown_on_the_packing(session, shared_path, monkeypatch):
    monkeypatch.chdir(shared_path)
    disks = samples.isostatic()
    write_packing("p.h5", disks)
    modes = jampetsc.modes("p.h5", count=3, out="modes.h5")
    sweep = jampetsc.sweep("p.h5", omega=1.0, fields=[1e-3, 1.0], out="s.h5")
    slow = jampetsc.quasistatic("p.h5", out="slow.h5")
    for words in (
        "modes.h5 --mode 3 --out mode.xyz",
        "s.h5 --field 1e-3 --out field.vtp",
        "slow.h5 --out slow.npz",
    ):
        export(words)
    ((columns, _, facts),) = frames_of(shared_path / "mode.xyz")
    mode, rattlers = pair(columns, "mode"), np.setdiff1d(np.arange(disks.n), modes["particles"])
    np.testing.assert_array_equal(mode[modes["particles"]], modes["modes"][2])
    assert facts["eigenvalue"] == modes["eigenvalues"][2] and len(rattlers) == 2
    assert not mode[rattlers].any() and columns["rattler"][rattlers].all()
    arrays = vtp(shared_path / "field.vtp")
    for part in ("real", "imag"):
        shown = arrays[f"displacement_{part}"][sweep["particles"], :2]
        np.testing.assert_array_equal(shown, getattr(sweep["fields/displacement"][0], part))
        assert len(arrays[f"rotation_{part}"]) == len(arrays["points"])
    np.testing.assert_array_equal(np.load("slow.npz")["nonaffine"][slow["particles"]], slow["nonaffine"])


@pytest.mark.scalar("real")
def test_what_lies_in_memory_is_told_and_exported_as_its_file_is(session, shared_path, monkeypatch):
    """On several ranks, each of which holds its own rows of the field."""
    monkeypatch.chdir(shared_path)
    disks = samples.isostatic()
    sweep = jampetsc.sweep(disks, omega=1.0, fields=[1.0])
    told = jampetsc.info(sweep).splitlines()
    with pytest.raises(InputError, match=r"out: missing\. Give the file to write"):
        jampetsc.export(sweep, field=1.0)
    assert str(jampetsc.export(sweep, field=1.0, out="memory.dump")) == "memory.dump"
    sweep.save("s.h5")
    jampetsc.export("s.h5", field=1.0, packing=disks, out="file.dump")
    session.comm.Barrier()
    assert (shared_path / "memory.dump").read_bytes() == (shared_path / "file.dump").read_bytes()
    of_file = jampetsc.info("s.h5").splitlines()
    assert told[0].startswith("sweep in memory: sweep of ") and len(of_file) == len(told)
    assert len([1 for one, other in zip(told, of_file, strict=True) if one != other]) <= 4  # name, files, run
    merged = jampetsc.merge("s.h5")
    assert merged.modulus(1.0) == sweep.modulus(1.0)
    assert merged["particles"].size == session.comm.allreduce(sweep["particles"].size)


def test_a_flow_is_one_file_of_many_frames(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flow = "flow --n 16 --phi 0.9 --seed 1 --model RD0 --rate 1e-2 --strain 1.0 --discard 0.3 --snapshots 3 --out f.h5"
    assert cli.dispatch(flow.split()) == 0
    result = jampetsc.load("f.h5")
    export("f.h5 --out f.xyz")
    export("f.h5 --out f.dump")
    texts, rows = frames_of(tmp_path / "f.xyz"), frames_of(tmp_path / "f.dump")
    assert len(texts) == len(rows) == 3
    tilts = []
    for row, ((columns, _, facts), (shown, cell, _)) in enumerate(zip(texts, rows, strict=True)):
        disks = snapshot(result, row)
        velocity = result["snapshots/velocities"][row]
        np.testing.assert_array_equal(pair(columns, "velo"), velocity)
        np.testing.assert_array_equal((shown["vx"], shown["vy"]), velocity.T)
        assert disks.strain == result["snapshots/strain"][row] and np.array_equal(disks.velocities, velocity)
        np.testing.assert_array_equal((shown["ix"], shown["iy"]), disks.images.T)
        turned = disks.reordered(np.arange(disks.n)[::-1])  # with all that is of a disk
        assert np.array_equal(turned.unwrapped[::-1], disks.unwrapped)
        assert np.array_equal(turned.velocities[::-1], velocity) and turned.strain == disks.strain
        np.testing.assert_array_equal(pair(columns, "image"), disks.images)
        np.testing.assert_array_equal(pair(columns, "unwrapped"), disks.unwrapped)
        assert facts["strain"] == result["snapshots/strain"][row] and facts["rate"] == 0.01
        places = np.column_stack((shown["x"], shown["y"]))
        pairs = [all_pairs(p, disks.radii, c) for p, c in ((places, cell), (disks.positions, disks.cell))]
        one, other = (sorted(np.hypot(*np.array(r, float).T)) for *_, r in pairs)
        np.testing.assert_allclose(one, other, rtol=1e-12)  # the same contacts in the cell that is written
        assert inside(cell, places) and abs(cell[1, 0]) <= cell[0, 0] / 2
        for name in ("f.xyz", "f.dump"):
            again = jampetsc.import_packing(name, row)
            assert again.potential == disks.potential == Potential("harmonic", "inverse-square-diameter", 1.0)
            assert again.record["pressure"] == pytest.approx(measure(disks).pressure, rel=1e-12)
            assert again.record["units"] == result.attributes["units"] and "assumed" not in again.record
        tilts.append((result["snapshots/strain"][row] - cell[1, 0] / cell[1, 1]) * cell[1, 1] / cell[0, 0])
    np.testing.assert_allclose(tilts, np.round(tilts), atol=1e-9)
    assert snapshot(result, -3).strain == snapshot(result, 0).strain
    for row in (3, -4):
        with pytest.raises(InputError, match=rf"f\.h5: no snapshot {row} \(3, numbered from 0\)"):
            snapshot(result, row)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["f.dump", "f.h5", "f.xyz"]


def test_disks_that_do_not_touch_are_exported_without_contacts_and_by_their_sizes(tmp_path):
    disks = Packing.from_positions(np.array([[1.0, 1.0], [5.0, 5.0]]), np.array([0.5, 0.7]), 9.0 * np.eye(2))
    for ending in ("xyz", "dump", "data", "vtp", "npz"):
        assert write_frames(tmp_path / f"p.{ending}", [packing_frame(disks)]) == 1
    assert vtp(tmp_path / "p.vtp")["connectivity"].size == 0
    for ending in ("xyz", "dump", "data", "npz"):
        found = jampetsc.import_packing(tmp_path / f"p.{ending}")
        np.testing.assert_array_equal(found.positions, disks.positions)
    for exponent in (2.5, 2.25):
        soft = disks.replace(potential=Potential(None, "inverse-square-diameter", 2.5e-7, exponent))
        for ending in ("xyz", "dump", "data", "npz", *(["gsd"] if find_spec("gsd") else [])):
            path = tmp_path / f"h.{ending}"
            write_frames(path, [packing_frame(soft)])
            found = jampetsc.import_packing(path)
            assert found.potential == soft.potential and "assumed" not in found.record
            constant = jampetsc.import_packing(path, stiffness="constant").potential
            assert constant == Potential(exponent=exponent, k=2.5e-7)
            harmonic = jampetsc.import_packing(path, potential="harmonic").potential
            assert harmonic == Potential("harmonic", "inverse-square-diameter", 2.5e-7)
    row = np.column_stack((3.0 * np.arange(11), np.ones(11)))
    for count, types in ((2, [1, 2]), (10, range(1, 11)), (11, [1] * 11)):  # where sizes are few
        disks = Packing.from_positions(row[:count], 0.5 + 0.01 * np.arange(count), 40.0 * np.eye(2))
        write_frames(tmp_path / "p.dump", [packing_frame(disks)])
        assert frames_of(tmp_path / "p.dump")[0][0]["type"].tolist() == list(types)

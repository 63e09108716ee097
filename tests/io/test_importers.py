"""Published packings: their numbers come out, and files that are something else are refused."""

import os
import re
from contextlib import nullcontext

import h5py
import numpy as np
import pytest
from samples import JAMBASHBULK, JAXMD

from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io import importers
from jampetsc.io.importers import import_packing
from jampetsc.io.packing_file import read_packing
from jampetsc.packing.contacts import measure
from jampetsc.packing.potentials import Potential


def test_jambashbulk_has_its_published_numbers():
    disks = import_packing(JAMBASHBULK)
    state = measure(disks)
    assert disks.potential == Potential("harmonic", "constant", 1.0)
    assert np.unique(disks.radii).tolist() == [1.0, 1.4]
    cell = [[9.5393607291793076, 0.0], [0.063057565492152521, 9.5693366275464142]]
    assert np.allclose(disks.cell, cell, 0, 1e-15)
    assert disks.phi == pytest.approx(0.81494906634508, rel=1e-12)
    assert (len(state.contacts), state.coordination, state.rattlers.sum()) == (33, 4.125, 0)
    assert state.energy == pytest.approx(0.00010928358570711, rel=1e-10)
    assert disks.record["pressure"] == state.pressure == pytest.approx(1e-3, rel=1e-9)
    assert state.max_force < 1e-10 and disks.record["published_pressure"] == 1e-3


@pytest.mark.parametrize("index", range(10))
def test_jaxmd_has_its_published_numbers(index):
    disks = import_packing(JAXMD, index)
    state, record = measure(disks), disks.record
    assert disks.n == 64
    assert disks.potential == Potential("harmonic", "inverse-square-diameter", 1.0)
    with h5py.File(JAXMD) as h5:
        energy, stress, moduli = (h5[name][index] for name in ("Energy", "Stress", "Cijkl"))
    assert state.energy == pytest.approx(energy, rel=1e-12)
    assert np.allclose(state.stress.ravel(), stress, rtol=0, atol=1e-14)
    assert state.pressure == pytest.approx(-(stress[0] + stress[3]) / 2, rel=1e-12)
    assert state.max_force == record["max_force"] < 1e-12
    names = ("energy", "stress_xy", "C_xyxy", "C_xxyy")
    assert [record[f"published_{name}"] for name in names] == [energy, stress[1], *moduli[2:4]]
    assert (record["imported_index"], record["phi"]) == (index, disks.phi)


def test_cell_vectors_are_the_columns_of_a_box(tmp_path):
    """The same packing in the cell with a₂ + a₁ for a₂."""
    (tmp_path / "x.nc").write_bytes(JAXMD.read_bytes())
    with h5py.File(tmp_path / "x.nc", "r+") as h5:
        box, s = h5["box"][0].reshape(2, 2), h5["pos"][0].reshape(-1, 2)
        tilted = box + box[0, 0] * np.eye(2, k=1)
        h5["box"][0] = tilted.ravel()
        h5["pos"][0] = np.column_stack((s[:, 0] - s[:, 1], s[:, 1])).ravel()
        h5["Stress"][0] += [0.0, 1e-3, 2e-3, 0.0]  # which the pressure does not show
        stress = h5["Stress"][0].tolist()
    plain, disks = import_packing(JAXMD), import_packing(tmp_path / "x.nc")
    assert disks.cell[1, 0] == tilted[0, 1] != 0 and disks.cell[0, 1] == 0
    assert disks.record["energy"] == pytest.approx(plain.record["energy"], rel=1e-12)
    assert [disks.record[f"published_stress_{name}"] for name in ("xx", "xy", "yx", "yy")] == stress
    with h5py.File(tmp_path / "x.nc", "r+") as h5:
        h5["pos"][...] *= 0.99
    with pytest.raises(InputError, match=r"x\.nc: pressure is .* but stored as 0\.1002.*: another potential"):
        import_packing(tmp_path / "x.nc")


TEXT = JAMBASHBULK.read_text()
NONE_OF = "none of lammps-data, lammps-dump, extxyz, gsd, xyr, npz, jamBashbulk, jax-md"
SPOILED = {  # what is wrong -> (content, the message)
    "a line lost": ("\n".join(TEXT.splitlines()[:20]), "lines x, y, r for N = 16 particles: truncated"),
    "the end lost": (TEXT.replace("\n}", "\n"), "lines x, y, r for N = 16 particles: truncated"),
    "no L2": (TEXT.replace("L2=", "LL="), "no L2 = … in the header"),
    "no P": (TEXT.replace("P =", "Q ="), "no P = … in the header"),
    "nan": (TEXT.replace("8.8767069662298361795", "nan"), r"positions\[0\].*must be finite"),
    "no pressure": (
        re.sub(r"P = [\d.e-]+", "P = nan", TEXT),
        "pressure is .* but stored as nan: another potential",
    ),
    "no number": (TEXT.replace("8.8767069662298361795", "8.8.7"), r"8\.8\.7 .*: not numbers"),
    "negative": (TEXT.replace("1.3999999999999999112", "-1.4"), r"radii\[8\] = -1.4: must be positive"),
    "moved": (TEXT.replace("8.87670", "8.97670"), "pressure is .* but stored as 0.001: another"),
    "cell": (TEXT.replace("9.5393607291793076335 ,", "1.5 ,"), "cell that repeats at .*use more particles"),
    "other text": ("the quick brown fox\n", NONE_OF),
    "empty": ("", NONE_OF),
    "netCDF of another kind": (
        b"CDF\x01" + bytes(range(256)),
        "netCDF 3, .*: not supported. Write a dump",
    ),
    "half": (JAXMD.read_bytes()[:20000], "truncated"),
}


def h5_of(tmp_path, attrs=None, **arrays):
    """The content of an HDF5 file of these arrays."""
    with h5py.File(tmp_path / "made.h5", "w") as h5:
        h5.attrs.update(attrs or {})
        for name, array in arrays.items():
            h5[name] = array
    return (tmp_path / "made.h5").read_bytes()


def refused(path, content, message):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=message) as caught:
        import_packing(path)
    assert str(caught.value).startswith(f"{path}: ") and str(caught.value).count(f"{path}") == 1
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("spoiled", SPOILED)
def test_spoiled_files_are_refused_in_one_line(tmp_path, spoiled):
    refused(tmp_path / "packing.txt", *SPOILED[spoiled])


def test_hdf5_of_other_contents_is_refused_in_one_line(tmp_path):
    path = tmp_path / "x.nc"
    for pos, rad, box in ((8, 4, 9), (12, 5, 4), (8, 4, 2)):
        arrays = {"pos": np.ones((1, pos)), "rad": np.ones((1, rad)), "box": np.ones((1, box))}
        message = f"{pos} coordinates for {rad} particles in a box of {box} numbers: neither two- nor three-dimensional"
        refused(path, h5_of(tmp_path, **arrays), message)
    refused(
        path, h5_of(tmp_path, pos=np.zeros((2, 8))), "no variable rad, box, hence not a packing of jax-md"
    )
    ours = h5_of(tmp_path, {"format": "jampetsc-packing"})
    refused(path, ours, "already a jampetsc-packing file. Use it without import")
    with pytest.raises(InputError, match=r"none.txt: not "):
        import_packing(tmp_path / "none.txt")


@pytest.mark.parametrize(("off", "refused"), [(1e-8, False), (5e-7, False), (5e-6, True), (1e-5, True)])
def test_how_far_a_stored_pressure_may_be_off(tmp_path, off, refused):
    """Published numbers have some nine digits; 1e-5 is another packing."""
    spoiled = tmp_path / "packing.txt"
    spoiled.write_text(re.sub(r"P = [\d.e-]+", f"P = {1e-3 * (1 + off):.17g}", JAMBASHBULK.read_text()))
    with pytest.raises(InputError, match=r"pressure is .* but stored as") if refused else nullcontext():
        assert import_packing(spoiled).n == 16


def test_a_file_without_an_end_is_not_read(tmp_path, monkeypatch):
    """A pipe whose writer goes on, and a text larger than a packing can be."""
    os.mkfifo(tmp_path / "pipe")
    holder = os.open(tmp_path / "pipe", os.O_RDWR)  # keeps a writer there: a reader would wait
    with pytest.raises(InputError, match=r"not a regular file\. Give a regular file"):
        import_packing(tmp_path / "pipe")
    os.close(holder)
    monkeypatch.setattr(importers, "MAX_TEXT_BYTES", 1000)
    with pytest.raises(InputError, match=r"too large \(at most 0 MB\)\. Cut"):
        import_packing(JAMBASHBULK)


def test_which_packing_of_many(tmp_path):
    two = tmp_path / "two.txt"
    text = JAMBASHBULK.read_text()
    head, _, rows = text.partition("\n{\n")
    *rows, end = rows.strip().splitlines()
    two.write_text(text + "\n".join([head, "{", *reversed(rows), end]))
    for index in (0, 1):
        assert np.array_equal(
            import_packing(two, index).positions, import_packing(JAMBASHBULK).positions[:: 1 - 2 * index]
        )
    lines, arrays = tmp_path / "one.xyr", tmp_path / "one.npz"
    lines.write_text("box 4\n0 0 0.5\n2 2 0.5\n")
    np.savez(arrays, positions=[[0, 0], [2, 2]], radii=[0.5, 0.5], box=[4.0])
    assert all(import_packing(path).n == 2 for path in (lines, arrays))
    beyond = (
        (two, 2, 2),
        (JAXMD, 10, 10),
        (JAXMD, -11, 10),
        (JAMBASHBULK, 1, 1),
        (lines, 1, 1),
        (arrays, 1, 1),
    )
    for path, index, count in beyond:
        with pytest.raises(InputError, match=rf"index {index}: no such packing \({count}, numbered from 0\)"):
            import_packing(path, index)


def test_the_command_writes_a_packing_file(tmp_path, capsys):
    out = tmp_path / "p.h5"
    assert cli.dispatch(["import", str(JAXMD), "--index", "9", "--out", str(out)]) == 0
    found, direct = read_packing(out), import_packing(JAXMD, 9)
    assert (found.fingerprint, found.potential) == (direct.fingerprint, direct.potential)
    assert {name: value for name, value in found.record.items() if name != "request"} == direct.record
    printed = capsys.readouterr().out
    assert "64 disks" in printed and "0.10047438   published 0.10047438" in printed

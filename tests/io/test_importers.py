"""Published packings: their numbers come out, and files that are something else are refused."""

import json
import os
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from jampetsc.cli import main as cli
from jampetsc.core.potentials import Potential
from jampetsc.core.state import measure
from jampetsc.errors import InputError
from jampetsc.io import importers
from jampetsc.io.importers import import_packing
from jampetsc.io.packing_file import read_packing

DATA = Path(__file__).parents[1] / "data"
JAMBASHBULK = DATA / "jambashbulk-N16-P1e-3-0001.txt"
JAXMD = DATA / "jaxmd-2d_polyuniform_N64_Lp-1.0.nc"


def test_jambashbulk_has_its_published_numbers():
    disks = import_packing(JAMBASHBULK)
    state = measure(disks)
    assert disks.potential == Potential("harmonic", "constant", 1.0)
    assert np.unique(disks.radii).tolist() == [1.0, 1.4]
    assert np.allclose(
        disks.cell, [[9.5393607291793076, 0.0], [0.063057565492152521, 9.5693366275464142]], 0, 1e-15
    )
    assert disks.phi == pytest.approx(0.81494906634508, rel=1e-12)
    assert len(state.contacts) == 33
    assert state.coordination == 4.125
    assert state.rattlers.sum() == 0
    assert state.energy == pytest.approx(0.00010928358570711, rel=1e-10)
    assert state.pressure == pytest.approx(1e-3, rel=1e-9)
    assert state.max_force < 1e-10
    assert disks.record["published_pressure"] == 1e-3
    assert disks.record["pressure"] == state.pressure


@pytest.mark.parametrize("index", range(10))
def test_jaxmd_has_its_published_numbers(index):
    disks = import_packing(JAXMD, index)
    state = measure(disks)
    assert disks.n == 64
    assert disks.potential == Potential("harmonic", "inverse-square-diameter", 1.0)
    with h5py.File(JAXMD) as h5:
        energy, stress, moduli = (h5[name][index] for name in ("Energy", "Stress", "Cijkl"))
    assert state.energy == pytest.approx(energy, rel=1e-12)
    assert np.allclose(state.stress.ravel(), stress, rtol=0, atol=1e-14)
    assert state.pressure == pytest.approx(-(stress[0] + stress[3]) / 2, rel=1e-12)
    assert state.max_force < 1e-12
    assert disks.record["published_energy"] == energy
    assert disks.record["published_stress_xy"] == stress[1]
    assert disks.record["published_C_xyxy"] == moduli[2] and disks.record["published_C_xxyy"] == moduli[3]
    assert disks.record["imported_index"] == index and disks.record["phi"] == disks.phi
    assert disks.record["max_force"] == state.max_force


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


def test_fractions_of_the_box_are_what_fits_the_energy(tmp_path):
    """Taken as lengths, the positions would have another energy: the file is refused, not misread."""
    spoiled = tmp_path / "x.nc"
    spoiled.write_bytes(JAXMD.read_bytes())
    with h5py.File(spoiled, "r+") as h5:
        h5["pos"][...] *= 0.99
    with pytest.raises(
        InputError, match=r"x\.nc: pressure is .* but stored as 0\.1002.*: another potential or unit"
    ):
        import_packing(spoiled)


EDITS = {
    "a line lost": (
        lambda text: "\n".join(text.splitlines()[:20]),
        "lines x, y, r for N = 16 disks: truncated",
    ),
    "the end lost": (lambda text: text.replace("\n}", "\n"), "lines x, y, r for N = 16 disks: truncated"),
    "no L2": (lambda text: text.replace("L2=", "LL="), "no L2 = … in the header"),
    "no P": (lambda text: text.replace("P =", "Q ="), "no P = … in the header"),
    "nan": (lambda text: text.replace("8.8767069662298361795", "nan"), r"positions\[0\].*must be finite"),
    "no pressure": (
        lambda text: re.sub(r"P = [\d.e-]+", "P = nan", text),
        "pressure is .* but stored as nan: another potential",
    ),
    "no number": (lambda text: text.replace("8.8767069662298361795", "8.8.7"), r"8\.8\.7 .*: not numbers"),
    "negative": (
        lambda text: text.replace("1.3999999999999999112", "-1.4"),
        r"radii\[8\] = -1.4: must be positive",
    ),
    "moved": (lambda text: text.replace("8.87670", "8.97670"), "pressure is .* but stored as 0.001: another"),
    "other text": (
        lambda text: "x y r\n1 2 3\n",
        "none of lammps-data, lammps-dump, extxyz, gsd, xyr, npz, jamBashbulk, jax-md",
    ),
    "empty": (
        lambda text: "",
        "none of lammps-data, lammps-dump, extxyz, gsd, xyr, npz, jamBashbulk, jax-md",
    ),
    "cell": (
        lambda text: text.replace("9.5393607291793076335 ,", "1.5 ,"),
        "cell that repeats at .*use more disks",
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_spoiled_text_is_refused_in_one_line(tmp_path, edit):
    change, message = EDITS[edit]
    spoiled = tmp_path / "packing.txt"
    spoiled.write_text(change(JAMBASHBULK.read_text()))
    with pytest.raises(InputError, match=message) as caught:
        import_packing(spoiled)
    assert str(caught.value).startswith(f"{spoiled}: ") and str(caught.value).count(f"{spoiled}") == 1
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("off", "refused"), [(1e-8, False), (5e-7, False), (5e-6, True), (1e-5, True)])
def test_how_far_a_stored_pressure_may_be_off(tmp_path, off, refused):
    """Published numbers have some nine digits; 1e-5 is another packing."""
    spoiled = tmp_path / "packing.txt"
    spoiled.write_text(re.sub(r"P = [\d.e-]+", f"P = {1e-3 * (1 + off):.17g}", JAMBASHBULK.read_text()))
    if refused:
        with pytest.raises(InputError, match=r"pressure is .* but stored as"):
            import_packing(spoiled)
    else:
        assert import_packing(spoiled).n == 16


def test_a_file_without_an_end_is_not_read(tmp_path, monkeypatch):
    """A pipe whose writer goes on, and a text larger than a packing can be."""
    os.mkfifo(tmp_path / "pipe")
    holder = os.open(tmp_path / "pipe", os.O_RDWR)  # keeps a writer there: a reader would wait
    with pytest.raises(InputError, match="is a pipe: give a regular file"):
        import_packing(tmp_path / "pipe")
    os.close(holder)
    monkeypatch.setattr(importers, "_LARGEST", 1000)
    with pytest.raises(InputError, match="more than 0 MB: cut"):
        import_packing(JAMBASHBULK)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "cut.nc").write_bytes(JAXMD.read_bytes()[:20000])
    (tmp_path / "classic.nc").write_bytes(b"CDF\x01" + bytes(range(256)))
    with h5py.File(tmp_path / "other.h5", "w") as h5:
        h5["pos"] = np.zeros((2, 8))
    with h5py.File(tmp_path / "ours.h5", "w") as h5:
        h5.attrs["format"] = "jampetsc-packing"
    with h5py.File(tmp_path / "3d.nc", "w") as h5:
        h5["pos"], h5["rad"], h5["box"] = np.ones((1, 12)), np.ones((1, 4)), np.ones((1, 9))
    with h5py.File(tmp_path / "odd.nc", "w") as h5:
        h5["pos"], h5["rad"], h5["box"] = np.ones((1, 12)), np.ones((1, 5)), np.eye(2).reshape(1, 4)
    with h5py.File(tmp_path / "flat.nc", "w") as h5:
        h5["pos"], h5["rad"], h5["box"] = np.ones((1, 8)), np.ones((1, 4)), np.ones((1, 2))
    cases = {
        "odd.nc": "12 coordinates for 5 disks: two-dimensional only",
        "flat.nc": "8 coordinates for 4 disks: two-dimensional only",
        "cut.nc": "truncated",
        "classic.nc": "none of lammps-data, lammps-dump, extxyz, gsd, xyr, npz, jamBashbulk, jax-md",
        "other.h5": "no variable rad, box: not a packing file of jax-md",
        "ours.h5": "is a jampetsc-packing file already: nothing to import",
        "3d.nc": "12 coordinates for 4 disks: two-dimensional only",
        "none.txt": "cannot be read",
    }
    for name, message in cases.items():
        with pytest.raises(InputError, match=message) as refused:
            import_packing(tmp_path / name)
        assert str(refused.value).startswith(f"{tmp_path / name}: ") and str(refused.value).count(name) == 1


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
    for path, index, count in ((two, 2, 2), (JAXMD, 10, 10), (JAXMD, -1, 10), (JAMBASHBULK, 1, 1)):
        with pytest.raises(InputError, match=f"index {index}: it holds {count} packings"):
            import_packing(path, index)


def imported(*words):
    return cli.dispatch(["import", *map(str, words)])


def test_the_command_writes_a_packing_file(tmp_path, capsys):
    out = tmp_path / "p.h5"
    assert imported(JAXMD, "--index", 9, "--out", out) == 0
    found, direct = read_packing(out), import_packing(JAXMD, 9)
    assert np.array_equal(found.base, direct.base)
    assert np.array_equal(found.offset, direct.offset)
    assert found.potential == direct.potential
    assert {name: value for name, value in found.record.items() if name != "request"} == direct.record
    assert json.dumps(found.record)  # plain Python values
    printed = capsys.readouterr().out
    assert "64 disks" in printed
    assert "0.10047438   published 0.10047438" in printed


def test_the_command_writes_nothing_for_bad_input(tmp_path):
    with pytest.raises(InputError, match="--index 10"):
        imported(JAXMD, "--index", 10, "--out", tmp_path / "p.h5")
    with pytest.raises(InputError, match="does not exist: create it first"):
        imported(JAXMD, "--out", tmp_path / "none" / "p.h5")
    assert list(tmp_path.iterdir()) == []

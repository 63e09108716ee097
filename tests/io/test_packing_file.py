"""Packing files: exact, complete or absent, and every defect named."""

from itertools import count

import h5py
import numpy as np
import pytest
from disk_faults import WRITES, killed

from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, read_packing, write_packing
from jampetsc.io.reader import load
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

RECORD = {
    "pressure": 1e-7,
    "phi": 0.84,
    "seed": 3,
    "protocol": "quench",
    "is_minimum": True,
    "energy": 0.1 + 0.2,
}


@pytest.fixture
def disks():
    rng = np.random.default_rng(1)
    n = 60
    return Packing.from_positions(
        20 * rng.random((n, 2)) - 5,
        rng.choice([0.5, 0.7], n),
        [[11.0 / 3, 0.0], [-0.1, 37.0 / 3]],
        Potential("hertzian", "inverse-square-diameter", 1.3),
        positions_low=1e-17 * rng.standard_normal((n, 2)),
        cell_low=1e-17 * np.array([[1.0, 0.0], [0.3, -1.0]]),
        record=RECORD,
    )


@pytest.fixture
def path(tmp_path, disks):
    write_packing(tmp_path / "p.h5", disks)
    return tmp_path / "p.h5"


def test_round_trip_keeps_every_bit(path, disks):
    for found in (read_packing(path), load(str(path))):
        for name in ("base", "offset", "radii", "cell_base", "cell_offset"):
            assert np.array_equal(getattr(found, name), getattr(disks, name)), name
        assert found.potential == disks.potential
        assert found.record == RECORD
        assert {type(value) for value in found.record.values()} == {float, int, str, bool}
        assert np.abs(found.offset - (found.positions - found.base)).max() > 1e-18, "one double would not do"


def test_the_record_does_not_rule_what_a_packing_is(path, disks):
    write_packing(path, disks.with_record(k=5.0, potential="harmonic", format="x", pressure=None))
    found = read_packing(path)
    assert found.potential == disks.potential and found.record.keys() == RECORD.keys() - {"pressure"}


def test_optional_contents_may_be_missing(path, disks):
    with h5py.File(path, "r+") as h5:
        del h5["positions_low"], h5["cell_low"], h5.attrs["k"], h5.attrs["format_version"], h5.attrs["seed"]
    found = read_packing(path)
    assert np.array_equal(found.positions, disks.positions)
    assert found.potential == Potential("hertzian", "inverse-square-diameter", 1.0)
    assert found.record.keys() == RECORD.keys() - {"seed"}


@pytest.mark.parametrize("exponent", [2.25, 3.1])
def test_any_exponent_is_kept(tmp_path, disks, exponent):
    soft = disks.replace(potential=Potential(exponent=exponent, k=1.3))
    write_packing(tmp_path / "p.h5", soft)
    found = read_packing(tmp_path / "p.h5")
    assert found.potential == soft.potential and found.fingerprint == soft.fingerprint != disks.fingerprint
    assert (
        found.fingerprint != soft.replace(potential=Potential(exponent=exponent + 1e-15, k=1.3)).fingerprint
    )


def put(h5, name, value):
    del h5[name]
    h5[name] = value


def claim(h5, count, names=("positions", "positions_low", "radii")):
    """Datasets of so many rows, of which nothing is written: the file stays small."""
    for name in names:
        del h5[name]
        h5.create_dataset(name, shape=(count, 2)[: 2 - (name == "radii")], chunks=True, dtype=float)


def change(name, index, value):
    return lambda h5: h5[name].__setitem__(index, value)


DEFECTS = {
    "nan": (change("positions", (7, 1), np.nan), r"positions\[7\].*nan.*must be finite"),
    "nan low": (change("positions_low", (7, 1), np.nan), r"positions_low\[7\].*must be finite"),
    "nan cell low": (change("cell_low", (0, 0), np.nan), r"cell_low\[0\] = .*must be finite"),
    "negative radius": (change("radii", 3, -0.5), r"radii\[3\] = -0.5: must be positive"),
    "flat cell": (change("cell", (1, 1), 0.0), r"cell: .*Lx, Ly > 0"),
    "no cell": (
        change("cell", (0, 0), 1e-300),
        "cell that repeats at .*use more particles",
    ),  # the search had no end
    "small cell": (change("cell", (0, 0), 1.0), r"cell that repeats at .*use more particles"),
    "rows missing": (
        lambda h5: put(h5, "radii", np.ones(59)),
        r"dataset radii: shape \(59,\), must be \(N,\) with N = 60",
    ),
    "no radii": (lambda h5: h5.__delitem__("radii"), r"dataset radii: missing"),
    "group": (
        lambda h5: (h5.__delitem__("cell"), h5.create_group("cell")),
        r"dataset cell: is a group, must hold real numbers",
    ),
    "text": (
        lambda h5: put(h5, "radii", ["a"] * 60),
        r"dataset radii: holds text or references, must hold real numbers",
    ),
    "complex": (lambda h5: put(h5, "radii", np.ones(60) * 1j), r"holds complex128, must hold real numbers"),
    "other format": (
        lambda h5: h5.attrs.update(format="jampetsc-sweep"),
        r"a jampetsc-sweep file\. Give a jampetsc-packing file",
    ),
    "potential": (
        lambda h5: h5.attrs.update(potential="WCA"),
        r"attribute potential = 'WCA': must be one of harmonic, hertzian, power. Make",
    ),
    "no potential": (
        lambda h5: h5.attrs.__delitem__("potential"),
        "potential: missing. Give one of harmonic",
    ),
    "no exponent": (lambda h5: h5.attrs.update(potential="power"), r"p.h5: exponent: missing. Give that of"),
    "small exponent": (
        lambda h5: h5.attrs.update(potential="power", exponent=1.5),
        r"p.h5: exponent 1.5: must be a number from 2 to 10",
    ),
    "worded exponent": (
        lambda h5: h5.attrs.update(potential="power", exponent="one"),
        r"attribute exponent = 'one': must be a real number",
    ),
    "other exponent": (
        lambda h5: h5.attrs.update(exponent=2.25),
        r"p.h5: exponent 2.25: of the potential power alone \(hertzian has 2.5\)",
    ),
    "no stiffness": (
        lambda h5: h5.attrs.__delitem__("stiffness"),
        r"stiffness: missing. Give one of constant",
    ),
    "negative k": (lambda h5: h5.attrs.update(k=-1.0), r"k = -1.0: must be a positive number"),
    "worded k": (lambda h5: h5.attrs.update(k="one"), r"attribute k = 'one': must be a real number"),
    "two k": (lambda h5: h5.attrs.update(k=[1.0, 2.0]), r"attribute k = .*: must be a real number"),
    "flags": (lambda h5: put(h5, "radii", np.ones(60, bool)), r"radii: holds true or false, must hold real"),
    "one too large": (
        lambda h5: claim(h5, 10**9, ["radii"]),
        r"radii: shape \(1000000000,\), must be \(N,\)",
    ),
    "too many": (lambda h5: claim(h5, 10**17), r"p.h5: larger than the memory"),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_defects_are_named_in_one_line(path, defect):
    spoil, message = DEFECTS[defect]
    with h5py.File(path, "r+") as h5:
        spoil(h5)
    with pytest.raises(InputError, match=message) as caught:
        read_packing(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_identity_is_name_and_hash_of_the_arrays(tmp_path, path, disks):
    """As a packing in memory has it."""
    found, identity = read_identified(path)
    assert identity == ("p.h5", disks.fingerprint) == ("p.h5", found.fingerprint)
    write_packing(tmp_path / "q.h5", disks.with_record(seed=99))
    assert read_identified(tmp_path / "q.h5")[1] == ("q.h5", disks.fingerprint)


def test_a_kill_at_any_moment_leaves_one_file_or_the_other_and_the_next_run_tidies_up(path, disks):
    for number in count():
        if not killed(number, lambda: write_packing(path, disks.with_record(seed=4)), WRITES):
            break
        assert read_packing(path).record["seed"] in (3, 4)
        write_packing(path, disks)
        assert [file.name for file in path.parent.iterdir()] == ["p.h5"]
    assert read_packing(path).record["seed"] == 4 and number > 5


@pytest.mark.scalar("real")
def test_rank_0_reads_for_all(session, shared_path, disks):
    """The other ranks are given a name that is not there."""
    name = shared_path / ("p.h5" if session.rank == 0 else "none.h5")
    if session.rank == 0:
        write_packing(name, disks)
    found, identity = read_identified(name, session.comm)
    assert identity[0] == "p.h5"
    assert len(set(session.comm.allgather((found.fingerprint, identity)))) == 1
    assert found.fingerprint == disks.fingerprint
    assert found.record == RECORD
    assert found.potential == disks.potential
    if session.rank == 0:
        name.write_text("no longer")
    with pytest.raises(InputError, match=r"p\.h5: not an HDF5 file"):
        read_identified(name, session.comm)

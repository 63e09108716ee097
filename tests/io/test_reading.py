"""Reading files: regular ones, in the end what there was when nobody replaced them, and no more than they hold."""

import errno
import os
from datetime import datetime

import h5py
import numpy as np
import pytest
from samples import published

import jampetsc
from jampetsc.commands.modes import Modes
from jampetsc.errors import InputError, JampetscError
from jampetsc.io import atomic, checksums, disk_motion, hdf5
from jampetsc.io.atomic import open_regular
from jampetsc.io.hdf5 import (
    attributes,
    open_file,
    opening,
    reading,
    set_attributes,
    values,
)
from jampetsc.io.outputs import check_output
from jampetsc.io.packing_file import write_packing
from jampetsc.io.provenance import derived_from
from jampetsc.io.reader import collected
from jampetsc.io.request import MAX_LINE_LENGTH, Request
from jampetsc.io.result_file import ResultWriter

# What is no regular file


def test_kinds_of_files(tmp_path):
    with pytest.raises(InputError, match=f"{tmp_path}: a folder without table.csv. Give the file"):
        jampetsc.load(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    for path, words in (
        (tmp_path, "a folder"),
        (tmp_path / "pipe", "not a regular file"),
        ("/dev/zero", "not a regular file"),
    ):
        with pytest.raises(InputError, match=f"^{path}: {words}. Give a regular file.$"):
            open_regular(path)


# HDF5


def test_hdf5_may_begin_behind_a_block_of_the_user(tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w", userblock_size=512) as h5:
        h5["x"] = np.arange(5)
    with open_file(path) as h5:
        assert values(h5["x"]).tolist() == [0, 1, 2, 3, 4]


def test_without_permission(tmp_path, monkeypatch):
    path = tmp_path / "x.h5"
    path.touch()

    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(atomic, "open", refuse, raising=False)
    with (
        pytest.raises(InputError, match=r"x\.h5: no permission to read it\. Change its permissions\.$"),
        open_file(path),
    ):
        pass
    with pytest.raises(InputError, match=r"exists and is a file that cannot be read \(Permission denied\)"):
        monkeypatch.setattr("jampetsc.io.outputs.check_writable", lambda out: None)
        check_output(path, "jampetsc-sweep")


def test_attributes_are_plain_values(tmp_path):
    odd = {"bytes": np.bytes_(b"a\xff"), "one": np.array([3]), "square": np.array([[4]])}
    with h5py.File(tmp_path / "x.h5", "w") as h5:
        set_attributes(h5, {"number": np.float64(0.5), "flag": np.bool_(True), "none": None, "word": "β"})
        h5.attrs.update(odd)
        found = attributes(h5)
    assert found.pop("square").tolist() == [[4]]
    assert found == {"number": 0.5, "flag": True, "word": "β", "bytes": "a\ufffd", "one": 3}
    assert [type(found[name]) for name in ("number", "flag", "one")] == [float, bool, int]


@pytest.mark.parametrize(
    ("attrs", "message"),
    [
        ({"format_version": "2.9"}, None),
        ({"format_version": 2}, None),
        (
            {"format_version": "3.0", "jampetsc_version": "9"},
            r"format_version 3\.0, but this jampetsc reads 2\.x\. Use jampetsc 9 or newer",
        ),
        ({"format_version": "one"}, r"format_version = 'one': must be a number such as 2\.0"),
        (
            {"format_version": "1.1", "jampetsc_version": "0.1.0"},
            r"format_version 1\.1, but this jampetsc reads 2\.x\. Make the file again\.$",
        ),
        ({"format": "jampetsc-later"}, "format jampetsc-later: not one of jampetsc-packing, "),
        (
            {"format_version": "3.1"},
            r"format_version 3\.1, but this jampetsc reads 2\.x\. Use a newer jampetsc\.$",
        ),
        ({"format": "NXdata"}, "format = 'NXdata': not a jampetsc file"),
        ({"format": 3}, "format = 3: not a jampetsc file"),
        ({"format": "jampetsc-part"}, "the part of one rank. Open the joint file beside its folder"),
        ({"format": "jampetsc-packing"}, "missing. Give a packing with positions"),
    ],
)
def test_what_a_file_says_it_is(tmp_path, attrs, message):
    path = sweep(tmp_path / "s.h5").path
    with h5py.File(path, "r+") as h5:
        h5.attrs.update(attrs)
    if message is None:
        assert jampetsc.load(path).format == "jampetsc-sweep"
        return
    with pytest.raises(InputError, match=message) as refused:
        jampetsc.load(path)
    assert str(refused.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("block", "raised", "said"),
    [
        (opening, OSError("Unable to open file (truncated file: eof = 96)"), "x: truncated, not written"),
        (opening, OSError("file signature not found"), "x: not an HDF5 file. Give a file of jampetsc"),
        (opening, OSError("odd\n  words"), r"x: not readable as HDF5 \(odd words\)\. Copy or make it again"),
        (reading, InputError("in its own words"), "in its own words$"),
        (reading, MemoryError("1 TB"), r"x: larger than the memory \(1 TB\)"),
        (reading, KeyboardInterrupt("of the user"), "of the user$"),
        (reading, JampetscError("no fault of the file"), "no fault of the file$"),
        *(
            (reading, error("odd words"), r"x: damaged \(odd words\)\. Copy or make it again\.$")
            for error in (OSError, RuntimeError, KeyError, IndexError, ValueError, TypeError, AttributeError,
                          ZeroDivisionError, OverflowError, NotImplementedError)
        ),
    ],
)  # fmt: skip
def test_what_libraries_raise_on_a_damaged_file_is_one_line(block, raised, said):
    mine = KeyboardInterrupt if isinstance(raised, KeyboardInterrupt) else JampetscError
    with pytest.raises(mine, match=f"^{said}"), block("x"):
        raise raised


# Replaced meanwhile


def test_what_is_replaced_while_it_is_read_is_read_again(tmp_path, monkeypatch):
    """By another file of the same age, by new content of the same one; what nobody replaces is refused at once."""
    path, new, tries = tmp_path / "p.h5", tmp_path / "new", []
    path.write_bytes(b"half")

    def replaced(file):
        tries.append(file)
        if len(tries) == 1:
            age = path.stat().st_mtime_ns
            new.write_bytes(b"half")
            os.utime(new, ns=(age, age))
            new.replace(path)
        elif len(tries) == 2:
            os.utime(path, ns=(1, 1))
        elif len(tries) == 4:
            write_packing(new, published())
            new.replace(path)
        checksums.verify(file)

    monkeypatch.setattr(hdf5, "verify", replaced)
    with pytest.raises(InputError, match="not an HDF5 file"):
        jampetsc.load(path)
    assert len(tries) == 3
    assert jampetsc.load(path).n == published().n and len(tries) == 5


# How a result came about


def sweep(path=None, attributes=None, **arrays):
    """A sweep of a file, or in memory, of these arrays and attributes."""
    with ResultWriter(path, "jampetsc-sweep") as writer:
        for name, values_ in ({"omega": [1.0], "G": [1j], "error_bound": [0.0]} | arrays).items():
            writer.dataset(name, np.array(values_))
        writer.attributes(**attributes or {})
    return jampetsc.load(path) if path else collected(writer)


def test_what_sweeps_have_in_common(tmp_path):
    shared = {"law": "contact", "beta": 0.5, "pressure": 1e-3, "packing_sha256": "ab"}
    shared |= {"particle_count": 9, "tau1": 2.0}
    sweeps = [
        sweep(tmp_path / f"{n}.h5", {**shared, "phi": n, "packing": f"{n}.h5"}, G=[1j * n]) for n in (1, 2)
    ]
    found = derived_from(sweeps, 1.5)
    assert shared.items() <= found.items() and not {"phi", "packing", "k"} & found.keys()
    assert derived_from([sweep(attributes={"k": 3.0})], 0.0)["k"] == 3.0
    many = derived_from(sweeps * 600, 0.0)  # an attribute holds 64 kB
    assert all(len(many[name]) < MAX_LINE_LENGTH + 3 for name in ("sources", "source_runs"))
    assert (found["sources"], found["wall_seconds"]) == ("1.h5 2.h5", 1.5)
    assert datetime.fromisoformat(found["date"]).utcoffset() is not None
    assert found["source_runs"] == " ".join(sweep.attributes["run_id"] for sweep in sweeps)
    for some in ([sweep(), sweeps[0]], [sweeps[0], sweep()]):
        assert "law" not in derived_from(some, 0.0)


def test_a_line_that_is_too_long_for_an_attribute_is_cut():
    for words, line in ((["a b", 1], "'a b' 1"), (["x" * MAX_LINE_LENGTH], "x" * MAX_LINE_LENGTH)):
        assert Request(Modes("p.h5"), words).recorded["argv"] == line
    many = Request(Modes("p.h5"), ["x" * (MAX_LINE_LENGTH + 1)])
    assert many.recorded["argv"] == "x" * MAX_LINE_LENGTH + " …"


# Fields


def of_fields(omega, n=3, value=0.0, **arrays):
    """A sweep in memory with fields of n disks at these frequencies; a value of the last one."""
    displacement = np.arange(2.0 * n * len(omega)).reshape(len(omega), n, 2) * 1j
    displacement[-1:, -1:, 0] += value
    return sweep(**{"fields/omega": omega, "fields/displacement": displacement}, **arrays)


def test_frequencies_shown_are_those_asked_for_or_four_at_most_in_their_order():
    """One that is asked for is found to a hundredth."""
    for omega, rows in (([1.0], [0]), ([3.0, 1.0, 2.0], [1, 2, 0]), ([7.0, 6, 5, 4, 3, 2, 1], [6, 4, 2, 0])):
        assert disk_motion.chosen_frequencies(of_fields(omega)).tolist() == rows
    with pytest.raises(InputError, match=r"no fields\. Run the sweep with fields"):
        disk_motion.chosen_frequencies(of_fields([]))
    held = of_fields([10.0, 1.0, 0.1])
    assert disk_motion.chosen_frequencies(held, [1.009, 0.0991, 10.0, 10.09]).tolist() == [1, 2, 0, 0]
    for omega in (1.0102, 0.9899, 0.102, 10.2):
        message = (
            rf"no fields at omega = {omega:g} \(nearest 0\.1, 1, 10\)\. Choose one of these, or run the sweep"
        )
        with pytest.raises(InputError, match=message):
            disk_motion.chosen_frequencies(held, [omega])


def test_rows_of_fields_are_disks_of_the_packing():
    disks = jampetsc.Packing(np.eye(3, 2), np.full(3, 0.1), 2.0)
    assert disk_motion.particle_rows(of_fields([1.0]), disks).tolist() == [0, 1, 2]
    assert disk_motion.particle_rows(of_fields([1.0], particles=[2, 0, 1]), disks).tolist() == [2, 0, 1]
    for n, more in ((3, [0, 1]), (3, [0, 1, 3]), (3, [-1, 0, 1]), (4, None)):
        held = of_fields([1.0], n, **({} if more is None else {"particles": more}))
        with pytest.raises(InputError, match="the 3 particles of the packing"):
            disk_motion.particle_rows(held, disks)
    with pytest.raises(InputError, match="fields without particles, as all are rattlers"):
        disk_motion.particle_rows(of_fields([1.0], 0, particles=[]), disks)


def test_fields_that_no_packing_has():
    held = of_fields([0.5, 2.0], value=0.99e100)
    assert np.array_equal(disk_motion.field_at(held, 0)[0], held.fields.displacement[0])
    assert disk_motion.field_at(held, 1)[1] is None
    for value in (1.01e100, np.nan, np.inf):
        with pytest.raises(
            InputError, match="its field at omega = 2 holds NaN, Inf or absurdly large values"
        ):
            disk_motion.field_at(of_fields([0.5, 2.0], value=value), 1)


# Moduli


def swept(omega, G, attributes=None, reduced=None, **arrays):
    """A sweep in memory; reduced: what differs from two modes in its spectrum, None where it has none."""
    modes = {"G0": 2.0, "eta_inf": 0.5, "rates": [1.0, 100.0], "weights": [3.0, 4.0]}
    if reduced is not None:
        arrays |= {f"spectrum/{name}": value for name, value in (modes | reduced).items()}
    return sweep(attributes=attributes, omega=omega, G=G, **arrays)


def test_spectra_that_no_packing_has():
    odd = {"G0": [np.nan], "eta_inf": [np.inf], "weights": [[1.0, np.nan], [1.0, 2.0, 3.0]]}
    odd["rates"] = [[0.1, rate] for rate in (1.01e100, 0.99e-100, -1.0, np.nan)]
    for changes in ({name: value} for name in odd for value in odd[name]):
        with pytest.raises(InputError, match=r"sweep in memory: impossible values in its spectrum"):
            swept([1.0], [1j], reduced=changes).spectrum  # noqa: B018
    extreme = swept([1.0], [1j], reduced={"rates": [0.99e100, 1.01e-100]})
    assert extreme.spectrum.rates[0] == 0.99e100


def test_stored_frequencies_give_stored_values_and_a_spectrum_all_others():
    omega = np.array([[0.2, 1.0, 50.0]])
    maxwell = 2 + 0.5j * omega + 3j * omega / (1 + 1j * omega) + 4j * omega / (100 + 1j * omega)
    held = swept([1.0, 2.0], [5 + 6j, 1j], reduced={})
    found = held.modulus(omega)
    assert np.allclose(found[0, ::2], maxwell[0, ::2], rtol=1e-12) and found[0, 1] == 5 + 6j
    assert held.G_storage.tolist() == [5, 0] and held.G_loss.tolist() == [6, 1]
    assert held.modulus(2.0) == 1j and np.ndim(held.modulus(3.0)) == 0


def test_frequencies_are_told_apart_by_their_ratio():
    held = swept([1e-14, 1.0], [1e-14j, 1j])
    assert held.modulus([[1.0, 1e-14]]).tolist() == [[1j, 1e-14j]]
    for nearly in (1e-14 * (1 + 5e-13), 1 - 5e-13):  # what rounding does to a number written and read
        assert held.modulus(nearly).imag == pytest.approx(nearly)
    for other in (1e-14 * (1 + 5e-12), 1 - 5e-12, 2e-14):
        message = (
            r"is not one of its 2 frequencies, 1e-14 to 1\. Choose one of them, or run the sweep with method"
        )
        with pytest.raises(InputError, match=f"omega = {other:g} {message}"):
            held.modulus([1.0, other])
    for odd in (np.nan, np.inf):  # which are near to every frequency that is stored, or to none
        with pytest.raises(InputError, match=f"omega = {odd}: must be finite"):
            held.modulus([1.0, odd])
    assert held.frequency_range == (1e-14, 1.0) and held.damping is None


def test_what_was_solved_under_power_law_damping_is_another_range():
    power = {"alpha": 0.5, "stress": 1e-3, "tau1": 4.0}
    held = swept([1.0, 2.0], [1j, 2j], power, {}, equivalent_omega=[3.0, 0.5])
    assert held.frequency_range == (0.5, 3.0)
    expected = held.damping.frequency(0.7 * 4.0) / 4.0
    assert expected != held.damping.frequency(0.7)
    assert held.modulus(0.7) == held.spectrum.modulus(expected) != held.spectrum.modulus(0.7)


def test_the_spectrum_of_a_file_of_its_own():
    writer = ResultWriter(None, "jampetsc-spectrum")
    writer.dataset("relaxation/rates", np.array([2.0]))
    writer.dataset("relaxation/weights", np.array([3.0]))
    writer.attributes(G0=1.0, eta_inf=0.0, slowest_omega=1e-3, fastest_omega=1e3)
    found = collected(writer)
    assert found.frequency_range == (1e-3, 1e3) and found.spectrum.G_inf == 4.0


def test_a_dataset_or_an_attribute_that_is_not_there(tmp_path):
    held = sweep(tmp_path / "s.h5")
    for name, message in (
        ("modes", "Choose among: G, error_bound, omega"),
        ("omga", r"Did you mean omega\?"),
    ):
        with pytest.raises(InputError, match=f"s.h5: no dataset {name}. {message}"):
            held[name]
    for name, message in (("formt", r"Did you mean format\?"), ("alpha", "Make the file again")):
        with pytest.raises(InputError, match=f"s.h5: attribute {name}: missing. {message}"):
            held.attributes[name]
    assert held.get("foo", 1) == 1 and held.get("omega").tolist() == [1.0]
    for name, message in (
        ("fields", "no fields. Run the sweep with"),
        ("spectrum", "no spectrum. Run the sweep"),
    ):
        with pytest.raises(InputError, match=message):
            getattr(held, name)
    with h5py.File(tmp_path / "s.h5", "r+") as h5:
        del h5["G"]
    with pytest.raises(InputError, match="no dataset G"):
        jampetsc.load(tmp_path / "s.h5")

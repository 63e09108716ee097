"""Files against the declaration of their format: other shapes and types are refused before anything is read."""

import h5py
import numpy as np
import pytest
from samples import stored

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.declaration import HEADER, MAX_DEPTH, TYPES, Table, contents, shape_text
from jampetsc.io.disk_motion import PHASES
from jampetsc.io.formats import FORMATS
from jampetsc.jamming.sample_protocol import PROTOCOLS
from jampetsc.packing.potentials import EXPONENTS, STIFFNESSES

LENGTHS = dict(zip("NMFASTKXW", range(4, 13), strict=True)) | dict.fromkeys("nmcbBqtgjrfPLG", 3) | {"D": 2}
VALUES = {"text": "a", "int": 3, "float": 0.5, "bool": True}


def array_of(row):
    """An array as a row of datasets declares it."""
    shape = tuple(LENGTHS.get(name, 0) + more for name, more in row.shapes[0])
    return np.ones(shape, TYPES[row.type][1])


@pytest.fixture(params=FORMATS)
def made(request):
    """(Format, open file in memory with all that it declares, its attributes)."""
    declared = FORMATS[request.param]
    rows = {**(declared.common.rows if declared.common else {}), **declared.attributes.rows}
    attributes = {
        "x".join(one.split("*")): row.choices[0] if row.choices else VALUES[row.type]
        for one, row in rows.items()
        if row.shapes is None
    }
    with h5py.File("made", "w", driver="core", backing_store=False) as h5:
        for name, row in declared.datasets.rows.items():
            h5["x".join(name.split("*"))] = array_of(row)
        yield declared, h5, {one: value for one, value in attributes.items() if one not in HEADER}


def refused(declared, items, attributes, what):
    """The line of the error with which a file with these contents is refused."""
    with pytest.raises(InputError, match=f"^p: {what}.*Make the file again.$") as error:
        declared.check("p", items, attributes)
    return str(error.value)


WRONG = {  # of an array: what is said of it
    "text": (lambda a: np.full(a.shape, b"a"), "holds text, must hold "),
    "compound": (lambda a: np.zeros(a.shape, [("a", float)]), "holds compound or opaque values, must hold "),
    "longer": (lambda a: np.concatenate([a, a], axis=-1) if a.ndim else a[None], "shape "),
    "deeper": (lambda a: a[..., None, None], "shape "),
}


def test_other_shapes_and_types_than_declared_are_refused(made):
    declared, h5, attributes = made
    items = contents(h5, "p")
    declared.check("p", items, attributes)
    datasets = {name: item[()] for name, item in items.items() if isinstance(item, h5py.Dataset)}
    for name, array in datasets.items():
        for what, (change, said) in WRONG.items():
            del h5[name]
            h5[name] = change(array)
            items[name] = h5[name]
            if what == "longer":  # or another one of the same length; or of a length of its own
                try:
                    declared.check("p", items, attributes)
                except InputError as error:
                    assert ": shape (" in str(error) and ", must be (" in str(error)
                else:
                    assert array.ndim == 1 and declared.datasets.row(name).shapes[0][0][0]
            else:
                refused(declared, items, attributes, f"dataset {name}: {said}")
            del h5[name]
            h5[name] = array
            items[name] = h5[name]
    del h5[name]
    h5.create_group(name)
    refused(declared, contents(h5, "p"), attributes, f"dataset {name}: is a group, must hold ")
    del h5[name]
    items = contents(h5, "p")
    for name, value in attributes.items():
        for other in (3 if isinstance(value, str) else "a", 1j, np.ones(2), np.void(b"a"), None):
            refused(declared, items, attributes | {name: other}, f"attribute {name} = .*: must be ")
        if declared.attribute(name).choices:
            for other in ("", "other") if isinstance(value, str) else (-1, 0, 4, 10**12):
                refused(
                    declared, items, attributes | {name: other}, f"attribute {name} = .*: must be one of "
                )
    h5["mine"] = "anything"
    declared.check("p", contents(h5, "p"), attributes | {"own": 1j})


def test_the_dimension_is_that_of_the_arrays(tmp_path):
    """Whatever looks up names of axes or units by it finds them, or the file is refused when it is loaded."""
    arrays = {
        "omega": np.ones(1),
        "G": np.ones(1) + 0j,
        "error_bound": np.ones(1),
        "fields/omega": np.ones(1),
    }
    for D, other in ((2, 3), (3, 2)):
        arrays["fields/displacement"] = np.ones((1, 4, D), complex)
        path = stored(tmp_path / "s.h5", "sweep", arrays, dimension=D)
        assert jampetsc.load(path).attributes["dimension"] == D
        with h5py.File(path, "r+") as h5:
            h5.attrs["dimension"] = other
        with pytest.raises(
            InputError, match=rf"displacement: shape \(1, 4, {D}\), must be .* with .*D = {other}"
        ):
            jampetsc.load(path)


@pytest.mark.parametrize("load", ["bogus", "1,x", "[1, 2", "", "zz", "1,2,3", "nan,0,0,0"])
def test_a_load_of_the_dimension(tmp_path, load):
    arrays = {"omega": np.ones(1), "G": np.ones(1) + 0j, "error_bound": np.ones(1)}
    for known in ("xy", "tensor", "0.0,1.0,0.0,0.0"):
        assert jampetsc.load(stored(tmp_path / "s.h5", "sweep", arrays, load=known)).load == known
    with pytest.raises(InputError, match=r"s\.h5: attribute load = .*: not a load in 2 dimensions\. Make"):
        jampetsc.load(stored(tmp_path / "s.h5", "sweep", arrays, load=load))


def test_allowed_values_are_those_of_the_program():
    for format in FORMATS.values():
        for name, values in (("potential", EXPONENTS), ("stiffness", STIFFNESSES), ("dimension", (2, 3))):
            row = format.attribute(name)
            if (
                row is not None
                and name in ("potential", "stiffness")
                and format is FORMATS["jampetsc-collapse"]
            ):
                continue  # those of its files
            assert row is None or row.choices == tuple(values)
    assert FORMATS["jampetsc-correlation"].attribute("phase").choices == PHASES
    assert FORMATS["jampetsc-jam"].attribute("protocol").choices == tuple(PROTOCOLS)


def test_numbers_are_read_as_they_are_declared(tmp_path):
    """Whatever program wrote them: compiled loops take no other byte order, and eight bits overflow."""
    arrays = {
        "omega": np.array([1, 2], np.int8),
        "G": np.array([1, 2], ">f4"),
        "error_bound": np.ones(2, "f2"),
    }
    found = jampetsc.load(stored(tmp_path / "s.h5", "sweep", arrays))
    assert [found[name].dtype for name in arrays] == [np.float64, np.complex128, np.float64]
    assert found["G"].tolist() == [1, 2] and found.stored("G").dtype == np.complex128
    with h5py.File(tmp_path / "s.h5", "r+") as h5:
        h5.attrs["L"] = np.longdouble(1.5)
    assert jampetsc.load(tmp_path / "s.h5").attributes["L"] == 1.5


def test_what_is_claimed_is_not_read(tmp_path):
    """A billion numbers of which nothing is written, in a file of some kilobytes: they were read first."""
    path = stored(tmp_path / "s.h5", "sweep", {"G": np.ones(3) + 0j, "error_bound": np.ones(3)})
    with h5py.File(path, "r+") as h5:
        h5.create_dataset("omega", (10**9,), float, chunks=True)
    with pytest.raises(
        InputError, match=r"s\.h5: dataset G: shape \(3,\), must be \(M,\) or \(M, P\) with M = 1000000000\."
    ):
        jampetsc.load(path)


@pytest.mark.parametrize("deep", [MAX_DEPTH + 1, 3000, "itself"])
@pytest.mark.parametrize("line", ["info {}", "merge {}", "plot {} --out o.svg"])
def test_groups_within_groups_have_an_end(tmp_path, monkeypatch, capsys, deep, line):
    """HDF5 takes a time that grows with the cube of their depth."""
    monkeypatch.chdir(tmp_path)
    path = stored("s.h5", "sweep", {"omega": np.ones(3), "G": np.ones(3) + 0j, "error_bound": np.ones(3)})
    with h5py.File(path, "r+") as h5:
        group = h5
        for _ in range(1 if deep == "itself" else deep):
            group = group.create_group("g")
        if deep == "itself":
            group["g"] = group
    assert cli.main(line.format(path).split()) == 2
    assert f"s.h5: too large (more than {MAX_DEPTH} groups inside each other)" in capsys.readouterr().err


def test_a_table_is_read_as_it_is_written():
    table = Table(
        "a, b | (M − 1, 2) | float, int? | k | one\n  two \\| three\nc* | scalar | text | | x", True
    )
    assert table.lines[0] == ("a, b", "(M − 1, 2)", "float, int?", "k", "one two \\| three")
    assert [(row.name, row.type, row.optional) for row in map(table.row, "ab")] == [
        ("a", "float", True), ("b", "int", True),
    ]  # fmt: skip
    assert (
        table.row("a").shapes == ((("M", -1), ("", 2)),)
        and shape_text(table.row("b").shapes[0]) == "(M − 1, 2)"
    )
    assert table.row("cd").unit == "" and table.row("d") is None
    with pytest.raises(ValueError):
        Table("a, b, c | scalar | float, int | | x", True)

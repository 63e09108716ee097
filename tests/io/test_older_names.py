"""Files of earlier layouts: renamed datasets and attributes, and where a missing attribute is to be found."""

import h5py
import numpy as np
import pytest

import jampetsc
from jampetsc.errors import InputError
from jampetsc.io.formats import OLDER_COLUMNS, with_present_names
from jampetsc.io.result_file import ResultWriter
from jampetsc.studies.study_table import rows_of


def older(path, format, arrays, version="1.0", **attributes):
    """A result of this format and version at `path`, with these datasets and attributes as they are."""
    with ResultWriter(path, format) as writer:
        for name, values in arrays.items():
            writer.dataset(name, values)
        writer.attributes(**attributes)
        writer.found["format_version"] = version
    return path


def test_present_names_replace_older_ones_unless_they_are_there():
    names = {"friction": "background_drag"}
    assert with_present_names({"friction": 1, "k": 2}, names) == {"background_drag": 1, "k": 2}
    both = {"coordination": 1, "contact_number": 2}
    assert with_present_names(both, {"coordination": "contact_number"}) == both
    assert "coordination" not in OLDER_COLUMNS  # of packings


@pytest.mark.parametrize("kind", ["shear", "flow", "jam"])
def test_contacts_with_rattlers_have_a_name_of_their_own(tmp_path, kind):
    arrays = {"coordination": np.array([3.9, 4.0]), "strain": np.array([0.1, 0.2])}
    facts = {"coordination_mean": 3.95} | ({"friction": 0.1} if kind == "flow" else {})
    result = jampetsc.load(older(tmp_path / "o.h5", f"jampetsc-{kind}", arrays, **facts))
    assert result["contact_number"].tolist() == [3.9, 4.0] and "coordination" not in result
    assert result.attributes["contact_number_mean"] == 3.95
    assert kind != "flow" or result.attributes["background_drag"] == 0.1
    result.save(tmp_path / "new.h5")
    with h5py.File(tmp_path / "new.h5") as h5:
        assert "contact_number" in h5 and not {"friction", "coordination_mean"} & set(h5.attrs)
    assert jampetsc.load(tmp_path / "new.h5")["contact_number"].tolist() == [3.9, 4.0]


def test_tables_of_studies_have_present_names(tmp_path):
    (tmp_path / "table.csv").write_text(
        "command,state,file,friction,coordination,coordination_mean\nflow,done,f.h5,0.1,,3.9\n"
    )
    table = jampetsc.load(tmp_path)
    assert table["background_drag"].tolist() == [0.1] and table["contact_number_mean"].tolist() == [3.9]
    row = {"state": "done", "row": {"file": "f.h5", "friction": 0.1}, "seconds": 1.0}
    assert rows_of([], {"t": row}) == [
        {"file": "f.h5", "background_drag": 0.1, "state": "done", "seconds": 1.0}
    ]


def test_pairs_of_contacts_are_numbers_of_particles(tmp_path):
    """Of 1.0 they are rows; both give numbers in the packing, also when saved again."""
    particles, numbers = np.array([7, 3, 5]), np.array([[7, 3], [3, 5]])
    for version, pairs in (("1.0", [[0, 1], [1, 2]]), ("1.1", numbers)):
        arrays = {"particles": particles, "contacts/pairs": np.array(pairs)}
        result = jampetsc.load(older(tmp_path / "q.h5", "jampetsc-quasistatic", arrays, version))
        assert result["contacts/pairs"].tolist() == numbers.tolist()
        assert result.stored("contacts/pairs")[1].tolist() == [3, 5]
        result.save(tmp_path / "again.h5")
        assert jampetsc.load(tmp_path / "again.h5")["contacts/pairs"].tolist() == numbers.tolist()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("G0", r"s\.h5: attribute G0: missing\. A file of `sweep` has none\. See the dataset reduced/G0, a file of "
         r"`quasistatic` or a file of `spectrum`\.$"),
        ("omega_star", r"A file of `sweep` has none\. See a file of `quasistatic`\.$"),
        ("acuracy", r"Did you mean accuracy\?$"), ("phi", r"Make the file again\.$"),
        ("colour", r"A file of `sweep` has none\. See its attributes\.$"),
    ],
)  # fmt: skip
def test_a_missing_attribute_is_looked_for_elsewhere(tmp_path, name, says):
    arrays = {"omega": np.ones(1), "G": np.ones(1, complex), "error_bound": np.ones(1)}
    path = older(tmp_path / "s.h5", "jampetsc-sweep", arrays, accuracy=1e-6)
    with pytest.raises(InputError, match=says):
        jampetsc.load(path).attributes[name]

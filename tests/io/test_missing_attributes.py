"""Attributes that a file does not have: where they are to be found."""

import numpy as np
import pytest

import jampetsc
from jampetsc.errors import InputError
from jampetsc.io.result_file import ResultWriter


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("G0", r"s\.h5: attribute G0: missing\. A file of `sweep` has none\. See the dataset spectrum/G0, a file of "
         r"`quasistatic` or a file of `spectrum`\.$"),
        ("omega_star", r"A file of `sweep` has none\. See a file of `quasistatic`\.$"),
        ("acuracy", r"Did you mean accuracy\?$"), ("phi", r"Make the file again\.$"),
        ("colour", r"A file of `sweep` has none\. See its attributes\.$"),
    ],
)  # fmt: skip
def test_a_missing_attribute_is_looked_for_elsewhere(tmp_path, name, says):
    arrays = {"omega": np.ones(1), "G": np.ones(1, complex), "error_bound": np.ones(1)}
    path = tmp_path / "s.h5"
    with ResultWriter(path, "jampetsc-sweep") as writer:
        for dataset, values in arrays.items():
            writer.dataset(dataset, values)
        writer.attributes(accuracy=1e-6)
    with pytest.raises(InputError, match=says):
        jampetsc.load(path).attributes[name]

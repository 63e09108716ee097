"""What the words of the command line mean: those that contradict each other, or mean nothing, are refused."""

import numpy as np
import pytest
from samples import stored

from jampetsc import main as cli
from jampetsc.commands.collapse_points import FORMATS
from jampetsc.commands.correlate import refuse_mixture
from jampetsc.commands.sources import files_named, rows_named
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.studies.study_table import table_text


def test_no_two_sweeps_of_one_packing_but_of_unknown_ones(tmp_path):
    def sweep(name, sha256):
        known = {"packing_sha256": sha256} if sha256 else {}
        arrays = {"omega": np.ones(1), "G": np.ones(1, complex), "error_bound": np.zeros(1)}
        return load(stored(tmp_path / name, "sweep", arrays, **known))

    others = [sweep("a.h5", None), sweep("b.h5", None), sweep("c.h5", "1" * 64), sweep("d.h5", "2" * 64)]
    refuse_mixture(others)
    with pytest.raises(InputError, match=r"e\.h5: the packing of c\.h5 \(sha256 111111111111…\)"):
        refuse_mixture([*others, sweep("e.h5", "1" * 64)])


def test_files_of_a_study_are_of_rows_that_are_done(tmp_path):
    rows = [
        {"command": "jam", "state": state, "file": f"{n}.h5", "seconds": 1, "cooling_rate": rate}
        for n, (state, rate) in enumerate((("done", 0.1), ("failed: no", 0.1), ("done", 0.2), ("done", 0.1)))
    ]
    (tmp_path / "table.csv").write_text(table_text(rows))
    folder, where = str(tmp_path), "cooling-rate=0.1, command = jam"
    assert files_named([folder], None, FORMATS[True]) == [str(tmp_path / f"{n}.h5") for n in (0, 2, 3)]
    some = ["other.h5", f"{folder}/0.h5", f"{folder}/3.h5"]
    assert files_named(["other.h5", folder], where, FORMATS[True]) == some
    assert rows_named(["other.h5"], None) == ["other.h5"]
    for finite, here, says in (
        (False, where, rf"no finished .* task where {where}\. Run such tasks"),
        (True, "cooling-rate=7", r"where cooling-rate=7: no such row in .*: cooling_rate is 0.1 or 0.2\.$"),
    ):
        with pytest.raises(InputError, match=says):
            files_named([folder], here, FORMATS[finite])


def test_a_flow_that_goes_on_elsewhere_leaves_what_it_goes_on_from(tmp_path):
    line = f"flow --n 16 --phi 0.5 --model RD0 --rate 0.1 --strain 0.02 --out {tmp_path}/f.h5"
    assert cli.dispatch(line.split()) == 0
    before = (tmp_path / "f.h5").read_bytes()
    assert cli.dispatch(f"flow {tmp_path}/f.h5 --strain 0.02 --out {tmp_path}/g.h5".split()) == 0
    assert (tmp_path / "f.h5").read_bytes() == before
    assert load(tmp_path / "g.h5")["strain"][-1] == pytest.approx(0.04, rel=0.1)

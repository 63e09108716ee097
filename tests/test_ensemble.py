"""The table of a study read back: arrays, choices of rows, averages over packings and their errors."""

import numpy as np
import pytest

import jampetsc
from jampetsc.analysis.statistics import bootstrap
from jampetsc.errors import InputError
from jampetsc.studies.table import table_text

MODULI = {1: -0.5, 2: 1.0, 3: 4.0}


@pytest.fixture
def folder(tmp_path):
    rows = [
        {"command": "quasistatic", "state": "done", "file": f"q{p}{s}{b}.h5", "packing": f"p{p}{s}.h5", "pressure": p,
         "seed": s, "law": "contact", "beta": b, "prestress": 1, "G0": MODULI[s] * p, "eta0": s / b, "seconds": 0.1}
        for p in (1e-2, 1e-3) for s in MODULI for b in (1.0, 0.1)
    ]  # fmt: skip
    rows.append({"command": "modes", "state": 'failed: no, "not" there', "file": "m.h5", "seconds": 0.2})
    (tmp_path / "table.csv").write_text(table_text(rows))
    return tmp_path


def test_columns_are_arrays(folder):
    table = jampetsc.load(folder)
    assert (table.rows, len(table["G0"])) == (13, 13) and "G0" in table
    assert list(table)[:5] == ["command", "state", "file", "packing", "pressure"]
    assert np.isnan(table["G0"][-1]) and table["law"][-1] == ""
    assert table.failed["state"].tolist() == ['failed: no, "not" there']
    assert table["pressure"][0] == 1e-2 and table["G0"][0] == -0.5 * 1e-2, "to the last bit"


def test_rows_are_chosen_by_their_values(folder):
    table = jampetsc.load(folder)
    assert table.where(pressure=0.001, beta=[1, 0.1], prestress=True).rows == 6
    assert table.where(law="contact", seed=(1, 3)).rows == 8
    assert table.where(seed="one").rows == 0
    with pytest.raises(InputError, match=r"no column presure; did you mean pressure\?"):
        table.where(presure=1)


def test_averages_keep_what_is_negative_and_report_it(folder):
    table = jampetsc.load(folder).where(beta=1)
    mean = table.mean(by="pressure")
    np.testing.assert_array_equal(mean["pressure"], [1e-3, 1e-2])
    np.testing.assert_allclose(mean["G0"], [1.5e-3, 1.5e-2])
    assert mean.count["G0"].tolist() == [3, 3] and mean.below_zero["G0"].tolist() == [1, 1]
    np.testing.assert_allclose(table.median(by=["law", "pressure"])["G0"], [1e-3, 1e-2])
    expected = np.std(list(MODULI.values()), ddof=1) / np.sqrt(3)
    np.testing.assert_allclose(mean.error["G0"], [1e-3 * expected, 1e-2 * expected], rtol=0.1)
    assert "seed" not in list(mean) and {"pressure", "G0", "eta0"} <= set(mean)


def test_one_packing_counts_once(folder):
    mean = jampetsc.load(folder).mean(by="pressure")
    with pytest.raises(InputError, match=r"G0 of pressure 0.001: .* are of one packing: .* in by= \(beta\)"):
        mean["G0"]
    assert jampetsc.load(folder).mean(by=["pressure", "beta"]).count["G0"].tolist() == [3] * 4


def test_what_is_no_table_is_refused(tmp_path):
    (tmp_path / "table.csv").write_text("command,state\n1,2,3\n")
    with pytest.raises(InputError, match="is not the table of a study"):
        jampetsc.load(tmp_path)
    (tmp_path / "table.csv").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="is not the table of a study"):
        jampetsc.load(tmp_path)


@pytest.mark.parametrize(
    ("statistic", "draw", "value", "error"),
    [
        ("mean", "normal", 0.0, 1.0 / np.sqrt(400)),
        ("mean", "exponential", 1.0, 1.0 / np.sqrt(400)),
        ("median", "normal", 0.0, np.sqrt(np.pi / 2 / 400)),
        ("median", "exponential", np.log(2), 1.0 / np.sqrt(400)),  # 1/(2 f(m) √n) with f(m) = 1/2
    ],
)
def test_errors_of_known_distributions(statistic, draw, value, error):
    samples = getattr(np.random.default_rng(1), f"standard_{draw}")((400, 20))
    found, errors = bootstrap(samples, statistic)
    assert np.mean(errors) == pytest.approx(error, rel=0.1)
    assert np.mean(((found - value) / errors) ** 2) == pytest.approx(1.0, abs=0.8)  # χ² of 20 is 1 ± 0.32


def test_errors_of_few_samples():
    two = np.random.default_rng(2).standard_normal((2, 1000))
    assert np.mean(bootstrap(two)[1] ** 2) == pytest.approx(0.5, rel=0.1), (
        "unbiased, though resamples lie closer"
    )
    assert np.isnan(bootstrap([1.0])[1]) and bootstrap([2.0, 2.0]) == (2.0, 0.0)

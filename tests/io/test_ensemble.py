"""The table of a study read back: arrays, choices of rows, averages over packings and their errors."""

import importlib.util
import re
from itertools import product

import numpy as np
import pytest
import samples

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.jammed_samples import independent_share
from jampetsc.analysis.statistics import mean_with_error, median_interval, median_with_error
from jampetsc.errors import InputError
from jampetsc.io.ensemble import DISTINGUISHING_COLUMNS, load_ensemble
from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load
from jampetsc.studies.study_table import table_text

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


def test_rows_are_chosen_and_columns_are_arrays(folder):
    table = jampetsc.load(folder)
    assert (table.rows, len(table["G0"])) == (13, 13) and "G0" in table
    assert list(table)[:5] == ["command", "state", "file", "packing", "pressure"]
    assert np.isnan(table["G0"][-1]) and table["law"][-1] == ""
    assert table.failed["state"].tolist() == ['failed: no, "not" there']
    assert table["pressure"][0] == 1e-2 and table["G0"][0] == -0.5 * 1e-2, "to the last bit"
    assert table.get("foo", 1) == 1 and table.get("seed")[0] == 1
    assert table.where(pressure=0.001, beta=[1, 0.1], prestress=True).rows == 6
    assert table.where(law="contact").rows == 12 and table.where(seed="one").rows == 0
    for some in ([1, 3], (1, 3), {1, 3}, np.array([1, 3])):
        assert table.where(seed=some).rows == 8 and set(table.where(seed=some)["seed"]) == {1, 3}
    with pytest.raises(InputError, match=r"table.csv: no column presure\. Did you mean pressure\?"):
        table.where(presure=1)
    assert table.failed.results() == []
    with pytest.raises(InputError, match=r"q0\.0111\.0\.h5: no such file"):
        table.results()


def test_info_tells_what_a_study_holds(folder, capsys):
    assert cli.main(["info", str(folder)]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"{folder}: study of 13 tasks\n")
    for line in (
        r"quasistatic +12 done",
        r"modes +0 done, 1 failed",
        r"pressure +0.001, 0.01",
        r"beta +0.1, 1",
    ):
        assert re.search(line, text), line
    assert text.splitlines()[-1] == '  m.h5: failed: no, "not" there'
    assert cli.main(["info", str(folder), "--matrices"]) == 2
    assert "is the folder of a study. Give a packing" in capsys.readouterr().err


def test_averages_keep_what_is_negative_and_report_it(folder):
    table = jampetsc.load(folder).where(beta=1)
    mean = table.mean(by="pressure")
    np.testing.assert_array_equal(mean["pressure"], [1e-3, 1e-2])
    np.testing.assert_allclose(mean["G0"], [1.5e-3, 1.5e-2])
    assert mean.count["G0"].tolist() == [3, 3] and mean.below_zero["G0"].tolist() == [1, 1]
    np.testing.assert_allclose(table.median(by=["law", "pressure"])["G0"], [1e-3, 1e-2])
    expected = 1.321 * np.std(list(MODULI.values()), ddof=1) / np.sqrt(3)  # t of two degrees of freedom
    np.testing.assert_allclose(mean.error["G0"], [1e-3 * expected, 1e-2 * expected], rtol=1e-3)
    assert "seed" not in list(mean) and {"pressure", "G0", "eta0"} <= set(mean)
    for part in (mean.error, mean.count, mean.below_zero):
        assert list(part) == list(mean) and len(part) == len(mean) > 3
    assert mean["seconds"].tolist() == pytest.approx([0.1, 0.1]) and "seconds" not in list(mean)
    assert table.mean("law")["law"].tolist() == ["contact"]


def test_one_packing_counts_once(folder, tmp_path):
    """Whatever tells two of its rows apart is named."""
    mean = jampetsc.load(folder).mean(by="pressure")
    with pytest.raises(
        InputError, match=r"G0 of pressure 0.001: .* are of one packing\. .* in by= what differs \(beta\)"
    ):
        mean["G0"]
    assert jampetsc.load(folder).mean(by=["pressure", "beta"]).count["G0"].tolist() == [3] * 4
    for name in set(DISTINGUISHING_COLUMNS) - {"command"}:
        text = f"command,state,file,packing,{name},seed,G0\na,done,1.h5,p,1,1,1\na,done,2.h5,p,%s,2,1\n"
        for other, by, told in ((2, (), name), (1, name, "see the table")):
            with pytest.raises(InputError, match=rf"in by= what differs \({told}\)"):
                written(tmp_path, text % other).mean(by)["G0"]
    table = written(tmp_path, "command,state,file,G0\na,done,1.h5,0\na,done,2.h5,-1e-300\n")  # of no packing
    assert table.mean().count["G0"].tolist() == [2]
    assert table.mean().below_zero["G0"].tolist() == [1], "zero is not below"


def written(folder, text):
    (folder / "table.csv").write_text(text)
    return jampetsc.load(folder)


def test_what_a_task_has_not_is_a_group_of_its_own_and_the_last(tmp_path):
    table = written(
        tmp_path,
        "command,state,file,packing,beta,G0\n"
        "a,done,1,p1,,1.0\na,done,2,p2,0.5,2.0\na,done,3,p3,,3.0\na,failed: no,4,p4,0.5,9.0\na,done,5,p5,0.1,4.0\n",
    )
    groups = table.groups(["beta"])
    assert [key["beta"] for key, _ in groups] == [0.1, 0.5, None]
    assert [rows["file"].tolist() for _, rows in groups] == [[5], [2], [1, 3]]
    mean = table.mean("beta")
    assert mean["G0"].tolist() == [4.0, 2.0, 2.0] and mean.count["G0"].tolist() == [1, 1, 2]
    assert np.isnan(mean.error["G0"]).tolist() == [True, True, False]
    assert table.mean()["G0"].tolist() == [2.5] and len(mean) == len(list(mean)) == 3  # of beta, file and G0


def test_only_numbers_are_averaged_and_packings_that_have_one_counted(tmp_path):
    table = written(
        tmp_path,
        "command,state,file,packing,beta,G0,none\n"
        "a,done,1.h5,p1,1,1.0,\na,done,2.h5,p1,2,,\na,done,3.h5,,1,inf,\na,done,4.h5,,1,-3.0,\na,done,5.h5,,2,-4.0,\n",
    )
    mean = table.mean()  # of one packing a row has no G0; imported ones have no name of a packing
    found = [one["G0"].tolist() for one in (mean, mean.count, mean.below_zero)]
    assert found == [[-2.0], [3], [2]]
    assert np.isnan(mean["none"]).all() and mean.count["none"].tolist() == [0]
    message = r"beta of all rows: 1\.h5 and 2\.h5 are of one packing\. .* in by= what differs \(beta\)"
    for name, said in (("beta", message), ("packing", "column packing holds text, which has no mean")):
        with pytest.raises(InputError, match=said):
            mean[name]


def test_a_share_has_the_error_of_all_its_samples(tmp_path):
    """Two samples that agree are not certain, and ten in one file weigh as much as ten in ten."""
    rows = [
        {"command": "jam", "state": "done", "file": f"j{k}.h5", "n": n, "jammed_fraction": value,
         "jammed_fraction_samples": count}
        for k, (n, value, count) in enumerate([(16, 1.0, 1), (16, 1.0, 1), (32, 0.5, 2), (32, 0.875, 8)])
    ]  # fmt: skip
    rows += [
        {"command": "shear", "state": "done", "file": f"s{k}.h5", "n": 64, "jammed_mean": 1.0, "jammed_error": 0.0,
         "jammed_samples": 1.0}
        for k in range(3)
    ]  # fmt: skip
    (tmp_path / "table.csv").write_text(table_text(rows))
    table = jampetsc.load(tmp_path)
    for averages in (table.where(command="jam").mean(by="n"), table.where(command="jam").median(by="n")):
        assert averages["jammed_fraction"] == pytest.approx([1.0, 0.8])
        expected = [independent_share(np.r_[np.ones(a), np.zeros(b)]).error for a, b in ((2, 0), (8, 2))]
        assert averages.error["jammed_fraction"] == pytest.approx(expected) and expected[0] == pytest.approx(
            1 / 6
        )
    sheared = table.where(command="shear").mean()
    assert sheared["jammed_mean"] == [1.0] and sheared.error["jammed_mean"] == pytest.approx(1 / 8)


def test_columns_have_the_type_of_all_their_cells(tmp_path):
    table = written(
        tmp_path,
        "command,state,file,n,large,mixed,p\na,done,1,3,100000000000000000000000,1,1e-12\na,done,2,4,1,x,2e-12\n",
    )
    assert [table[name].dtype.kind for name in ("n", "large", "mixed", "p")] == list("ifUf")
    for name, value, rows in (
        *(("p", 1e-12 * factor, 1) for factor in (1, 1 + 1e-12, 1 + 5e-10)),
        *(("p", odd, 0) for odd in (1e-12 * (1 + 5e-9), np.nan)),
        *(("n", "3", 1), ("n", None, 0), ("mixed", 1, 1)),
    ):
        assert table.where(**{name: value}).rows == rows, (name, value)
    assert "2 rows of" in repr(table) and table.failed.rows == 0
    table = written(tmp_path, "command,state,file,p\na,done,1,\na,done,2,3.5\n")
    assert table.where(p=np.nan).rows == 1


@pytest.mark.parametrize("text", [
    b"", b"command,state,n\na,done,3\n", b"command,state,file\na,done\n", b"command,state\n1,2\n",
    b"command,state,file\npack,done,a.h5\npack,done,a.h5,1\n", b"\xff\xfe", None,
])  # fmt: skip
def test_what_is_no_table_is_refused(tmp_path, text):
    message = r"table\.csv: not the table of a study\. Run `jampetsc study` again"
    if text is None:
        message = r"a folder without table\.csv\. Give the file in it; run a study that was stopped again"
    else:
        (tmp_path / "table.csv").write_bytes(text)
    with pytest.raises(InputError, match=message):
        load_ensemble(tmp_path, load)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 400])
@pytest.mark.parametrize(
    ("draw", "true_mean", "true_median"), [("normal", 0, 0), ("exponential", 1, np.log(2))]
)
def test_errors_cover(n, draw, true_mean, true_median):
    """Student's mean of normal samples in 68 % of cases; the median's interval whatever the distribution."""
    samples = getattr(np.random.default_rng(n), f"standard_{draw}")((n, 4000))
    exact = draw == "normal" or n > 100
    mean, error = mean_with_error(samples)
    off = abs(mean - true_mean) / error
    assert np.mean(off < 1) == pytest.approx(0.683, abs=0.025 if exact else 0.09)
    assert not exact or np.mean(off < 2) > (0.9 if n > 5 else 0.81)
    if n > 2:
        low, high = median_interval(samples)
        assert np.mean((low < true_median) & (true_median < high)) == pytest.approx(0.683, abs=0.04)
    value, error = median_with_error(samples)
    assert 0.62 < np.mean(abs(value - true_median) < error) < 0.78


def test_errors_of_hardly_any_samples():
    assert np.isnan(mean_with_error([1.0])[1]) and np.isnan(median_with_error([1.0])[1])
    assert mean_with_error([2.0, 2.0]) == median_with_error([2.0, 2.0]) == (2.0, 0.0)
    assert np.isnan(median_interval([1.0, 2.0])).all()


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A study of three packings at each of two pressures, and sweeps under two laws."""
    folder = tmp_path_factory.mktemp("swept")
    rows = []
    for number, (p, s, beta) in enumerate(product((1e-2, 1e-3), (1, 2, 3), (1.0, 0.1))):
        arrays = {"omega": np.array([1e-3, 1.0]), "error_bound": np.zeros(2)}
        arrays["G"] = p * beta * np.array([s + 1j, s**2 - 2j * s])
        samples.stored(folder / f"{number}.h5", "sweep", arrays)
        told = {"command": "sweep", "state": "done", "file": f"{number}.h5", "packing": f"p{p}{s}.h5"}
        rows.append(told | {"pressure": p, "seed": s, "beta": beta})
    write_packing(folder / "p0.011.h5", samples.published())  # its row has no curve
    rows.append(rows[0] | {"command": "pack", "file": "p0.011.h5", "beta": 1.0})
    (folder / "table.csv").write_text(table_text(rows))
    return folder


def test_averages_of_curves_are_those_of_their_points(swept):
    table = jampetsc.load(swept).where(beta=1.0)
    for curves, middle in (
        (table.mean_curve("G", by="pressure"), [2 + 1j, 14 / 3 - 4j]),
        (table.median_curve(by=["pressure"]), [2 + 1j, 4 - 4j]),
    ):
        assert [curve.key for curve in curves] == [{"pressure": 1e-3}, {"pressure": 1e-2}]
        for curve in curves:
            assert curve.count == 3 and curve.omega.tolist() == [1e-3, 1.0]
            np.testing.assert_allclose(curve.value, curve.key["pressure"] * np.array(middle), rtol=1e-12)
    one = table.mean_curve("G", by="pressure")[1].error
    expected = [mean_with_error([1e-2, 2e-2, 3e-2])[1], mean_with_error([0.02, 0.04, 0.06])[1]]
    np.testing.assert_allclose([one[0].real, one[1].imag], expected, rtol=1e-12)
    (real,) = table.where(pressure=1e-2).mean_curve("error_bound")
    assert real.value.dtype == float and real.key == {}
    with pytest.raises(InputError, match=r"G of pressure 0\.001: .* are of one packing"):
        jampetsc.load(swept).mean_curve("G", by="pressure")
    with pytest.raises(InputError, match="no dataset G and times in the files of these rows"):
        table.mean_curve("G", over="times")
    with pytest.raises(InputError, match="other G than"):
        jampetsc.load(swept).where(beta=1.0).mean_curve(over="G")


def test_tables_for_pandas(folder):
    table = jampetsc.load(folder)
    means = table.where(command="quasistatic", beta=1.0).mean(by="pressure")
    if importlib.util.find_spec("pandas") is None:
        for one in (table, means):
            with pytest.raises(
                InputError, match=r"requires the package pandas\. Run: .* -m pip install pandas"
            ):
                one.to_pandas()
        return
    whole, frame = table.to_pandas(), means.to_pandas()
    assert whole["G0"][0] == table["G0"][0] and len(whole) == 13
    assert frame["G0"].tolist() == means["G0"].tolist()
    assert frame["G0_error"].tolist() == means.error["G0"].tolist()

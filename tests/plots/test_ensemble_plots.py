"""Pictures of a study: means over its packings, and which of its files a kind of picture shows."""

from dataclasses import replace

import numpy as np
import pytest
from test_plots import write_sweep

from jampetsc.analysis.statistics import half_width, mean_with_error, median_interval
from jampetsc.cli import main as cli
from jampetsc.io.reader import load
from jampetsc.plots.curves import average_curves, curve_of, group_curves
from jampetsc.studies.table import table_text

OMEGA = np.geomspace(1e-4, 1, 9)


@pytest.fixture
def folder(tmp_path):
    """Sweeps of five packings at two pressures each, one of them unstable to shear, and a packing."""
    rows = [{"command": "pack", "state": "done", "file": "packing.h5", "seconds": 0.1}]
    for pressure in (1e-2, 1e-3):
        for seed in range(5):
            G = (seed - 0.5) * pressure + 1j * OMEGA * (1 + seed)
            name = f"sweep-{pressure}-{seed}.h5"
            write_sweep(
                tmp_path / name, pressure, OMEGA, G, packing_sha256=f"{pressure}{seed}", particle_count=64
            )
            rows.append({"command": "sweep", "state": "done", "file": name, "seconds": 0.1})
    (tmp_path / "table.csv").write_text(table_text(rows))
    return tmp_path


def curves(folder):
    return [curve_of(result) for result in load(folder).where(command="sweep").results()]


def test_curves_are_arithmetic_means_with_their_errors(folder):
    averages = average_curves(curves(folder))
    assert [curve.pressure for curve in averages] == [1e-2, 1e-3]
    for curve in averages:
        np.testing.assert_allclose(curve.G, 1.5 * curve.pressure + 3j * OMEGA, rtol=1e-14)
        expected = half_width(4) * np.sqrt(2.5 / 5)  # standard error of 0, 1, 2, 3, 4
        np.testing.assert_allclose(curve.bounds[0], expected * curve.pressure, rtol=1e-9)
        np.testing.assert_allclose(curve.bounds[1], expected * OMEGA, rtol=1e-9)


def test_a_median_has_the_interval_of_a_median(folder):
    """0, 1, 2, 3 and 90: the last moves the mean, not the median, and the interval is not alike on both sides."""
    found = curves(folder)[:5]
    some = [
        replace(one, G=value + 1j * one.omega) for one, value in zip(found, (0, 1, 2, 3, 90), strict=True)
    ]
    (median,) = average_curves(some, "median")
    np.testing.assert_allclose(median.G, 2 + 1j * OMEGA)
    low, high = median_interval(np.array([0.0, 1, 2, 3, 90]))
    np.testing.assert_allclose(
        median.bounds[0], [np.full(len(OMEGA), 2 - low), np.full(len(OMEGA), high - 2)]
    )
    assert np.isnan(average_curves(some[:1], "median")[0].bounds).all()


def test_sizes_are_not_averaged(folder):
    write_sweep(
        folder / "sweep-0.01-0.h5", 1e-2, OMEGA, 1 + 1j * OMEGA, packing_sha256="large", particle_count=256
    )
    averages = average_curves(curves(folder))
    assert len(averages) == 3
    assert [group.label for group in group_curves(averages)[1]][1:] == [
        "$p/k=10^{-2}$, $N=64$",
        "$p/k=10^{-2}$, $N=256$",
    ]


@pytest.mark.parametrize("kind", [[], ["--kind", "collapse"]])
def test_pictures_of_a_study(folder, capsys, kind):
    assert cli.main(["plot", str(folder), *kind, "--out", str(folder / "x.png")]) == 0
    said = capsys.readouterr().out
    assert "10 sweeps" in said and "arithmetic means over packings with errors" in said
    assert "G' < 0 somewhere in 2 of them" in said
    assert (folder / "x.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("medians", "a study with pack, sweep: nothing for medians picture\n"),
        ("fields", "a study with pack, sweep: nothing for fields picture; of those that show a single file"),
    ],
)
def test_a_study_without_what_is_to_be_drawn(folder, capsys, kind, says):
    assert cli.main(["plot", str(folder), "--kind", kind, "--out", str(folder / "x.png")]) == 2
    assert says in capsys.readouterr().err


def test_some_rows_of_a_study_are_chosen_by_their_values(folder, capsys):
    def plot(*words):
        return cli.main(["plot", str(folder), *words, "--out", str(folder / "x.png")])

    assert plot("--kind", "loss", "--where", "command=sweep,file=sweep-0.01-3.h5") == 0
    assert "G'' of 1 sweep," in capsys.readouterr().out
    for where, says in (
        ("file=none", "a study with nothing: nothing for a picture"),
        ("state=failed", "a study with nothing: nothing for a picture"),
        ("beta=1", "no column beta"),
        ("file", "--where file: write column=value"),
    ):
        assert plot("--where", where) == 2
        assert says in capsys.readouterr().err
    assert (
        cli.main(["plot", str(folder / "sweep-0.01-3.h5"), "--where", "n=1", "--out", str(folder / "x.png")])
        == 2
    )
    assert "--where n=1: chooses rows of a study" in capsys.readouterr().err


def test_intervals_of_long_tails_stay_among_the_samples():
    values = np.array([1.0, 1.1, 1.2, 1.3, 1.4, 1e6])  # of five or less the interval takes the extremes in
    low, high = median_interval(values)
    assert 1.0 <= low < np.median(values) < high < 2.0 < mean_with_error(values)[1]


def test_an_interval_is_one_standard_error_to_either_side():
    low, high = median_interval(np.random.default_rng(2).normal(size=(401, 50)))
    assert np.mean(0.5 * (high - low)) == pytest.approx(np.sqrt(np.pi / 2 / 401), rel=0.06)

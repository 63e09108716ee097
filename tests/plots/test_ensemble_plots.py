"""Pictures of a study: means over its packings, and which of its files a kind of picture shows."""

from dataclasses import replace

import numpy as np
import pytest
from samples import stored
from test_jam_plots import jam_of, shear_of
from test_picture_limits import curve
from test_plots import write_sweep

from jampetsc import main as cli
from jampetsc.analysis.statistics import half_width, median_interval
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.plots.curves import average_curves, group_curves
from jampetsc.plots.draw import draw
from jampetsc.studies.study_table import table_text

OMEGA = np.geomspace(1e-4, 1, 9)


def sweeps_of(values, pressure=1e-2, n=64):
    """Sweeps of packings with G' = these values times p, and G'' = ω times one more than the number of the packing."""
    found = []
    for seed, value in enumerate(values):
        G, facts = value * pressure + 1j * OMEGA * (1 + seed), {"packing_sha256": f"{pressure} {n} {seed}"}
        found.append(curve(f"sweep-{pressure}-{seed}.h5", OMEGA, pressure, G, particle_count=n, **facts))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Sweeps of five packings at two pressures each, one unstable to shear, one about to be; a packing, and samples."""
    folder = tmp_path_factory.mktemp("study")
    commands = {"packing.h5": "pack", "jam.h5": "jam", "shear.h5": "shear"}
    jam = jam_of()
    shear = shear_of(np.tile([1, 1, 1, 0], 20), phi=0.9, **jam.attributes | {"k": 1.0})
    for kind, one in (("jam", jam), ("shear", shear)):
        stored(folder / f"{kind}.h5", kind, one, **one.attributes)
    values = np.array([-0.5, 0.0, 1.5, 2.5, 3.5])
    for one in sweeps_of(values) + sweeps_of(values, 1e-3):
        write_sweep(folder / one.name, one.pressure, OMEGA, one.G, **one.attributes)
        commands[one.name] = "sweep"
    rows = [
        {"command": made, "state": "done", "file": name, "seconds": 0.1} for name, made in commands.items()
    ]
    (folder / "table.csv").write_text(table_text(rows))
    return folder


def test_curves_are_arithmetic_means_with_their_errors():
    """Of each pressure and each N."""
    values = np.arange(5) - 0.5
    averages = average_curves(sweeps_of(values) + sweeps_of(values, 1e-3) + sweeps_of([1.0], n=256))
    assert [one.pressure for one in averages] == [1e-2, 1e-3, 1e-2]
    for one in averages[:2]:
        np.testing.assert_allclose(one.G, 1.5 * one.pressure + 3j * OMEGA, rtol=1e-14)
        expected = half_width(4) * np.sqrt(2.5 / 5)  # standard error of 0, 1, 2, 3, 4
        np.testing.assert_allclose(
            one.bounds, expected * np.array([np.full(9, one.pressure), OMEGA]), rtol=1e-9
        )
    labels = [group.label for group in group_curves(averages)[1]]
    assert labels == ["$p/k=10^{-3}$, $N=64$", "$p/k=10^{-2}$, $N=64$", "$p/k=10^{-2}$, $N=256$"]


def test_a_median_has_the_interval_of_a_median():
    """0, 1, 2, 3 and 90: the last moves the mean, not the median, and the interval is not alike on both sides."""
    some = [replace(one, G=one.G.real + 1j * OMEGA) for one in sweeps_of([0, 1, 2, 3, 90], 1.0)]
    (median,) = average_curves(some, "median")
    np.testing.assert_allclose(median.G, 2 + 1j * OMEGA)
    low, high = median_interval(np.array([0.0, 1, 2, 3, 90]))
    np.testing.assert_allclose(median.bounds[0], [np.full(9, 2 - low), np.full(9, high - 2)])
    assert np.isnan(average_curves(some[:1], "median")[0].bounds).all()


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (
            None,
            "G' and G'' of 10 sweeps, arithmetic means over packings with errors; G' < 0 somewhere in 2 of them",
        ),
        ("collapse", "collapse of 10 sweeps with mu = 0.5, lambda = 1, arithmetic means"),
        ("fraction", "share of samples that jam, of 2 files"),
    ],
)
def test_pictures_of_a_study(folder, kind, says):
    assert says in draw([folder], kind).text


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (
            "medians",
            "jam, pack, shear, sweep, but medians pictures need quasistatic files. Draw another kind.$",
        ),
        ("fields", "a study, but fields pictures show a single file. Give the file"),
    ],
)
def test_a_study_without_what_is_to_be_drawn(folder, kind, says):
    with pytest.raises(InputError, match=says):
        draw([folder], kind)


def test_some_rows_of_a_study_are_chosen_by_their_values(folder, tmp_path, capsys):
    def plot(path, *words):
        return cli.main(["plot", str(path), *words, "--out", str(tmp_path / "x.png")])

    assert plot(folder, "--kind", "loss", "--where", "command=sweep,file=sweep-0.01-3.h5") == 0
    assert "G'' of 1 sweep," in capsys.readouterr().out
    for path, where, says in (
        (
            folder,
            "command=sweeps",
            "no such row in {folder}/table.csv. Choose among: command is pack or jam or shear or sweep",
        ),
        (folder, "state=failed", "state is done"),
        (folder, "beta=1", "no column beta"),
        (folder, "file", "--where file: not a list of conditions. Write column=value"),
        (folder / "sweep-0.01-3.h5", "n=1", "--where n=1: "),
        (folder / "none", "n=1", "none: no such file"),
        (
            tmp_path,
            "n=1",
            "a folder without table.csv. Give the file in it; run a study that was stopped again",
        ),
    ):
        assert plot(path, "--where", where) == 2
        assert says.format(folder=folder) in capsys.readouterr().err
    assert len(load(folder).where(command="sweep").results()) == 10


def test_an_interval_is_one_standard_error_to_either_side():
    low, high = median_interval(np.random.default_rng(2).normal(size=(401, 50)))
    assert np.mean(0.5 * (high - low)) == pytest.approx(np.sqrt(np.pi / 2 / 401), rel=0.06)

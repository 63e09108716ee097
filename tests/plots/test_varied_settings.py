"""Means and pictures keep apart what a study has set, and legends, labels and colours name what differs."""

import numpy as np
import pytest
from cycler import cycler
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from picture_contents import told
from test_floppy_plots import quasistatic_of
from test_flow_plots import facts
from test_picture_limits import curve
from test_plots import sweep_of, write_sweep

import jampetsc
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.plots.draw import draw
from jampetsc.plots.exponent_plots import plot_exponents
from jampetsc.plots.flow_kinds import kind_of, labels_of
from jampetsc.plots.flow_plots import flow_curves, plot_flow, plot_stress
from jampetsc.plots.moduli_plots import average_files, plot_moduli
from jampetsc.plots.quasistatic_plots import groups_of, plot_medians, pressures_of
from jampetsc.plots.style import STORAGE
from jampetsc.studies.study_table import table_text

OMEGA = np.array([1e-3, 1e-2, 1e-1])
WORDS = {  # column -> two values, and the words of a legend
    "lattice": ("square", "triangular"),
    "keep": (0.8, 0.9),
    "potential": ("harmonic", "hertzian"),
    "stabilise": ("shear", "volume"),
    "accuracy": (1e-6, 1e-3),
}


def study_of(folder, column, values, pressures=(0.01, 0.01), names="seed phi", **more):
    """A study of two seeds with each of two values of a column; G' is the number of the value, G'' ten times that."""
    rows = []
    for number, value in enumerate(values):
        for seed in (1, 2):
            file = f"{number}-{seed}.h5"
            G = (1 + number) * (1 + 10j) * np.ones(3)
            write_sweep(folder / file, pressures[seed - 1], OMEGA, G, packing_sha256=file, seed=seed, **more)
            row = {"command": "sweep", "state": "done", "file": file, "packing": file, "G0": 1.0 + number}
            settings = " ".join(dict.fromkeys([*names.split(), column]))
            rows.append(
                row | {"seed": seed, "pressure": pressures[seed - 1], column: value, "settings": settings}
            )
    (folder / "table.csv").write_text(table_text(rows))
    return folder


@pytest.mark.parametrize("column", WORDS)
def test_a_picture_has_a_curve_for_each_value_that_a_study_has_set(tmp_path, column):
    values = WORDS[column]
    page = draw([study_of(tmp_path, column, values)])
    storage = [line for line in page.axes[0].get_lines() if STORAGE in line.get_label()]
    assert [line.get_ydata()[0] for line in storage] == [1.0, 2.0]
    texts = [f"{column} {value:g}" if isinstance(value, float) else f"{column} {value}" for value in values]
    assert told(page.axes[0])[:2] == texts


def test_columns_by_which_curves_differ_are_chosen(tmp_path):
    """What is averaged over then is said; seeds of a study may be kept apart."""
    study = study_of(tmp_path, "lattice", WORDS["lattice"])
    page = draw([study], by="seed", kind="moduli")
    assert told(page.axes[0])[:2] == ["seed 1", "seed 2"]
    assert page.axes[0].get_lines()[0].get_ydata()[0] == pytest.approx(1.5)
    assert page.text.endswith("over lattice square, triangular")
    files = [str(tmp_path / f"{n}-{seed}.h5") for n in (0, 1) for seed in (1, 2)]
    (page,) = [draw(files, by=["pressure"], statistic="mean")]
    assert len([line for line in page.axes[0].get_lines() if "4 sweeps" in line.get_label()]) == 2
    with pytest.raises(
        InputError, match=r"by latice: no such column of these results\. Choose among: pressure, "
    ):
        draw([study], by="latice", kind="moduli")


def test_seeds_of_one_packing_fraction_are_averaged(tmp_path):
    """Though each has a pressure of its own, which stands for its mean where p is an abscissa."""
    study = study_of(tmp_path, "phi", (0.88, 0.9), pressures=(0.02, 0.03), names="seed")
    page = draw([study])
    assert told(page.axes[0])[:2] == [r"$\phi=0.88$", r"$\phi=0.9$"]
    curves, *_ = average_files(load(study).results(), "mean")
    assert [(one.pressure, one.name) for one in curves] == [(pytest.approx(0.025), "2 sweeps")] * 2
    held = [quasistatic_of((1.0, 1.0, 1.0), pressure=p) for p in (0.02, 0.03, 0.05)]
    for result in held[:2]:
        result.settings = {"phi": 0.88, "pressure": None}
    np.testing.assert_allclose(pressures_of(held), [0.025, 0.025, 0.05])
    assert [len(files) for files in groups_of(held)[16].values()] == [2, 1]


@pytest.mark.parametrize("names", ["seed lattice", ""])
def test_means_of_a_table_refuse_what_the_study_has_set(tmp_path, names):
    """Also of tables that do not say which columns are settings."""
    study = study_of(tmp_path, "lattice", WORDS["lattice"], names=names)
    if not names:
        lines = (tmp_path / "table.csv").read_text().splitlines()
        place = lines[0].split(",").index("settings")
        cells = [line.split(",") for line in lines]
        text = "\n".join(",".join(cell for n, cell in enumerate(row) if n != place) for row in cells)
        (tmp_path / "table.csv").write_text(text + "\n")
    table = load(study)
    said = r"G0 of pressure 0\.01: rows differ in lattice \(lattice square or triangular\)\. Choose rows with where"
    with pytest.raises(InputError, match=said):
        table.mean(by="pressure")["G0"]
    with pytest.raises(InputError, match="rows differ in lattice"):
        table.mean_curve()
    assert table.mean(by="lattice")["G0"].tolist() == [1.0, 2.0]
    assert [one.count for one in table.median_curve(by=["pressure", "lattice"])] == [2, 2]


def test_pictures_of_one_kind_refuse_or_separate_what_a_study_has_set():
    first, other = quasistatic_of((1.0, 1.0, 1.0)), quasistatic_of((2.0, 2.0, 2.0), pressure=2e-3)
    first.settings, other.settings = {"stabilise": "volume"}, {"stabilise": "shear"}
    with pytest.raises(InputError, match=r"q.h5: stabilise shear, but q.h5 has volume\. Choose one"):
        plot_medians([first, other])
    weak = quasistatic_of((1.0, 1.0, 1.0), law="own", normal=1.0)
    with pytest.raises(InputError, match=r"q.h5: normal 2.0, but q.h5 has 1.0"):
        groups_of([weak, quasistatic_of((1.0, 1.0, 1.0), law="own", normal=2.0)])
    runs = [facts(rate=rate) for rate in (0.1, 0.2) for _ in range(2)]
    for run, step in zip(runs, (0.1, 0.2) * 2, strict=True):
        run.settings = {"step": step, "rate": run.attributes["rate"]}
    assert len(flow_curves(runs)) == 2
    assert labels_of([kind_of(run) for run in runs[:2]]) == ["step 0.1", "step 0.2"]


def test_a_label_belongs_to_a_file():
    """Also of files that do not differ in what they record; G' and G'' keep their names."""
    results = [
        curve(f"{name}.h5", G=scale * (1 + 1j * OMEGA)) for name, scale in (("a", 3), ("b", 1), ("c", 2))
    ]
    ax = plot_moduli(results, label=["0.66", "0.67", "0.68"])
    assert told(ax) == ["0.66", "0.67", "0.68", "$G$′", "$G$″"]
    handles = ax.get_legend().get_lines()
    for result, handle in zip(results, handles, strict=False):
        (line,) = [
            own for own in ax.get_lines() if result.name in own.get_label() and STORAGE in own.get_label()
        ]
        assert (
            to_rgb(line.get_color()) == to_rgb(handle.get_color()) and line.get_ydata()[0] == result.G[0].real
        )
    assert len({to_rgb(handle.get_color()) for handle in handles[:3]}) == 3
    pressures = [
        curve("a.h5", pressure=1e-2),
        curve("b.h5", pressure=1e-3),
    ]  # the legend of p begins with the low one
    ax = plot_moduli(pressures, label=["high", "low"])
    shown = {to_rgb(line.get_color()): line.get_label() for line in ax.get_lines()}
    for text, handle in list(zip(told(ax), ax.get_legend().get_lines(), strict=True))[:2]:
        assert {"high": "a.h5", "low": "b.h5"}[text] in shown[to_rgb(handle.get_color())]
    many = [curve(f"{n}.h5", pressure=10.0**-n) for n in range(1, 10)]
    assert told(plot_moduli(many, label=list("ABCDEFGHI")))[:9] == list("ABCDEFGHI")


def colours_of(ax):
    return [to_rgb(line.get_color()) for line in ax.get_lines() if STORAGE in line.get_label()]


def test_colours_are_those_of_the_user():
    results = [curve("a.h5", pressure=1e-2), curve("b.h5", pressure=1e-3)]
    red, green, black = (to_rgb(name) for name in ("tab:red", "tab:green", "k"))
    style = {"axes.prop_cycle": cycler(color=["tab:red", "tab:green"])}
    for settings in ({"color": ["tab:red", "C2"]}, {"style": style}):
        assert colours_of(plot_moduli(results, **settings)) == [green, red]  # low pressure is drawn first
    assert colours_of(plot_moduli(results, style=style, color="k")) == [black] * 2
    for wrong in ("redd", ["k", "redd"]):
        with pytest.raises(InputError, match=r"color redd: not a colour of matplotlib\. Give a name"):
            plot_moduli(results, color=wrong)


def test_pictures_on_the_same_axes_have_colours_of_their_own():
    ax = Figure().subplots()
    for n in range(4):
        plot_moduli([curve(f"{n}.h5")], ax=ax, label=f"call {n}")
    assert len(set(colours_of(ax))) == 4
    assert sorted(told(ax)) == ["$G$′", "$G$″", "call 0", "call 1", "call 2", "call 3"]
    axes = Figure().subplots(1)
    for name in ("first", "second"):
        plot_stress(rates_of(), ax=axes, label=name)
    assert told(axes) == ["first", "second"]
    first, second = (to_rgb(container.lines[0].get_color()) for container in axes.containers)
    assert first != second


def rates_of(**more):
    return [
        facts(rate=rate, seed=n, shear_stress_mean=rate**0.5, **more)
        for n, rate in enumerate((0.1, 0.2, 0.4))
    ]


def test_panels_are_chosen_in_their_layout():
    every = plot_flow(rates_of())
    chosen = plot_flow(rates_of(), panels=[("f", "a")])
    for ax, number in zip(chosen, (5, 0), strict=True):
        assert (ax.get_ylabel(), ax.get_xlabel()) == (every[number].get_ylabel(), every[number].get_xlabel())
        assert ax.get_ylabel() and ax.get_yscale() == every[number].get_yscale()
        for own, other in zip(ax.get_lines(), every[number].get_lines(), strict=True):
            np.testing.assert_array_equal(own.get_xydata(), other.get_xydata())
    assert [ax.get_title(loc="left") for ax in chosen] == ["(a)", "(b)"] and len(chosen[0].figure.axes) == 2
    rows = plot_flow(rates_of(), panels=[("a", "b"), ("c",)])
    places = [ax.get_position() for ax in rows]
    assert places[0].y0 == pytest.approx(places[1].y0) and places[2].y1 < places[0].y0
    ax = Figure().subplots()
    assert plot_flow(rates_of(), ax=ax, panels=[("b",)]) is ax and ax.get_ylabel() == every[1].get_ylabel()
    with pytest.raises(InputError, match=r"panels g: no such panel\. This picture has a to f"):
        plot_flow(rates_of(), panels=[("g",)])
    with pytest.raises(InputError, match="panels a: given twice"):
        plot_flow(rates_of(), panels=[("a", "a")])
    for wrong in ("aa", "1", "a,,b", ""):
        with pytest.raises(InputError, match="not letters of panels"):
            jampetsc.plot(sweep_of(), panels=wrong)


def test_stress_alone_is_a_flow_curve():
    """Also where no pressure is positive."""
    ax = plot_stress(rates_of(pressure_mean=-1.0))
    x, y = ax.containers[0].lines[0].get_data()
    np.testing.assert_allclose(x, [0.05, 0.1, 0.2])  # in 1/τ₁
    np.testing.assert_allclose(y, np.sqrt([0.1, 0.2, 0.4]) / 2.0)  # in k
    assert ax.get_ylabel() == r"$\sigma\ [k]$" and ax.get_xlabel() == r"$\dot\gamma\ [1/\tau_1]$"
    with pytest.raises(InputError, match="one rate of each model"):
        plot_stress(rates_of()[:1])
    with pytest.raises(InputError, match="no shear stress is positive"):
        plot_stress([facts(rate=rate, shear_stress_mean=-1.0) for rate in (0.1, 0.2)])


@pytest.mark.parametrize("power", [0.5, 2.0])
def test_exponents_of_a_network_without_modulus(power):
    """G* of a critical network is a power of ω to the lowest one, G' of a floppy one ω²: G₀ is 0 at any ω."""
    omega = np.geomspace(1e-6, 1e-2, 13)
    G = (1j * omega) ** 0.5 if power == 0.5 else omega**2 + 1j * omega
    page = plot_exponents.draw([curve(omega=omega, G=G, pressure=0.0)])
    assert "with G0 = 0 in 1 of them" in page.text
    (line,) = [own for own in page.axes[0].get_lines() if len(own.get_xdata()) == 13]
    np.testing.assert_allclose(line.get_ydata()[1:-1], min(power, 1.0), atol=1e-3)
    with pytest.raises(InputError, match=r"a\.h5: G' and G''/omega still change .* Begin the sweep lower"):
        plot_exponents([curve(omega=omega, G=(1j * omega) ** 0.5, pressure=1e-3)])

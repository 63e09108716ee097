"""What every picture has: panels of its own or given ones, limits, words, style, ticks, legends, and its numbers."""

import csv
import inspect
import itertools

import numpy as np
import pytest
from matplotlib.figure import Figure
from picture_contents import told
from test_flow_plots import series
from test_picture_limits import curve
from test_plots import plot, sweep_of, write_sweep

import jampetsc
from jampetsc.errors import InputError
from jampetsc.plots import style
from jampetsc.plots.draw import MODULES, pictures, plain_text, table_bytes, table_rows
from jampetsc.plots.flow_plots import plot_flow
from jampetsc.plots.moduli_plots import plot_moduli
from jampetsc.plots.page import Page, draw_band, draw_points
from jampetsc.plots.ticks import visible_labels

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")


def test_every_module_with_pictures_is_listed():
    files = style.Path(style.__file__).parent.glob("*.py")
    found = {path.stem for path in files if "@picture(" in path.read_text()}
    assert found - {"picture"} == set(MODULES) and next(iter(pictures())) == "moduli"
    for picture in pictures().values():  # which takes what it declares; python keeps `lambda` for itself
        _, _, *taken = inspect.signature(picture.function).parameters
        assert {{"more": "lambda"}.get(name, name) for name in taken} == set(picture.keywords)


def test_a_picture_is_drawn_on_the_axes_of_its_user():
    """The same numbers as on a figure of its own; number, limits and size of the user's are left alone."""
    own = plot_flow([series("a.h5")])
    figure = Figure(figsize=(9, 5))
    given = figure.subplots(1, 2)
    back = plot_flow([series("a.h5")], ax=given)
    assert back is given and figure.get_size_inches().tolist() == [9, 5]
    for one, other in zip(own, back, strict=True):
        assert table_rows([one]) == table_rows([other]) != []
        assert one.get_ylabel() == other.get_ylabel() and other.get_title(loc="left") == ""
    ax = Figure().subplots()
    assert plot_moduli([curve()], ax=ax) is ax


@pytest.mark.usefixtures("own_dots")
def test_size_limits_words_and_style_are_chosen(tmp_path):
    (tmp_path / "my.mplstyle").write_text("axes.linewidth: 7\n")
    limits = {"xlim": (1e-3, 1), "ylim": [(1e-2, 2)]}
    ax = jampetsc.plot(sweep_of(), size=(5, 4), **limits, label=["mine"], style=tmp_path / "my.mplstyle")
    assert ax.figure.get_size_inches().tolist() == [5, 4]
    assert (ax.get_xlim(), ax.get_ylim()) == ((1e-3, 1), (1e-2, 2))
    assert told(ax)[0] == "mine" and ax.spines["top"].get_linewidth() == 7
    file, out = write_sweep(tmp_path / "s.h5"), tmp_path / "x.png"
    plot(file, "--size", "2,3", "--xlim", "1e-3:1", "--ylim", "1e-2:2", "--label", "mine", "--out", out)
    assert style.matplotlib.image.imread(out).shape[:2] == (900, 600)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"kind": "modulus"}, "kind modulus: no such kind of picture; did you mean modul"),
        ({"nonsense": 1}, "nonsense: not an option of any picture"),
        ({"mu": 11}, r"mu 11: must lie in \[0, 10\]"),
        ({"ax": Figure().subplots(), "size": (2, 2)}, "size, ax: both given"),
        ({"ax": Figure().subplots(1, 2)}, "ax: 2 axes, but this picture needs 1"),
    ],
)
def test_what_cannot_be_chosen(asked, message):
    with pytest.raises(InputError, match=message):
        jampetsc.plot(sweep_of(), **asked)


def test_the_numbers_that_are_drawn_are_written_with_the_names_of_their_axes(tmp_path):
    """k = 4 and τ₁ = 2: what is written is what is shown."""
    omega, G = np.array([1e-3, 0.1, 1.0]), np.array([1 + 1j, 2 + 3j, -1 + 5j])
    file = write_sweep(tmp_path / "s.h5", omega=omega, G=4 * G, bound=0.4, k=4.0, tau1=2.0)
    plot(file, "--csv", tmp_path / "n.csv", "--out", tmp_path / "x.svg")
    with open(tmp_path / "n.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["x"] for row in rows} == {"omega tau_1"} and rows[0]["panel"] == "a"
    for part, values, x in (("G′", G.real[:2], omega[:2]), ("G″", G.imag, omega)):
        own = [row for row in rows if row["series"].startswith(part)]
        line = [row for row in own if row["what"] == "line"]
        np.testing.assert_allclose([float(row["x_value"]) for row in line], 2 * x)
        np.testing.assert_allclose([float(row["y_value"]) for row in line], values)
        band_rows = [row for row in own if row["what"] == "band"]
        np.testing.assert_allclose([float(row["y_high"]) for row in band_rows], values + 0.1)


def test_ends_of_bars_and_bands_are_written():
    """Of the points that are numbers, in both directions."""
    ax = Figure().subplots()
    ax.errorbar([1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], 0.5, label="s")
    ax.fill_between([1.0, 2.0], [0.0, 1.0], [3.0, 5.0], label="band")
    names = ("x_value", "y_value", "x_low", "x_high", "y_low", "y_high")
    found = [[row.get(name, np.nan) for name in names] for row in table_rows([ax])]
    rows = [[1.0, 4.0, 0.5, 1.5, 3.9, 4.4], [3.0, 6.0, 2.5, 3.5, 5.7, 6.6]]
    bands = [[x, np.nan, np.nan, np.nan, low, high] for x, low, high in ((1.0, 0.0, 3.0), (2.0, 1.0, 5.0))]
    np.testing.assert_allclose(found, rows + bands)


def test_names_that_are_no_text_are_written_as_escapes():
    ax = Figure().subplots()
    ax.plot([1.0, 2.0], label="b\udcffd.h5")
    assert rb"b\udcffd.h5" in table_bytes([ax])


@pytest.mark.parametrize("date", ["x", "9" * 20])
def test_a_date_that_is_none_is_refused(tmp_path, monkeypatch, date):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
    style.save(Figure(), tmp_path / "a.png")
    with pytest.raises(InputError, match=f"^SOURCE_DATE_EPOCH {date}: no date for a picture"):
        style.save(Figure(), tmp_path / "a.pdf")


@pytest.mark.parametrize(
    ("label", "words"),
    [
        (r"$\omega_m\ [\sqrt{k/m}]$", "omega_m [sqrt k/m]"), (r"$C(\delta)$", "C(delta)"),
        (r"$p/k=10^{-3}$, $N=64$", "p/k=10^-3, N=64"), (r"$y/H-\frac{1}{2}$", "y/H-1/2"),
        (r"$\dot\gamma\ [k_{\rm e}/k_{\rm d}d_{\rm s}^2]$", "dot gamma [k_e/k_dd_s^2]"),
    ],
)  # fmt: skip
def test_labels_without_tex(label, words):
    assert plain_text(label) == words


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.2, 0.33, "0.2 0.25 0.3"),
        (3, 40, "5 10 20"),
        (0.012, 0.4, "0.02 0.05 0.1 0.2"),
        (4e-4, 2e-3, r"5\times10^{-4} 10^{-3} 2\times10^{-3}"),
        (1e-7, 1.0, "-6 -4 -2 0"),
        (1e-3, 1.0, "-3 -2 -1 0"),
    ],
)
def test_ticks_of_log_axes_are_few_and_written_alike(low, high, labels):
    page = Page()
    ax = page.panels(subplot_kw={"xscale": "log"})
    page.xlim = (low, high)
    page.finish()
    shown = [tick for tick in ax.get_xticks() if low <= tick <= high]
    if high / low < 100:
        assert [ax.xaxis.get_major_formatter()(tick, 0).strip("$") for tick in shown] == labels.split()
    else:
        np.testing.assert_allclose(np.log10(shown), [float(word) for word in labels.split()], atol=1e-9)
        assert len(ax.xaxis.get_minorticklocs()) > len(shown)


def test_labels_that_would_touch_are_taken_away():
    page = Page(size=(1.2, 2))
    ax = page.panels(subplot_kw={"xscale": "log"})
    page.xlim = (4e-4, 1.2e-2)
    page.finish()
    page.figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in visible_labels(ax.xaxis)]
    assert len(boxes) >= 2 and all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))


@pytest.mark.parametrize("entries", [1, 7])
@pytest.mark.parametrize("shape", ["flat", "peak", "cross"])
def test_the_legend_covers_no_data(shape, entries):
    """Where every corner is taken it stands above, and the picture grows for it."""
    x = np.geomspace(1e-6, 1e3, 100)
    drawn = {
        "flat": [(x, f * np.ones(100)) for f in (1.0, 2.0, 3.0)],
        "peak": [(x, x / (1 + x**2))],
        "cross": [(x, x), (x, 1 / x), (x, np.ones(100)), (np.ones(100), x), (x, x**0.5), (x, x**-0.5)],
    }[shape]
    page = Page()
    ax = page.panels(subplot_kw={"xscale": "log", "yscale": "log"})
    for x, y in drawn:
        ax.plot(x, y)
    page.legend(ax, [style.entry("a label of some length")] * entries)
    page.finish()
    page.figure.draw_without_rendering()
    box, whole = ax.get_legend().get_window_extent(), page.figure.bbox
    assert whole.x0 <= box.x0 and box.x1 <= whole.x1 and box.y1 <= whole.y1 + 1
    assert (page.figure.get_figheight() > 3.0) == (box.y0 >= ax.bbox.y1) == (entries == 7)
    fine = np.linspace(0, 99, 5000)
    for line in drawn:
        line = np.column_stack([np.exp(np.interp(fine, np.arange(100), np.log(v))) for v in line])
        assert not box.count_contains(ax.transData.transform(line))


def test_bars_and_bands_do_not_stretch_log_axes():
    page = Page()
    ax = page.panels(subplot_kw={"xscale": "log", "yscale": "log"})
    bars = draw_points(
        ax, [1.0, 2.0, 3.0, 4.0], [1.0, np.nan, -1.0, 2.0], [0.999999, 0.1, 0.1, np.nan], label="x"
    )
    draw_band(ax, [1.0, 4.0], [1e-12, 1.0], [2.0, 2.0], "x")
    page.finish()
    assert (
        bars.has_yerr and bars.lines[0].get_xdata().tolist() == [1.0, 4.0] and 0.2 < ax.get_ylim()[0] < 1 / 3
    )
    flat = Page()
    ax = flat.panels(subplot_kw={"xscale": "log", "yscale": "log"})
    draw_points(ax, [1.0, 2.0], [1.0, 1.0001])
    flat.finish()
    assert ax.get_ylim()[1] / ax.get_ylim()[0] == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.2, "0.2"), (20.0, "20"), (1e-3, "10^{-3}"), (-1e-3, "-10^{-3}"), (2e-3, r"2\times10^{-3}"),
     (3.16e-4, r"3.2\times10^{-4}"), (9.99e-4, "10^{-3}"), (9999.0, "10^{4}"), (123.4, "123")],
)  # fmt: skip
def test_numbers_as_print_writes_them(value, text):
    assert style.number(value) == text
    assert [style.power_or_number(x) for x in (0.1, 1.0)] == ["10^{-1}", "1"]
    powers = {1: "p", 0.5: "p^{1/2}", 2 / 3: "p^{2/3}", -0.5: "p^{-1/2}", 2: "p^{2}", 0.47: "p^{0.47}"}
    assert [style.power_text("p", x) for x in powers] == list(powers.values())

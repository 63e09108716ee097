"""Where pictures end: how many fit, which files agree, which numbers belong to them, and what is refused."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import bands, figure_of, lines
from matplotlib.transforms import Bbox
from samples import published
from test_flow_plots import facts

from jampetsc.analysis.scaling import collapse_spread
from jampetsc.errors import InputError
from jampetsc.plots import fields, jamming, logaxes, moduli, packing, style, trade, vibrations
from jampetsc.plots.averages import average_curves
from jampetsc.plots.correlation import CorrelationCurve, plot_comparison, plot_lengths
from jampetsc.plots.curves import Curve, curve_of, group_curves
from jampetsc.plots.floppy import pressures_of
from jampetsc.plots.flowcurves import plot_flow_curves
from jampetsc.plots.moduli import BOTH, plot_collapse, plot_moduli
from jampetsc.plots.style import LOSS, STORAGE
from jampetsc.plots.units import units_of
from jampetsc.speed_accuracy.table import Row
from jampetsc.words import pictures, response_pictures

OMEGA = np.array([1e-2, 1e-1, 1.0])


def curve(name="a.h5", omega=OMEGA, pressure=1e-3, G=None, **attributes):
    G = 1 + 1j * omega if G is None else G
    return Curve(name, omega, G, np.zeros((2, len(omega))), pressure, attributes)


def file(**attributes):
    return SimpleNamespace(path=Path("a.h5"), attributes=attributes)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"k": 0.0}, "attribute k = 0.0: must be a positive number"),
        ({"k": np.inf}, "attribute k = inf: must be a positive number"),
        ({"tau1": -1.0}, "attribute tau1 = -1.0: must be a positive number"),
        ({"pressure": np.inf}, "attribute pressure = inf: must be a number; make the file again"),
        ({"pressure": "low"}, "attribute pressure = low: must be a number"),
    ],
)
def test_what_is_no_unit(attributes, message):
    with pytest.raises(InputError, match=f"^a.h5: {message}"):
        units_of(file(**attributes))


def test_units_that_a_file_does_not_tell():
    assert vars(units_of(file())) == {"k": 1.0, "tau1": 1.0, "pressure": None}
    assert vars(units_of(file(k=2, tau1=3.0, pressure=-1.0))) == {"k": 2.0, "tau1": 3.0, "pressure": -0.5}


@pytest.mark.parametrize(("pressure", "told"), [(None, "is not recorded"), (0.0, "0"), (-1.0, "-1")])
def test_pressures_that_a_log_axis_does_not_show(pressure, told):
    attributes = {} if pressure is None else {"pressure": pressure}
    with pytest.raises(InputError, match=f"a.h5: pressure {told}: must be positive on a log axis"):
        pressures_of([file(pressure=1.0), file(**attributes)])
    assert pressures_of([file(pressure=1.0 + 1e-9, k=2.0)]) == [0.5]


# Means of sweeps


@pytest.mark.parametrize(("off", "same"), [(0.5e-9, True), (2e-9, False)])
def test_a_mean_is_over_the_same_frequencies(off, same):
    some = [curve("a.h5"), curve("b.h5", OMEGA * (1 + off))]
    if same:
        assert average_curves(some)[0].name == "2 sweeps"
    else:
        with pytest.raises(InputError, match=r"b\.h5: other frequencies than a\.h5: a mean needs the same"):
            average_curves(some)
    with pytest.raises(InputError, match="other frequencies"):
        average_curves([some[0], curve("b.h5", OMEGA[:2])])


def test_a_mean_takes_each_packing_once():
    with pytest.raises(InputError, match=r"b\.h5: is of the same packing as a\.h5: a mean takes each once"):
        average_curves([curve("a.h5", packing_sha256="x"), curve("b.h5", packing_sha256="x")])
    (mean,) = average_curves([curve("a.h5"), curve("b.h5")])  # packings that are not known
    assert np.allclose(mean.G, 1 + 1j * OMEGA) and mean.bounds.max() < 1e-12
    (single,) = average_curves([curve("a.h5")])
    assert single.name == "a.h5" and np.isnan(single.bounds).all()


class Sweep(dict):
    def __init__(self, omega, G, **attributes):
        super().__init__()
        self.omega, self.G, self.error_bound = omega, G, np.arange(1.0, len(omega) + 1)
        self.path, self.attributes = Path("s.h5"), attributes


def test_frequencies_that_are_there_twice_count_once():
    omega = np.array([1.0, 0.5, 1.0 + 0.5e-9, 2.0, 1.0 + 1e-8])
    found = curve_of(Sweep(omega, np.array([1.0, 2.0, 3.0, np.nan, 5.0]) + 1j, tau1=2.0, k=0.5))
    assert np.allclose(found.omega, [1.0, 2.0, 2.0]) and found.G.real.tolist() == [4.0, 2.0, 10.0]
    assert found.bounds[0].tolist() == [4.0, 2.0, 10.0] and found.pressure is None


# What scaling leaves out


def test_scaling_ends_where_criticality_does():
    figure = figure_of(plot_collapse, [curve(omega=np.array([0.1, 1.0, 1.01]))])
    x, *_ = lines(figure.axes[0])[0]
    assert np.allclose(x, [100.0, 1000.0])
    with pytest.raises(InputError, match=r"lowest frequency 1\.01: critical scaling needs some up to"):
        plot_collapse([curve(omega=np.array([1.01, 2.0]))], "x.png")
    for pressure, message in ((None, "attribute pressure is missing"), (0.0, "pressure 0: must be positive")):
        with pytest.raises(InputError, match=message):
            plot_collapse([curve(pressure=pressure)], "x.png")


def test_the_last_frequency_that_is_compared():
    """ωτ₁ = 0.1 belongs to the spread, 0.11 does not."""
    omega = np.array([1e-3, 1e-2, 0.1, 0.11])
    one, other = (1 + 1j) * np.ones(4), np.array([1, 1, 2, 9]) * (1 + 1j)
    assert collapse_spread([(omega, one, 1.0), (omega, other, 1.0)]) > 0.01
    assert collapse_spread([(omega, one, 1.0), (omega, np.array([1, 1, 1, 9]) * (1 + 1j), 1.0)]) < 1e-12


# Correlations


def lengths(pressure=1e-3, omega=(1e-3, 1e-2)):
    count = len(omega)
    return CorrelationCurve(
        "c.h5", np.array(omega), np.full(count, 2.0 + 3j), np.zeros((2, count)), pressure, {},
        C=np.ones((1, count, 2, 3)), errors=np.zeros((1, count, 2, 3)), delta=np.array([[0.0, 1.0, 2.0]]),
        lanes=np.ones(1), size=20.0,
    )  # fmt: skip


def test_a_length_is_scaled_with_its_pressure():
    with pytest.raises(
        InputError, match=r"c\.h5: attribute pressure is missing: correlate sweeps that have it"
    ):
        plot_lengths([lengths(), lengths(None)], "x.png")


@pytest.mark.parametrize(("off", "there"), [(1.009, True), (1.011, False)])
def test_files_are_compared_at_a_frequency_that_they_have(off, there):
    if there:
        assert figure_of(plot_comparison, [lengths()], [1e-2 * off]).axes
    else:
        with pytest.raises(InputError, match=r"c\.h5: no correlation at omega = 0.01011: it has 0.001, 0.01"):
            plot_comparison([lengths()], [1e-2 * off], "x.png")


# How many fit


def test_panels_of_fields():
    disks = published()
    panels = [("", np.zeros((disks.n, 2)))] * fields.COLUMNS
    particles = np.arange(disks.n)
    assert len(figure_of(fields.plot_panels, disks, panels, particles, symbol="u").axes) == fields.COLUMNS
    with pytest.raises(InputError, match=f"{fields.COLUMNS + 1} fields: one picture holds {fields.COLUMNS}"):
        fields.plot_panels(disks, [*panels, panels[0]], particles, "x.png", "u")


def test_panels_of_snapshots():
    panels = [("", published())] * packing.PANELS
    assert len(figure_of(packing.plot_flowing, panels).axes) == packing.PANELS
    with pytest.raises(
        InputError, match=f"{packing.PANELS + 1} snapshots: one picture shows {packing.PANELS}"
    ):
        packing.plot_flowing([*panels, panels[0]], "x.png")


def samples(count, jammed=10, phi_J=0):
    found = []
    for n in range(count):
        one = jamming.Samples(("random", 16 + n, "bidisperse", "harmonic"))
        one.runs[0.84] = [(np.ones(1), np.array([1e-3 * (k + 1)])) for k in range(jammed)]
        one.runs[0.84] += [(np.zeros(1), np.array([1.0]))] * 5
        one.jamming = {0.84: 0.84 + 1e-3 * np.arange(phi_J)}
        found.append(one)
    return found


def test_pressures_of_so_many_kinds(monkeypatch):
    monkeypatch.setattr(jamming, "flow_units", lambda results: SimpleNamespace(k=1.0, label=lambda *_: "p"))
    for count, jammed, message in (
        (6, 10, None),
        (7, 10, "7 kinds of samples: one picture"),
        (1, 9, "fewer than 10 jammed"),
    ):
        monkeypatch.setattr(jamming, "samples_of", lambda results, n=count, m=jammed: samples(n, m))
        if message is None:
            assert len(figure_of(jamming.plot_pressures, [file()]).axes) == 6
        else:
            with pytest.raises(InputError, match=message):
                jamming.plot_pressures([file()], "x.png")


def test_a_density_of_phi_J_needs_ten_samples(monkeypatch):
    monkeypatch.setattr(jamming, "samples_of", lambda results: samples(1, phi_J=10))
    assert figure_of(jamming.plot_jamming_densities, [file()]).axes
    monkeypatch.setattr(jamming, "samples_of", lambda results: samples(1, phi_J=9))
    with pytest.raises(InputError, match=r"a\.h5: holds fewer than 10 values of phi_J"):
        jamming.plot_jamming_densities([file()], "x.png")


def test_flow_curves_need_two_rates_of_one_kind():
    with pytest.raises(InputError, match="flow curves need several rates of one model, phi and N"):
        plot_flow_curves([facts(rate=0.1), facts(rate=0.2, mass=2.0)], "x.png")
    some = [facts(rate=0.1), facts(rate=0.4)]
    for ax in figure_of(plot_flow_curves, some).axes:
        np.testing.assert_allclose(ax.get_xlim(), (0.05 / 1.3, 0.2 * 1.3))


class Modes(dict):
    """A file of three modes."""

    path, attributes = Path("m.h5"), {"k": 2.0}

    def __init__(self):
        super().__init__(eigenvalues=np.array([-1.0, 0.0, 8.0]), modes=np.arange(12.0).reshape(3, 2, 2))

    def stored(self, name):
        return self[name]


def test_modes_are_numbered_from_one():
    assert [field[0, 0] for _, field in vibrations.chosen_modes(Modes(), "1,3")] == [0.0, 8.0]
    assert vibrations.frequencies(Modes()).tolist() == [2.0]
    for text in ("0", "4", "1,-1"):
        with pytest.raises(InputError, match=f"--mode {text.split(',')[-1]}: m.h5 holds modes 1 to 3"):
            vibrations.chosen_modes(Modes(), text)


# Words and guides


@pytest.mark.parametrize(
    ("value", "tick", "number", "power"),
    [
        (1e-3, "0.001", "10^{-3}", "10^{-3}"),
        (0.99e-3, r"9.9\times10^{-4}", r"9.9\times10^{-4}", r"9.9\times10^{-4}"),
        (0.1, "0.1", "0.1", "10^{-1}"),
        (1.0, "1", "1", "1"),
        (9999.0, "9999", r"10^{4}", "10^{4}"),
        (1e4, "10^{4}", "10^{4}", "10^{4}"),
        (99.0, "99", "99", "99"),
        (123.4, "123.4", "123", "123"),
        (-1e4, "-10^{4}", "-10^{4}", "-10^{4}"),
        (0.0, "0", "0", "0"),
    ],
)
def test_numbers_of_axes_and_legends(value, tick, number, power):
    assert (style.tick_text(value), style.number(value), style.power_or_number(value)) == (
        tick,
        number,
        power,
    )


@pytest.mark.parametrize(("decades", "drawn"), [(0.59, False), (0.61, True)])
def test_how_long_a_stretch_is_marked_by_a_guide(decades, drawn):
    x = np.geomspace(1.0, 10**decades, 9)
    assert (logaxes._regime(x, x**0.5, 0.5) is not None) == drawn


@pytest.mark.parametrize(("slope", "drawn"), [(0.61, True), (0.63, False), (0.39, True), (0.37, False)])
def test_how_close_to_its_slope_data_are(slope, drawn):
    x = np.geomspace(1.0, 100.0, 9)
    assert (logaxes._regime(x, x**slope, 0.5) is not None) == drawn


def test_moduli_are_guided_where_they_are_viscous():
    """As in BT Fig. 3a; their collapse is also where it is critical, but not where the frequency stays (BT Fig. 4a)."""
    omega = np.geomspace(1e-4, 1.0, 41)
    for G, guides, scaled in (
        ((1 + 1j) * omega**0.5, [], ["$x^{1/2}$"]),
        (1 + 1j * omega, [r"$\omega$"], ["$x$"]),
        (1 + 1j * omega**0.75, [], []),
    ):
        one = [curve(omega=omega, G=G)]
        as_it_is = [r"$\omega$"] if guides else []
        cases = (
            (plot_moduli, {}, guides),
            (plot_collapse, {}, scaled),
            (plot_collapse, {"lam": 0}, as_it_is),
        )
        for plot, settings, wanted in cases:
            (ax,) = figure_of(plot, one, **settings).axes
            assert [text.get_text() for text in ax.texts] == wanted
    (ax,) = figure_of(plot_moduli, [curve(omega=omega, G=1 + 1j * omega)], parts=(LOSS,)).axes
    assert not ax.texts  # of one modulus there is room for none


def test_a_guide_is_the_middle_of_the_longest_stretch():
    x = np.geomspace(1.0, 1e8, 81)
    y = np.where(x < 10**1.05, x**0.5, np.where(x < 10**3.05, x**2, x**0.5 * 10 ** (1.5 * 3.05)))
    first, last = logaxes._regime(x, y, 0.5)
    assert last - first == pytest.approx(2.5) and 0.5 * (first + last) == pytest.approx(
        0.5 * (3.2 + 8.0), abs=0.1
    )
    assert logaxes._regime(x[:2], x[:2], 1.0) is None


def test_kinds_of_samples_are_named_by_what_differs():
    kind = ("random", 64, "bidisperse", "harmonic")
    assert jamming._labels([kind]) == ["$N=64$"]
    assert jamming._labels([kind, ("random", 256, *kind[2:])]) == ["$N=64$", "$N=256$"]
    assert jamming._labels([kind, ("shear", *kind[1:])]) == ["random", "shear"]
    assert jamming._labels([kind, (*kind[:2], "", "hertzian")]) == ["harmonic", "hertzian"]  # "": not told


def run(choice, error, seconds, group="accuracy"):
    return Row(group, choice, seconds, error_storage=error, error_loss=0.5 * error)


def test_runs_of_equal_error_share_a_name():
    rows = [
        run("--accuracy 0.01", 1e-3, 1.0),
        run("--accuracy 0.001", 1e-3, 2.0),
        run("--accuracy 1e-05", 1e-6, 3.0),
        run("direct, low_memory.opts", 1e-2, 9.0, "method"),
        run("7 frequencies", 1e-1, 4.0, "frequencies"),
    ]
    assert [(row.seconds, name) for row, name in trade._names(rows)] == [
        (4.0, "7"),
        (9.0, "low_memory"),
        (2.0, "$10^{-2}$, $10^{-3}$"),
        (3.0, "$10^{-5}$"),
    ]


def test_a_name_rises_no_farther_than_it_must():
    frame, box = Bbox([[0, 0], [100, 100]]), Bbox([[10, 40], [30, 48]])
    assert trade._rise(box, [], frame) == 0
    beside = Bbox([[31, 40], [50, 48]])
    assert trade._rise(box, [beside], frame) == 0
    below = trade._rise(box, [Bbox([[10, 41], [30, 80]])], frame)
    assert below < 0 and box.translated(0, below).y1 <= 41 and below >= -8 - 2
    over = trade._rise(Bbox([[10, 1], [30, 9]]), [Bbox([[10, 0], [30, 5]])], frame)
    assert over > 0 and 1 + over >= 5
    assert trade._rise(Bbox([[90, 40], [110, 48]]), [], frame) == 100  # never within the frame


def test_frequencies_that_get_a_marker():
    few = np.geomspace(1e-3, 1.0, 16)
    assert moduli._marker_rows(few, 3) == list(range(16))
    many = np.geomspace(1e-3, 1.0, 161)
    rows = [moduli._marker_rows(many, number) for number in (0, 1)]
    assert [len(one) for one in rows] == [8, 8] and not set(rows[0]) & set(rows[1])
    assert np.ptp(np.diff(rows[0])) <= 1 and rows[0][0] == pytest.approx(10, abs=1)
    uneven = np.concatenate([[1e-6], np.geomspace(1e-3, 1.0, 100)])  # evenly over what they span nevertheless
    assert sum(row < 2 for row in moduli._marker_rows(uneven, 0)) == 2


@pytest.mark.parametrize(("above", "sign"), [(True, 1.0), (False, -1.0)])
def test_a_guide_stays_clear_of_all_lines_where_it_is_drawn(above, sign):
    """Of y = x², and of a line at ten or a tenth of it: by 0.12 decades at least."""
    x = np.geomspace(1.0, 1e3, 31)
    drawn = [(x, x**2), (x, 10.0**sign * x**2)]
    with style.figure(4, 3) as fig:
        ax = fig.add_subplot()
        logaxes.set_log_axes(ax, drawn)
        logaxes.draw_guide(ax, x, x**2, 2.0, "x", drawn, above)
        ((u, v, *_),) = lines(ax)
        low, high = ax.get_ylim()
    gap = sign * np.log10(v / u**2) - 1.0
    assert gap.min() == pytest.approx(gap.max()) and 0.12 - 1e-9 <= gap.min() < 0.3
    assert low < v.min() and v.max() < high and u.min() >= 1.0 and u.max() <= 1e3


def test_one_colour_is_dark():
    assert style.colours(1) == style.colours(3)[:1] == [style.sequential()(0.0)]


def test_many_pressures_are_told_by_a_bar():
    """Up to seven in the legend, eight by the colours of a bar from the lowest to the highest."""
    for count, barred in ((7, False), (8, True)):
        curves = [curve(f"{n}.h5", pressure=10.0 ** (-1 - n)) for n in range(count)]
        fig = figure_of(plot_moduli, curves)
        assert len(fig.axes) == 1 + barred
        told = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
        assert told == ([] if barred else [f"$10^{{{n - count}}}$" for n in range(count)]) + [STORAGE, LOSS]
        assert fig.axes[0].get_legend().get_title().get_text() == ("" if barred else "$p/k$")
        shades = [group.colour for group in group_curves(curves)[1]]
        np.testing.assert_allclose(shades, [style.sequential()(n / (count - 1)) for n in range(count)])
        if barred:
            assert (
                fig.axes[1].get_ylim() == pytest.approx((1e-8, 1e-1)) and fig.axes[1].get_ylabel() == "$p/k$"
            )


def test_negative_moduli_are_counted_where_they_would_be_drawn():
    some = [
        curve("a.h5", G=G + 1j * OMEGA)
        for G in (np.array([-1.0, 1.0, 1.0]), np.zeros(3) + 1.0, np.array([0.0, 1.0, 1.0]))
    ]
    (ax,) = figure_of(plot_moduli, some).axes
    assert [text.get_text() for text in ax.texts if "not shown" in text.get_text()] == [
        f"{STORAGE} < 0 (not shown) in 2 of 3 sweeps"
    ]
    (ax,) = figure_of(plot_moduli, some, parts=(LOSS,)).axes
    assert not [text for text in ax.texts if "not shown" in text.get_text()]
    below = [curve(G=-OMEGA - 1j * OMEGA)]
    for parts, words in ((BOTH, "neither G' nor G'' is positive"), ((LOSS,), "no modulus is positive")):
        with pytest.raises(InputError, match=f"a.h5: {words} anywhere"):
            plot_moduli(below, "x.png", parts=parts)


def test_a_collapse_is_guided_by_the_ratio_of_its_exponents():
    """Critical at the lowest pressure, viscous at the highest: G*/p^μ ∝ x^(μ/λ)."""
    omega = np.geomspace(1e-6, 1.0, 61)
    low, high = (
        curve(omega=omega, G=(1 + 1j) * omega**0.25, pressure=1e-6),
        curve(omega=omega, G=1 + 1j * omega, pressure=1e-1),
    )
    (ax,) = figure_of(plot_collapse, [high, low], mu=0.5, lam=2.0).axes
    assert [text.get_text() for text in ax.texts] == ["$x^{1/4}$", "$x$"]
    assert ax.get_xlabel() == r"$\omega\tau_1\,/\,(p/k)^{2}$" and "(p/k)^{1/2}" in ax.get_ylabel()


def test_a_collapse_may_leave_the_frequency_and_then_all_of_it():
    some = [curve(omega=np.array([0.1, 1.0, 10.0]), pressure=p) for p in (1e-4, 1e-2)]
    (ax,) = figure_of(plot_collapse, some, lam=0.0).axes
    assert ax.get_xlabel() == r"$\omega\tau_1$" and "(p/k)^{1/2}" in ax.get_ylabel()
    assert all(line[0].tolist() == [0.1, 1.0, 10.0] for line in lines(ax, 3))


def test_bands_of_a_collapse_are_scaled_as_its_values():
    one = replace(curve(pressure=1e-2), bounds=np.array([[0.1, 0.2, 0.3], [1e-3, 2e-3, 3e-3]]))
    (ax,) = figure_of(plot_collapse, [one], band="what they are").axes
    for (_, low, high), part, bound in zip(bands(ax), (one.G.real, one.G.imag), one.bounds, strict=True):
        np.testing.assert_allclose((low, high), [(part - bound) / 0.1, (part + bound) / 0.1])
    skewed = replace(one, bounds=np.stack((0.5 * one.bounds, one.bounds), axis=1))  # another below than above
    (ax,) = figure_of(plot_collapse, [skewed], band="what they are").axes
    for (_, low, high), part, bound in zip(bands(ax), (one.G.real, one.G.imag), one.bounds, strict=True):
        np.testing.assert_allclose((low, high), [(part - 0.5 * bound) / 0.1, (part + bound) / 0.1])
    assert [text.get_text() for text in ax.get_legend().get_texts()][-1] == "what they are"


@pytest.mark.parametrize(
    ("low", "high", "labelled", "between"),
    [
        (-3.0, 0.0, [-3, -2, -1, 0], True),
        (-7.0, 0.0, [-6, -4, -2, 0], False),
        (-6.0, 0.0, range(-6, 1), True),
        (-13.9, 0.1, [-12, -10, -8, -6, -4, -2, 0], False),
    ],
)
def test_at_most_seven_powers_of_ten_are_labelled(low, high, labelled, between):
    with style.figure(3, 3) as fig:
        ax = fig.add_subplot(xscale="log")
        logaxes.set_ticks(ax.xaxis, low, high)
        np.testing.assert_allclose(np.log10(ax.xaxis.get_major_locator().locs), list(labelled), atol=1e-9)
        minor = np.log10(ax.xaxis.get_minor_locator().locs)
        assert bool((np.abs(minor - np.round(minor)) > 0.1).any()) == between


def test_limits_leave_a_margin_and_guides_stay_in_sight():
    x = np.array([1e-4, 1.0])
    with style.figure(3, 3) as fig:
        ax = fig.add_subplot()
        logaxes.set_log_axes(ax, [(x, 1e-2 * x), (np.array([1e-3, 10.0]), np.array([1.0, 1.0]))])
        np.testing.assert_allclose(np.log10(ax.get_xlim()), [-4 - 0.2, 1 + 0.2])
        np.testing.assert_allclose(np.log10(ax.get_ylim()), [-6 - 0.24, 0.24])
        logaxes.set_log_axes(ax, [(x[:1], x[:1])])
        np.testing.assert_allclose(np.log10(ax.get_xlim()), [-4.1, -3.9])


def test_a_legend_does_not_mind_lines_without_points():
    with style.figure(3, 3, layout="constrained") as fig:
        ax = fig.add_subplot()
        x = np.geomspace(1e-3, 1.0, 9)
        (line,) = ax.plot(x, x, label="x")
        logaxes.set_log_axes(ax, [(x, x)])
        ax.plot([], [])
        assert (
            logaxes.place_legend(fig, ax, "title", [line], [(x, x), (x[:0], x[:0])])._loc == 4
        )  # lower right


@pytest.mark.parametrize("floor", [1e-12, 1e-4])
def test_errors_of_a_trade_end_where_the_reference_does(floor):
    """Rows without a time or an error are left out; what is smaller than the reference's bound is drawn at it."""
    rows = [
        run("--accuracy 0.01", 1e-2, 1.0), run("--accuracy 1e-06", 1e-6, 4.0), run("direct", 1e-3, 2.0, "method"),
        run("direct, a.opts", 1e-3, 0.0, "method"), run("direct, b.opts", np.nan, 2.0, "method"),
        run("", 1.0, 1.0, "reference"),
    ]  # fmt: skip
    ax = figure_of(trade.plot_trade, rows, floor).axes[0]
    points = sorted((x[0], y[0]) for x, y, *_ in lines(ax, 1))
    errors = {1.0: 1e-2, 4.0: 1e-6, 2.0: 1e-3}
    np.testing.assert_allclose(
        points, sorted((t, max(e, floor)) for t, one in errors.items() for e in (one, 0.5 * one))
    )
    joined = [(x, y) for x, y, *_ in lines(ax, 2) if x[0] != x[1] and not np.isclose(y[0], y[1])]
    np.testing.assert_allclose(joined, [([1.0, 4.0], [1e-2, max(1e-6, floor)])])
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert ("errors below are not resolved" in told) == (
        floor > 1e-6
    ) and "rational sweep, by --accuracy" in told
    assert told[1] == "one frequency after another" and len(told) == 4 + (floor > 1e-6)


def test_nothing_to_trade_is_an_empty_picture():
    ax = figure_of(trade.plot_trade, [run("direct", np.nan, 1.0, "method")], 1e-9).axes[0]
    assert not ax.get_lines() and len(ax.get_legend().get_texts()) == 2


def test_studies_with_packings_unstable_to_shear_say_in_how_many(monkeypatch):
    """G' < 0 at some frequency is enough."""
    some = [
        curve(f"{n}.h5", G=np.array([a, 1.0, 1.0]) + 1j, packing_sha256=str(n))
        for n, a in enumerate((-1.0, 1.0, -2.0, 0.0))
    ]
    asked = SimpleNamespace(average=True, statistic=None)
    (mean,), band, words = response_pictures._averaged(asked, some)
    assert mean.G[0] == pytest.approx(-0.5 + 1j)
    assert band == "mean, 68 % interval\n$G$\u2032 < 0 in 2 of 4"
    assert (
        "; G' < 0 somewhere in 2 of them, which count like the others; 4 packings only: rough errors" in words
    )
    *_, band, words = response_pictures._averaged(asked, some[1:2])
    assert (
        words == ", arithmetic means over packings with errors; 1 packing only: no error" and "\n" not in band
    )
    (median,), band, words = response_pictures._averaged(
        SimpleNamespace(average=True, statistic="median"), some
    )
    assert median.G[0] == pytest.approx(-0.5 + 1j) and band.startswith("median, 68 % interval")
    assert words.startswith(", medians over packings")
    assert response_pictures._averaged(SimpleNamespace(average=False, statistic=None), some) == (some, "", "")
    with pytest.raises(InputError, match="--statistic median: is taken over the packings of a study"):
        response_pictures._averaged(SimpleNamespace(average=False, statistic="median"), some)


@pytest.mark.parametrize(
    ("kind", "held", "count", "message"),
    [
        (["moduli"], "sweep", 3, None),
        (["fields"], "sweep", 1, None),
        (["fields"], "sweep", 2, "2 sweep files: fields pictures show one; plot them one by one"),
        (["spectrum"], "modes", 1, "a.h5: is a modes file: spectrum pictures need spectra or sweeps"),
        (["packing"], "sweep", 1, "a.h5: is a sweep file: packing pictures need a packing"),
        (
            ["lanes"],
            "jam",
            1,
            "a.h5: is a jam file: lanes pictures need velocity-correlation files or flow files",
        ),
    ],
)
def test_a_kind_shows_some_files(kind, held, count, message):
    if message is None:
        assert pictures.choose(kind, held, ["a.h5"] * count) == kind[0]
    else:
        with pytest.raises(InputError, match=message):
            pictures.choose(kind, held, ["a.h5"] * count)


@pytest.mark.parametrize(
    ("rows", "kind", "fit"),
    [
        (0, "moduli", False),
        (1, "moduli", True),
        (5, "moduli", True),
        (0, "fields", False),
        (1, "fields", True),
        (2, "fields", False),
    ],
)
def test_so_many_files_of_a_study_fit(rows, kind, fit):
    assert pictures.fits(SimpleNamespace(rows=rows), kind) == fit


@pytest.mark.parametrize(
    ("size", "shown"), [(0.9e200, True), (1.1e200, False), (1.1e-200, True), (0.9e-200, False), (0.0, True)]
)
@pytest.mark.parametrize("part", [1.0, 1j])
def test_moduli_that_a_log_axis_can_show(size, shown, part):
    """Of either part; what vanishes is left out later."""
    G = np.array([1 + 1j, (1 + 1j) - part + part * size])
    if shown:
        assert len(curve_of(Sweep(np.array([1.0, 2.0]), G)).omega) == 2
    else:
        with pytest.raises(InputError, match=r"s\.h5: holds moduli that no picture can show"):
            curve_of(Sweep(np.array([1.0, 2.0]), G))


@pytest.mark.parametrize(("seconds", "ticks"), [((1.0, 20.0), True), ((1.0, 2000.0), False)])
def test_times_over_less_than_two_decades_are_labelled_between(seconds, ticks):
    rows = [run("direct", 1e-3, one, "method") for one in seconds]
    ax = figure_of(trade.plot_trade, rows, 1e-9).axes[0]
    left, right = ax.get_xlim()
    shown = [tick for tick in ax.get_xticks() if left <= tick <= right]
    assert any(tick in (2.0, 5.0, 20.0) for tick in shown) == ticks and {1.0, 10.0} <= set(shown)
    assert ax.xaxis.get_major_formatter()(20.0, 0) == "20"


def test_a_picture_grows_by_the_legend_above_it():
    """Where data is in every corner; the axes stay as large as they were."""
    x = np.geomspace(1e-6, 1e3, 100)
    data = [(x, x), (x, 1 / x), (x, np.ones(100)), (np.ones(100), x), (x, x**0.5), (x, x**-0.5)]
    heights, figures = [], []
    for entries in (0, 6):
        with style.figure(3.4, 2.9, layout="constrained") as fig:
            ax = fig.add_subplot()
            drawn = [ax.plot(*line, label="a label of some length")[0] for line in data]
            logaxes.set_log_axes(ax, data)
            if entries:
                logaxes.place_legend(fig, ax, "", drawn, data)
            fig.draw_without_rendering()
            heights.append(ax.get_window_extent().height / fig.dpi)
            figures.append(fig.get_figheight())
    assert figures[1] > figures[0] + 0.2 and heights[1] == pytest.approx(heights[0], abs=0.1)

"""Where pictures end: how many fit, which files agree, which numbers belong to them, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from picture_contents import drawn_by, figure_of, held, lines, told
from test_flow_plots import facts

from jampetsc.errors import InputError
from jampetsc.plots import trade_plots
from jampetsc.plots.correlation_plots import CorrelationCurve, plot_lengths
from jampetsc.plots.curves import Curve, average_curves, curve_of
from jampetsc.plots.flow_plots import plot_flow
from jampetsc.plots.moduli_plots import plot_collapse, plot_loss, plot_moduli
from jampetsc.plots.picture import units_of
from jampetsc.plots.quasistatic_plots import pressures_of
from jampetsc.plots.style import STORAGE
from jampetsc.studies.trade_report import TradeRow

OMEGA = np.array([1e-2, 1e-1, 1.0])


def curve(name="a.h5", omega=OMEGA, pressure=1e-3, G=None, **attributes):
    G = 1 + 1j * omega if G is None else G
    return Curve(name, omega, G, np.zeros((2, len(omega))), pressure, attributes)


def file(**attributes):
    return held({}, attributes)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"k": 0.0}, "attribute k = 0.0: not a positive number"),
        ({"k": np.inf}, "attribute k = inf: not a positive number"),
        ({"tau1": -1.0}, "attribute tau1 = -1.0: not a positive number"),
        ({"pressure": np.inf}, "attribute pressure = inf: not a number. Make the file again"),
        ({"pressure": "low"}, "attribute pressure = low: not a number"),
    ],
)
def test_what_is_no_unit(attributes, message):
    with pytest.raises(InputError, match=f"^a.h5: {message}"):
        units_of(file(**attributes))


@pytest.mark.parametrize(("pressure", "told"), [(None, "is not recorded"), (0.0, "0"), (-1.0, "-1")])
def test_pressures_that_a_log_axis_does_not_show(pressure, told):
    attributes = {} if pressure is None else {"pressure": pressure}
    with pytest.raises(InputError, match=f"a.h5: pressure {told}. Give files of positive pressure"):
        pressures_of([file(pressure=1.0), file(**attributes)])
    assert pressures_of([file(pressure=1.0 + 1e-9, k=2.0)]) == [0.5]


def test_legends_name_the_dimension_that_differs_and_a_load_that_is_not_shear():
    both = told(figure_of(plot_moduli, [curve(), curve("b.h5", dimension=3)]).axes[0])
    assert len(both) == 4 and both[:2] == ["$D=2$", "$D=3$"]
    title = figure_of(plot_moduli, [curve(load="compression")]).axes[0].get_legend().get_title().get_text()
    assert title == "load compression,  $p/k$"


def test_a_mean_is_over_the_same_frequencies_and_takes_each_packing_once():
    first, near, known = curve(), curve("b.h5", OMEGA * (1 + 0.5e-9)), {"packing_sha256": "x"}
    (mean,) = average_curves([first, near])  # packings that are not known
    assert mean.name == "2 sweeps" and np.allclose(mean.G, 1 + 1j * OMEGA) and mean.bounds.max() < 1e-8
    (single,) = average_curves([first])
    assert single.name == "a.h5" and np.isnan(single.bounds).all()
    other = r"b\.h5: not the frequencies of a\.h5\. For a mean"
    for one, two, message in (
        (first, curve("b.h5", OMEGA * (1 + 2e-9)), other),
        (first, curve("b.h5", OMEGA[:2]), other),
        (
            curve(**known),
            curve("b.h5", **known),
            r"b\.h5: the packing of a\.h5\. Give each packing once",
        ),
    ):
        with pytest.raises(InputError, match=message):
            average_curves([one, two])


def sweep(omega, G, **attributes):
    arrays = {"omega": omega, "G": G, "error_bound": np.arange(1.0, len(omega) + 1)}
    return held(arrays, attributes, "s.h5", "jampetsc-sweep")


def test_frequencies_that_are_there_twice_count_once():
    omega = np.array([1.0, 0.5, 1.0 + 0.5e-9, 2.0, 1.0 + 1e-8])
    found = curve_of(sweep(omega, np.array([1.0, 2.0, 3.0, np.nan, 5.0]) + 1j, tau1=2.0, k=0.5))
    assert np.allclose(found.omega, [1.0, 2.0, 2.0]) and found.G.real.tolist() == [4.0, 2.0, 10.0]
    assert found.bounds[0].tolist() == [4.0, 2.0, 10.0] and found.pressure is None


def test_scaling_ends_where_criticality_does():
    figure = figure_of(plot_collapse, [curve(omega=np.array([0.1, 1.0, 1.01]))])
    np.testing.assert_allclose(lines(figure.axes[0])[0][0], [100.0, 1000.0])
    for refused, message in (
        (curve(omega=np.array([1.01, 2.0])), r"lowest frequency 1\.01, above 1/τ₁"),
        (curve(pressure=None), "attribute pressure: missing"),
        (curve(pressure=0.0), "pressure 0: must be positive"),
    ):
        with pytest.raises(InputError, match=f"a.h5: {message}"):
            plot_collapse([refused])


def test_a_length_is_scaled_with_its_pressure():
    ones, three = np.ones((1, 2, 2, 3)), np.array([[0.0, 1.0, 2.0]])
    shown = {"C": ones, "errors": 0 * ones, "delta": three, "lanes": np.ones(1), "size": 20.0}
    some = CorrelationCurve("c.h5", OMEGA[:2], np.full(2, 2 + 3j), np.zeros((2, 2)), None, {}, **shown)
    with pytest.raises(
        InputError, match=r"c\.h5: attribute pressure: missing\. Correlate sweeps that have it"
    ):
        plot_lengths([replace(some, pressure=1e-3), some])


def test_flow_curves_need_two_rates_of_one_kind():
    with pytest.raises(InputError, match="one rate of each model, phi and N"):
        plot_flow([facts(rate=0.1), facts(rate=0.2, mass=2.0)])
    some = [facts(rate=0.1), facts(rate=0.4)]
    for ax in figure_of(plot_flow, some).axes:
        np.testing.assert_allclose(ax.get_xlim(), (0.05 / 1.3, 0.2 * 1.3))


def test_moduli_are_guided_where_they_are_viscous():
    """As in BT Fig. 3a; their collapse is also where it is critical, but not where the frequency stays (BT Fig. 4a)."""
    omega = np.geomspace(1e-4, 1.0, 41)
    for G, guides, scaled in (
        ((1 + 1j) * omega**0.5, [], ["$x^{1/2}$"]),
        (1 + 1j * omega, [r"$\omega$"], ["$x$"]),
    ):
        one = [curve(omega=omega, G=G)]
        cases = [(plot_moduli, {}, guides), (plot_collapse, {}, scaled)]
        cases += [(plot_collapse, {"lambda": 0}, guides)] if guides else []
        for plot, settings, wanted in cases:
            (ax,) = figure_of(plot, one, **settings).axes
            assert [text.get_text() for text in ax.texts] == wanted
    (ax,) = figure_of(plot_loss, [curve(omega=omega, G=1 + 1j * omega)]).axes
    assert not ax.texts  # of one modulus there is room for none
    for limits in ((0.01, 1.0), [(0.01, 1.0)]):  # a guide to what is out of sight would be cut off
        (ax,) = figure_of(plot_moduli, [curve(omega=omega, G=1 + 1j * omega)], xlim=limits).axes
        assert ax.texts and ax.get_lines()[-1].get_xdata().min() >= 0.01


def run(choice, error, seconds, group="accuracy"):
    return TradeRow(group, choice, seconds, 9.0, error_storage=error, error_loss=0.5 * error)


def test_negative_moduli_are_counted_where_they_would_be_drawn():
    some = [curve(G=np.array(G) + 1j * OMEGA) for G in ([-1.0, 1, 1], [1.0, 1, 1], [0.0, 1, 1])]
    (ax,) = figure_of(plot_moduli, some).axes
    assert ax.texts[0].get_text() == f"{STORAGE} ≤ 0 (not shown) in 2 of 3 sweeps"
    (ax,) = figure_of(plot_loss, some).axes
    assert not [text for text in ax.texts if "not shown" in text.get_text()]
    for picture, words in (
        (plot_moduli, "neither G' nor G'' is positive at any frequency"),
        (plot_loss, "no modulus is positive"),
    ):
        with pytest.raises(InputError, match=f"a.h5: {words}"):
            picture([curve(G=np.array([-1.0, 0.0, -1.0]) * (1 + 1j))])


def test_a_collapse_is_guided_by_the_ratio_of_its_exponents():
    """Critical at the lowest pressure, viscous at the highest: G*/p^μ ∝ x^(μ/λ)."""
    omega = np.geomspace(1e-6, 1.0, 61)
    low = curve(omega=omega, G=(1 + 1j) * omega**0.25, pressure=1e-6)
    high = curve(omega=omega, G=1 + 1j * omega, pressure=1e-1)
    (ax,) = figure_of(plot_collapse, [high, low], mu=0.5, **{"lambda": 2.0}).axes
    assert [text.get_text() for text in ax.texts] == ["$x^{1/4}$", "$x$"]
    assert ax.get_xlabel() == r"$\omega\tau_1\,/\,(p/k)^{2}$" and "(p/k)^{1/2}" in ax.get_ylabel()


@pytest.mark.parametrize("floor", [1e-12, 1e-4])
def test_errors_of_a_trade_end_where_the_reference_does(floor):
    """Rows without a time or an error are left out; what is smaller than the reference's bound is drawn at it."""
    rows = [
        run("--accuracy 0.01", 1e-2, 1.0), run("--accuracy 1e-06", 1e-6, 4.0), run("direct", 1e-3, 2.0, "method"),
        run("direct, a.opts", 1e-3, 0.0, "method"), run("direct, b.opts", np.nan, 2.0, "method"),
        run("", 1.0, 1.0, "reference"),
    ]  # fmt: skip
    ax = drawn_by(trade_plots.draw_trade, rows, floor).axes[0]
    points = sorted((face == "white", x[0], y[0]) for x, y, _, face in lines(ax, 1))  # open: G''
    errors = {1.0: 1e-2, 2.0: 1e-3, 4.0: 1e-6}
    wanted = [(n, t, max(e * share, floor)) for n, share in enumerate((1, 0.5)) for t, e in errors.items()]
    np.testing.assert_allclose(points, wanted)
    joined = [(x, y) for x, y, *_ in lines(ax, 2) if x[0] != x[1] and not np.isclose(y[0], y[1])]
    np.testing.assert_allclose(joined, [([1.0, 4.0], [1e-2, max(1e-6, floor)])])
    assert ("errors below are not resolved" in told(ax)) == (floor > 1e-6) and len(told(ax)) == 4 + (
        floor > 1e-6
    )
    assert told(ax)[:2] == ["rational sweep, by --accuracy", "one frequency after another"]


@pytest.mark.parametrize(
    ("size", "shown"), [(0.9e200, True), (1.1e200, False), (1.1e-200, True), (0.9e-200, False), (0.0, True)]
)
@pytest.mark.parametrize("part", [1.0, 1j])
def test_moduli_that_a_log_axis_can_show(size, shown, part):
    """Of either part; what vanishes is left out later."""
    G = np.array([1 + 1j, (1 + 1j) - part + part * size])
    if shown:
        assert len(curve_of(sweep(np.array([1.0, 2.0]), G)).omega) == 2
    else:
        with pytest.raises(InputError, match=r"s\.h5: moduli beyond the range of a picture"):
            curve_of(sweep(np.array([1.0, 2.0]), G))

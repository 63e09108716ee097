"""Flow curves with their laws and starts of flows: what is drawn, in the units of the axes."""

import numpy as np
import pytest
from flow_means import RATES, TAU1, K, flow, sheared
from picture_contents import figure_of, held, told
from test_flow_plots import facts
from test_overshoot import ROW, STRAIN, noisy_starts

import jampetsc
from jampetsc.analysis.correlated_series import mean_of_facts
from jampetsc.analysis.overshoot import find_peak
from jampetsc.errors import InputError
from jampetsc.plots.draw import table_rows
from jampetsc.plots.start_plots import mean_starts, plot_start
from jampetsc.plots.yielding_plots import plot_flow_curve


def series_of(ax):
    """{name: (x, y) of points and lines, (x, low, high) of bands} of what an axes shows."""
    found = {}
    for row in table_rows([ax]):
        values = [row[name] for name in ("x_value", "y_value", "y_low", "y_high") if name in row]
        found.setdefault(row["series"], []).append(values[:2] if "y_value" in row else values)
    return {name: np.array(values).T for name, values in found.items()}


@pytest.fixture(scope="module")
def runs():
    return [flow(None, rate, seed) for seed in (1, 2, 3) for rate in RATES]


def test_a_fit_is_drawn_with_its_points_yield_stress_and_quasistatic_shear(runs):
    """Over k and τ₁, which are not 1."""
    fit = jampetsc.scaling(*runs, sheared(None))
    ax = figure_of(plot_flow_curve, fit).axes[0]
    drawn = series_of(ax)
    for name, quantity in (("RD0", "shear_stress"), ("RD0, p", "pressure")):
        assert np.allclose(drawn[name][0], RATES * TAU1) and np.allclose(drawn[name][1], fit[quantity] / K)
    rate, stress = drawn["RD0, fit"]
    law = [fit[f"groups/{name}"][0] for name in ("yield_stress", "consistency", "flow_index")]
    assert np.allclose(stress, (law[0] + law[1] * (rate / TAU1) ** law[2]) / K)
    assert np.allclose(drawn["RD0, sigma_y"][1], law[0] / K)
    assert np.allclose(drawn["RD0, quasistatic shear stress"][1], 1.1e-3 / K)
    assert np.allclose(drawn["RD0, quasistatic pressure"][1], 8.8e-3 / K)
    ends = [fit[f"groups/yield_stress_{end}"][0] / K for end in ("low", "high")]
    assert np.allclose(drawn["RD0, 95 % of sigma_y"][1:, 0], ends)
    assert told(ax)[-2:] == [r"95 % of $\sigma_y$", "quasistatic"]


def test_flows_are_drawn_without_a_fit(runs):
    ax = figure_of(plot_flow_curve, [*runs, sheared(None)]).axes[0]
    drawn = series_of(ax)
    first = [run.attributes for run in runs if run.attributes["rate"] == RATES[0]]
    assert drawn["RD0"][1][0] == pytest.approx(mean_of_facts(first, "shear_stress")[0] / K)
    assert np.allclose(drawn["RD0, quasistatic shear stress"][1], 1.1e-3 / K) and "RD0, fit" not in drawn


def test_groups_and_files_have_names(runs):
    others = [flow(None, rate, seed, 0.9) for seed in (1, 2, 3) for rate in RATES]
    both = jampetsc.scaling(*runs, *others, by="phi")
    assert told(figure_of(plot_flow_curve, both).axes[0])[:2] == ["phi = 0.86", "phi = 0.9"]
    weak = jampetsc.scaling(*(flow(None, rate, noise=0.3) for rate in RATES))
    assert r"$\sigma_y$" not in told(figure_of(plot_flow_curve, weak).axes[0])  # not resolved


def test_what_does_not_belong_to_a_flow_curve(runs):
    fit = jampetsc.scaling(*runs)
    for results, says in (
        ([fit, runs[0]], "a fit, which has the points of its flows. Draw it without"),
        ([*runs, sheared(None, phi=0.9)], r"phi = 0\.9, N = 64, k = 2\.5: of no flow\. Give"),
        ([*runs, sheared(None, k=1.0)], r"phi = 0\.86, N = 64, k = 1: of no flow\. Give"),
        ([sheared(None)], "quasistatic shear alone. Give flows"),
    ):
        with pytest.raises(InputError, match=says):
            plot_flow_curve(results)


def started(seed=1, height=0.3, rate=0.1, rows=STRAIN, at_rest=0.25, **more):
    """Flows of one kind with their starts, in units of k = 2."""
    starts, steady = noisy_starts(seed, height, 0.05, 4)
    flows = []
    for number, (stress, mean) in enumerate(zip(starts, steady, strict=True)):
        parts = 2.0 * np.array([0.75, 0.25, 0.0]) * stress[: len(rows), None]
        arrays = {"strain": rows + 0.5 * ROW, "shear_stress": parts}
        if at_rest is not None:
            arrays["start/shear_stress"] = 2.0 * np.array([0.0, at_rest, 0.0])
        told = facts(rate=rate, seed=number, shear_stress_mean=2.0 * mean, discard=0.9, **more).attributes
        flows.append(held(arrays, told, f"{number}.h5", "jampetsc-flow"))
    return flows, starts, steady


def test_a_start_is_the_mean_over_seeds_with_its_peak():
    flows, starts, steady = started()
    ax = figure_of(plot_start, flows).axes[0]
    (start,) = mean_starts(flows).values()
    kept = STRAIN <= 0.9
    assert np.allclose(start.strain, np.r_[0.0, STRAIN[kept]])
    assert np.allclose(start.stress, np.r_[0.25, starts[:, kept].mean(axis=0)])
    assert start.peak == find_peak(STRAIN[kept], starts[:, kept], steady)
    drawn = series_of(ax)
    assert np.allclose(drawn["RD, mean"], [start.strain, start.stress])
    assert np.allclose(drawn["RD, steady"][1], steady.mean())
    assert np.allclose(drawn["RD"], [[start.peak.strain], [start.peak.stress]])
    text = plot_start.draw(flows).text
    assert text.startswith(f"start of 4 runs: peak {start.peak.stress:.4g} ± ") and "overshoot" in text


def test_starts_that_cannot_be_averaged():
    flows, *_ = started()
    other = held({**flows[0], "strain": 4 * STRAIN}, flows[0].attributes, "other.h5", "jampetsc-flow")
    few, *_ = started(rows=STRAIN[:7])
    still = held({**flows[0], "strain": 0 * STRAIN}, flows[0].attributes, "still.h5", "jampetsc-flow")
    for results, says in (
        ([*flows, other], r"other\.h5: rows of 0\.01 in strain, 0\.h5 has 0\.005\. For a mean give flows"),
        ([still], r"still\.h5: strain or stress out of range\. Make the file again"),
        (few, r"0\.h5: 7 rows before discard: too few for a start \(at least 8\)\. Run the flow with series"),
    ):
        with pytest.raises(InputError, match=says):
            mean_starts(results)


def test_starts_without_errors_and_without_overshoot():
    flows, *_ = started(at_rest=None)
    assert "without errors (one seed)" in plot_start.draw(flows[:1]).text
    assert mean_starts(flows)[next(iter(mean_starts(flows)))].strain[0] > 0
    flat, *_ = started(height=0.0)
    assert "no overshoot beyond noise" in plot_start.draw(flat).text
    both = [*flows, *started(seed=2, rate=0.2)[0]]
    assert told(figure_of(plot_start, both).axes[0]) == [
        r"$\dot\gamma=5\times10^{-2}$",
        r"$\dot\gamma=0.1$",
        "steady",
    ]

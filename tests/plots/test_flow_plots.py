"""Pictures of steady shear, drawn from real runs and from results of known content."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from picture_contents import bands, bars, figure_of, held, lines, require_arrows, told

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.correlated_series import layer_heights, mean_profile
from jampetsc.analysis.power_laws import local_exponents
from jampetsc.analysis.statistics import half_width
from jampetsc.errors import InputError
from jampetsc.io.disk_motion import snapshot, velocity_profiles
from jampetsc.packing.contacts import measure
from jampetsc.plots.draw import draw, table_rows
from jampetsc.plots.flow_kinds import kind_of, labels_of, shared_words
from jampetsc.plots.flow_plots import (
    draw_local_exponents,
    flow_curves,
    flow_regimes,
    lanes_of,
    plot_against_phi,
    plot_flow,
    plot_lanes,
    plot_order,
    plot_profiles,
    plot_regimes,
)
from jampetsc.plots.packing_plots import find_touching
from jampetsc.plots.picture import flow_units


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Real ones, at two rates."""
    folder = tmp_path_factory.mktemp("flow")
    for rate in ("1e-2", "3e-2"):
        words = f"flow --n 64 --phi 0.86 --model RD0 --rate {rate} --strain 0.5 --snapshots 2 --out"
        assert cli.main([*words.split(), str(folder / f"{rate}.h5")]) == 0
    return [str(folder / "1e-2.h5"), str(folder / "3e-2.h5")]


@pytest.mark.parametrize(
    "files, kind, says",
    [
        (slice(0, 1), None, "stress and pressure of 1 run over the strain"),
        (slice(0, 2), None, "flow curves of 2 runs at 2 rates"),
        (slice(0, 1), "snapshot", "contacts of 64 disks at strain 0.5"),
        (slice(0, 2), "snapshot", "64 disks at strain 0.5, 64 disks at strain 0.5"),
        (slice(0, 2), "lanes", "g_y of 2 files"),
    ],
)
def test_pictures(runs, files, kind, says):
    assert says in draw(runs[files], kind).text


def test_snapshots_are_titled_by_what_differs_between_the_runs(runs):
    def titles(paths):
        return [ax.get_title() for ax in np.ravel(jampetsc.plot(paths, "snapshot"))]

    other = jampetsc.load(runs[1])
    other.attributes["mass"] = 1.0
    assert titles(runs[0]) == [""] and titles([runs[0], other]) == ["no mass", "$m=1$"]


@pytest.mark.parametrize("count", [1, 12, 13])
def test_a_legend_names_twelve_runs_of_one_rate_at_most(count):
    names = [f"r{n}" for n in range(count)] if count == 12 else []
    assert told(figure_of(plot_flow, [series(f"r{n}.h5") for n in range(count)]).axes[1]) == [*names, "means"]


def test_velocities_are_those_of_the_last_snapshot_per_rate(runs):
    field = jampetsc.load(runs[0])["snapshots/velocities"][-1] / 1e-2
    require_arrows(jampetsc.plot(runs[0], "velocities"), field)


def test_flow_files_are_correlated_as_correlate_does(runs, tmp_path):
    g = tmp_path / "g.h5"
    assert cli.main(["correlate", runs[0], "--out", str(g)]) == 0
    first, other = lanes_of([jampetsc.load(path) for path in runs])
    assert np.array_equal(first[2], jampetsc.load(g)["g_y"]) and not np.allclose(first[2], other[2])


def facts(**more):
    """A result with the attributes that curves are told apart by."""
    plain = {"model": "RD", "phi": 0.8, "particle_count": 64, "mass": 1.0, "potential": "harmonic", "k": 2.0}
    plain |= {"rate": 0.1, "seed": 1, "units": "those of the packing", "stiffness": "constant", "tau1": 0.5}
    names = ("shear_stress", "pressure", "contact_number")
    plain |= {f"{name}_{part}": 1.0 for name in names for part in ("mean", "error")}
    plain |= {f"{name}_samples": np.inf for name in names}
    return held({}, plain | more, format="jampetsc-flow")


def test_what_differs_is_not_averaged():
    for more in ({"mass": 2.0}, {"sizes": "monodisperse"}, {"potential": "hertzian"}, {"particle_count": 8}):
        assert len(flow_curves([facts(), facts(**more)])) == 2
    for twin in (facts(), facts(phi=0.8 + 1e-9)):
        with pytest.raises(InputError, match="Give each run once"):
            flow_curves([facts(), twin])
    assert labels_of([kind_of(facts()), kind_of(facts(mass=2.0))]) == ["$m=1$", "$m=2$"]
    massive = [kind_of(facts(mass=quality**2, quality=quality)) for quality in (1.0, 0.3)]
    assert labels_of(massive) == ["$Q=1$", "$Q=0.3$"]
    assert shared_words(massive) == r"RD, $\phi=0.8$, $N=64$"
    assert shared_words([kind_of(facts()), kind_of(facts(phi=0.9))]) == "RD, $N=64$"
    assert shared_words([kind_of(facts())]) == r"$\phi=0.8$, $N=64$"  # the model is the entry
    assert labels_of([kind_of(facts())]) == ["RD"]
    assert labels_of([kind_of(facts()), kind_of(facts(model="RD0", mass=0.0))]) == ["RD", "RD0"]


def test_curves_against_phi(tmp_path):
    some = [facts(phi=phi, rate=rate, pressure_mean=phi * rate) for phi in (0.8, 0.82) for rate in (0.1, 0.2)]
    curves = flow_curves(some, "phi")
    assert [rate for _, rate in curves] == [0.1, 0.2]
    for (_, rate), curve in curves.items():
        assert np.allclose(curve["pressure"][:2], [[0.8, 0.82], [0.4 * rate, 0.41 * rate]])  # p/k
        assert np.allclose(curve["contact_number"][1], 1.0)
    with pytest.raises(InputError, match="one phi of each model"):
        plot_against_phi(some[:2])


def test_units_are_those_of_the_files(runs):
    (curve,) = flow_curves([facts(), facts(seed=2, rate=0.2)]).values()
    assert np.allclose(curve["pressure"], [[0.05, 0.1], [0.5, 0.5], [0.5, 0.5]])  # γ̇τ₁, p/k and its error
    own, made = flow_units([facts()]), flow_units([jampetsc.load(path) for path in runs])
    assert own.label("p", "stress") == r"$p\ [k]$" and own.label("x", "length") == "$x$"
    assert made.label("p", "stress") == r"$p\ [k_{\rm e}/d_{\rm s}^2]$"
    assert made.label(r"\eta", "viscosity") == r"$\eta\ [k_{\rm d}]$"
    spheres = flow_units([facts(units="k_e = k_d = 1, diameter of the small disks 1", dimension=3)])
    assert spheres.label("p", "stress") == r"$p\ [k_{\rm e}/d_{\rm s}^3]$"
    assert spheres.label(r"\eta", "viscosity") == r"$\eta\ [k_{\rm d}/d_{\rm s}]$"
    with pytest.raises(InputError, match=r"a\.h5: units those of the packing, but 1e-2"):
        flow_units([jampetsc.load(runs[0]), facts()])


def test_flow_curves_are_drawn_in_the_units_that_their_axes_name():
    """σ = (2, 6) k, p = (4, 8) k at γ̇τ₁ = (0.05, 0.1), for k = 2 and τ₁ = ½."""
    x, s, p = np.array([[0.05, 0.1], [2.0, 6.0], [4.0, 8.0]])
    some = []
    for rate, stress, pressure in zip(2 * x, 2 * s, 2 * p, strict=True):
        values = {"shear_stress_mean": stress, "pressure_mean": pressure}
        errors = {"shear_stress_error": 0.1 * stress, "pressure_error": 0.1 * pressure}
        some.append(facts(rate=rate, **values, **errors))
    axes = figure_of(plot_flow, some).axes
    expected = [[(s, 0.1 * s)], [(p, 0.1 * p)], [(s / p, np.sqrt(0.02) * s / p)]]
    expected += [[(s / x, 0.1 * s / x), (p / x, 0.1 * p / x)]]
    for ax, wanted in zip(axes, expected, strict=False):
        for drawn, (y, error) in zip(bars(ax), wanted, strict=True):
            np.testing.assert_allclose(drawn, [x, y, error, error])
    stress, pressure = (container.lines[0] for container in axes[4].containers)
    np.testing.assert_allclose((stress.get_ydata(), pressure.get_ydata()), [[np.log2(3)], [1.0]])
    assert stress.get_markerfacecolor() != "white" and pressure.get_markerfacecolor() == "white"


def test_slopes_of_both_regimes_are_drawn_where_a_curve_follows_them():
    def guides(power):
        rates = 10.0 ** np.arange(-4.0, 0.0)
        some = [facts(rate=rate, shear_stress_mean=rate**power, pressure_mean=rate**0.3) for rate in rates]
        return [[text.get_text() for text in ax.texts] for ax in figure_of(plot_flow, some).axes[:2]]

    assert guides(1.0) == [[r"$\dot\gamma$"], []]
    assert guides(2.0) == [[r"$\dot\gamma^{2}$"], []]
    assert guides(0.5) == [[], []]


def test_series_are_sums_of_their_parts_with_their_own_means():
    one = series("a.h5", shear_stress_mean=3.0, pressure_mean=5.0)
    for ax, name, mean in zip(
        figure_of(plot_flow, [one]).axes, ("shear_stress", "pressure"), (3.0, 5.0), strict=True
    ):
        drawn, level = lines(ax)
        np.testing.assert_allclose(drawn[:2], [one["strain"], one[name].sum(1) / 2.0])  # k = 2
        np.testing.assert_allclose(level[:2], [[0.15, 0.3], [mean / 2, mean / 2]])


def test_curves_average_seeds():
    some = [
        facts(seed=seed, rate=rate, pressure_mean=p)
        for seed, rate, p in ((1, 0.1, 2.0), (2, 0.1, 4.0), (1, 0.3, 9.0))
    ]
    ((_, curve),) = flow_curves(some).items()
    rates, pressure, error = curve["pressure"]
    np.testing.assert_allclose((rates, pressure), [[0.05, 0.15], [1.5, 4.5]])
    assert error[0] >= 0.5 * (1 - 1e-12)  # of runs that differ by 1
    values = np.array([1.0, 10.0, 1000.0])
    x = np.array([1e-3, 1e-2, 1e-1])
    middle, exponent, error = local_exponents(x, values, values * [0.03, 0.04, 0.0])
    np.testing.assert_allclose(error, np.array([0.05, 0.04]) / np.log(10))
    np.testing.assert_allclose((exponent, middle), ([1, 2], 10 ** np.array([-2.5, -1.5])))


def test_the_last_snapshot_is_the_last_state(runs):
    result = jampetsc.load(runs[0])
    disks = snapshot(result)
    contacts, number, alone = find_touching(disks)
    assert len(contacts) * 2 / disks.n == result["contact_number"][-1] == number.mean()
    assert f"$Z={number.mean():.3f}$" in jampetsc.plot(result, "snapshot").get_xlabel()
    assert np.array_equal(np.flatnonzero(~alone), np.unique(np.r_[contacts.i, contacts.j]))
    peeled = measure(disks)  # as if forces were balanced: contacts that a flow has would be lost
    assert len(peeled.contacts) < len(contacts) and peeled.rattlers.sum() > alone.sum()


@pytest.mark.parametrize(
    ("count", "kind", "says"),
    [
        (1, "snapshot", "no snapshots. Run the flow"),
        (2, "velocities", "Plot them one by one"),
        (1, "moduli", "a flow file"),
        (4, "profile", "4 kinds of flow: one picture of profiles shows 3"),
    ],
)
def test_what_cannot_be_drawn(count, kind, says):
    with pytest.raises(InputError, match=says):
        draw([series(f"{n}.h5", phi=0.8 + 0.01 * n) for n in range(count)], kind)


@pytest.mark.parametrize(
    ("power", "names"),
    [(1.0, ["Newtonian"]), (2.0, ["Bagnoldian"]), (0.4, []), (2.5, ["Newtonian", "Bagnoldian"])],
)
def test_exponents_that_have_a_name_are_marked_where_they_are_in_sight(power, names):
    ax, rates = Figure(figsize=(2.3, 2.3)).subplots(), np.array([0.1, 0.2, 0.4])
    powers = power, 0.9 if power == 2.5 else 1.01 * power
    draw_local_exponents(ax, [({}, *local_exponents(rates, rates**one, 0.1 * rates)) for one in powers])
    assert [text.get_text() for text in ax.texts] == names
    ax.figure.draw_without_rendering()
    assert all(text.get_window_extent().y1 <= ax.bbox.y1 for text in ax.texts)  # not over the frame
    levels = [line.get_ydata()[0] for line in ax.get_lines() if line.get_linestyle() == ":"]
    assert levels == [{"Newtonian": 1, "Bagnoldian": 2}[name] for name in names]


def test_rates_at_which_phi_is_varied_are_named_with_their_kinds():
    kinds = ((0.2, 1.0), (0.2, 2.0), (0.4, 1.0))
    some = [facts(phi=phi, rate=rate, mass=mass) for phi in (0.8, 0.82) for rate, mass in kinds]
    ax = figure_of(plot_against_phi, some).axes[2]
    assert told(ax) == ["$m=1$, $0.1$", "$m=1$, $0.2$", "$m=2$, $0.1$"]
    assert ax.get_legend().get_title().get_text() == r"$\dot\gamma\ [1/\tau_1]$"
    assert told(figure_of(plot_against_phi, some[::3]).axes[2]) == ["$0.1$"]


def series(name, rate=0.1, **more):
    """A flow file of three rows."""
    arrays = {key: np.array([[1.0, 0.5], [2.0, 0.5], [3.0, 0.5]]) for key in ("shear_stress", "pressure")}
    arrays["strain"] = np.array([0.1, 0.2, 0.3])
    return held(arrays, facts(rate=rate, discard=0.15, **more).attributes, name, "jampetsc-flow")


def test_lanes_are_drawn_with_bands_of_one_error_kind_by_kind():
    one = {"x": np.array([0.5, 1.5]), "g_y": np.array([0.4, -0.1]), "g_y_error": np.array([0.1, 0.05])}
    one = held(one, facts().attributes, "g.h5", "jampetsc-velocity-correlation")
    ax = figure_of(plot_lanes, [one]).axes[0]
    np.testing.assert_allclose(lines(ax, 2)[1][:2], [one["x"], one["g_y"]])
    np.testing.assert_allclose(bands(ax)[0], [one["x"], [0.3, -0.15], [0.5, -0.05]])
    assert told(ax) == [r"RD, $\phi=0.8$, $\dot\gamma=0.1$"]


def test_regimes_are_exponents_and_clusters_at_the_lowest_rates():
    """σ ~ γ̇ at Q = 1, ~ γ̇² at Q = 10; the highest rate does not count, nor do disks without mass."""
    some = [
        facts(
            rate=rate, quality=q, mass=q**2, shear_stress_mean=stress, shear_stress_error=0.0,
            largest_cluster_mean=clusters * rate,
        )
        for q, clusters, stresses in ((1.0, 320.0, (1.0, 2.0, 9.0)), (10.0, 32.0, (1.0, 4.0, 5.0)))
        for rate, stress in zip((0.1, 0.2, 0.4), stresses, strict=True)
    ]  # fmt: skip
    some += [facts(model="RD0", mass=0.0, rate=rate, largest_cluster_mean=1.0) for rate in (0.1, 0.2)]
    quality, exponent, _, cluster, low, high = flow_regimes(some)["RD"][0.8]
    assert np.allclose([quality, exponent, cluster], [[1, 10], [1, 2], [0.5, 0.05]])
    assert np.allclose([low, high], [[0.05, 0.05], [0.1, 0.1]])  # in 1/τ₁
    slopes, shares = figure_of(plot_regimes, some).axes
    assert np.allclose(bars(slopes)[0][:2], [quality, exponent])
    assert told(shares) == ["$0.8$"]
    with pytest.raises(InputError, match="no massive disks at two rates"):
        flow_regimes(some[-2:])


def seen(sizes, seed, **arrays):
    attributes = facts(sizes=sizes, seed=seed, discard=1.0).attributes
    return held(arrays, attributes, f"{sizes}-{seed}.h5")


def test_order_is_drawn_kind_by_kind_with_its_mean():
    strain, one_size, files = np.array([0.0, 1.0, 2.0]), "monodisperse", []
    for n in (1, 2):
        orders = {"snapshots/psi6_local": strain / 4 + 0.1 * n, "snapshots/psi6_global": strain / 8}
        files.append(seen(one_size, n, **{"snapshots/strain": strain}, **orders))
    for ax, mean in zip(figure_of(plot_order, files).axes, (strain / 4 + 0.15, strain / 8), strict=True):
        np.testing.assert_allclose(ax.get_lines()[-1].get_ydata(), mean)
        assert len(ax.get_lines()) == 3
    later = seen(one_size, 3, **{**files[1], "snapshots/strain": strain + 1})
    for refused, says in (
        ([files[0], later], "snapshots at other strains than monodisperse-1.h5"),
        ([seen(one_size, 1)], "no snapshots. Run the flow with"),
    ):
        with pytest.raises(InputError, match=says):
            plot_order(refused)


def test_profiles_are_means_of_windows_and_of_runs():
    """v_x of the start and of the steady part, of two runs; layers without disks do not count."""
    strain, y = np.array([0.05, 0.1, 0.2, 1.5, 2.0]), layer_heights(4)
    rows = np.array([0 * y, 0.5 * y, y, y, y])
    rows[0, 2] = np.nan
    files = [seen("bidisperse", n, strain=strain, velocity_profile=rows * (1 + 0.1 * n)) for n in (0, 1)]
    v, error = mean_profile(velocity_profiles(files, 0.0, 0.1))
    np.testing.assert_allclose(v, 1.05 * np.array([0.25, 0.25, 0.5, 0.25]) * y)
    np.testing.assert_allclose(error, half_width(1) * np.abs(v) / 1.05 * 0.05)  # of two runs
    (ax,) = figure_of(plot_profiles, files).axes
    np.testing.assert_allclose(ax.get_lines()[0].get_data(), [[-0.5, 0.5], [-0.5, 0.5]])
    rows[:, 1] = np.nan  # a layer that is always empty has no point, and no number
    empty = figure_of(plot_profiles, [seen("bidisperse", 0, strain=strain, velocity_profile=rows)]).axes
    assert sum("x_value" in row for row in table_rows(empty)) == 3 * 3
    steady = ax.containers[-1].lines[0]
    np.testing.assert_allclose(steady.get_data(), [1.05 * y, y])
    with pytest.raises(InputError, match="no velocity profiles"):
        mean_profile(velocity_profiles([seen("bidisperse", 1, strain=strain)], 0, 1))
    with pytest.raises(InputError, match=r"no row between strain 3 and 4\. Choose other strains\."):
        mean_profile(velocity_profiles(files, 3.0, 4.0))

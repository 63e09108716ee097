"""Pictures of steady shear, drawn from real runs through the command line."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import Held, bands, bars, figure_of, lines
from matplotlib.figure import Figure

import jampetsc
from jampetsc.analysis.profiles import heights, mean_profile, middle_share
from jampetsc.analysis.scaling import local_exponents
from jampetsc.analysis.statistics import half_width
from jampetsc.cli import main as cli
from jampetsc.core.state import measure
from jampetsc.errors import InputError
from jampetsc.io.result_file import ResultWriter
from jampetsc.io.results import Attributes
from jampetsc.io.snapshots import snapshot
from jampetsc.plots.flowcurves import (
    _draw_exponents,
    _ratio,
    flow_curves,
    plot_against_phi,
    plot_flow,
    plot_regimes,
    regimes,
)
from jampetsc.plots.numbers import table
from jampetsc.plots.packing import touching
from jampetsc.plots.shearing import kind_of, labels_of, lanes_of, plot_lanes, plot_order, plot_profiles
from jampetsc.plots.units import flow_units


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flow")
    paths = []
    for rate, seed in [("1e-2", 1), ("1e-2", 2), ("3e-2", 1)]:
        path = folder / f"{rate}-{seed}.h5"
        words = f"flow --n 64 --phi 0.86 --model RD0 --rate {rate} --seed {seed} --strain 0.5 --snapshots 2"
        assert cli.main([*words.split(), "--out", str(path)]) == 0
        paths.append(str(path))
    return paths


@pytest.mark.parametrize(
    "files, more, says",
    [
        (slice(0, 2), (), "stress and pressure of 2 runs over the strain"),
        (slice(0, 3), (), "flow curves of 3 runs at 2 rates"),
        (slice(0, 1), ("--kind", "snapshot"), "64 disks at strain 0.5"),
        (slice(1, 3), ("--kind", "snapshot"), "64 disks at strain 0.5, 64 disks at strain 0.5"),
        (slice(0, 3), ("--kind", "lanes"), "g_y of 3 files"),
        (slice(0, 1), ("--kind", "velocities"), "velocities at strain 0.5"),
    ],
)
def test_pictures(runs, tmp_path, capsys, files, more, says):
    out = tmp_path / "picture.png"
    assert cli.main(["plot", *runs[files], *more, "--out", str(out)]) == 0
    assert says in capsys.readouterr().out
    assert out.stat().st_size > 10_000


def test_flow_files_are_correlated_as_correlate_does(runs, tmp_path):
    g = tmp_path / "g.h5"
    assert cli.main(["correlate", *runs[:2], "--out", str(g)]) == 0
    first, other = lanes_of([jampetsc.load(path) for path in runs])
    assert np.array_equal(first[2], jampetsc.load(g)["g_y"]) and not np.allclose(first[2], other[2])


def facts(**more):
    """A result with the attributes that curves are told apart by."""
    plain = {"model": "RD", "phi": 0.8, "particle_count": 64, "mass": 1.0, "potential": "harmonic", "k": 2.0}
    plain |= {"rate": 0.1, "seed": 1, "units": "those of the packing", "stiffness": "constant", "tau1": 0.5}
    names = ("shear_stress", "pressure", "coordination")
    plain |= {f"{name}_{part}": 1.0 for name in names for part in ("mean", "error")}
    return SimpleNamespace(path=Path("a.h5"), attributes=Attributes("a.h5", plain | more))


def test_what_differs_is_not_averaged():
    for more in ({"mass": 2.0}, {"sizes": "monodisperse"}, {"potential": "hertzian"}, {"particle_count": 8}):
        assert len(flow_curves([facts(), facts(**more)])) == 2
    for twin in (facts(), facts(phi=0.8 + 1e-9)):
        with pytest.raises(InputError, match="an average takes each once"):
            flow_curves([facts(), twin])
    assert labels_of([kind_of(facts()), kind_of(facts(mass=2.0))]) == ["$m=1$", "$m=2$"]
    assert labels_of([kind_of(facts())]) == ["RD"]
    assert labels_of([kind_of(facts()), kind_of(facts(model="RD0", mass=0.0))]) == ["RD", "RD0"]


def test_curves_against_phi(tmp_path):
    some = [facts(phi=phi, rate=rate, pressure_mean=phi * rate) for phi in (0.8, 0.82) for rate in (0.1, 0.2)]
    curves = flow_curves(some, "phi")
    assert [rate for _, rate in curves] == [0.1, 0.2]
    for (_, rate), curve in curves.items():
        assert np.allclose(curve["pressure"][:2], [[0.8, 0.82], [0.4 * rate, 0.41 * rate]])  # p/k
        assert np.allclose(curve["coordination"][1], 1.0)
    with pytest.raises(InputError, match="need several phi"):
        plot_against_phi(some[:2])


def test_units_are_those_of_the_files(runs):
    (curve,) = flow_curves([facts(), facts(seed=2, rate=0.2)]).values()
    assert np.allclose(curve["pressure"], [[0.05, 0.1], [0.5, 0.5], [0.5, 0.5]])  # γ̇τ₁, p/k and its error
    own, made = flow_units([facts()]), flow_units([jampetsc.load(path) for path in runs])
    assert own.label("p", "stress") == r"$p\ [k]$" and own.label("x", "length") == "$x$"
    assert made.label("p", "stress") == r"$p\ [k_{\rm e}/d_{\rm s}^2]$"
    assert made.label(r"\eta", "viscosity") == r"$\eta\ [k_{\rm d}]$"
    with pytest.raises(InputError, match=r"a\.h5: is in other units .those of the packing. than 1e-2-1"):
        flow_units([jampetsc.load(runs[0]), facts()])


def test_flow_curves_are_drawn_in_the_units_that_their_axes_name():
    """σ = (2, 6) k, p = (4, 8) k at γ̇τ₁ = (0.05, 0.1), for k = 2 and τ₁ = ½."""
    some = [
        facts(
            rate=rate,
            shear_stress_mean=2 * s,
            shear_stress_error=0.2 * s,
            pressure_mean=2 * p,
            pressure_error=p / 5,
        )
        for rate, s, p in ((0.1, 2.0, 4.0), (0.2, 6.0, 8.0))
    ]
    x, s, p = np.array([[0.05, 0.1], [2.0, 6.0], [4.0, 8.0]])
    axes = figure_of(plot_flow, some).axes
    friction = s / p
    expected = [[(s, 0.1 * s)], [(p, 0.1 * p)], [(friction, np.sqrt(0.02) * friction)]]
    expected += [[(s / x, 0.1 * s / x), (p / x, 0.1 * p / x)]]
    for ax, wanted in zip(axes, expected, strict=False):
        for drawn, (y, error) in zip(bars(ax), wanted, strict=True):
            np.testing.assert_allclose(drawn, [x, y, error, error])
    stress, pressure = (container.lines[0] for container in axes[4].containers)
    np.testing.assert_allclose((stress.get_ydata(), pressure.get_ydata()), [[np.log2(3)], [1.0]])
    assert stress.get_markerfacecolor() != "white" and pressure.get_markerfacecolor() == "white"
    against = figure_of(plot_against_phi, [facts(phi=phi, rate=0.2) for phi in (0.8, 0.82)])
    assert [text.get_text() for text in against.axes[2].get_legend().get_texts()] == ["$0.1$"]


def test_series_are_sums_of_their_parts_with_their_own_means(tmp_path):
    strain, parts = 0.1 * np.arange(1, 11), np.random.default_rng(1).random((2, 10, 3))
    attributes = facts(discard=0.5, shear_stress_mean=3.0, pressure_mean=5.0).attributes
    with ResultWriter(tmp_path / "run.h5", "jampetsc-flow") as writer:
        for name, values in (("strain", strain), ("shear_stress", parts[0]), ("pressure", parts[1])):
            writer.dataset(name, values)
        writer.attributes(**attributes)
    axes = figure_of(plot_flow, [jampetsc.load(tmp_path / "run.h5")]).axes
    for ax, values, mean in zip(axes, parts, (3.0, 5.0), strict=True):
        series, level = lines(ax)
        np.testing.assert_allclose(series[:2], [strain, values.sum(1) / 2.0])  # k = 2
        np.testing.assert_allclose(level[:2], [[0.5, 1.0], [mean / 2, mean / 2]])


def test_curves_average_seeds(runs):
    results = [jampetsc.load(path) for path in runs]
    ((_, curve),) = flow_curves(results).items()
    rates, pressure, error = curve["pressure"]
    means = [float(r.attributes["pressure_mean"]) for r in results]
    assert np.allclose(rates, [1e-2, 3e-2])
    assert np.allclose(pressure, [np.mean(means[:2]), means[2]])
    assert error[0] >= abs(means[0] - means[1]) / 2 * (1 - 1e-12)
    values = np.array([1.0, 10.0, 1000.0])
    middle, exponent, error = local_exponents(
        np.array([1e-3, 1e-2, 1e-1]), values, values * [0.03, 0.04, 0.0]
    )
    assert error == pytest.approx(np.array([0.05, 0.04]) / np.log(10))
    assert np.allclose(exponent, [1, 2]) and np.allclose(middle, 10 ** np.array([-2.5, -1.5]))


def test_the_last_snapshot_is_the_last_state(runs):
    result = jampetsc.load(runs[0])
    disks = snapshot(result)
    contacts, number, alone = touching(disks)
    assert len(contacts) * 2 / disks.n == result["coordination"][-1] == number.mean()
    assert np.array_equal(np.flatnonzero(~alone), np.unique(np.r_[contacts.i, contacts.j]))
    peeled = measure(disks)  # as if forces were balanced: contacts that a flow has would be lost
    assert len(peeled.contacts) < len(contacts) and peeled.rattlers.sum() > alone.sum()


def test_what_cannot_be_drawn(runs, tmp_path, capsys):
    plain = tmp_path / "plain.h5"
    words = "flow --n 64 --phi 0.86 --model RD0 --rate 1e-1 --strain 0.2 --out"
    assert cli.main([*words.split(), str(plain)]) == 0
    for files, more, message in [
        ([plain], ["--kind", "snapshot"], "holds no snapshots"),
        (runs[:2], ["--kind", "velocities"], "plot them one by one"),
        ([*runs[:1]], ["--kind", "moduli"], "is a flow file"),
    ]:
        assert cli.main(["plot", *map(str, files), *more, "--out", str(tmp_path / "x.png")]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("power", "names"),
    [(1.0, ["Newtonian"]), (2.0, ["Bagnoldian"]), (0.4, []), (2.5, ["Newtonian", "Bagnoldian"])],
)
def test_exponents_that_have_a_name_are_marked_where_they_are_in_sight(power, names):
    ax, rates = Figure().subplots(), np.array([0.1, 0.2, 0.4])
    powers = power, 0.9 if power == 2.5 else 1.01 * power
    _draw_exponents(ax, [({}, *local_exponents(rates, rates**one, 0.1 * rates)) for one in powers])
    assert [text.get_text() for text in ax.texts] == names
    levels = [line.get_ydata()[0] for line in ax.get_lines() if line.get_linestyle() == ":"]
    assert levels == [{"Newtonian": 1, "Bagnoldian": 2}[name] for name in names]


def test_the_error_of_a_quotient_is_of_both():
    value, error = _ratio(
        (np.array([3.0, -4.0]), np.array([0.3, 0.0])), (np.array([2.0, 2.0]), np.array([0.0, 0.5]))
    )
    np.testing.assert_allclose((value, error), [[1.5, -2.0], [0.15, 0.5]])


def test_rates_at_which_phi_is_varied_are_named_with_their_kinds():
    some = [
        facts(phi=phi, rate=rate, mass=mass)
        for phi in (0.8, 0.82)
        for rate, mass in ((0.2, 1.0), (0.2, 2.0), (0.4, 1.0))
    ]
    legend = figure_of(plot_against_phi, some).axes[2].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [
        "$m=1$, $0.1$",
        "$m=1$, $0.2$",
        "$m=2$, $0.1$",
    ]
    assert legend.get_title().get_text() == r"$\dot\gamma\ [1/\tau_1]$"


def series(name, rate=0.1, **more):
    """A flow file of three rows."""
    arrays = {key: np.array([[1.0, 0.5], [2.0, 0.5], [3.0, 0.5]]) for key in ("shear_stress", "pressure")}
    arrays["strain"] = np.array([0.1, 0.2, 0.3])
    return Held(arrays, facts(rate=rate, discard=0.15, **more).attributes, name, "jampetsc-flow")


def test_lanes_are_drawn_with_bands_of_one_error_kind_by_kind():
    one = {"x": np.array([0.5, 1.5]), "g_y": np.array([0.4, -0.1]), "g_y_error": np.array([0.1, 0.05])}
    one = Held(one, facts().attributes, "g.h5", "jampetsc-velocity-correlation")
    ax = figure_of(plot_lanes, [one]).axes[0]
    np.testing.assert_allclose(lines(ax, 2)[1][:2], [one["x"], one["g_y"]])
    np.testing.assert_allclose(bands(ax)[0], [one["x"], [0.3, -0.15], [0.5, -0.05]])
    (text,) = ax.get_legend().get_texts()
    assert text.get_text() == r"RD, $\phi=0.8$, $\dot\gamma=0.1$"


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
    quality, exponent, _, cluster, low, high = regimes(some)["RD"][0.8]
    assert np.allclose([quality, exponent, cluster], [[1, 10], [1, 2], [0.5, 0.05]])
    assert np.allclose([low, high], [[0.05, 0.05], [0.1, 0.1]])  # in 1/τ₁
    slopes, shares = figure_of(plot_regimes, some).axes
    assert np.allclose(bars(slopes)[0][:2], [quality, exponent])
    assert [text.get_text() for text in shares.get_legend().get_texts()] == ["$0.8$"]
    with pytest.raises(InputError, match="regimes are of massive disks at several rates"):
        regimes(some[-2:])


def seen(sizes, seed, **arrays):
    attributes = facts(sizes=sizes, seed=seed, discard=1.0).attributes
    return Held(arrays, attributes, f"{sizes}-{seed}.h5")


def test_order_is_drawn_kind_by_kind_with_its_mean():
    strain = np.array([0.0, 1.0, 2.0])
    files = [
        seen("monodisperse", n, **{"snapshots/strain": strain, "snapshots/psi6_local": strain / 4 + 0.1 * n,
                                   "snapshots/psi6_global": strain / 8}) for n in (1, 2)
    ]  # fmt: skip
    fig = figure_of(plot_order, files)
    for ax, mean in zip(fig.axes, (strain / 4 + 0.15, strain / 8), strict=True):
        np.testing.assert_allclose(ax.get_lines()[-1].get_ydata(), mean)
        assert len(ax.get_lines()) == 3
    with pytest.raises(InputError, match=r"snapshots at other strains than monodisperse-1.h5"):
        figure_of(
            plot_order, [files[0], seen("monodisperse", 3, **{**files[1], "snapshots/strain": strain + 1})]
        )
    with pytest.raises(InputError, match="holds no snapshots: run the flow with"):
        plot_order([seen("monodisperse", 1)])


def test_profiles_are_means_of_windows_and_of_runs():
    """v_x of the start and of the steady part, of two runs; layers without disks do not count."""
    strain, y = np.array([0.05, 0.1, 0.2, 1.5, 2.0]), heights(4)
    rows = np.array([0 * y, 0.5 * y, y, y, y])
    rows[0, 2] = np.nan
    files = [seen("bidisperse", n, strain=strain, velocity_profile=rows * (1 + 0.1 * n)) for n in (0, 1)]
    v, error = mean_profile(files, 0.0, 0.1)
    np.testing.assert_allclose(v, 1.05 * np.array([0.25, 0.25, 0.5, 0.25]) * y)
    np.testing.assert_allclose(error, half_width(1) * np.abs(v) / 1.05 * 0.05)  # of two runs
    (ax,) = figure_of(plot_profiles, files).axes
    np.testing.assert_allclose(ax.get_lines()[0].get_data(), [[-0.5, 0.5], [-0.5, 0.5]])
    files[0]["velocity_profile"][:, 1] = (
        np.nan
    )  # a layer that is empty all the time has no point, and no number
    empty = figure_of(plot_profiles, files[:1]).axes
    assert sum("x_value" in row for row in table(empty)) == 3 * 3
    steady = ax.containers[-1].lines[0]
    np.testing.assert_allclose(steady.get_data(), [1.05 * y, y])
    assert middle_share(heights(20)) == pytest.approx(1.0)
    with pytest.raises(InputError, match="holds no velocity profiles"):
        mean_profile([seen("bidisperse", 1, strain=strain)], 0, 1)
    with pytest.raises(InputError, match="has no row between strain 3 and 4"):
        mean_profile(files, 3.0, 4.0)

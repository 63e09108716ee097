"""Pictures of steady shear, drawn from real runs through the command line."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import bands, bars, figure_of, lines

import jampetsc
from jampetsc import cli
from jampetsc.analysis.profiles import heights, mean_profile, middle_share
from jampetsc.analysis.statistics import half_width
from jampetsc.contacts.state import measure
from jampetsc.errors import InputError
from jampetsc.plots.flowcurves import _ratio, flow_curves, local_exponents, plot_against_phi, plot_flow_curves
from jampetsc.plots.order import plot_order
from jampetsc.plots.packing import touching
from jampetsc.plots.profiles import plot_profiles
from jampetsc.plots.regimes import plot_regimes, regimes
from jampetsc.plots.shearing import kind_of, labels_of, lanes_of, plot_lanes, plot_series
from jampetsc.plots.units import flow_units
from jampetsc.storage.reader import Attributes
from jampetsc.storage.result_file import ResultWriter
from jampetsc.storage.snapshots import snapshot
from jampetsc.words.pictures import PICTURES


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
        (slice(0, 1), (), "stress and pressure of 1 run over the strain"),
        (slice(0, 2), (), "stress and pressure of 2 runs"),
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


def test_lanes(runs, tmp_path, capsys):
    g, out = tmp_path / "g.h5", tmp_path / "g.svg"
    assert cli.main(["correlate", *runs[:2], "--out", str(g)]) == 0
    assert cli.main(["plot", str(g), "--out", str(out)]) == 0
    assert "g_y of 1 file" in capsys.readouterr().out and out.exists()


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
    plot_against_phi(some, tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="need several phi"):
        plot_against_phi(some[:2], tmp_path / "x.png")


@pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")
def test_a_mean_that_is_not_positive_is_left_out(tmp_path):
    some = [facts(rate=rate, shear_stress_mean=mean) for rate, mean in ((0.1, -1.0), (0.2, 1.0), (0.4, 2.0))]
    plot_flow_curves(some, tmp_path / "x.png")
    plot_flow_curves([*some[:1], facts(rate=0.3, pressure_mean=0.0)], tmp_path / "y.png")
    assert (tmp_path / "x.png").exists() and (tmp_path / "y.png").exists()


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
    axes = figure_of(plot_flow_curves, some).axes
    friction = s / p
    expected = [[(s, 0.1 * s)], [(p, 0.1 * p)], [(friction, np.sqrt(0.02) * friction)]]
    expected += [[(s / x, 0.1 * s / x), (p / x, 0.1 * p / x)]]
    for ax, wanted in zip(axes, expected, strict=False):
        for drawn, (y, error) in zip(bars(ax), wanted, strict=True):
            np.testing.assert_allclose(drawn, [x, y, error, error])
    stress, pressure = lines(axes[4], 1)
    np.testing.assert_allclose((stress[1], pressure[1]), [[np.log2(3)], [1.0]])
    assert stress[3] != "white" and pressure[3] == "white"
    against = figure_of(plot_against_phi, [facts(phi=phi, rate=0.2) for phi in (0.8, 0.82)])
    assert [text.get_text() for text in against.axes[2].get_legend().get_texts()] == ["$0.1$"]


def test_series_are_sums_of_their_parts_with_their_own_means(tmp_path):
    strain, parts = 0.1 * np.arange(1, 11), np.random.default_rng(1).random((2, 10, 3))
    attributes = facts(discard=0.5, shear_stress_mean=3.0, pressure_mean=5.0).attributes
    with ResultWriter(tmp_path / "run.h5", "jampetsc-flow") as writer:
        for name, values in (("strain", strain), ("shear_stress", parts[0]), ("pressure", parts[1])):
            writer.dataset(name, values)
        writer.attributes(**attributes)
    axes = figure_of(plot_series, [jampetsc.load(tmp_path / "run.h5")]).axes
    for ax, values, mean in zip(axes, parts, (3.0, 5.0), strict=True):
        series, level = lines(ax)
        np.testing.assert_allclose(series[:2], [strain, values.sum(1) / 2.0])  # k = 2
        np.testing.assert_allclose(level[:2], [[0.5, 1.0], [mean / 2, mean / 2]])


def test_velocities_are_drawn_per_rate(runs, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr("jampetsc.plots.fields.plot_panels", lambda disks, panels, *_: shown.extend(panels))
    assert cli.main(["plot", runs[2], "--kind", "velocities", "--out", str(tmp_path / "x.png")]) == 0
    ((_, field),) = shown
    assert np.array_equal(field, jampetsc.load(runs[2])["snapshots/velocities"][-1] / 3e-2)


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


def test_what_is_not_positive_is_left_out_of_all_but_the_coordination():
    """Of four rates one has a negative stress, one a negative pressure; Z is known for all."""
    rates, stress, pressure = (0.1, 0.2, 0.4, 0.8), (1.0, -1.0, 4.0, 6.0), (8.0, 2.0, -1.0, 16.0)
    some = [
        facts(rate=r, shear_stress_mean=s, pressure_mean=p, coordination_mean=3.0 + r)
        for r, s, p in zip(rates, stress, pressure, strict=True)
    ]
    axes = figure_of(plot_flow_curves, some).axes
    for ax in axes[:4]:
        for x, *_ in bars(ax):
            np.testing.assert_allclose(x, [0.05, 0.4])  # τ₁ = ½
    np.testing.assert_allclose(bars(axes[5])[0][:2], [[0.05, 0.1, 0.2, 0.4], 3.0 + np.array(rates)])
    (top,) = bars(axes[1])
    assert top[1].tolist() == [4.0, 8.0] and bars(axes[3])[1][1].tolist() == [80.0, 20.0]
    low, high = axes[3].get_ylim()
    assert low < 6.0 / 0.8 < 80.0 < high  # p/γ̇ is in sight as σ/γ̇ is
    assert axes[3].texts[0].get_text() == r"filled: $\sigma$, hollow: $p$"
    against = [
        facts(phi=phi, rate=0.2, shear_stress_mean=s)
        for phi, s in ((0.79, 0.0), (0.8, -1.0), (0.81, 1.0), (0.82, 2.0))
    ]
    axes = figure_of(plot_against_phi, against).axes
    counts = [len(bars(ax)[0][0]) for ax in axes]
    assert counts == [2, 4, 4] and axes[0].get_yscale() == "log" and axes[2].get_yscale() == "linear"


@pytest.mark.parametrize(
    ("power", "names"),
    [(1.0, ["Newtonian"]), (2.0, ["Bagnoldian"]), (0.4, []), (2.5, ["Newtonian", "Bagnoldian"])],
)
def test_exponents_that_have_a_name_are_marked_where_they_are_in_sight(power, names):
    some = [
        facts(rate=r, shear_stress_mean=r**power, pressure_mean=r ** (0.9 if power == 2.5 else 1.01 * power))
        for r in (0.1, 0.2, 0.4)
    ]
    ax = figure_of(plot_flow_curves, some).axes[4]
    assert [text.get_text() for text in ax.texts] == names
    levels = [line.get_ydata()[0] for line in ax.get_lines() if line.get_linestyle() == ":"]
    assert levels == [{"Newtonian": 1, "Bagnoldian": 2}[name] for name in names]


def test_the_error_of_a_quotient_is_of_both():
    value, error = _ratio(
        (np.array([3.0, -4.0]), np.array([0.3, 0.0])), (np.array([2.0, 2.0]), np.array([0.0, 0.5]))
    )
    np.testing.assert_allclose((value, error), [[1.5, -2.0], [0.15, 0.5]])


def test_axes_of_a_flow_are_named_by_their_units():
    texts = [ax.get_ylabel() for ax in figure_of(plot_flow_curves, [facts(rate=r) for r in (0.1, 0.2)]).axes]
    assert texts[:4] == [
        r"$\sigma\ [k]$",
        r"$p\ [k]$",
        r"$\sigma/p$",
        r"$\sigma/\dot\gamma,\ p/\dot\gamma\ [k\tau_1]$",
    ]
    vagberg = flow_units([facts(units="k_e = k_d = 1, diameter of the small disks 1")])
    packing = flow_units([facts(stiffness="inverse-square-diameter")])
    plain = flow_units([facts()])
    names = ("energy", "stress", "rate", "viscosity", "length")
    assert [getattr(plain, name) for name in names] == ["k", "k", r"1/\tau_1", r"k\tau_1", ""]
    assert [getattr(packing, name) for name in names] == [
        r"k_{\rm e}",
        r"k_{\rm e}",
        r"1/\tau_1",
        r"k_{\rm e}\tau_1",
        "",
    ]
    assert [getattr(vagberg, name) for name in names] == [
        r"k_{\rm e}", r"k_{\rm e}/d_{\rm s}^2", r"k_{\rm e}/k_{\rm d}d_{\rm s}^2", r"k_{\rm d}", r"d_{\rm s}",
    ]  # fmt: skip
    for other in ({"k": 1.0}, {"tau1": 1.0}, {"stiffness": "inverse-square-diameter"}):
        with pytest.raises(InputError, match="is in other units"):
            flow_units([facts(), facts(**other)])


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
    result = Rows(strain=np.array([0.1, 0.2, 0.3]))
    result |= {key: np.array([[1.0, 0.5], [2.0, 0.5], [3.0, 0.5]]) for key in ("shear_stress", "pressure")}
    one = Rows(result)
    one.path, one.attributes, one.format = (
        Path(name),
        facts(rate=rate, discard=0.15, **more).attributes,
        "jampetsc-flow",
    )
    return one


class Rows(dict):
    """What a file holds."""


@pytest.mark.parametrize(("count", "named"), [(1, False), (2, True), (12, True), (13, False)])
def test_so_many_series_are_named(count, named):
    fig = figure_of(plot_series, [series(f"run{n}.h5") for n in range(count)])
    legend = fig.axes[0].get_legend()
    assert (legend is not None) == named
    if named:
        assert [text.get_text() for text in legend.get_texts()] == [f"run{n}" for n in range(count)]
    assert fig.axes[1].texts[0].get_text() == "dashed: means"


def test_lanes_are_drawn_with_bands_of_one_error_kind_by_kind():
    one = Rows(x=np.array([0.5, 1.5]), g_y=np.array([0.4, -0.1]), g_y_error=np.array([0.1, 0.05]))
    one.path, one.format, one.attributes = Path("g.h5"), "jampetsc-velocity-correlation", facts().attributes
    ax = figure_of(plot_lanes, [one]).axes[0]
    np.testing.assert_allclose(lines(ax, 2)[1][:2], [one["x"], one["g_y"]])
    np.testing.assert_allclose(bands(ax)[0], [one["x"], [0.3, -0.15], [0.5, -0.05]])
    (text,) = ax.get_legend().get_texts()
    assert text.get_text() == r"RD, $\phi=0.8$, $\dot\gamma=0.1$"


@pytest.mark.parametrize(
    ("kind", "plot", "said"),
    [
        (
            "phi",
            "jampetsc.plots.flowcurves.plot_against_phi",
            "stress, pressure and coordination of 2 runs against phi",
        ),
        ("phi_J", "jampetsc.plots.jamming.plot_jamming_densities", "distribution of phi_J of 2 files"),
        (
            "fraction",
            "jampetsc.plots.jamming.plot_fraction",
            "f(phi), the share of samples that jam, of 2 files",
        ),
        ("lanes", "jampetsc.plots.shearing.plot_lanes", "g_y of 2 files"),
        (
            "strain",
            "jampetsc.plots.slowly.plot_slow_shear",
            "energy, stress, pressure and coordination of 2 runs over the strain",
        ),
        ("modes", "jampetsc.plots.vibrations.plot_modes", "modes of 2 packings"),
        ("states", "jampetsc.plots.vibrations.plot_states", "density of states of 2 packings"),
    ],
)
def test_a_picture_shows_all_files_and_says_so(monkeypatch, kind, plot, said):
    drawn = []
    monkeypatch.setattr(plot, lambda *what: drawn.append(what))
    items = [object(), object()]
    assert PICTURES[kind].draw(SimpleNamespace(out="x.png"), items) == said
    assert drawn == [(items, "x.png")]


def test_a_snapshot_counts_the_disks_that_are_no_walls(monkeypatch):
    drawn = []
    monkeypatch.setattr("jampetsc.plots.packing.plot_flowing", lambda panels, out: drawn.extend(panels))
    items = []
    for walls, last in ((3, 0.75), (0, 1.25)):
        one = Rows({"snapshots/strain": np.array([0.25, last]), "state/radii": np.full(5, 0.5)})
        positions = {
            "snapshots/positions": np.arange(20.0).reshape(2, 5, 2),
            "snapshots/cell": np.tile(9 * np.eye(2), (2, 1, 1)),
        }
        one |= positions
        some = Rows(one)
        some.stored = some.__getitem__
        some.attributes = facts(**({"walls": walls} if walls else {})).attributes
        items.append(some)
    said = PICTURES["snapshot"].draw(SimpleNamespace(out="x.png"), items)
    assert said == "contacts of 2 disks at strain 0.75, 5 disks at strain 1.25"
    for (_, disks), one, walls in zip(drawn, items, (3, None), strict=True):
        assert disks.record.get("walls") == walls and disks.potential.k == 2.0
        np.testing.assert_allclose(disks.positions % 9, one["snapshots/positions"][1] % 9)
    assert [title for title, _ in drawn] == ["RD between walls", "RD"]


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
    file = Rows(arrays)
    file.path, file.attributes = (
        Path(f"{sizes}-{seed}.h5"),
        facts(sizes=sizes, seed=seed, discard=1.0).attributes,
    )
    return file


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
    with pytest.raises(InputError, match="holds no six-fold order"):
        plot_order([seen("monodisperse", 1)], "x.png")


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
    steady = [line for line in ax.get_lines() if len(line.get_xdata()) == 4][-1]
    np.testing.assert_allclose(steady.get_data(), [1.05 * y, y])
    assert middle_share(heights(20)) == pytest.approx(1.0)
    with pytest.raises(InputError, match="holds no velocity profiles"):
        mean_profile([seen("bidisperse", 1, strain=strain)], 0, 1)
    with pytest.raises(InputError, match="has no row between strain 3 and 4"):
        mean_profile(files, 3.0, 4.0)

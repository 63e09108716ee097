"""Pictures of steady shear, drawn from real runs through the command line."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import bars, figure_of, lines

import jampetsc
from jampetsc import cli
from jampetsc.contacts.state import measure
from jampetsc.errors import InputError
from jampetsc.plots.flowcurves import flow_curves, local_exponents, plot_against_phi, plot_flow_curves
from jampetsc.plots.packing import touching
from jampetsc.plots.shearing import kind_of, labels_of, lanes_of, last_snapshot, plot_series
from jampetsc.plots.units import flow_units
from jampetsc.storage.reader import Attributes
from jampetsc.storage.result_file import ResultWriter


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
    middle, exponent = local_exponents(np.array([1e-3, 1e-2, 1e-1]), np.array([1.0, 10.0, 1000.0]))
    assert np.allclose(exponent, [1, 2]) and np.allclose(middle, 10 ** np.array([-2.5, -1.5]))


def test_the_last_snapshot_is_the_last_state(runs):
    result = jampetsc.load(runs[0])
    disks = last_snapshot(result)
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

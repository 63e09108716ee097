"""Pictures of which packings jam: shares with their errors, densities, and samples of one kind put together."""

from dataclasses import replace

import numpy as np
import pytest
from densities import jamming_step
from drawn import Held, bars, figure_of, lines
from pressures import CUTS, low_end
from samples import isostatic

from jampetsc.analysis.averages import mean_of_runs
from jampetsc.analysis.jamming import correlated_share, density, independent_share, memory
from jampetsc.analysis.statistics import half_width
from jampetsc.cli import main as cli
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.io.result_file import ResultWriter
from jampetsc.plots import jamming
from jampetsc.plots.jamming import Samples, plot_fraction, plot_jamming_densities, plot_pressures, samples_of
from jampetsc.plots.quasistatic_shear import plot_quasistatic_shear
from jampetsc.studies.table import table_text

UNITS = {"units": "k_e = k_d = 1, diameter of the small disks 1", "stiffness": "inverse-square-diameter"}
PHIS = (0.83, 0.84)


def write_jam(path, n=64, seeds=range(40), seed=1, **attributes):
    """A file as `jam` writes it, of samples that jam more often the denser they are."""
    rng = np.random.default_rng(seed)
    phi, number = np.repeat(PHIS, len(seeds)), np.tile(list(seeds), len(PHIS))
    jammed = (rng.random(len(phi)) < (phi - 0.825) * 50).astype(float)
    jammed[: len(phi) and 1] = np.nan
    with ResultWriter(path, "jampetsc-jam") as writer:
        for name, values in {
            "phi": phi,
            "seed": number,
            "jammed": jammed,
            "pressure": jammed * rng.exponential(1e-3, len(phi)),
        }.items():
            writer.dataset(name, values)
        facts = {"particle_count": n, "sizes": "bidisperse", "potential": "harmonic", **UNITS}
        if "cooling_rate" in attributes:
            writer.dataset("phi_J", np.where(np.isfinite(jammed), rng.normal(0.84, 1e-3, len(phi)), np.nan))
        writer.attributes(**facts | attributes)
    return load(path)


def switching(rng, steps, change):
    """A series of zeros and ones that changes with this probability per step: ρ(t) = (1 − 2c)^t, 2τ = (1 − c)/c."""
    return np.cumsum(rng.random(steps) < change) % 2.0


def test_intervals_of_independent_samples():
    nothing = independent_share(np.zeros(10))
    assert (nothing.value, nothing.low) == (0, 0) and nothing.high == pytest.approx(1 / 11)
    everything = independent_share(np.ones(10))
    assert (everything.value, everything.high) == (1, 1) and everything.low == pytest.approx(10 / 11)
    rng = np.random.default_rng(0)
    found = [independent_share(rng.random(200) < 0.3) for _ in range(2000)]
    held = np.mean([one.low <= 0.3 <= one.high for one in found])
    assert held == pytest.approx(0.6827, abs=0.04)


def test_states_of_a_run_remember():
    rng = np.random.default_rng(1)
    change, steps = 0.05, 4000
    runs = [switching(rng, steps, change) for _ in range(60)]
    shares = [correlated_share(runs[k : k + 3]) for k in range(0, 60, 3)]
    error = np.mean([0.5 * (one.high - one.low) for one in shares])
    assert error == pytest.approx(np.std([one.value for one in shares]), rel=0.4)
    assert memory(runs) == pytest.approx((1 - change) / change, rel=0.1)
    alone = correlated_share([np.ones(500)])
    assert alone.value == 1 and alone.low < 0.6  # may be one long memory


def test_runs_that_differ_by_more_than_they_say():
    assert mean_of_runs([1.0, 3.0], [0.1, 0.1], [np.inf] * 2) == (2.0, half_width(1))
    value, error = mean_of_runs([1.0, 1.0], [0.3, 0.3], [np.inf] * 2)
    assert value == 1.0 and error == pytest.approx(0.3 / np.sqrt(2))


def test_densities():
    values = np.random.default_rng(2).exponential(1.0, 4000)
    edges, height, error = density(values, 0.0)
    assert edges[0] == 0 and np.sum(height * np.diff(edges)) == pytest.approx(1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    apart = (height - np.exp(-middle)) / error
    assert np.sqrt(np.mean(apart[:12] ** 2)) < 2
    assert np.allclose(density(values, 0.0, 4.0)[2], 2 * error)


@pytest.mark.parametrize(("y", "alpha"), [(1.0, 2.0), (1.5, 2.5), (1.1, 2.0)])
def test_the_lower_end_of_a_density_has_a_known_exponent(y, alpha):
    """p = Δφ^y of smoothly distributed Δφ: any one cut is too high, the limit is not, and its error covers it."""
    rng = np.random.default_rng(3)
    found = [low_end(rng.exponential(1.0, 4000) ** y, alpha) for _ in range(150)]
    limit, error = np.transpose([(one.limit, one.limit_error) for one in found])
    assert np.mean(limit) == pytest.approx(y, abs=3 * np.std(limit) / np.sqrt(150) + 0.01)
    assert np.std(limit) == pytest.approx(np.mean(error), rel=0.2)
    assert 0.58 < np.mean(np.abs(limit - y) < error) < 0.78
    wide = np.mean([one.y for one in found], axis=0)
    assert wide[0] > wide[1] > wide[2] > y and wide[0] > 1.1 * y
    one = found[0]
    assert one.power == (pytest.approx(1 / one.limit - 1), pytest.approx(one.limit_error / one.limit**2))
    assert np.allclose(one.error, one.y / np.sqrt(one.counts))
    p = rng.exponential(1.0, 4000)
    again, once = low_end(p, alpha, memory=4.0), low_end(p, alpha)  # four that count as one
    assert again.limit == pytest.approx(once.limit) and again.limit_error == pytest.approx(
        2 * once.limit_error
    )


def test_a_pure_power_is_found_below_every_cut():
    p = (np.arange(1, 200001) / 200000) ** 1.3  # P ~ p^(1/1.3 − 1), without any noise
    found = low_end(p, 2.3)
    assert np.allclose(found.y, 1.3, rtol=1e-3) and found.limit == pytest.approx(1.3, rel=2e-3)
    assert np.allclose(found.cuts, np.mean(p) * np.array(CUTS))
    assert np.isnan(low_end(p[:3]).limit) and np.isnan(low_end(np.zeros(0)).limit)


def test_where_disks_begin_to_jam_and_how_steeply():
    """φ_J with a normal distribution: f is its distribution function."""
    rng, phi = np.random.default_rng(0), np.linspace(0.83, 0.85, 7)
    found = [
        jamming_step(phi, [independent_share(rng.normal(0.84, 0.004, 300) < one) for one in phi])
        for _ in range(200)
    ]
    middle, width, *errors = np.transpose(found)
    for value, true, error in ((middle, 0.84, errors[0]), (width, 0.004, errors[1])):
        assert 0.9 < np.std((value - true) / error) < 1.1 and abs(np.mean((value - true) / error)) < 0.35
    steep = [independent_share(np.full(100, one)) for one in (0.0, 0.0, 1.0, 1.0)]
    assert np.isnan(jamming_step(phi[:4], steep)).all()


def test_samples_of_one_kind_are_put_together(tmp_path):
    files = [
        write_jam(tmp_path / "a.h5"),
        write_jam(tmp_path / "b.h5", seeds=range(40, 90)),
        write_jam(tmp_path / "c.h5", n=256),
    ]
    small, large = samples_of(files)
    assert (small.kind[1], large.kind[1]) == (64, 256)
    assert sorted(small.runs) == list(PHIS)
    assert (
        small.share(0.84).samples == 90 and small.share(0.83).samples == 88
    )  # one of each file reached none
    hard = np.concatenate([one["pressure"][(one["phi"] == 0.84) & (one["jammed"] == 1)] for one in files[:2]])
    assert np.allclose(np.sort(small.pressures(0.84)), np.sort(hard))
    with pytest.raises(InputError, match=r"seed 0 is in a\.h5 too"):
        samples_of([files[0], write_jam(tmp_path / "d.h5")])
    sheared = {"protocol": "shear", "step": 1e-3}
    others = {
        "separated": write_jam(tmp_path / "e.h5", separated=True),
        "coarse": write_jam(tmp_path / "f.h5", **sheared),
        "fine": write_jam(tmp_path / "g.h5", **sheared | {"step": 1e-4}),
        "both": write_jam(tmp_path / "h.h5", protocol="compress", cooling_rate=1e-2, step=1e-3, strain=4.0),
    }
    kinds = [one.kind for one in samples_of([files[0], *others.values()])]
    assert sorted(jamming._labels(kinds)) == [
        "compress, $R=10^{-2}$, sheared by 4",
        "random",
        "random, separated",
        r"shear, $\Delta\gamma=10^{-3}$",
        r"shear, $\Delta\gamma=10^{-4}$",
    ]


def test_jamming_densities_by_rate_of_cooling(tmp_path):
    rates = {"protocol": "compress", "cooling_rate": 1e-2}, {"protocol": "compress", "cooling_rate": 1e-3}
    files = [write_jam(tmp_path / f"{k}.h5", **rate) for k, rate in enumerate(rates)]
    fast, slow = samples_of(files)
    assert fast.kind[0] == "compress, $R=10^{-2}$" and slow.kind[0] == "compress, $R=10^{-3}$"
    here = files[0]["phi"] == 0.83
    assert np.array_equal(fast.jamming[0.83], files[0]["phi_J"][here][1:])  # one sample reached no minimum
    with pytest.raises(InputError, match="holds fewer than 10 values of phi_J"):
        plot_jamming_densities([write_jam(tmp_path / "random.h5")])


def test_bars_of_shares_are_their_intervals_and_pressures_are_in_units_of_k(tmp_path):
    file = write_jam(tmp_path / "a.h5", seeds=range(80), k=2.0)
    (samples,) = samples_of([file])
    ((x, y, down, up),) = bars(figure_of(plot_fraction, [file]).axes[0])
    shares = [samples.share(phi) for phi in PHIS]
    assert np.allclose(x, PHIS) and np.allclose(y, [one.value for one in shares])
    assert np.allclose(y - down, [one.low for one in shares]) and np.allclose(
        y + up, [one.high for one in shares]
    )
    drawn = bars(figure_of(plot_pressures, [file]).axes[0])
    for (x, y, _, up), phi in zip(drawn, PHIS, strict=True):
        edges, height, error = density(samples.pressures(phi) / 2.0, 0.0)
        assert np.allclose(x, 0.5 * (edges[1:] + edges[:-1])) and np.allclose((y, up), (height, error))


def test_what_cannot_be_drawn(tmp_path):
    with pytest.raises(InputError, match="fewer than 10 jammed samples"):
        plot_pressures([write_jam(tmp_path / "few.h5", seeds=range(5))], tmp_path / "x.png")
    with pytest.raises(InputError, match="holds no sample"):
        plot_fraction([write_jam(tmp_path / "none.h5", seeds=range(0))], tmp_path / "x.png")
    kinds = [write_jam(tmp_path / f"{n}.h5", n=n) for n in range(4, 11)]
    with pytest.raises(InputError, match="7 kinds of samples"):
        plot_pressures(kinds)
    own = write_jam(tmp_path / "own.h5", n=32, units="those of the packing", stiffness="constant")
    with pytest.raises(InputError, match=r"own\.h5: is in other units .those of the packing. than 4\.h5"):
        plot_pressures([kinds[0], own])
    assert not list(tmp_path.glob("*.png"))


def write_shear(path, disks, phi, seed=1, k=1.0):
    """A file as `shear` writes it, whose last minimum is `disks`."""
    rng = np.random.default_rng(seed)
    jammed = switching(rng, 200, 0.1)
    series = {"strain": 0.01 * np.arange(1, 201), "jammed": jammed, "energy": 1e-20 + 1e-4 * jammed}
    series |= {
        "shear_stress": jammed * rng.normal(1e-4, 1e-4, 200),
        "pressure": 1e-3 * jammed * rng.random(200),
    }
    state = {name: getattr(disks, name) for name in ("base", "offset", "cell_base", "cell_offset", "radii")}
    with ResultWriter(path, "jampetsc-shear") as writer:
        for name, values in (series | {"coordination": 4 * jammed}).items():
            writer.dataset(name, values)
        for name, values in state.items():
            writer.dataset(f"state/{name}", values)
        means = {f"{name}_mean": series[name].mean() for name in ("shear_stress", "pressure")}
        facts = {
            "phi": phi,
            "seed": seed,
            "particle_count": disks.n,
            "discard": 1.0,
            "energy_cut": 1e-16,
            "k": k,
        }
        facts |= {"sizes": "bidisperse", "potential": "harmonic", "coordination_mean": 2.0, **UNITS}
        writer.attributes(**facts | means)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A folder with two runs of quasistatic shear and a file of random samples."""
    folder = tmp_path_factory.mktemp("study")
    rows = [{"command": "jam", "state": "done", "file": "jam.h5", "seconds": 0.1}]
    write_jam(folder / "jam.h5")
    for phi in (0.82, 0.9):
        write_shear(folder / f"shear-{phi}.h5", isostatic(), phi)
        rows.append({"command": "shear", "state": "done", "file": f"shear-{phi}.h5", "seconds": 0.1})
    (folder / "table.csv").write_text(table_text(rows))
    return folder


@pytest.mark.parametrize(
    "files, kind, says",
    [
        (["shear-0.82.h5"], [], "energy, stress, pressure and coordination of 1 run"),
        (["shear-0.9.h5"], ["--kind", "minimum"], "24 disks at strain 2"),
        (["jam.h5"], [], "share of samples that jam, of 1 file"),
        (["jam.h5", "shear-0.82.h5"], ["--kind", "pressures"], "P(p) of the jammed samples of 2 files"),
        ([""], ["--kind", "fraction"], "share of samples that jam, of 3 files"),
        ([""], ["--kind", "strain"], "of 2 runs over the strain"),
    ],
)
def test_pictures(study, tmp_path, capsys, files, kind, says):
    out = tmp_path / "picture.png"
    assert cli.main(["plot", *(str(study / name) for name in files), *kind, "--out", str(out)]) == 0
    assert says in capsys.readouterr().out
    assert out.stat().st_size > 8_000


def test_series_of_slow_shear_are_per_disk_and_in_units_of_k(tmp_path):
    write_shear(tmp_path / "s.h5", isostatic(), 0.9, k=2.0)
    result = load(tmp_path / "s.h5")
    axes = figure_of(plot_quasistatic_shear, [result]).axes
    jammed = result["jammed"] == 1
    units = {"energy": 2.0 * 24, "shear_stress": 2.0, "pressure": 2.0, "coordination": 1.0}
    for ax, (name, unit) in zip(axes, units.items(), strict=True):
        x, y, *_ = lines(ax, 200)[0]
        assert np.allclose(x, result["strain"]) and np.allclose(y[jammed], result[name][jammed] / unit)
        if name != "energy":
            level = next(one for one in lines(ax, 2) if one[2] == "--")
            assert np.allclose(level[:2], [[1.0, 2.0], [result.attributes[f"{name}_mean"] / unit] * 2])


def test_states_before_the_discarded_strain_do_not_count(study):
    result = load(study / "shear-0.9.h5")
    (samples,) = samples_of([result])
    assert samples.share(0.9).samples == 100 and 1 < samples.share(0.9).independent < 20
    assert samples.share(0.9).value == pytest.approx(result["jammed"][100:].mean())
    pressures = result["pressure"][100:]
    _, height, error = density(pressures[result["jammed"][100:] == 1], 0.0)
    found = samples.density(0.9)
    assert memory([pressures]) > 1.5  # one run, whose states remember each other
    assert np.allclose(found[1], height) and np.allclose(found[2], np.sqrt(memory([pressures])) * error)


def test_a_mixture_that_no_picture_shows_is_refused(study, tmp_path, capsys):
    files = [str(study / name) for name in ("jam.h5", "shear-0.9.h5")]
    assert cli.main(["plot", *files, "--kind", "strain", "--out", str(tmp_path / "x.png")]) == 2
    assert "one picture shows one or the other" in capsys.readouterr().err


def test_the_last_minimum_is_the_last_state(study):
    disks = replace(load(study / "shear-0.9.h5").last, potential=isostatic().potential)
    assert disks.fingerprint == isostatic().fingerprint


def test_runs_are_remembered_by_their_length():
    """Alternating states have the least memory, one state of many a memory of its own; the longer run tells more."""
    short, long = np.tile([0.0, 1.0], 5), np.repeat([0.0, 1.0], 45)
    alone = [memory([run]) for run in (short, long)]
    assert alone[0] == 1.0 and alone[1] > 2
    assert memory([short, long]) == pytest.approx((10 * alone[0] + 90 * alone[1]) / 100)


def test_an_empty_bin_has_the_error_of_one_sample():
    values = np.r_[np.linspace(0.0, 0.1, 12), np.linspace(0.9, 1.0, 13)]
    edges, height, error = density(values, 0.0, 3.0)
    counts = np.histogram(values, edges)[0]
    assert (counts == 0).any() and len(counts) == 5
    np.testing.assert_allclose(error * 25 * np.diff(edges), np.sqrt(3 * np.maximum(counts, 1)))
    np.testing.assert_allclose(height * 25 * np.diff(edges), counts)


def test_samples_that_are_all_alike_have_a_density():
    edges, height, error = density(np.full(12, 0.84))
    assert np.sum(height * np.diff(edges)) == pytest.approx(1) and np.isfinite(error).all()


@pytest.mark.parametrize(("count", "bins"), [(16, 5), (36, 6), (35, 5), (899, 29), (1000, 30)])
def test_as_many_bins_as_the_root_of_samples(count, bins):
    assert len(density(np.linspace(0.0, 1.0, count))[1]) == bins


def samples(kind, count=12, phi_J=0.84, phis=(0.84,)):
    one = Samples(kind)
    for phi in phis:
        one.runs[phi] = [(np.ones(1), np.array([1e-3 * (n + 1)])) for n in range(count)]
        one.jamming[phi] = phi_J + 1e-3 * np.arange(count) ** 2
    return one


def test_means_of_phi_J_are_dotted(monkeypatch):
    kinds = (("compress", 64, "", ""), ("compress", 256, "", ""))
    monkeypatch.setattr(
        jamming, "samples_of", lambda results: [samples(kinds[0]), samples(kinds[1], 20, 0.8)]
    )
    ax = figure_of(plot_jamming_densities, []).axes[0]
    means = [x[0] for x, _, dash, _ in lines(ax, 2) if dash == ":"]
    np.testing.assert_allclose(
        means, [0.84 + 1e-3 * np.mean(np.arange(12) ** 2), 0.8 + 1e-3 * np.mean(np.arange(20) ** 2)]
    )
    for (x, y, _, up), one in zip(bars(ax), (samples(kinds[0]), samples(kinds[1], 20, 0.8)), strict=True):
        edges, height, error = density(one.jamming[0.84])
        np.testing.assert_allclose((x, y, up), (0.5 * (edges[1:] + edges[:-1]), height, error))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["$N=64$", "$N=256$"]
    both = samples(kinds[0], phis=(0.83, 0.84))
    monkeypatch.setattr(jamming, "samples_of", lambda results: [both])
    told = [
        text.get_text() for text in figure_of(plot_jamming_densities, []).axes[0].get_legend().get_texts()
    ]
    assert told == [rf"$N=64$, cooled at $\phi={phi}$" for phi in (0.83, 0.84)]


def slow_shear(jammed, plastic=None, name="s.h5", **more):
    """A shear file of so many states."""
    jammed = np.array(jammed, float)
    scales = {"shear_stress": 1e-3, "pressure": 2e-3, "coordination": 4.0}
    arrays = {key: jammed * scale for key, scale in scales.items()}
    means = {f"{key}_mean": values.mean() for key, values in arrays.items()}
    arrays |= {"jammed": jammed, "strain": 0.1 * np.arange(1, len(jammed) + 1)}
    arrays |= {"energy": np.where(jammed == 1, 1e-4, 1e-20)}
    arrays |= {} if plastic is None else {"plastic": np.array(plastic, float)}
    facts = {"discard": 0.25, "energy_cut": 1e-16, "particle_count": 10, "k": 2.0, "stiffness": "constant"}
    return Held(arrays, facts | means | more, name)


def test_states_that_jam_are_lines_others_dots_and_single_ones_dashes():
    file = slow_shear([1, 1, 0, 1, 0, 0, 1, 1])
    fig = figure_of(plot_quasistatic_shear, [file])
    strain = file["strain"]
    for ax, (name, unit) in zip(
        fig.axes,
        (("energy", 20.0), ("shear_stress", 2.0), ("pressure", 2.0), ("coordination", 1.0)),
        strict=True,
    ):
        line, loose, single = ax.get_lines()[:3]
        values = file[name] / unit
        np.testing.assert_allclose(line.get_ydata(), np.where(file["jammed"] == 1, values, np.nan))
        np.testing.assert_allclose(loose.get_data(), [strain[[2, 4, 5]], values[[2, 4, 5]]])
        np.testing.assert_allclose(single.get_data(), [strain[[3]], values[[3]]])
        assert single.get_marker() == "_" and loose.get_marker() == "."
    cut = [y[0] for x, y, dash, _ in lines(fig.axes[0], 2) if dash == ":"]
    assert cut == [1e-16] and fig.axes[0].get_yscale() == "log"
    told = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert told == ["jammed", "not jammed", "means"]


def test_where_all_is_jammed_no_cut_is_drawn_and_plastic_events_are_marked():
    fig = figure_of(plot_quasistatic_shear, [slow_shear(np.ones(6), [0, 1, 0, 0, 1, 0])])
    told = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert told == ["jammed", "plastic events, in (b)", "means"]
    assert not [1 for _, _, dash, _ in lines(fig.axes[0], 2) if dash == ":"]
    marks = [line for line in fig.axes[1].get_lines() if line.get_marker() == "|"]
    np.testing.assert_allclose(marks[0].get_xdata(), [0.2, 0.5])
    assert (np.asarray(marks[0].get_ydata()) == 0.02).all()  # of the height of the panel
    quiet = figure_of(plot_quasistatic_shear, [slow_shear(np.ones(6), np.zeros(6))])
    assert [text.get_text() for text in quiet.axes[0].get_legend().get_texts()] == ["jammed", "means"]

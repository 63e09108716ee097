"""Pictures of which packings jam: shares with their errors, densities, and samples of one kind put together."""

import numpy as np
import pytest
from picture_contents import bars, figure_of, held, lines, told, with_arrays
from samples import isostatic

from jampetsc.analysis.jammed_samples import (
    binomial_share,
    correlated_share,
    density,
    effective_samples,
    independent_share,
    memory,
)
from jampetsc.errors import InputError
from jampetsc.packing.packing import PLACES
from jampetsc.plots import jamming_plots
from jampetsc.plots.draw import draw
from jampetsc.plots.jamming_plots import (
    plot_fraction,
    plot_jamming_densities,
    plot_pressures,
    plot_stepwise_shear,
    samples_of,
)
from papers.tables.densities import jamming_step
from papers.tables.pressures import CUTS, low_end

UNITS = {"units": "k_e = k_d = 1, diameter of the small disks 1", "stiffness": "inverse-square-diameter"}
PHIS = (0.83, 0.84)


def jam_of(n=64, seeds=range(40), seed=1, path="a.h5", **attributes):
    """What `jam` makes, of samples that jam more often the denser they are."""
    rng = np.random.default_rng(seed)
    phi, number = np.repeat(PHIS, len(seeds)), np.tile(list(seeds), len(PHIS))
    jammed = (rng.random(len(phi)) < (phi - 0.825) * 50).astype(float)
    jammed[: len(phi) and 1] = np.nan
    pressure = jammed * rng.exponential(1e-3, len(phi))
    arrays = {"phi": phi, "seed": number, "jammed": jammed, "pressure": pressure}
    if "cooling_rate" in attributes:
        arrays["phi_J"] = np.where(np.isfinite(jammed), rng.normal(0.84, 1e-3, len(phi)), np.nan)
    facts = {"particle_count": n, "sizes": "bidisperse", "potential": "harmonic", **UNITS}
    return held(arrays, facts | attributes, path, "jampetsc-jam")


def shear_of(jammed, plastic=None, path="s.h5", **more):
    """What `shear` makes, of so many states."""
    jammed = np.array(jammed, float)
    scales = {"shear_stress": 1e-3, "pressure": 2e-3, "contact_number": 4.0}
    arrays = {key: jammed * scale for key, scale in scales.items()}
    means = {f"{key}_mean": values.mean() for key, values in arrays.items()}
    arrays |= {"jammed": jammed, "strain": 0.1 * np.arange(1, len(jammed) + 1)}
    arrays |= {"energy": np.where(jammed == 1, 1e-4, 1e-20)}
    arrays |= {} if plastic is None else {"plastic": np.array(plastic, float)}
    facts = {"discard": 0.25, "energy_cut": 1e-16, "particle_count": 10, "k": 2.0, "stiffness": "constant"}
    facts |= {"phi": 0.9, "seed": 1, "sizes": "bidisperse", "potential": "harmonic"}
    return held(arrays, facts | means | more, path, "jampetsc-shear")


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
    known = (1 - change) / change  # estimated as the larger of two numbers, so rather from above
    assert 0.9 * known < memory(runs) < 1.3 * known
    for share in shares:
        assert binomial_share(share.value, effective_samples(share)).error == pytest.approx(share.error)
    alone = correlated_share([np.ones(500)])
    assert alone.value == 1 and alone.low < 0.6  # may be one long memory


def test_densities():
    values = np.random.default_rng(2).exponential(1.0, 4000)
    edges, height, error = density(values, 0.0)
    assert edges[0] == 0 and np.sum(height * np.diff(edges)) == pytest.approx(1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    apart = (height - np.exp(-middle)) / error
    assert np.sqrt(np.mean(apart[:12] ** 2)) < 2
    for count, bins in ((16, 5), (36, 6), (35, 5), (899, 29), (1000, 30)):  # the root of samples
        assert len(density(np.linspace(0.0, 1.0, count))[1]) == bins
    edges, height, error = density(np.full(12, 0.84))  # all alike
    assert np.sum(height * np.diff(edges)) == pytest.approx(1) and np.isfinite(error).all()


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
    pure = low_end((np.arange(1, 200001) / 200000) ** y, 1 + y)  # P ~ p^(1/y − 1), without any noise
    assert np.allclose(pure.y, y, rtol=1e-3) and pure.limit == pytest.approx(y, rel=2e-3)
    assert np.isnan(low_end(np.ones(3)).limit) and np.isnan(low_end(np.zeros(0)).limit)
    p = rng.exponential(1.0, 4000)
    assert np.allclose(low_end(p, alpha).cuts, np.mean(p) * np.array(CUTS))
    again, once = low_end(p, alpha, memory=4.0), low_end(p, alpha)  # four that count as one
    assert again.limit == pytest.approx(once.limit) and again.limit_error == pytest.approx(
        2 * once.limit_error
    )


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


def test_samples_of_one_kind_are_put_together():
    files = [jam_of(), jam_of(seeds=range(40, 90), path="b.h5"), jam_of(256)]
    small, large = samples_of(files)
    assert (small.kind[1], large.kind[1]) == (64, 256) and sorted(small.runs) == list(PHIS)
    assert [small.share(phi).samples for phi in PHIS] == [88, 90]  # one of each file reached no minimum
    hard = np.concatenate([one["pressure"][(one["phi"] == 0.84) & (one["jammed"] == 1)] for one in files[:2]])
    assert np.allclose(np.sort(small.pressures(0.84)), np.sort(hard))
    with pytest.raises(InputError, match=r"seed 0 is in a\.h5 as well"):
        samples_of([files[0], jam_of(path="d.h5")])


def test_disks_and_spheres_are_samples_of_two_kinds():
    kinds = [samples.kind for samples in samples_of([jam_of(), jam_of(dimension=3)])]
    assert jamming_plots.labels_of(kinds) == ["$D=2$", "$D=3$"]


def test_kinds_of_samples_are_named_by_what_differs():
    sheared, cooled = {"protocol": "shear", "step": 1e-3}, {"protocol": "compress", "cooling_rate": 1e-2}
    files = [jam_of(), jam_of(separated=True), jam_of(**sheared), jam_of(**sheared | {"step": 1e-4})]
    kinds = [one.kind for one in samples_of([*files, jam_of(**cooled, step=1e-3, strain=4.0)])]
    assert sorted(jamming_plots.labels_of(kinds)) == [
        "compress, $R=10^{-2}$, sheared by 4", "random", "random, separated", r"shear, $\Delta\gamma=10^{-3}$",
        r"shear, $\Delta\gamma=10^{-4}$",
    ]  # fmt: skip
    for more, names in (
        ({}, ["$N=64$"]),
        ({"n": 256}, ["$N=64$", "$N=256$"]),
        ({"potential": "hertzian", "sizes": ""}, ["hertzian", "harmonic"]),  # "": not told
        ({"protocol": "shear"}, ["random", "shear"]),
    ):
        kinds = [one.kind for one in samples_of([jam_of(), jam_of(**more)] if more else [jam_of()])]
        assert jamming_plots.labels_of(kinds) == names


def test_jamming_densities_by_rate_of_cooling():
    """A line for each kind and φ it was cooled at, a dotted one at its mean."""
    files = [jam_of(protocol="compress", cooling_rate=rate, seed=n) for n, rate in enumerate((1e-2, 1e-3))]
    fast, slow = samples_of(files)
    assert [one.kind[0] for one in (fast, slow)] == [f"compress, $R=10^{{-{n}}}$" for n in (2, 3)]
    here = files[0]["phi"] == 0.83
    assert np.array_equal(fast.jamming[0.83], files[0]["phi_J"][here][1:])  # one sample reached no minimum
    ax = figure_of(plot_jamming_densities, files).axes[0]
    values = [one.jamming[phi] for one in (fast, slow) for phi in PHIS]
    means = [x[0] for x, _, dash, _ in lines(ax, 2) if dash == ":"]
    np.testing.assert_allclose(means, [np.mean(some) for some in values])
    for (x, y, _, up), some in zip(bars(ax), values, strict=True):
        edges, height, error = density(some)
        np.testing.assert_allclose((x, y, up), (0.5 * (edges[1:] + edges[:-1]), height, error))
    cooled = [rf"compress, $R=10^{{-{n}}}$, cooled at $\phi={phi}$" for n in (2, 3) for phi in PHIS]
    assert told(ax) == cooled


def test_bars_of_shares_are_their_intervals_and_pressures_are_in_units_of_k():
    file = jam_of(seeds=range(80), k=2.0)
    (samples,) = samples_of([file])
    ((x, y, down, up),) = bars(figure_of(plot_fraction, [file]).axes[0])
    shares = [samples.share(phi) for phi in PHIS]
    drawn = np.transpose([(phi, one.value, one.low, one.high) for phi, one in zip(PHIS, shares, strict=True)])
    np.testing.assert_allclose((x, y, y - down, y + up), drawn)
    for (x, y, _, up), phi in zip(bars(figure_of(plot_pressures, [file]).axes[0]), PHIS, strict=True):
        edges, height, error = density(samples.pressures(phi) / 2.0, 0.0)
        np.testing.assert_allclose((x, y, up), (0.5 * (edges[1:] + edges[:-1]), height, error))


KINDS = [jam_of(n, path=f"{n}.h5") for n in range(4, 11)]
OWN = jam_of(32, path="own.h5", units="those of the packing", stiffness="constant")


@pytest.mark.parametrize(
    ("picture", "files", "says"),
    [
        (plot_pressures, [jam_of(seeds=range(5))], "fewer than 10 jammed samples"),
        (plot_fraction, [jam_of(seeds=range(0))], "no sample reached"),
        (plot_pressures, KINDS, "7 kinds of samples"),
        (plot_pressures, [KINDS[0], OWN], r"own\.h5: units those of the packing, but 4\.h5"),
        (plot_jamming_densities, [jam_of()], "fewer than 10 values of phi_J"),
    ],
)
def test_what_cannot_be_drawn(picture, files, says):
    with pytest.raises(InputError, match=says):
        picture(files)


def test_files_of_samples_and_of_shear_go_together_in_some_pictures():
    shear = shear_of(np.tile([1, 1, 1, 0], 20), **UNITS | {"k": 1.0})
    minimum = {f"state/{name}": getattr(isostatic(), name) for name in (*PLACES, "radii")}
    shear = with_arrays(shear, minimum)
    both = [jam_of(), shear]
    for files, kind, says in (
        (both[1:], None, "energy, stress, pressure and contacts of 1 run over the strain"),
        (both[1:], "minimum", "24 disks at strain 8"),
        (both, "pressures", "P(p) of the jammed samples of 2 files"),
        (both, None, "f(phi), the share of samples that jam, of 2 files"),
    ):
        assert draw(files, kind).text == says
    with pytest.raises(InputError, match=r"a\.h5, s\.h5: a jam file and a shear file\. Draw them"):
        draw(both, "strain")


def test_states_before_the_discarded_strain_do_not_count():
    rng = np.random.default_rng(1)
    result = shear_of(switching(rng, 200, 0.1), discard=10.0, **UNITS)
    result = with_arrays(result, {"pressure": result["jammed"] * rng.random(200)})
    (samples,) = samples_of([result])
    share, steady = samples.share(0.9), result["jammed"][100:] == 1
    assert share.samples == 100 and 1 < share.independent < 20 and share.value == pytest.approx(steady.mean())
    pressures = result["pressure"][100:]
    _, height, error = density(pressures[steady], 0.0)
    found = samples.density(0.9)
    assert memory([pressures]) > 1.5  # one run, whose states remember each other
    np.testing.assert_allclose(found[1:], (height, np.sqrt(memory([pressures])) * error))


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


def test_states_that_jam_are_lines_others_dots_and_single_ones_dashes():
    file = shear_of([1, 1, 0, 1, 0, 0, 1, 1])
    fig = figure_of(plot_stepwise_shear, [file])
    strain, units = (
        file["strain"],
        {"energy": 20.0, "shear_stress": 2.0, "pressure": 2.0, "contact_number": 1.0},
    )
    for ax, (name, unit) in zip(fig.axes, units.items(), strict=True):
        line, loose, single = ax.get_lines()[:3]
        values = file[name] / unit
        np.testing.assert_allclose(line.get_ydata(), np.where(file["jammed"] == 1, values, np.nan))
        np.testing.assert_allclose(loose.get_data(), [strain[[2, 4, 5]], values[[2, 4, 5]]])
        np.testing.assert_allclose(single.get_data(), [strain[[3]], values[[3]]])
        assert single.get_marker() == "_" and loose.get_marker() == "."
        if name != "energy":
            level = next(one for one in lines(ax, 2) if one[2] == "--")
            np.testing.assert_allclose(level[:2], [[0.25, 0.8], [file.attributes[f"{name}_mean"] / unit] * 2])
    cut = [y[0] for x, y, dash, _ in lines(fig.axes[0], 2) if dash == ":"]
    assert cut == [1e-16] and fig.axes[0].get_yscale() == "log"
    assert told(fig.axes[0]) == ["jammed", "not jammed", "means"]


def test_where_all_is_jammed_no_cut_is_drawn_and_plastic_events_are_marked():
    fig = figure_of(plot_stepwise_shear, [shear_of(np.ones(6), [0, 1, 0, 0, 1, 0])])
    assert told(fig.axes[0]) == ["jammed", "plastic events, in (b)", "means"]
    assert not [1 for _, _, dash, _ in lines(fig.axes[0], 2) if dash == ":"]
    marks = [line for line in fig.axes[1].get_lines() if line.get_marker() == "|"]
    np.testing.assert_allclose(marks[0].get_xdata(), [0.2, 0.5])
    assert (np.asarray(marks[0].get_ydata()) == 0.02).all()  # of the height of the panel
    quiet = figure_of(plot_stepwise_shear, [shear_of(np.ones(6), np.zeros(6))])
    assert told(quiet.axes[0]) == ["jammed", "means"]

"""Pictures of quasistatic files and modes, drawn from results of known content."""

import numpy as np
import pytest
from picture_contents import bands, bars, figure_of, held, lines, require_arrows, told, with_arrays
from samples import published

from jampetsc.analysis.statistics import median_interval
from jampetsc.errors import InputError
from jampetsc.plots import style
from jampetsc.plots.draw import choose_kind, pictures, plot
from jampetsc.plots.mode_plots import (
    plot_lowest,
    plot_modes,
    plot_participation,
    plot_states,
    pooled_density,
)
from jampetsc.plots.quasistatic_plots import plot_medians, plot_viscosities

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib
MOTIONS = ("normal", "transverse", "nonaffine")


def quasistatic_of(medians, size=16, pressure=1e-3, k=1.0, bare=None, **more):
    """A result of which only attributes are there: medians of Δu∥, Δu⊥ and u_na with pre-stress, and without."""
    attributes = {"pressure": k * pressure, "k": k, "tau1": 1.0, "particle_count": size, "law": "contact"}
    attributes |= {"prestress": bare is not None, "beta": 1.0, "eta0": 1.0, "eta_inf": 0.5}
    for prefix, values in (("", medians), *([("no_prestress_", bare)] if bare is not None else [])):
        attributes |= {f"{prefix}{name}_median": one for name, one in zip(MOTIONS, values, strict=True)}
    return held({}, attributes | more, "q.h5", "jampetsc-quasistatic")


def modes_of(values, floppiness=None, pressure=1e-3, **more):
    """A result with these eigenvalues of 4 disks."""
    arrays = {"eigenvalues": np.array(values), "particles": np.arange(4)}
    arrays["floppiness"] = np.ones(len(values)) if floppiness is None else np.array(floppiness)
    arrays["participation_ratio"] = 1.0 / (1.0 + np.arange(len(values)))
    return held(arrays, {"pressure": pressure, "k": 1.0, "complete": True} | more, "m.h5", "jampetsc-modes")


def states_of(edges, counts, pressure=1e-3, **more):
    """A result with these numbers of states of 4 particles."""
    arrays = {"states/edges": edges, "states/counts": counts, "particles": np.arange(4)}
    return held(arrays, {"pressure": pressure, "k": 1.0} | more, "s.h5", "jampetsc-modes")


def lowest_of(pressure, count=(10, 50), n=16):
    """Modes of known floppiness, shares and medians: all of them numbers times powers of p."""
    one = modes_of(np.linspace(1e-3, 1.0, 60), pressure=pressure, k=2.0, particle_count=n)
    arrays = {
        "transverse": np.full(60, 4.0 / pressure),
        "normal": np.ones(60),
        "lowest/count": np.array(count),
    }
    for row, name in enumerate(MOTIONS, 1):
        arrays[f"cumulative/{name}"] = row * np.arange(1, 61) / 1000
        arrays[f"lowest/{name}_median"] = row * pressure * np.arange(1.0, len(count) + 1)
        one.attributes[f"{name}_median"] = 5.0 * pressure
    one.path = one.path.with_name(f"{pressure}-{n}-{len(count)}.h5")
    return with_arrays(one, arrays)


def test_lines_run_through_medians_and_small_points_are_files():
    """Three files to a pressure, one of them far off; guides of ±1/4 through the geometric mean of the bare ones."""
    some = [
        quasistatic_of(0.5 * c * np.arange(1, 4), pressure=p, bare=p * c * np.arange(1, 4), k=2.0)
        for p in (1e-2, 1e-4)
        for c in (1.0, 1.5, 20.0)
    ]
    ax = figure_of(plot_medians, some).axes[0]
    points, medians = lines(ax, 6), lines(ax, 2)
    p = np.array([1e-4, 1e-2])
    for number, (factor, slope) in enumerate(((1, 0.25), (2, -0.25), (3, -0.25))):
        bare, stressed, guide = medians[3 * number : 3 * number + 3]
        np.testing.assert_allclose(bare[:2], [p, 1.5 * factor * p])
        np.testing.assert_allclose(stressed[:2], [p, np.full(2, 0.75 * factor)])
        np.testing.assert_allclose(guide[1], 1.5 * factor * 1e-3 * (p / 1e-3) ** slope)
        assert (bare[2], stressed[2:], guide[2]) == ("-", ("--", "white"), ":") and bare[3] != "white"
        np.testing.assert_allclose(points[2 * number][1], factor * np.outer(p, [1.0, 1.5, 20.0]).ravel())
        np.testing.assert_allclose(points[2 * number][0], np.repeat(p, 3))
    assert len(points) == 6
    low, high = median_interval(np.array([1.0, 1.5, 20.0]))
    np.testing.assert_allclose(bands(ax)[0][1:], [low * p, high * p])
    assert told(ax)[3:] == [
        "no pre-stress",
        "pre-stress",
        r"$p^{\pm 1/4}$",
        "single packings",
        "68 % interval",
    ]
    alone = told(figure_of(plot_medians, some[:1]).axes[0])
    assert alone[3:] == ["no pre-stress", "pre-stress"]  # no guide through one pressure
    some[0].attributes["load"] = "compression"
    with pytest.raises(InputError, match=r"load xy, but .* has compression\. Draw files of one load"):
        figure_of(plot_medians, some)
    some[0].attributes |= {"load": "xy", "dimension": 3}
    with pytest.raises(InputError, match=r"dimension 2, but .* has 3\. Draw files of one dimension"):
        figure_of(plot_medians, some)
    some[0].attributes |= {"dimension": 2, "beta": 0.1}
    with pytest.raises(InputError, match=r"beta 1\.0, but .* has 0\.1\. Draw files of one law"):
        figure_of(plot_medians, some)


def test_modes_in_one_picture_are_of_one_dimension_and_their_shares_of_one_load():
    plane, compressed, space = (
        modes_of([1.0, 2.0], **more) for more in ({}, {"load": "yy"}, {"dimension": 3})
    )
    assert len(figure_of(plot_states, [plane, compressed]).axes) == 1
    for plot_of, other, says in (
        (plot_modes, compressed, "load yy, but m.h5 has xy. Draw files of one load"),
        (plot_modes, space, "dimension 3, but m.h5 has 2. Draw files of one dimension"),
        (plot_states, space, "dimension 3, but m.h5 has 2. Draw files of one dimension"),
    ):
        with pytest.raises(InputError, match=says):
            figure_of(plot_of, [plane, other])


def test_the_guide_goes_with_the_largest_packings_and_sizes_have_markers():
    some = [quasistatic_of([n, n, n], n, p) for n in (64, 16) for p in (1e-3, 1e-2)]
    ax = figure_of(plot_medians, some).axes[0]
    guides = [y for _, y, dash, _ in lines(ax, 2) if dash == ":"]
    np.testing.assert_allclose([np.sqrt(y[0] * y[1]) for y in guides], [64.0] * 3)
    assert told(ax)[3:5] == ["$N=16$", "$N=64$"] and not {"single packings", "68 % interval"} & set(told(ax))


def test_viscosities_are_medians_over_files_in_units_of_k_and_tau1():
    """Own β and those of the scan, but for β = 0; k = 2 and τ₁ = 4. Filled and solid: η₀, open and dashed: η_∞."""
    some = []
    for eta in (1.0, 3.0, 50.0):
        one = quasistatic_of([1, 1, 1], k=2.0, eta0=8 * eta, eta_inf=4 * eta, tau1=4.0, beta=0.1)
        scan = {"beta": [0.0, 0.01], "eta0": [9.0, 0.8 * eta], "eta_inf": [9.0, 0.4 * eta]}
        some.append(held({f"beta_scan/{name}": values for name, values in scan.items()}, one.attributes))
    ax = figure_of(plot_viscosities, some).axes[0]
    low, high = lines(ax, 2)
    np.testing.assert_allclose(low[:2], [[0.01, 0.1], [0.3, 3.0]])
    np.testing.assert_allclose(high[:2], [[0.01, 0.1], [0.15, 1.5]])
    assert (low[2], high[2:]) == ("-", ("--", "white"))
    limits = [median_interval(np.array(eta0)) for eta0 in ([0.1, 0.3, 5.0], [1.0, 3.0, 50.0])]
    np.testing.assert_allclose(bands(ax)[0][1:], np.transpose(limits))
    assert told(ax) == ["$10^{-3}$", r"$\eta_0$", r"$\eta_\infty$", "68 % interval"]
    both = figure_of(plot_viscosities, [some[0], quasistatic_of([1, 1, 1], 64)]).axes[0]
    assert told(both)[:2] == ["$10^{-3}$, $N=16$", "$10^{-3}$, $N=64$"]


def test_guides_at_the_viscosities_have_slopes_1_and_one_half():
    """η₀ = 0.01 + β and η_∞ = √(0.01 + β): over the decades where these are straight."""
    beta = np.logspace(-6, 3, 10)
    one = quasistatic_of([1, 1, 1], eta0=1.01, eta_inf=1.01**0.5, beta=1.0)
    scan = {"beta": beta, "eta0": 0.01 + beta, "eta_inf": np.sqrt(0.01 + beta)}
    scanned = held({f"beta_scan/{name}": values for name, values in scan.items()}, one.attributes)
    ax = figure_of(plot_viscosities, [scanned]).axes[0]
    guides = [np.log(line.get_data()) for line in ax.get_lines() if len(line.get_xdata()) == 50]
    np.testing.assert_allclose([np.ptp(y) / np.ptp(x) for x, y in guides], [1.0, 0.5])
    assert [text.get_text() for text in ax.texts] == [r"$\beta$", r"$\beta^{1/2}$"]


def test_modes_keep_their_numbers_where_some_have_no_frequency():
    """Of λ = −1, 0, 4, 16 in k = 4 the third and fourth are shown, coloured by floppiness; infinite is the largest."""
    one = modes_of([-4.0, 0.0, 4.0, 16.0], [10.0, 99.0, 5.0, np.inf], k=4.0)
    fig = figure_of(plot_modes, [one])
    fig.draw_without_rendering()  # which gives points their colours
    shown = fig.axes[0].collections[0]
    np.testing.assert_allclose(shown.get_offsets(), [(3, 1.0), (4, 2.0)])
    colours = shown.get_facecolors()
    np.testing.assert_allclose(colours, style.sequential()([0.0, 1.0]))
    assert fig.axes[2].get_ylim() == pytest.approx((5.0, 10.0)) and not lines(fig.axes[1], 4)
    assert told(fig.axes[0]) == [r"$2.5\times10^{-4}$"]
    share = np.array([0.1, 0.4, 0.7, 1.0])
    one = with_arrays(one, {"cumulative/nonaffine": share, "cumulative/modulus": share**2})
    nonaffine, modulus = lines(figure_of(plot_modes, [one]).axes[1], 4)
    np.testing.assert_allclose((*nonaffine[:2], modulus[1]), [np.arange(1, 5), share, share**2])
    assert (nonaffine[2], modulus[2]) == ("-", "--")


def test_modes_of_many_packings_share_a_marker_and_an_entry():
    """Twelve of two pressures: two entries and a band; shares are means over the modes that all files have."""
    some = []
    for n in range(12):
        one = modes_of(np.arange(1.0, 5.0 + (n > 1)), pressure=(1e-2, 1e-4)[n % 2])
        share = np.full(len(one["eigenvalues"]), n / 12)
        one = with_arrays(one, {"cumulative/nonaffine": share, "cumulative/modulus": share})
        some.append(one)
    fig = figure_of(plot_modes, some)
    assert told(fig.axes[0]) == ["$10^{-4}$", "$10^{-2}$", "68 % interval"]
    low, _, high, _ = lines(fig.axes[1], 4)
    np.testing.assert_allclose((*low[:2], high[1]), [np.arange(1, 5), np.full(4, 0.5), np.full(4, 5 / 12)])


def test_states_are_pooled_by_pressure():
    """Of two files at one pressure and one at another; per degree of freedom of all disks that are no rattlers."""
    some = [modes_of(values, pressure=p) for values, p in (([1.0, 1.1], 1e-2), ([1.0], 1e-3), ([1.05], 1e-3))]
    ax = figure_of(plot_states, some).axes[0]
    (*drawn, _), width = lines(ax), 10 ** (1 / 8) - 1  # Debye's law is the last
    for (x, y, *_), pooled in zip(drawn, ([some[1], some[2]], [some[0]]), strict=True):
        np.testing.assert_allclose((x, y), pooled_density(pooled))
    np.testing.assert_allclose(drawn[1][1], [2 / 8 / width])
    np.testing.assert_allclose(drawn[0][1], [2 / 16 / width])
    assert told(ax) == ["$10^{-3}$", "$10^{-2}$", r"$\omega_m$"]
    omega, density = pooled_density([modes_of(2.0 * (0.05 * np.arange(1, 8)) ** 2, k=2.0)] * 2)
    edges = 10.0 ** (np.round(np.log10(omega) * 8 - 0.5) / 8)  # the integral over ω is the share of modes
    assert np.sum(density * edges * width) == pytest.approx(7 / 8) and 0.04 < omega.min() < omega.max() < 0.4


@pytest.mark.parametrize("dimension", [2, 3])
def test_numbers_of_states_are_pooled_with_debye_and_the_excess_of_contacts(dimension):
    """k = 4. D(ω) ∝ ω^(D−1); files of one pressure together; a star where ω is Δz, of 10 or 14 contacts 1."""
    edges, more = np.geomspace(0.5, 5.0, 9), {"pressure": 4e-2, "k": 4.0, "dimension": dimension}
    counts = np.round(1e6 * np.diff(edges**dimension)).astype(int)
    contacts = {"contacts": 4 * dimension + 2}
    some = [
        states_of(2.0 * edges, counts, **more, **contacts),
        states_of(2.0 * edges, 3 * counts, **more, **contacts),
    ]
    drawn = lines(figure_of(plot_states, some).axes[0])
    (omega, density, *_), guide, star = drawn
    np.testing.assert_allclose(omega, np.sqrt(edges[1:] * edges[:-1]))
    np.testing.assert_allclose(density, 2 * counts / np.diff(edges) / (4 * dimension))
    slope = np.polyfit(np.log(guide[0]), np.log(guide[1]), 1)[0]
    assert slope == pytest.approx(dimension - 1) and guide[2] == ":"
    assert np.mean(np.log(guide[1])) == pytest.approx(np.mean(np.log(density)))
    np.testing.assert_allclose(star[:2], [[1.0], [np.exp(np.interp(0.0, np.log(omega), np.log(density)))]])
    assert told(figure_of(plot_states, some).axes[0]) == [
        "$10^{-2}$", rf"$\omega_m{'^{2}' * (dimension == 3)}$", r"$\omega_m=\Delta z$"
    ]  # fmt: skip
    spectrum = modes_of(4.0 * np.repeat(omega**2, [1, 0, 2, 0, 0, 1, 0, 4]), **more)
    _, y = pooled_density([*some, spectrum])
    np.testing.assert_allclose(y * np.diff(edges) * 12 * dimension, 4 * counts + [1, 0, 2, 0, 0, 1, 0, 4])
    empty = states_of(2.0 * edges, 0 * counts, **more)
    with pytest.raises(InputError, match=r"s\.h5: no mode between its edges\. Count between others"):
        figure_of(plot_states, [empty])
    for others in (2.0 * edges[1:], 2.0 * edges * (1 + 1e-8)):
        with pytest.raises(InputError, match=r"s\.h5: other edges than s\.h5\. Draw files of equal states"):
            pooled_density([some[0], states_of(others, counts[: len(others) - 1], **more)])


def test_what_the_lowest_modes_carry_against_pressure():
    p = np.array([1e-4, 1e-2])
    files = [lowest_of(x) for x in p for _ in range(2)]
    floppy, share, medians = figure_of(plot_lowest, files).axes[:3]
    for x, y, *_ in bars(floppy):
        np.testing.assert_allclose((x, y), (p / 2, 2 / np.sqrt(p)))
    levels = [row * count / 1000 for row in (1, 2, 3) for count in (10, 50)]
    np.testing.assert_allclose([y for _, y, *_ in bars(share)], np.repeat(levels, 2).reshape(6, 2))
    whole_and_alone = np.outer([5, 2, 5, 4, 5, 6], p)  # alone: of 50 modes
    np.testing.assert_allclose([y for _, y, *_ in bars(medians)], whole_and_alone)
    np.testing.assert_allclose(lines(floppy, 2)[-1][1], 2 / np.sqrt(p))  # the guide


def test_responses_and_modes_are_arrows_on_their_packing():
    """Without pre-stress first, and with it; as many times the field as is told."""
    bare, stressed = np.random.default_rng(1).normal(size=(2, 16, 2))
    one = quasistatic_of([1, 1, 1], bare=[1, 1, 1])
    fields = {"nonaffine": stressed, "no_prestress/nonaffine": bare, "particles": np.arange(16)}
    one = with_arrays(one, fields)
    modes = held(
        {"eigenvalues": np.array([-1.0, 1e-2]), "particles": np.arange(16), "modes": [stressed, bare]},
        {"k": 1.0},
        "m.h5",
        "jampetsc-modes",
    )
    one.packing = modes.packing = published()
    for axes, titles in (
        (plot([one], "response"), ["no pre-stress", "pre-stress"]),
        (plot([modes], mode=[2, 1]), [r"mode 2, $\lambda/k=10^{-2}$", r"mode 1, $\lambda/k=0$"]),
    ):
        assert [ax.get_title() for ax in axes] == titles
        for ax, field in zip(axes, (bare, stressed), strict=True):
            require_arrows(ax, field)


def test_participation_ratios_are_points_and_medians_of_bins_with_enough_modes():
    """k = 4; five modes near 1 with ratios 1/2 to 1/6, a mode of no energy and one alone in its bin."""
    near = 4.0 * (1.02 + 0.01 * np.arange(5)) ** 2
    one = modes_of([0.0, *near, 400.0], k=4.0, pressure=4e-3)
    other = modes_of([16.0], pressure=1e-2)
    ax = figure_of(plot_participation, [one, other]).axes[0]
    points, median, alone, _ = lines(ax)
    np.testing.assert_allclose(points[0], [*np.sqrt(near / 4.0), 10.0])
    np.testing.assert_allclose(points[1], 1.0 / np.arange(2, 8))
    np.testing.assert_allclose(median[:2], [[10 ** (1 / 16)], [1 / 4]])
    np.testing.assert_allclose(alone[:2], [[4.0], [1.0]])
    assert told(ax) == ["$10^{-3}$", "$10^{-2}$"]
    with pytest.raises(InputError, match=r"dimension 3, but m\.h5 has 2\. Draw files of one"):
        figure_of(plot_participation, [one, modes_of([1.0], dimension=3)])


RESPONSE = held({"nonaffine": 0, "particles": 0}, {"prestress": False}, "q.h5", "jampetsc-quasistatic")
MODES, UNTOLD = modes_of([1.0, 2.0], complete=False), modes_of([1.0, 2.0])
del UNTOLD.attributes["complete"]
MODES = with_arrays(MODES, {"modes": np.zeros((2, 4, 2))})
BARE_MODES = modes_of([1.0, 2.0])


@pytest.mark.parametrize(
    ("results", "asked", "says"),
    [
        ([MODES], {"mode": [3]}, "mode 3: not in m.h5. Give one from 1 to 2"),
        ([BARE_MODES], {"mode": [3]}, "m.h5: modes without eigenvectors. Run modes again with them"),
        ([BARE_MODES], {"kind": "mode"}, "m.h5: modes without eigenvectors. Run modes again with them"),
        ([MODES], {"kind": "states"}, "m.h5: 2 modes, not all. Run modes with states or all"),
        ([UNTOLD], {"kind": "states"}, "m.h5: 2 modes, not all. Run modes with states or all"),
        ([MODES] * 2, {"mode": [1]}, "2 modes files: mode pictures show one"),
        ([quasistatic_of([1, 1, 1])], {"mode": [1]}, "a quasistatic file. For mode pictures give modes"),
        ([RESPONSE], {"kind": "response"}, "its packing was in memory"),
        ([quasistatic_of([1, 1, 1], law="stokes")], {"kind": "viscosities"}, "law stokes, without beta"),
        ([lowest_of(1e-4), lowest_of(1e-3, n=64)], {"kind": "lowest-modes"}, "files of several N. Choose one"),
        ([lowest_of(1e-4), lowest_of(1e-3, (10,))], {"kind": "lowest-modes"}, "different numbers of modes"),
        ([lowest_of(1e-4), lowest_of(1e-3, ())], {"kind": "lowest-modes"}, "dataset lowest/count: missing"),
    ],
)  # fmt: skip
def test_what_is_refused(results, asked, says):
    with pytest.raises(InputError, match=says):
        plot(results, **asked)


def test_networks_at_rest_have_pictures_of_their_modes_and_of_their_response():
    assert told(plot([modes_of([1.0, 2.0], pressure=0.0)])[0]) == ["$0$"]
    assert choose_kind(list(pictures()), [quasistatic_of([1, 1, 1], pressure=0.0)], [""]) == "response"
    assert choose_kind(list(pictures()), [quasistatic_of([1, 1, 1])], [""]) == "medians"


def test_modes_of_no_energy_are_left_out():
    (above, *_) = plot([modes_of([3e-32, 1e-2, 4e-2], [1e16, 5.0, 2.0], pressure=0.0)])
    (dots,) = above.collections
    np.testing.assert_allclose(dots.get_offsets(), [(2, 0.1), (3, 0.2)])
    assert (dots.norm.vmin, dots.norm.vmax) == (2.0, 5.0)

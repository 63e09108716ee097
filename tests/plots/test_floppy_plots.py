"""Pictures of quasistatic files and modes, drawn through the command line from files of known content."""

import numpy as np
import pytest
from drawn import Held, bands, bars, figure_of, lines
from samples import published

from jampetsc.analysis.statistics import median_interval
from jampetsc.cli import main as cli
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.reader import load
from jampetsc.io.result_file import ResultWriter
from jampetsc.plots import style
from jampetsc.plots.floppy import plot_medians, plot_viscosities
from jampetsc.plots.vibrations import chosen_modes, density_of_states, plot_lowest, plot_modes, plot_states

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib


def write_quasistatic(path, pressure=1e-3, packing=None, prestress=True, law="contact", n=16, tau1=1.0):
    """Medians that follow BT eqs. 19-21 exactly, half of them with pre-stress; η₀ = √p + β/√p and a field."""
    rng = np.random.default_rng(1)
    attributes = {
        "pressure": pressure,
        "k": 2.0,
        "tau1": tau1,
        "particle_count": n,
        "law": law,
        "beta": 1.0,
        "prestress": prestress,
    }
    with ResultWriter(path, "jampetsc-quasistatic") as writer:
        for prefix in ("", "no_prestress_") if prestress else ("",):
            medians = np.array([pressure**0.25, pressure**-0.25, 2 * pressure**-0.25])
            medians *= 1.0 if prefix or not prestress else 0.5
            names = (f"{prefix}{name}_median" for name in ("normal", "transverse", "nonaffine"))
            attributes |= dict(zip(names, medians, strict=True))
        attributes |= {"eta0": pressure**0.5 + pressure**-0.5, "eta_inf": 0.5}
        writer.dataset("beta_scan/beta", [0.0, 1e-3])
        writer.dataset("beta_scan/eta0", [pressure**0.5, pressure**0.5 + 1e-3 * pressure**-0.5])
        writer.dataset("beta_scan/eta_inf", [0.01, 0.02])
        writer.dataset("particles", np.arange(16))
        writer.dataset("nonaffine", rng.normal(size=(16, 2)))
        writer.dataset("no_prestress/nonaffine", rng.normal(size=(16, 2)))
        if packing is not None:
            attributes |= dict(zip(("packing", "packing_sha256"), read_identified(packing)[1], strict=True))
        writer.attributes(**attributes)
    return str(path)


def write_modes(path, pressure=1e-3, packing=None, complete=True):
    """Thirty modes with ω = 0.05, 0.10, … in units of √(k/m); k = 2."""
    rng = np.random.default_rng(2)
    values = 2.0 * (0.05 * np.arange(1, 31)) ** 2
    with ResultWriter(path, "jampetsc-modes") as writer:
        writer.dataset("eigenvalues", values)
        writer.dataset("floppiness", 5.0 / np.sqrt(values))
        writer.dataset("modes", rng.normal(size=(30, 16, 2)))
        writer.dataset("particles", np.arange(16))
        for name, power in (("nonaffine", 1), ("modulus", 2)):
            writer.dataset(f"cumulative/{name}", np.linspace(0.1, 1, 30) ** power)
        attributes = {"pressure": pressure, "k": 2.0, "complete": complete, "prestress": False}
        if packing is not None:
            attributes |= dict(zip(("packing", "packing_sha256"), read_identified(packing)[1], strict=True))
        writer.attributes(**attributes)
    return str(path)


@pytest.fixture
def packing(tmp_path):
    write_packing(tmp_path / "packing.h5", published())
    return tmp_path / "packing.h5"


def plot(*words):
    return cli.main(["plot", *map(str, words)])


def test_what_lines_of_medians_and_viscosities_are(tmp_path):
    """Filled: without pre-stress, and η₀; open: with it, and η_∞. k = 2 and τ₁ = 4."""
    files = [load(write_quasistatic(tmp_path / f"q{n}.h5", 10.0**-n, tau1=4.0)) for n in (4, 3)]
    p = np.array([5e-5, 5e-4])
    drawn = lines(figure_of(plot_medians, files).axes[0], 2)
    expected = [(2 * p) ** 0.25, (2 * p) ** -0.25, 2 * (2 * p) ** -0.25]
    for number, medians in enumerate(expected):
        bare, stressed = drawn[3 * number : 3 * number + 2]  # the third is the guide
        np.testing.assert_allclose(bare[:2], [p, medians])
        np.testing.assert_allclose(stressed[:2], [p, medians / 2])
        assert (bare[2], stressed[2:]) == ("-", ("--", "white"))
    drawn = lines(figure_of(plot_viscosities, files).axes[0])
    beta = np.array([1e-3, 1.0])
    for number, level in enumerate(2 * p):
        low, high = drawn[2 * number : 2 * number + 2]
        np.testing.assert_allclose(low[:2], [beta, (level**0.5 + beta * level**-0.5) / 8])
        np.testing.assert_allclose(high[:2], [beta, [0.02 / 8, 0.5 / 8]])
        assert (low[2], high[2:]) == ("-", ("--", "white"))


def test_what_lines_of_modes_are(tmp_path):
    above, below = figure_of(plot_modes, [load(write_modes(tmp_path / "m.h5"))]).axes[:2]
    number, share = np.arange(1, 31), np.linspace(0.1, 1, 30)
    np.testing.assert_allclose(above.collections[0].get_offsets(), np.column_stack((number, 0.05 * number)))
    nonaffine, modulus = lines(below, 30)
    np.testing.assert_allclose(nonaffine[:2], [number, share])
    np.testing.assert_allclose(modulus[:2], [number, share**2])
    assert (nonaffine[2], modulus[2]) == ("-", "--")


def test_density_of_states_is_normalised(tmp_path):
    """∫ D dω is the number of modes over that of degrees of freedom: 30 of 32 here, in both files."""
    files = [load(write_modes(tmp_path / f"m{n}.h5")) for n in (1, 2)]
    omega, density = density_of_states(files)
    edges = 10.0 ** (np.round(np.log10(omega) * 8 - 0.5) / 8)
    widths = edges * (10 ** (1 / 8) - 1)
    assert np.sum(density * widths) == pytest.approx(30 / 32, rel=1e-12)
    assert omega.min() > 0.04 and omega.max() < 1.6


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["{modes}", "--mode", "31"], "mode 31: m.h5 holds modes 1 to 30"),
        (["{modes}", "--mode", "x"], "--mode x: write numbers"),
        (["{modes}", "--kind", "states"], "holds 30 modes only: run modes with --all"),
        (["{modes}", "{modes}", "--mode", "1"], "2 modes files: mode pictures show one"),
        (["{quasistatic}", "--mode", "1"], "is a quasistatic"),
        (["{quasistatic}", "--kind", "response"], "its packing was in memory"),
    ],
)
def test_refusals(tmp_path, capsys, words, says):
    names = {
        "modes": write_modes(tmp_path / "m.h5", complete=False),
        "quasistatic": write_quasistatic(tmp_path / "q.h5"),
    }
    out = tmp_path / "out.png"
    assert plot(*(word.format(**names) for word in words), "--out", out) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_viscosities_need_contact_damping(tmp_path):
    stokes = load(write_quasistatic(tmp_path / "q.h5", law="stokes"))
    with pytest.raises(InputError, match="law stokes: has no beta"):
        plot_viscosities([stokes])


def quasistatic_of(medians, size=16, pressure=1e-3, k=1.0, bare=None, **more):
    """A result of which only attributes are there: medians of Δu∥, Δu⊥ and u_na with pre-stress, and without."""
    attributes = {"pressure": k * pressure, "k": k, "tau1": 1.0, "particle_count": size, "law": "contact"}
    attributes |= {"prestress": bare is not None, "beta": 1.0, "eta0": 1.0, "eta_inf": 0.5}
    for prefix, values in (("", medians), *([("no_prestress_", bare)] if bare is not None else [])):
        names = (f"{prefix}{name}_median" for name in ("normal", "transverse", "nonaffine"))
        attributes |= dict(zip(names, values, strict=True))
    return Held({}, attributes | more, "q.h5")


def test_lines_run_through_medians_and_small_points_are_files():
    """Three files to a pressure, one of them far off; guides of ±1/4 through the geometric mean of the bare ones."""
    some = [
        quasistatic_of(0.5 * c * np.arange(1, 4), pressure=p, bare=p * c * np.arange(1, 4))
        for p in (1e-4, 1e-2)
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
        assert guide[2] == ":"
        np.testing.assert_allclose(points[2 * number][1], factor * np.outer(p, [1.0, 1.5, 20.0]).ravel())
        np.testing.assert_allclose(points[2 * number][0], np.repeat(p, 3))
    assert len(points) == 6
    found = bands(ax)
    low, high = median_interval(np.array([1.0, 1.5, 20.0]))
    np.testing.assert_allclose(found[0][1:], [low * p, high * p])
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert told[3:] == ["no pre-stress", "pre-stress", r"$p^{\pm 1/4}$", "single files", "68 % interval"]


def test_the_guide_goes_with_the_largest_packings_and_sizes_have_markers():
    some = [quasistatic_of([n, n, n], n, p) for n in (16, 64) for p in (1e-3, 1e-2)]
    ax = figure_of(plot_medians, some).axes[0]
    guides = [y for _, y, dash, _ in lines(ax, 2) if dash == ":"]
    assert len(guides) == 3
    for y in guides:
        assert np.sqrt(y[0] * y[1]) == pytest.approx(64)
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert told[3:5] == ["$N=16$", "$N=64$"] and "single files" not in told and "68 % interval" not in told


def test_viscosities_are_medians_over_files_in_units_of_k_and_tau1():
    """Own β and those of the scan, but for β = 0; k = 2 and τ₁ = 4."""
    some = []
    for eta in (1.0, 3.0, 50.0):
        one = quasistatic_of([1, 1, 1], k=2.0, eta0=8 * eta, eta_inf=4 * eta, tau1=4.0, beta=0.1)
        one.update(
            {
                "beta_scan/beta": [0.0, 0.01],
                "beta_scan/eta0": [9.0, 0.8 * eta],
                "beta_scan/eta_inf": [9.0, 0.4 * eta],
            }
        )
        some.append(one)
    ax = figure_of(plot_viscosities, some).axes[0]
    (low, high) = lines(ax, 2)
    np.testing.assert_allclose(low[:2], [[0.01, 0.1], [0.3, 3.0]])
    np.testing.assert_allclose(high[:2], [[0.01, 0.1], [0.15, 1.5]])
    limits = np.transpose(
        [median_interval(np.array([0.1, 0.3, 5.0])), median_interval(np.array([1.0, 3.0, 50.0]))]
    )
    np.testing.assert_allclose(bands(ax)[0][1:], limits)
    legend = ax.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [
        "$10^{-3}$",
        r"$\eta_0$",
        r"$\eta_\infty$",
        "68 % interval",
    ]
    other = quasistatic_of([1, 1, 1], 64)
    legend = figure_of(plot_viscosities, [some[0], other]).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()][:2] == ["$10^{-3}$, $N=16$", "$10^{-3}$, $N=64$"]


def modes_of(values, floppiness=None, pressure=1e-3, **more):
    """A result with these eigenvalues of 4 disks."""
    arrays = {"eigenvalues": np.array(values), "particles": np.arange(4)}
    arrays["floppiness"] = np.ones(len(values)) if floppiness is None else np.array(floppiness)
    return Held(arrays, {"pressure": pressure, "k": 1.0, "complete": True} | more, "m.h5")


def test_modes_keep_their_numbers_where_some_have_no_frequency():
    """Of λ = −1, 0, 4, 16 in k = 4 the third and fourth are shown, coloured by floppiness; infinite is the largest."""
    one = modes_of([-4.0, 0.0, 4.0, 16.0], [1.0, 10.0, 5.0, np.inf], k=4.0)
    fig = figure_of(plot_modes, [one])
    fig.draw_without_rendering()  # which gives points their colours
    shown = fig.axes[0].collections[0]
    np.testing.assert_allclose(shown.get_offsets(), [(3, 1.0), (4, 2.0)])
    colours = shown.get_facecolors()
    np.testing.assert_allclose(colours[0], style.sequential()(np.log10(5.0)))
    np.testing.assert_allclose(colours[1], style.sequential()(1.0))
    assert fig.axes[2].get_ylim() == pytest.approx((1.0, 10.0)) and not lines(fig.axes[1], 4)
    titles = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert titles == [r"$2.5\times10^{-4}$"]


def write_lowest(path, pressure, count=(10, 50), n=16):
    """Modes of known floppiness, shares and medians: all of them numbers times powers of p."""
    m = 60
    with ResultWriter(path, "jampetsc-modes") as writer:
        writer.dataset("eigenvalues", np.linspace(1e-3, 1.0, m))
        writer.dataset("transverse", np.full(m, 4.0 / pressure))
        writer.dataset("normal", np.ones(m))
        writer.dataset("lowest/count", np.array(count))
        for row, name in enumerate(("normal", "transverse", "nonaffine"), 1):
            writer.dataset(f"cumulative/{name}", row * np.arange(1, m + 1) / 1000)
            writer.dataset(f"lowest/{name}_median", row * pressure * np.arange(1.0, len(count) + 1))
        medians = {f"{name}_median": 5.0 * pressure for name in ("normal", "transverse", "nonaffine")}
        writer.attributes(pressure=pressure, k=2.0, particle_count=n, **medians)
    return load(path)


def test_what_the_lowest_modes_carry_against_pressure(tmp_path):
    p = np.array([1e-4, 1e-2])
    files = [write_lowest(tmp_path / f"{x}-{seed}.h5", x) for x in p for seed in (0, 1)]
    floppy, share, medians = figure_of(plot_lowest, files).axes[:3]
    for x, y, *_ in bars(floppy):
        np.testing.assert_allclose(x, p / 2)
        np.testing.assert_allclose(y, 2 / np.sqrt(p))
    levels = [row * count / 1000 for row in (1, 2, 3) for count in (10, 50)]
    for (_, y, *_), level in zip(bars(share), levels, strict=True):
        np.testing.assert_allclose(y, level)
    for (_, y, *_), times in zip(
        bars(medians), [5, 2, 5, 4, 5, 6], strict=True
    ):  # whole, then by 50 modes alone
        np.testing.assert_allclose(y, times * p)
    for other, message in (
        (write_lowest(tmp_path / "n.h5", 1e-3, n=64), "files of several N: choose one"),
        (write_lowest(tmp_path / "c.h5", 1e-3, (10,)), "files with other numbers of modes"),
        (write_lowest(tmp_path / "o.h5", 1e-3, ()), "does not tell what its modes carry of slow shear"),
    ):
        with pytest.raises(InputError, match=message):
            plot_lowest([files[0], other])


def test_titles_of_modes_are_their_own_eigenvalues():
    one = modes_of([1e-3, 1e-2, -1.0])
    one["modes"] = np.zeros((3, 4, 2))
    one.stored = lambda name: one[name]
    titles = [title for title, _ in chosen_modes(one, [2, 1, 3])]
    assert titles == [
        r"mode 2, $\lambda/k=10^{-2}$",
        r"mode 1, $\lambda/k=10^{-3}$",
        r"mode 3, $\lambda/k=0$",
    ]


def test_states_are_pooled_by_pressure():
    """Of two files at one pressure and one at another; per degree of freedom of all disks that are no rattlers."""
    some = [modes_of(values, pressure=p) for values, p in (([1.0, 1.1], 1e-2), ([1.0], 1e-3), ([1.05], 1e-3))]
    ax = figure_of(plot_states, some).axes[0]
    drawn = lines(ax)
    for (x, y, *_), pooled in zip(drawn, ([some[1], some[2]], [some[0]]), strict=True):
        np.testing.assert_allclose((x, y), density_of_states(pooled))
    width = 10 ** (1 / 8) - 1
    np.testing.assert_allclose(drawn[1][1], [2 / 8 / width])
    np.testing.assert_allclose(drawn[0][1], [2 / 16 / width])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["$10^{-3}$", "$10^{-2}$"]

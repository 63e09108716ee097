"""Pictures: drawn from real files through the command line, and what must be right about them."""

import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import samples
from picture_contents import bands, drawn_by, figure_of, held, lines, require_arrows, told, with_arrays
from samples import stored
from test_picture_limits import curve

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.plots import cell_drawing
from jampetsc.plots.curves import group_curves
from jampetsc.plots.draw import draw, pictures, table_rows
from jampetsc.plots.field_plots import ARROWS, plot_fields, spaced_rows
from jampetsc.plots.moduli_plots import plot_collapse, plot_moduli
from jampetsc.plots.packing_plots import draw_panels, find_touching, flow_panel, plot_packing
from jampetsc.plots.style import LOSS, STORAGE, sequential

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = np.geomspace(1e-8, 1e3, 45)
LAWS = (r"contact, $\beta=1$", r"Stokes, $\eta_F=0$")


def modulus(omega, pressure):
    """G*(ω) much like that of a packing: √p, then √ω, then a plateau and a dashpot."""
    rates = np.geomspace(pressure, 1.0, 50)
    s = 1j * np.asarray(omega)[:, None]
    weights = 0.3 * np.sqrt(rates) * np.gradient(np.log(rates))
    return 0.5 * np.sqrt(pressure) + 0.3 * s[:, 0] + np.sum(weights * s / (s + rates), axis=1)


def sweep_of(
    pressure=1e-3, omega=OMEGA, G=None, bound=1e-9, packing=None, fields=None, path=None, **attributes
):
    """A sweep in memory, or a file of it; fields is (omega, displacement, rotation or None, particles)."""
    arrays = {"omega": omega, "G": modulus(omega, pressure) if G is None else G}
    arrays |= {"error_bound": np.full(len(omega), bound)}
    attributes = {"law": "contact", "beta": 1.0, "pressure": pressure, "k": 1.0, "tau1": 1.0} | attributes
    if packing is not None:
        attributes |= dict(zip(("packing", "packing_sha256"), read_identified(packing)[1], strict=True))
    if fields is not None:
        names = ("fields/omega", "fields/displacement", "fields/rotation", "particles")
        arrays |= {name: values for name, values in zip(names, fields, strict=True) if values is not None}
    return stored(path, "sweep", arrays, **attributes)


def write_sweep(path, *what, **more):
    """A file of a sweep: `sweep_of`."""
    return str(sweep_of(*what, path=path, **more))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three sweeps, a packing, a sweep with fields of it, and what cannot be drawn; nobody changes them."""
    folder = tmp_path_factory.mktemp("drawn")
    for n in (2, 3, 4):
        write_sweep(folder / f"p{n}.h5", 10.0**-n)
    write_packing(folder / "packing.h5", samples.published())
    write_fields(folder)
    write_sweep(folder / "none.h5", G=np.full(45, np.nan))
    stored(folder / "modes.h5", "modes", {"eigenvalues": np.ones(3)})
    ones = np.ones((6, 16, 2), complex)
    (folder / "taken.png").mkdir()
    for name, omega, particles in (
        ("few", OMEGA[:1], np.arange(15)),
        ("beyond", OMEGA[:1], np.arange(1, 17)),
        ("many", np.geomspace(1e-3, 1, 6), np.arange(16)),
    ):
        fields = (omega, ones[: len(omega)], None, particles)
        write_sweep(folder / f"{name}.h5", packing=folder / "packing.h5", fields=fields)
    return folder


@pytest.fixture
def with_fields(tmp_path):
    """A sweep with fields, beside its packing, to be moved about."""
    write_packing(tmp_path / "packing.h5", samples.published())
    return write_fields(tmp_path)


def write_fields(folder):
    """A sweep with fields at four frequencies of fifteen of the sixteen disks, beside its packing."""
    rng = np.random.default_rng(1)
    u = rng.normal(size=(4, 15, 2)) + 1j * rng.normal(size=(4, 15, 2))
    fields = (np.array([1e-6, 1e-4, 10**-1.5, 1.0]), u, u[..., 0] * 1e-3, np.arange(1, 16))
    return write_sweep(folder / "fields.h5", packing=folder / "packing.h5", fields=fields)


def plot(*words):
    assert cli.dispatch(["plot", *map(str, words)]) == 0


@pytest.mark.parametrize(
    ("words", "ending", "begins"),
    [
        ("p2.h5 p3.h5 p4.h5", ".svg", b"<?xml"),
        ("packing.h5", ".pdf", b"%PDF"),
        ("fields.h5 --kind fields", ".png", b"\x89PNG"),
    ],
)
def test_every_format_is_twice_the_same_whatever_matplotlibrc_says(
    words, ending, begins, folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(folder)
    for name, settings in (
        ("a", {}),
        ("b", {"font.size": 30, "lines.linewidth": 9, "svg.hashsalt": "other"}),
    ):
        with matplotlib.rc_context(settings):
            plot(*words.split(), "--out", tmp_path / f"{name}{ending}")
    one, other = (path.read_bytes() for path in sorted(tmp_path.iterdir()))  # and nothing else is there
    assert one == other and one.startswith(begins)
    assert not [word for word in (b"CreationDate", b"dc:date", b"Software") if word in one]
    assert capsys.readouterr().out.startswith(str(tmp_path / f"a{ending}: "))


@pytest.mark.parametrize(
    ("files", "options", "says"),
    [
        ("p2 p3 p4", {}, "G' and G'' of 3 sweeps"),
        ("packing", {}, "packing of 16 disks"),
        ("p2 p3 p4", {"mu": 0.4}, "collapse of 3 sweeps with mu = 0.4, lambda = 1"),
        ("p2 p3 p4", {"lambda": 0.9}, "collapse of 3 sweeps with mu = 0.5, lambda = 0.9"),
        ("fields", {"omega": [1e-6, 1.0]}, "fields at omega tau1 = 1e-06, 1"),
        ("fields", {"omega": [0.0316, 1.0]}, "fields at omega tau1 = 0.0316228, 1"),  # as people write it
        ("many", {"phase": "strain"}, "fields at omega tau1 = 0.001, "),  # four of them
    ],
)
def test_the_kind_follows_from_files_and_options(files, options, says, folder):
    assert says in draw([folder / f"{name}.h5" for name in files.split()], **options).text


@pytest.mark.parametrize("kind", ["moduli", "collapse"])
def test_units_of_the_file_do_not_show(kind):
    """k = 4 and τ₁ = 2 scale a sweep exactly; in units of k and 1/τ₁ it is the same picture."""
    plain = sweep_of(pressure=2.0**-10)
    scaled = sweep_of(2.0**-8, OMEGA / 2, 4 * plain["G"], bound=4e-9, k=4.0, tau1=2.0)
    assert table_rows([jampetsc.plot(plain, kind)]) == table_rows([jampetsc.plot(scaled, kind)])


@pytest.mark.parametrize(
    "case",
    [
        {"omega": np.array([1e-3, 1e-2, 0.1, 1.0, 10.0])},
        {"omega": np.array([0.5])},
        {"omega": np.geomspace(1e-10, 1e4, 141)},
        {"G": np.where(OMEGA < 1e-4, -0.01, 0.1) + 1j * OMEGA},  # unstable: G' < 0 at low frequency
        {"G": np.where(OMEGA < 1e-4, np.nan, 0.1 + 1j * OMEGA)},  # some frequencies failed
        {"omega": np.r_[OMEGA, OMEGA[7] * (1 + 1e-12)]},  # a grid and a list that meet
        {"bound": 0.05},  # wider than the curve itself at low frequency
        {"law": "stokes", "beta": None, "eta_f": 0.0, "G": 0.1 + 1j * OMEGA / (1 + OMEGA**2)},
    ],
)
def test_unusual_sweeps_are_drawn_without_complaint(case, recwarn):
    figure_of(plot_moduli, sweep_of(**case)).draw_without_rendering()
    assert not [str(w.message) for w in recwarn]


@pytest.mark.parametrize(
    ("differing", "labels"),
    [
        ([{"beta": 10.0}, {"beta": 0.0}], [r"$\beta=0$", r"$\beta=10$"]),
        ([{"prestress": True}, {"prestress": False}], ["no pre-stress", "pre-stress"]),
        ([{"rotations": True}, {"law": "stokes", "beta": None, "eta_f": 1.0}],
         [r"contact, $\beta=1$", r"Stokes, $\eta_F=1$"]),
        ([{"beta": 1.0}, {"pressure": 1e-2, "beta": 2.0}], [r"$p/k=10^{-3}$, $\beta=1$", r"$p/k=10^{-2}$, $\beta=2$"]),
        ([{"alpha": 0.5, "stress": 1e-6}, {}], [r"$\alpha=0.5$, $\sigma_0/k=10^{-6}$", "linear damping"]),
        ([{"normal": 0.0}, {}], [r"$w_\parallel=0$", r"$w_\parallel=1$"]),  # a file older than --normal has 1
        ([{"pressure": None}], ["$p$ unknown"]),
        ([{"load": "compression"}, {}], ["load compression", "shear xy"]),
    ],
)  # fmt: skip
def test_labels_tell_what_differs(differing, labels):
    title, groups = group_curves([curve(**{"law": "contact", "beta": 1.0} | more) for more in differing])
    assert title == "" and [group.label for group in groups] == labels


def test_laws_at_several_pressures_share_their_colours_and_each_law_has_a_marker():
    laws = ({"law": "contact", "beta": 1.0}, {"law": "stokes", "beta": None, "eta_f": 0.0})
    some = [curve(pressure=p, **law) for law in laws for p in (1e-3, 1e-2)]
    groups = {group.label: group for group in group_curves(some)[1]}
    low, high = [[f"$p/k=10^{{{n}}}$, {law}" for law in LAWS] for n in (-3, -2)]
    look = {label: (group.colour, group.marker, group.dash) for label, group in groups.items()}
    for one, other in (low, high):
        assert look[one][0] == look[other][0] and look[one][1] != look[other][1] and look[one][2] == "-"
    assert [part[0] for part in map(look.get, low)] != [part[0] for part in map(look.get, high)]
    legend = figure_of(plot_moduli, some).axes[0].get_legend()
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["$p/k=10^{-3}$", "$p/k=10^{-2}$", *LAWS, STORAGE, LOSS]
    told_apart = [(line.get_marker(), line.get_linestyle()) for line in legend.get_lines()]
    assert told_apart[2:5] == [("o", "None"), ("s", "None"), ("None", "-")]
    assert all(
        group.parts == () for group in group_curves(some[1:3])[1]
    )  # a pressure each: nothing is shared


def test_many_values_of_one_parameter_have_a_colour_bar():
    """Their logarithm is the colour; 0, which has none, is grey and keeps its entry."""
    betas = [0.0, *np.logspace(-6, 1, 8)]
    some = [curve(law="contact", beta=beta) for beta in betas]
    ax, bar = figure_of(plot_moduli, some).axes
    assert bar.get_ylabel() == r"$\beta$" and bar.get_ylim() == pytest.approx((1e-6, 10.0))
    assert told(ax) == [r"$\beta=0$", STORAGE, LOSS]
    colours = [group.colour for group in group_curves(some)[1]]
    np.testing.assert_allclose(colours[1:], sequential()(np.linspace(0.0, 1.0, 8)), atol=0.02)
    assert len(set(colours[0][:3])) == 1 and bar.get_yscale() == "log"
    assert len(figure_of(plot_moduli, some[:7]).axes) == 1  # few have a legend
    both = [curve(law="contact", beta=beta, pressure=p) for beta in betas[1:6] for p in (1e-3, 1e-2)]
    assert len(figure_of(plot_moduli, both).axes) == 1  # two parameters differ


def oscillation(omega, amplitude, **attributes):
    """Strains imposed, k = 2, τ₁ = 4: G*/k = 1 + 2i, 3 + 4i, … frequency by frequency of each amplitude."""
    number = np.arange(len(amplitude) * len(omega)).reshape(len(amplitude), -1)
    G = (1 + 2j + (2 + 2j) * number) * 2.0
    arrays = {"omega": np.array(omega), "amplitude": np.array(amplitude), "G": G, "error": 0.1 * G.imag}
    facts = {"law": "contact", "beta": 1.0, "alpha": 0.5, "contacts": "moving", "control": "strain"}
    facts |= {"pressure": 2e-3, "k": 2.0, "tau1": 4.0}
    return held(arrays, facts | attributes, format="jampetsc-oscillate")


def test_oscillations_are_drawn_over_the_frequency_beside_sweeps_or_over_the_amplitude():
    both = [oscillation([1e-3, 1e-2], [0.1, 0.2]), sweep_of()]
    ax = figure_of(plot_moduli, both).axes[0]
    labels = [
        r"$\alpha=0.5$, $\gamma_0=0.1$, moving contacts",
        r"$\alpha=0.5$, $\gamma_0=0.2$, moving contacts",
    ]
    assert told(ax)[:3] == [*labels, "linear damping, linear response"]
    drawn = [line[:2] for line in lines(ax, 2)]
    np.testing.assert_allclose(drawn, [([4e-3, 4e-2], y) for y in ((1, 3), (2, 4), (5, 7), (6, 8))])
    failed = oscillation([1e-3], [0.1, 0.2, 0.3])
    failed = with_arrays(failed, {"G": [[np.nan], *failed["G"][1:]]})
    ax = figure_of(plot_moduli, [failed]).axes[0]
    assert (ax.get_xlabel(), told(ax)[0]) == (r"$\gamma_0$", "$10^{-3}$")
    np.testing.assert_allclose(
        [line[:2] for line in lines(ax, 2)], [([0.2, 0.3], y) for y in ((3, 5), (4, 6))]
    )
    np.testing.assert_allclose(bands(ax)[0][1:], [(2.6, 4.4), (3.4, 5.6)])
    stressed = oscillation([1e-3], [0.1, 0.2], control="stress")
    assert figure_of(plot_moduli, [stressed]).axes[0].get_xlabel() == r"$\sigma_0/k$"
    assert figure_of(plot_moduli, [stressed, failed]).axes[0].get_xlabel() == r"$\omega\tau_1$"


def test_two_sweeps_in_memory_are_two():
    one = sweep_of()
    assert jampetsc.plot([one, sweep_of(1e-2)]).get_lines()
    with pytest.raises(InputError, match="sweep in memory: given twice"):
        jampetsc.plot([one, one])


def test_sweeps_of_one_pressure_share_a_label():
    title, groups = group_curves([curve(pressure=p) for p in (1e-2, 1e-4, 1.0000001e-4, 1e-3)])
    assert title == "$p/k$" and [len(group.curves) for group in groups] == [2, 1, 1]
    assert [group.label for group in groups] == ["$10^{-4}$", "$10^{-3}$", "$10^{-2}$"]


def test_both_moduli_with_their_bounds_are_drawn_and_collapsed():
    """G' solid and filled, G'' dashed and open, each in its own band."""
    G, p = modulus(OMEGA, 4e-4), 4e-4
    one = replace(curve(pressure=p, omega=OMEGA, G=G), bounds=np.stack((0.1 * G.real, 0.2 * G.imag)))
    for plot, x, unit in ((plot_moduli, OMEGA, 1.0), (plot_collapse, OMEGA / p, p**0.5)):
        low = slice(None) if plot is plot_moduli else OMEGA <= 1.0
        ax = figure_of(plot, [one]).axes[0]
        storage, loss = lines(ax, len(x[low]))[:2]
        assert (storage[2], loss[2:]) == ("-", ("--", "white")) and storage[3] != "white"
        for drawn, band, part, share in zip(
            (storage, loss), bands(ax), (G.real, G.imag), (0.1, 0.2), strict=True
        ):
            expected = part[low] / unit
            np.testing.assert_allclose(drawn[:2], [x[low], expected])
            np.testing.assert_allclose(band[1:], [(1 - share) * expected, (1 + share) * expected])


def luminance(colour):
    r, g, b = (x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in colour[:3])
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def test_colours_grow_lighter_with_pressure_and_stay_visible_on_white():
    _, groups = group_curves([curve(pressure=p) for p in np.geomspace(1e-5, 1e-1, 5)])
    shades = [luminance(g.colour) for g in groups]
    assert (np.diff(shades) > 0.02).all()
    assert shades[-1] < 0.65
    assert 1.05 / (shades[-1] + 0.05) >= 3  # contrast with white, as WCAG 2 asks of graphics


@pytest.mark.parametrize("cell", [np.array([[4.0, 0.0], [a, 3.0]]) for a in (0.0, 1.3, -2.0)])
def test_what_leaves_the_cell_comes_in_on_the_other_side(cell):
    """Every point of every disk and segment, folded into the cell, lies on a drawn image, also across a corner."""
    rng = np.random.default_rng(7)
    starts, radii = cell_drawing.wrap(rng.uniform(-20, 20, (40, 2)), cell), rng.uniform(0.1, 0.6, 40)
    vectors, turns = rng.uniform(-1.2, 1.2, (40, 2)), np.linspace(0, 2 * np.pi, 60)
    rims = radii[:, None, None] * np.column_stack((np.cos(turns), np.sin(turns)))
    along = vectors[:, None] * np.linspace(0, 1, 23)[:, None]
    for (rows, anchors), points in (
        (cell_drawing.disk_images(starts, radii, cell), rims),
        (cell_drawing.segment_images(starts, vectors, cell), along),
    ):
        assert len({(row, *np.round(anchor, 9)) for row, anchor in zip(rows, anchors, strict=True)}) == len(
            rows
        )
        for row, offsets in enumerate(points):
            folded = cell_drawing.wrap(starts[row] + offsets, cell)
            images = anchors[rows == row][:, None] + offsets
            assert np.linalg.norm(images - folded, axis=2).min(axis=0).max() < 1e-9


def test_lines_are_as_wide_as_forces_are_strong_and_the_caption_is_in_units_of_k():
    disks = samples.published()
    stiff = disks.replace(potential=Potential(k=4.0))
    figures = [figure_of(plot_packing, one) for one in (disks, stiff)]
    captions = [one.axes[0].get_xlabel() for one in figures]
    assert captions[0] == captions[1] and "p/k=" in captions[0]
    contacts, frame = measure(disks).contacts, figures[0].axes[0].patches[0].get_xy()
    room = np.ptp(figures[0].axes[0].get_xlim()) / np.ptp(frame[:, 0])
    assert room == pytest.approx(1.02)  # for the line of the frame
    drawn = figures[0].axes[0].collections[1]
    vectors = np.array([end - begin for begin, end in drawn.get_segments()])
    which = [int(np.linalg.norm(contacts.r - one, axis=1).argmin()) for one in vectors]
    assert set(which) == set(range(len(contacts)))
    widths = np.array(drawn.get_linewidths())
    np.testing.assert_allclose(widths / widths.mean(), contacts.force[which] / contacts.force[which].mean())


@pytest.mark.parametrize(("load", "E"), [("xy", ((0, 1), (0, 0))), ("compression", ((0.5, 0), (0, 0.5)))])
def test_arrows_are_the_field_at_peak_and_at_zero_stress_with_its_affine_part(load, E):
    """Re and −Im of (E x + ũ/γ)/G*, but for |G*|, times what is told; x from the middle of the cell."""
    disks, rng = samples.published(), np.random.default_rng(3)
    u = 0.01 * (rng.normal(size=(1, 16, 2)) + 2j * rng.normal(size=(1, 16, 2)))
    sweep = sweep_of(fields=(OMEGA[24:25], u, u[..., 0], np.arange(16)), load=load)
    sweep.packing = disks
    turn = np.exp(-1j * np.angle(modulus(OMEGA, 1e-3)[24]))
    centres = cell_drawing.wrap(disks.positions, disks.cell) - disks.cell.sum(axis=0) / 2
    total = u[0] + centres @ np.transpose(E)
    motion, spin = turn * total, turn * u[0, :, 0]
    axes = plot_fields([sweep], total=True)
    for ax, name, take in zip(axes, ("peak", "zero"), (np.real, lambda z: -np.imag(z)), strict=True):
        faces = ax.collections[0]
        assert f"$u$ at {name} stress" in ax.get_title()
        require_arrows(ax, take(motion))
        turned = take(spin) / np.sqrt(np.mean(take(spin) ** 2))
        rows = cell_drawing.disk_images(
            cell_drawing.wrap(disks.positions, disks.cell), disks.radii, disks.cell
        )[0]
        np.testing.assert_allclose(faces.get_array(), turned[rows])


def test_rattlers_are_hollow_walls_dark_and_both_are_told():
    disks = samples.published()
    radii = disks.radii * np.where(np.arange(16) == 5, 0.5, 1.0)
    disks = Packing.from_positions(disks.positions, radii, disks.cell)
    rows = cell_drawing.disk_images(cell_drawing.wrap(disks.positions, disks.cell), disks.radii, disks.cell)[
        0
    ]
    state, loose = measure(disks), disks.replace(record={"walls": 3})
    flow = drawn_by(lambda page: draw_panels(page, [flow_panel("", loose)]))
    for fig, hollow, walls in (
        (figure_of(plot_packing, disks), state.rattlers, 0), (flow, find_touching(loose)[2], 3)
    ):  # fmt: skip
        ax = fig.axes[0]
        shades = np.where(rows < walls, 0.45, np.where(hollow[rows], 1.0, 0.88))
        np.testing.assert_allclose(ax.collections[0].get_facecolors()[:, 0], shades)
        told = ax.get_xlabel()
        assert ("dark: walls" in told) == bool(walls) and f"$N={disks.n - walls}$" in told
        assert ("hollow: " in told) == hollow.any()
        assert not any(
            spine.get_visible() for spine in ax.spines.values()
        )  # the cell has an outline of its own


def test_arrows_spread_evenly_when_there_are_too_many_disks():
    rng = np.random.default_rng(9)
    cell = np.array([[120.0, 0.0], [30.0, 60.0]])
    points = rng.uniform(0, 1, (20000, 2)) @ cell
    rows = spaced_rows(points, cell)
    assert 0.8 * ARROWS < len(rows) <= ARROWS
    assert len(np.unique(rows)) == len(rows)
    quarters = np.floor((points[rows] @ np.linalg.inv(cell)) * 4).astype(int)
    counts = np.bincount(quarters[:, 0] * 4 + quarters[:, 1], minlength=16)
    assert counts.max() < 1.3 * counts.min()
    assert len(spaced_rows(points[:100], cell)) == 100


def test_many_disks_make_a_small_vector_file(tmp_path):
    rng = np.random.default_rng(10)
    side = 80
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    disks = Packing.from_positions(
        grid + rng.normal(0, 0.01, grid.shape), np.full(side**2, 0.51), np.eye(2) * side
    )
    write_packing(tmp_path / "large.h5", disks)
    plot(tmp_path / "large.h5", "--out", tmp_path / "large.pdf")
    content = (tmp_path / "large.pdf").read_bytes()
    assert b"/Subtype /Image" in content


def test_the_packing_of_a_sweep(with_fields, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    moved, beside = tmp_path / "elsewhere" / "moved.h5", tmp_path / "packing.h5"
    beside.rename(moved)
    with pytest.raises(InputError, match=r"its packing packing\.h5 is not beside it\. Give it with packing"):
        draw([with_fields], "fields")
    assert "fields at" in draw([with_fields], packing=moved).text
    write_packing(beside, samples.published("hertzian"))
    with pytest.raises(
        InputError, match=r"packing\.h5: not the packing that fields\.h5 was made from \(sha256"
    ):
        draw([with_fields], "fields")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("few.h5 --kind fields", "dataset particles: shape .15,., must be .n,. with n = 16"),
        ("beyond.h5 --kind fields", "dataset particles: not rows of the 16 particles"),
        ("many.h5 --omega 1e-3:1:6 --phase strain", "6 frequencies: one picture holds 5"),
        ("none.h5", "none.h5: no modulus at any frequency"),
    ],
)
def test_what_cannot_be_drawn(words, message, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises(InputError, match=message) as caught:
        plot("--out", "x.png", *words.split())
    assert "\n" not in str(caught.value)
    assert not list(folder.glob("*x.png*"))


def test_the_help_lists_all_kinds(capsys):
    with pytest.raises(SystemExit):
        cli.main(["plot", "--help"])
    text = "".join(capsys.readouterr().out.split())
    assert f"({','.join(pictures())})" in text


def test_plotting_loads_no_mpi_no_petsc_and_needs_no_display(with_fields, tmp_path):
    script = (
        "import sys; from jampetsc import main as cli\n"
        "import jampetsc.io.reader, jampetsc.plots.flow_plots\n"
        "assert 'numba' not in sys.modules, 'a third of a second for a compiler that reading does not need'\n"
        "status = cli.main(sys.argv[1:])\n"
        "unwanted = ('petsc4py', 'slepc4py', 'mpi4py', 'matplotlib.pyplot', 'tkinter')\n"
        "bad = [name for name in unwanted if name in sys.modules]\n"
        "sys.exit(str(bad) if bad or status else 0)"
    )
    words = ["plot", with_fields, "--kind", "fields", "--out", str(tmp_path / "b.png")]
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

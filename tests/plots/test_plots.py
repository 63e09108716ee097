"""Pictures: drawn from real files through the command line, and what must be right about them."""

import re
import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import samples
from drawn import bands, drawn_by, figure_of, lines

import jampetsc
from jampetsc.cli import main as cli
from jampetsc.core.disks import Disks
from jampetsc.core.potentials import Potential
from jampetsc.core.state import measure
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.reader import load
from jampetsc.io.result_file import ResultWriter
from jampetsc.plots import periodic
from jampetsc.plots.curves import Curve, group_curves
from jampetsc.plots.draw import choose
from jampetsc.plots.fields import ARROWS, _colours, _spread, plot_fields
from jampetsc.plots.moduli import plot_collapse, plot_moduli
from jampetsc.plots.numbers import table
from jampetsc.plots.packing import _draw, flowing, plot_packing, touching

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = np.geomspace(1e-8, 1e3, 45)


def modulus(omega, pressure):
    """G*(ω) much like that of a packing: √p, then √ω, then a plateau and a dashpot."""
    rates = np.geomspace(pressure, 1.0, 50)
    s = 1j * np.asarray(omega)[:, None]
    weights = 0.3 * np.sqrt(rates) * np.gradient(np.log(rates))
    return 0.5 * np.sqrt(pressure) + 0.3 * s[:, 0] + np.sum(weights * s / (s + rates), axis=1)


def write_sweep(
    path, pressure=1e-3, omega=OMEGA, G=None, bound=1e-9, packing=None, fields=None, **attributes
):
    """A sweep file; fields is (omega, displacement, rotation or None, particles)."""
    G = modulus(omega, pressure) if G is None else G
    with ResultWriter(path, "jampetsc-sweep") as writer:
        for name, values in (("omega", omega), ("G", G), ("error_bound", np.full(len(omega), bound))):
            writer.dataset(name, values)
        attributes = {"law": "contact", "beta": 1.0, "pressure": pressure, "k": 1.0, "tau1": 1.0} | attributes
        if packing is not None:
            attributes |= dict(zip(("packing", "packing_sha256"), read_identified(packing)[1], strict=True))
        writer.attributes(**attributes)
        if fields is not None:
            writer.dataset("fields/omega", fields[0])
            writer.dataset("fields/displacement", fields[1])
            if fields[2] is not None:
                writer.dataset("fields/rotation", fields[2])
            writer.dataset("particles", fields[3])
    return str(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three sweeps, a packing, a sweep with fields of it, and what cannot be drawn; nobody changes them."""
    folder = tmp_path_factory.mktemp("drawn")
    for n in (2, 3, 4):
        write_sweep(folder / f"p{n}.h5", 10.0**-n)
    write_packing(folder / "packing.h5", samples.published())
    write_fields(folder)
    write_sweep(folder / "negative.h5", -0.1, G=modulus(OMEGA, 0.1))
    write_sweep(folder / "bare.h5", None, G=modulus(OMEGA, 0.1))
    write_sweep(folder / "fast.h5", omega=np.geomspace(10, 100, 5))
    with ResultWriter(folder / "modes.h5", "jampetsc-modes") as writer:
        writer.dataset("eigenvalues", np.ones(3))
    return folder


@pytest.fixture
def sweeps(folder):
    return [str(folder / f"p{n}.h5") for n in (2, 3, 4)]


@pytest.fixture
def packing(tmp_path):
    write_packing(tmp_path / "packing.h5", samples.published())
    return str(tmp_path / "packing.h5")


@pytest.fixture
def with_fields(tmp_path, packing):
    return write_fields(tmp_path)


def write_fields(folder):
    """A sweep with fields at four frequencies of fifteen of the sixteen disks, beside its packing."""
    rng = np.random.default_rng(1)
    u = rng.normal(size=(4, 15, 2)) + 1j * rng.normal(size=(4, 15, 2))
    fields = (np.array([1e-6, 1e-4, 10**-1.5, 1.0]), u, u[..., 0] * 1e-3, np.arange(1, 16))
    return write_sweep(folder / "fields.h5", packing=folder / "packing.h5", fields=fields)


def plot(*words):
    assert cli.dispatch(["plot", *map(str, words)]) == 0


@pytest.mark.parametrize(("kind", "ending"), [("moduli", ".svg"), ("packing", ".pdf"), ("fields", ".png")])
def test_every_kind_in_every_format_twice_the_same(
    kind, ending, sweeps, packing, with_fields, tmp_path, capsys
):
    files = {"packing": [packing], "fields": [with_fields]}.get(kind, sweeps)
    pictures = []
    for name in ("first", "second"):
        plot(*files, "--kind", kind, "--out", tmp_path / f"{name}{ending}")
        pictures.append((tmp_path / f"{name}{ending}").read_bytes())
    assert pictures[0] == pictures[1]
    assert pictures[0].startswith({".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[ending])
    assert not [word for word in (b"CreationDate", b"dc:date", b"Software") if word in pictures[0]]
    assert capsys.readouterr().out.startswith(str(tmp_path / f"first{ending}: "))
    assert not list(tmp_path.glob("*.partial"))


def test_the_kind_follows_from_files_and_options(sweeps, packing, with_fields, tmp_path, capsys):
    cases = {
        "G' and G'' of 3 sweeps": sweeps,
        "packing of 16 disks": [packing],
        "collapse of 3 sweeps with mu = 0.4, lambda = 1": [*sweeps, "--mu", "0.4"],
        "collapse of 3 sweeps with mu = 0.5, lambda = 0.9": [*sweeps, "--lambda", "0.9"],
        "fields at omega tau1 = 1e-06, 1": [with_fields, "--omega", "1e-6,1"],
    }
    for expected, words in cases.items():
        plot(*words, "--out", tmp_path / "x.png")
        assert expected in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["moduli", "collapse"])
def test_units_of_the_file_do_not_show(kind, tmp_path):
    """k = 4 and τ₁ = 2 scale a sweep exactly; in units of k and 1/τ₁ it is the same picture."""
    plain = write_sweep(tmp_path / "plain.h5", 2.0**-10)
    scaled = write_sweep(
        tmp_path / "scaled.h5", 2.0**-8, OMEGA / 2, 4 * modulus(OMEGA, 2.0**-10), bound=4e-9, k=4.0, tau1=2.0
    )
    shown = [table([jampetsc.plot(path, kind=kind)]) for path in (plain, scaled)]
    for one, other in zip(*shown, strict=True):
        assert one | {"series": ""} == other | {"series": ""}


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
def test_unusual_sweeps_are_drawn_without_complaint(case, tmp_path, recwarn):
    figure_of(plot_moduli, load(write_sweep(tmp_path / "sweep.h5", **case))).draw_without_rendering()
    assert not [str(w.message) for w in recwarn]


def test_a_modulus_that_cannot_be_shown(tmp_path):
    for G, message in ((np.full(45, np.nan), "no modulus at any"), (np.full(45, -1 - 1j), "nothing to show")):
        path = write_sweep(tmp_path / "sweep.h5", G=G)
        with pytest.raises(InputError, match=message):
            plot(path, "--out", tmp_path / "x.png")


def curve(pressure, **attributes):
    G = modulus(OMEGA, pressure or 1e-3)
    return Curve(
        "a.h5", OMEGA, G, np.zeros((2, len(OMEGA))), pressure, {"law": "contact", "beta": 1.0} | attributes
    )


def test_labels_tell_what_differs():
    title, groups = group_curves([curve(1e-2), curve(1e-4), curve(1.0000001e-4), curve(1e-3)])
    assert title == "$p/k$"
    assert [g.label for g in groups] == ["$10^{-4}$", "$10^{-3}$", "$10^{-2}$"]
    assert [len(g.curves) for g in groups] == [2, 1, 1]
    _, groups = group_curves([curve(1e-3, beta=b) for b in (10.0, 0.0)])
    assert [g.label for g in groups] == [r"$\beta=0$", r"$\beta=10$"]
    _, groups = group_curves([curve(1e-3, prestress=on) for on in (True, False)])
    assert {g.label for g in groups} == {"pre-stress", "no pre-stress"}
    _, groups = group_curves([curve(1e-3, rotations=True), curve(1e-3, law="stokes", beta=None, eta_f=1.0)])
    assert [g.label for g in groups] == [r"contact, $\beta=1$", r"Stokes, $\eta_F=1$"]
    _, groups = group_curves([curve(1e-3, beta=1.0), curve(1e-2, beta=2.0)])
    assert [g.label for g in groups] == [r"$p/k=10^{-3}$, $\beta=1$", r"$p/k=10^{-2}$, $\beta=2$"]
    _, groups = group_curves([curve(1e-3, alpha=0.5, stress=1e-6), curve(1e-3)])
    assert [g.label for g in groups] == [r"$\alpha=0.5$, $\sigma_0/k=10^{-6}$", "linear"]
    _, groups = group_curves([curve(1e-3, normal=0.0), curve(1e-3)])  # a file older than --normal has 1
    assert [g.label for g in groups] == [r"$w_\parallel=0$", r"$w_\parallel=1$"]
    _, groups = group_curves([curve(None)])
    assert [g.label for g in groups] == ["$p$ unknown"]


def test_both_moduli_with_their_bounds_are_drawn_and_collapsed():
    """G' solid and filled, G'' dashed and open, each in its own band."""
    G, p = modulus(OMEGA, 4e-4), 4e-4
    one = replace(curve(p), bounds=np.stack((0.1 * G.real, 0.2 * G.imag)))
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
    _, groups = group_curves([curve(p) for p in np.geomspace(1e-5, 1e-1, 5)])
    shades = [luminance(g.colour) for g in groups]
    assert (np.diff(shades) > 0.02).all()
    assert shades[-1] < 0.65
    assert 1.05 / (shades[-1] + 0.05) >= 3  # contrast with white, as WCAG 2 asks of graphics


CELLS = [np.array([[4.0, 0.0], [a, 3.0]]) for a in (0.0, 1.3, -2.0)]


@pytest.mark.parametrize("cell", CELLS)
def test_images_of_disks_are_those_that_reach_into_the_cell(cell):
    rng = np.random.default_rng(7)
    centres, radii = periodic.wrap(rng.uniform(-20, 20, (30, 2)), cell), rng.uniform(0.1, 0.6, 30)
    rows, points = periodic.disk_images(centres, radii, cell)
    found = {(row, *np.round(point, 9)) for row, point in zip(rows, points, strict=True)}
    assert len(found) == len(rows)
    angles = np.linspace(0, 2 * np.pi, 200)
    rim = np.column_stack((np.cos(angles), np.sin(angles)))
    for row in range(30):
        for a in range(-3, 4):
            for b in range(-3, 4):
                centre = centres[row] + (a, b) @ cell
                inside = (centre + radii[row] * rim) @ np.linalg.inv(cell)
                if ((inside > 1e-9) & (inside < 1 - 1e-9)).all(axis=1).any():
                    assert (row, *np.round(centre, 9)) in found


@pytest.mark.parametrize("cell", CELLS)
def test_segments_go_on_across_the_boundary(cell):
    """Every point of every segment, folded into the cell, lies on a drawn image, also across a corner."""
    rng = np.random.default_rng(8)
    start, vector = periodic.wrap(rng.uniform(-9, 9, (40, 2)), cell), rng.uniform(-1.2, 1.2, (40, 2))
    rows, starts = periodic.segment_images(start, vector, cell)
    for t in np.linspace(0, 1, 23):
        folded = periodic.wrap(start + t * vector, cell)
        drawn = starts + t * vector[rows]
        for row in range(40):
            distance = np.linalg.norm(drawn[rows == row] - folded[row], axis=1)
            assert distance.min() < 1e-9


def test_lines_are_as_wide_as_forces_are_strong_and_the_caption_is_in_units_of_k():
    disks = samples.published()
    stiff = replace(disks, potential=Potential(k=4.0))
    figures = [figure_of(plot_packing, one) for one in (disks, stiff)]
    captions = [one.axes[0].get_xlabel() for one in figures]
    assert captions[0] == captions[1] and "p/k=" in captions[0]
    contacts = measure(disks).contacts
    drawn = figures[0].axes[0].collections[1]
    vectors = np.array([end - begin for begin, end in drawn.get_segments()])
    which = [int(np.linalg.norm(contacts.r - one, axis=1).argmin()) for one in vectors]
    assert set(which) == set(range(len(contacts)))
    widths = np.array(drawn.get_linewidths())
    np.testing.assert_allclose(widths / widths.mean(), contacts.force[which] / contacts.force[which].mean())


def test_arrows_are_the_field_at_peak_and_at_zero_stress_with_its_affine_part(tmp_path, packing):
    """Re and −Im of (y x̂ + ũ/γ)/G*, but for |G*|, times what is told; y from the middle of the cell."""
    disks, rng = samples.published(), np.random.default_rng(3)
    u = 0.01 * (rng.normal(size=(1, 16, 2)) + 2j * rng.normal(size=(1, 16, 2)))
    path = write_sweep(tmp_path / "s.h5", packing=packing, fields=(OMEGA[24:25], u, u[..., 0], np.arange(16)))
    turn = np.exp(-1j * np.angle(modulus(OMEGA, 1e-3)[24]))
    total = u[0].copy()
    total[:, 0] += periodic.wrap(disks.positions, disks.cell)[:, 1] - disks.cell[1, 1] / 2
    motion, spin = turn * total, turn * u[0, :, 0]
    axes = plot_fields([load(path)], total=True)
    for ax, name, take in zip(axes, ("peak", "zero"), (np.real, lambda z: -np.imag(z)), strict=True):
        faces, arrows = ax.collections
        factor = float(re.search(r"arrows \$([\d.]+)", ax.get_xlabel())[1])
        assert f"$u$ at {name} stress" in ax.get_title()
        drawn = np.column_stack((arrows.U, arrows.V)) / factor
        for one in take(motion):  # arrows that leave the cell are drawn twice
            assert np.abs(drawn - one).max(axis=1).min() < 1e-9
        turned = take(spin) / np.sqrt(np.mean(take(spin) ** 2))
        rows = periodic.disk_images(periodic.wrap(disks.positions, disks.cell), disks.radii, disks.cell)[0]
        np.testing.assert_allclose(faces.get_facecolors(), _colours()(0.5 + turned[rows] / 4))


def test_rattlers_are_hollow_walls_dark_and_both_are_told():
    disks = samples.published()
    radii = disks.radii * np.where(np.arange(16) == 5, 0.5, 1.0)
    disks = Disks.from_positions(disks.positions, radii, disks.cell)
    rows = periodic.disk_images(periodic.wrap(disks.positions, disks.cell), disks.radii, disks.cell)[0]
    state, loose = measure(disks), replace(disks, record={"walls": 3})
    flow = drawn_by(lambda page: _draw(page, [flowing("", loose)]))
    for fig, hollow, walls in (
        (figure_of(plot_packing, disks), state.rattlers, 0), (flow, touching(loose)[2], 3)
    ):  # fmt: skip
        ax = fig.axes[0]
        shades = np.where(rows < walls, 0.45, np.where(hollow[rows], 1.0, 0.88))
        np.testing.assert_allclose(ax.collections[0].get_facecolors()[:, 0], shades)
        told = ax.get_xlabel()
        assert ("dark: walls" in told) == bool(walls) and f"$N={disks.n - walls}$" in told
        assert ("hollow: " in told) == hollow.any()


def test_arrows_spread_evenly_when_there_are_too_many_disks():
    rng = np.random.default_rng(9)
    cell = np.array([[120.0, 0.0], [30.0, 60.0]])
    points = rng.uniform(0, 1, (20000, 2)) @ cell
    rows = _spread(points, cell)
    assert 0.8 * ARROWS < len(rows) <= ARROWS
    assert len(np.unique(rows)) == len(rows)
    quarters = np.floor((points[rows] @ np.linalg.inv(cell)) * 4).astype(int)
    counts = np.bincount(quarters[:, 0] * 4 + quarters[:, 1], minlength=16)
    assert counts.max() < 1.3 * counts.min()
    assert len(_spread(points[:100], cell)) == 100


def test_many_disks_make_a_small_vector_file(tmp_path):
    rng = np.random.default_rng(10)
    side = 80
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    disks = Disks.from_positions(
        grid + rng.normal(0, 0.01, grid.shape), np.full(side**2, 0.51), np.eye(2) * side
    )
    write_packing(tmp_path / "large.h5", disks)
    plot(tmp_path / "large.h5", "--out", tmp_path / "large.pdf")
    content = (tmp_path / "large.pdf").read_bytes()
    assert b"/Subtype /Image" in content


def test_frequencies_of_fields_are_found_as_people_write_them(with_fields, tmp_path, capsys):
    plot(with_fields, "--omega", "0.0316,1", "--out", tmp_path / "x.png")
    assert "omega tau1 = 0.0316228, 1" in capsys.readouterr().out
    with pytest.raises(
        InputError, match=r"no fields at omega = 0\.001: nearest are 1e-06, 0\.0001, 0\.0316228"
    ):
        plot(with_fields, "--omega", "0.001", "--out", tmp_path / "x.png")


def test_the_packing_of_a_sweep(with_fields, packing, tmp_path):
    out = ("--out", tmp_path / "x.png")
    (tmp_path / "elsewhere").mkdir()
    moved = tmp_path / "elsewhere" / "moved.h5"
    (tmp_path / "packing.h5").rename(moved)
    with pytest.raises(InputError, match=r"its packing packing\.h5 is not beside it: give it with --packing"):
        plot(with_fields, "--kind", "fields", *out)
    plot(with_fields, "--packing", moved, *out)
    write_packing(packing, samples.published("hertzian"))
    with pytest.raises(
        InputError, match=r"packing\.h5: is not the packing that fields\.h5 was made from \(sha256"
    ):
        plot(with_fields, "--kind", "fields", *out)


def test_fields_that_do_not_fit_the_packing(tmp_path, packing):
    for particles in (np.arange(15), np.arange(1, 17)):
        fields = (np.array([1.0]), np.ones((1, 16, 2), complex), None, particles)
        path = write_sweep(tmp_path / "odd.h5", packing=packing, fields=fields)
        with pytest.raises(InputError, match="fields of 16 particles do not fit the 16 disks"):
            plot(path, "--kind", "fields", "--out", tmp_path / "x.png")


def test_too_many_frequencies_for_one_picture(tmp_path, packing):
    omega = np.geomspace(1e-3, 1, 6)
    fields = (omega, np.ones((6, 16, 2), complex), None, np.arange(16))
    path = write_sweep(tmp_path / "many.h5", packing=packing, fields=fields)
    plot(path, "--kind", "fields", "--phase", "strain", "--out", tmp_path / "x.png")  # four of them
    with pytest.raises(InputError, match="6 frequencies: one picture holds 5"):
        plot(path, "--omega", "1e-3:1:6", "--phase", "strain", "--out", tmp_path / "x.png")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("p2.h5 packing.h5", r"p2\.h5 is a sweep, packing\.h5 a packing: one picture shows"),
        (
            "packing.h5 packing.h5",
            r"packing\.h5: is given already|2 packing files: packing pictures show one",
        ),
        ("p2.h5 --kind fields", "holds no fields: ask the sweep for --fields"),
        ("fields.h5 fields.h5 --kind fields", "2 sweep files: fields pictures show one"),
        ("p2.h5 --kind packing", "is a sweep file: packing pictures need a packing"),
        ("packing.h5 --kind moduli", "is a packing file: moduli pictures need sweeps"),
        (
            "p2.h5 --kind moduli --omega 1",
            r"omega \[1\.\]: belongs to correlation or fields pictures, not to moduli",
        ),
        (
            "p2.h5 --mu 0.5 --omega 1",
            r"omega \[1\.\]: belongs to correlation or fields pictures, not to collapse",
        ),
        ("p2.h5 --kind fields --lambda 1", r"lambda 1\.0: belongs to collapse pictures, not to fields"),
        ("p2.h5 --mu nan", r"--mu nan: must lie in \[0, 10\]"),
        ("p2.h5 --lambda -1", r"--lambda -1: must lie in \[0, 10\]"),
        ("bare.h5 --kind collapse", r"bare\.h5: attribute pressure is missing"),
        ("negative.h5 --kind collapse", r"negative\.h5: pressure -0\.1: must be positive"),
        ("fast.h5 --kind collapse", r"fast\.h5: lowest frequency 10: critical scaling needs"),
        ("modes.h5 --kind moduli", r"modes\.h5: is a modes file: moduli pictures need sweeps"),
        ("missing.h5", r"missing\.h5: no such file"),
    ],
)
def test_what_cannot_be_drawn(words, message, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises(InputError, match=message) as caught:
        plot(*words.split(), "--out", "x.png")
    assert "\n" not in str(caught.value)
    assert not list(folder.glob("*x.png*"))


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("x.jpg", r"out x\.jpg: give it the ending \.png or \.pdf or \.svg"),
        ("x", "out x: give it the ending"),
        ("nowhere/x.png", "folder nowhere does not exist"),
        ("folder.png", r"folder\.png: is a folder"),
    ],
)
def test_where_nothing_can_be_written(out, message, sweeps, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=message):
        plot(*sweeps, "--out", out)


def test_plotting_loads_no_mpi_no_petsc_and_needs_no_display(with_fields, tmp_path):
    script = (
        "import sys; from jampetsc.cli import main as cli\n"
        "import jampetsc.io.reader, jampetsc.plots.flowcurves\n"
        "assert 'numba' not in sys.modules, 'a third of a second for a compiler that reading does not need'\n"
        "status = cli.main(sys.argv[1:])\n"
        "unwanted = ('petsc4py', 'slepc4py', 'mpi4py', 'matplotlib.pyplot', 'tkinter')\n"
        "bad = [name for name in unwanted if name in sys.modules]\n"
        "sys.exit(str(bad) if bad or status else 0)"
    )
    words = ["plot", with_fields, "--kind", "fields", "--out", str(tmp_path / "b.png")]
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_users_matplotlibrc_changes_nothing(sweeps, tmp_path):
    plot(*sweeps, "--out", tmp_path / "a.svg")
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "svg.hashsalt": "other"}):
        plot(*sweeps, "--out", tmp_path / "b.svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_the_one_file_of_another_kind_is_named_wherever_it_stands(sweeps, packing):
    for place in range(4):
        files = [*sweeps[:place], packing, *sweeps[place:]]
        odd = packing if place else sweeps[0]
        with pytest.raises(InputError) as refused:
            choose(["moduli"], [load(file) for file in files], files)
        noun = "packing" if place else "sweep"
        assert f", {odd} a {noun}: one picture shows one or the other" in str(refused.value)
        assert str(refused.value).startswith(f"{files[0]} is a {'sweep' if place else 'packing'}, ")

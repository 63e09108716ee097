"""Correlations of displacements: loops over pairs, fields of known C, and the command line."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from picture_contents import bands, bars, figure_of, lines, told
from samples import stored

from jampetsc import main as cli
from jampetsc.analysis import displacement_correlation
from jampetsc.analysis.displacement_correlation import (
    LOG_EXPONENT,
    MIN_RESAMPLED_PACKINGS,
    LaneSums,
    bin_edges,
    correlate_displacements,
    first_root,
    grid_cells,
    lane_sums,
    length_spread,
    stokes_collapse,
)
from jampetsc.commands.correlate import refuse_mixture
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.reader import load
from jampetsc.packing.packing import Packing
from jampetsc.plots.correlation_plots import MEDIUM, correlation_curve, plot_correlation, plot_lengths
from papers.claims.correlations import stokes
from papers.claims.medium import dragged, solid
from papers.claims.medium import first_root as first_root_of

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

SIDE = 60.0
SQUARE = np.array([(SIDE, 0.0), (0.0, SIDE)])
SPACE = np.array([(SIDE, 0.0, 0.0), (11.0, 50.0, 0.0), (-7.0, 17.0, 40.0)])
TILTED = np.array([(SIDE, 0.0), (23.0, SIDE)])


def scattered(n, cell, seed=0):
    return np.random.default_rng(seed).random((n, len(cell))) @ cell


def wave(points, cell, m, n=0, phase=0.3):
    """cos(k·r + phase) with the reciprocal vector (m, n) of the cell."""
    k = 2 * np.pi * np.linalg.inv(cell) @ [m, n]
    return np.cos(points @ k + phase)


def random_field(points, factor, seed):
    """u_y of a medium that random stresses stir (`medium`), of waves down to L/8 with random phases; and its C(δ)."""
    m, n = (a.ravel() for a in np.meshgrid(np.arange(-8, 9), np.arange(9)))
    k = 2 * np.pi * np.column_stack((m, n))[(n > 0) | (m > 0)] / SIDE
    size = np.hypot(*k.T)
    amplitude = factor(size) * k[:, 0] / size
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(k))

    def known(delta):
        return np.cos(np.outer(delta, k[:, 0])) @ amplitude**2 / np.sum(amplitude**2)

    return np.cos(points @ k.T + phase) @ amplitude, known


@pytest.mark.parametrize(("cell", "width"), [(TILTED, 7.0), (SPACE, 21.0)], ids=["plane", "space"])
def test_sums_against_a_loop_over_pairs(cell, width):
    n, cells = 120, 64
    points, fields = scattered(n, cell), np.random.default_rng(1).normal(size=(2, n))
    images = points + np.random.default_rng(2).integers(-3, 4, points.shape) @ cell  # which do not matter
    found = lane_sums(images, cell, fields, width, cells)
    fields = fields / np.sqrt(np.mean(fields**2, axis=1))[:, None]
    lanes = np.array([round(side / width) for side in np.diag(cell)[1:]])
    fractions = points @ np.linalg.inv(cell)
    lane = [tuple(place) for place in np.floor(fractions[:, 1:] % 1 * lanes).astype(int).tolist()]
    column = np.floor(points[:, 0] / SIDE % 1 * cells).astype(int)
    edges = bin_edges(cells)
    pairs, products, separations = np.zeros(len(edges)), np.zeros((2, len(edges))), np.zeros(len(edges))
    for i in range(n):
        for j in range(n):
            lag = (column[j] - column[i]) % cells
            if lane[i] == lane[j] and 1 <= lag <= cells // 2:
                bin_ = np.searchsorted(edges, lag, side="right") - 1
                pairs[bin_] += 1
                separations[bin_] += lag / cells
                products[:, bin_] += fields[:, i] * fields[:, j]
    np.testing.assert_array_equal(found.pairs.sum(axis=0), pairs)
    np.testing.assert_allclose(found.products.sum(axis=0), products, atol=1e-11)
    np.testing.assert_allclose(found.separations.sum(axis=0), separations)
    area = np.prod(np.diag(cell)[1:]) / np.prod(lanes)
    assert found.disks.sum() == n and found.width == pytest.approx(area ** (1 / (len(cell) - 1)), rel=1e-15)
    np.testing.assert_allclose(found.squares.sum(axis=0), n)


@pytest.mark.parametrize("cell", [SQUARE, TILTED], ids=["square", "tilted"])
@pytest.mark.parametrize("m", [1, 2, 5])
def test_a_plane_wave(cell, m):
    points = scattered(20000, cell)
    found = correlate_displacements(
        [lane_sums(points, cell, wave(points, cell, m)[None], 0.5, grid_cells(SIDE, 1.0))]
    )
    np.testing.assert_allclose(found.values[0], np.cos(2 * np.pi * m * found.separation), atol=0.03)
    assert found.root[0] == pytest.approx(1 / (4 * m), abs=0.004)
    assert found.minimum[0] == pytest.approx(1 / (2 * m), abs=0.05)


@pytest.mark.parametrize("factor", [solid, dragged])
@pytest.mark.parametrize("width", [0.2, 0.5, 1.0])
def test_a_random_medium_of_known_correlation(width, factor):
    """Averaged over eight samples: right within its own errors, whatever the width of the lanes; the root is that of
    the medium but for its shortest waves.
    """
    sums = []
    for seed in range(8):
        points = scattered(3000, SQUARE, seed)
        field, known = random_field(points, factor, seed)
        sums.append(lane_sums(points, SQUARE, field[None], width, grid_cells(SIDE, 1.0)))
    found = correlate_displacements(sums)
    true = known(found.separation * SIDE)
    off = np.abs(found.values[0] - true)[1:] / found.errors[0][1:]
    assert np.median(off) < 1.5 and off.max() < 6
    fine = np.linspace(0, 0.5, 5001)
    root = fine[np.argmax(known(fine * SIDE) <= 0)]
    assert abs(found.root[0] - root) < 4 * found.root_error[0] < 0.02
    assert root == pytest.approx(first_root_of(factor), abs=0.006)


@pytest.mark.parametrize("packings", [MIN_RESAMPLED_PACKINGS - 1, MIN_RESAMPLED_PACKINGS])
def test_from_enough_packings_on_whole_ones_are_resampled(packings):
    """Copies of one packing: drawn whole they never differ, drawn as strips they do."""
    points = scattered(2000, SQUARE)
    one = lane_sums(points, SQUARE, random_field(points, solid, 1)[0][None], 1.0, grid_cells(SIDE, 1.0))
    errors = correlate_displacements([one] * packings).errors[:, 1:]
    if packings < MIN_RESAMPLED_PACKINGS:
        assert (errors > 1e-4).all()
    else:
        np.testing.assert_allclose(errors, 0.0, atol=1e-12)


def test_errors_are_those_of_the_mean_of_packings():
    """Many packings of independent C at one δ: the error is their scatter over √n, as for any mean."""
    rng = np.random.default_rng(4)
    ones = np.ones((1, 1))
    packings = [
        LaneSums(np.full((1, 1, 1), c), ones, ones, 0.25 * ones, np.ones(1), 1.0)
        for c in rng.normal(0.3, 0.1, 200)
    ]
    scatter = np.std([sums.products[0, 0, 0] for sums in packings], ddof=1)
    assert correlate_displacements(packings).errors[0, 1] == pytest.approx(scatter / np.sqrt(200), rel=0.2)


def test_each_packing_weighs_the_same_whatever_its_amplitude():
    points = scattered(2000, SQUARE)
    fields = [wave(points, SQUARE, m)[None] for m in (1, 3)]
    plain = correlate_displacements([lane_sums(points, SQUARE, f, 1.0, 256) for f in fields])
    loud = correlate_displacements(
        [lane_sums(points, SQUARE, a * f, 1.0, 256) for a, f in zip((1, 1e6), fields, strict=True)]
    )
    np.testing.assert_allclose(plain.values, loud.values, atol=1e-12)


def test_spread_of_collapsed_lengths():
    """Lengths made to collapse do so with their exponent and with no other; saturated ones are left out."""
    omega = np.geomspace(1e-5, 1e-1, 60)

    def lengths(p):
        x = omega / np.sqrt(p)
        free = 3.0 * x**-0.3 * (-np.log(p)) ** 0.65
        return omega, np.clip(free, 1.0, 25.0) * (1 + 2j), 100.0, p

    files = [lengths(p) for p in (1e-4, 1e-3, 1e-2)]
    collapsed, other = ([(*file, exponent) for file in files] for exponent in (-0.65, 0.65))
    assert length_spread(collapsed, stokes_collapse) < 1e-2 < 0.1 < length_spread(other, stokes_collapse)
    with pytest.raises(InputError, match="no two sweeps overlap"):
        length_spread(collapsed[:1], stokes_collapse)


def test_a_lane_may_be_as_wide_as_the_cell_and_then_is_one_unit_without_an_error():
    cell = np.diag([12.0, 9.0])
    points, grid = scattered(20, cell), grid_cells(12.0, 1.0)
    sums = lane_sums(points, cell, np.ones((1, 20)), 9.0, grid)
    assert sums.width == 9.0 and sums.disks.tolist() == [20.0]
    found = correlate_displacements([sums])
    assert np.isnan(found.errors).all() and np.isnan(found.root_error).all()
    for width in (0.0, -1.0, 9.01, np.nan):
        with pytest.raises(InputError, match="must be positive and at most the height of the cell, 9"):
            lane_sums(points, cell, np.ones((1, 20)), width, grid)


def test_nothing_to_correlate():
    with pytest.raises(InputError, match="no disks to correlate"):
        lane_sums(np.empty((0, 2)), SQUARE, np.empty((1, 0)), 1.0, 64)
    alone = lane_sums(np.array([[1.0, 1.0]]), SQUARE, np.ones((1, 1)), 1.0, 64)
    with pytest.raises(InputError, match=r"lanes of width 1 without pairs of disks\. Use wider lanes"):
        correlate_displacements([alone])


# The command line


OMEGA = np.array([1e-4, 1e-2])


def write_sweep(
    folder,
    name,
    seed=0,
    n=400,
    omega=OMEGA,
    lengths=(1, 2),
    pressure=1e-3,
    unit=1.0,
    wide=1.0,
    G=1.0 + 0j,
    size=1.0,
    **attributes,
):
    """A packing of small disks at random and a sweep with waves of L/m as fields, beside each other."""
    side = wide * unit * np.sqrt(n)
    cell = np.diag([side, side])
    points = scattered(n, cell, seed)
    packing = folder / f"packing-{name}.h5"
    write_packing(packing, Packing.from_positions(points, np.full(n, 0.5 * unit), cell))
    fields = np.zeros((len(omega), n, 2), complex)
    for field, m in zip(fields, lengths, strict=True):
        field[:, 1] = size * (wave(points, cell, m, phase=seed) + 1j * wave(points, cell, 2 * m, phase=seed))
    file, sha256 = read_identified(packing)[1]
    path = folder / f"{name}.h5"
    arrays = {"omega": omega, "G": np.ones(len(omega)) * G, "error_bound": omega, "fields/omega": omega}
    arrays |= {"fields/displacement": fields, "particles": np.arange(n)}
    known = {"law": "stokes", "eta_f": 1.0, "pressure": pressure, "particle_count": n, "k": 1.0, "tau1": 1.0}
    return stored(path, "sweep", arrays, **known | {"packing": file, "packing_sha256": sha256} | attributes)


def run(*words):
    return cli.dispatch(["correlate", *map(str, words)])


def test_chosen_frequencies_and_a_packing_elsewhere(tmp_path, capsys):
    sweep = write_sweep(tmp_path, "s")
    packing = (tmp_path / "packing-s.h5").rename(tmp_path / "elsewhere.h5")
    run(sweep, "--omega", "1e-2", "--packing", packing, "--out", tmp_path / "c.h5")
    np.testing.assert_array_equal(load(tmp_path / "c.h5")["omega"], [1e-2])


def test_a_phase_needs_a_modulus(tmp_path):
    write_sweep(tmp_path, "still", G=np.array([np.nan, 1.0]))
    with pytest.raises(InputError, match=r"still\.h5: no modulus at omega = 0\.0001, .*Use --phase strain"):
        run(tmp_path / "still.h5", "--out", tmp_path / "c.h5")


def test_bins_and_grids():
    for length in (3.0, 20.0, 100.3):
        cells = grid_cells(length, 1.0)
        assert cells % 2 == 0 and cells >= 8 and abs(length / cells - 1 / 8) < 1 / 8 / 8
        edges = bin_edges(cells)
        widths = np.diff(edges)
        assert edges[0] == 1 and edges[-1] <= cells // 2
        assert (widths >= 4).all() and (np.diff(widths) >= 0).all()
        following = edges[-1] + max(4, round(0.08 * edges[-1]))
        assert following > cells // 2  # no further bin would fit
        assert (widths[edges[:-1] > 60] > 4).all()
    for cells, edges in ((8, [1]), (10, [1, 5]), (16, [1, 5]), (18, [1, 5, 9])):  # or at half the cell
        assert bin_edges(cells).tolist() == edges


def test_errors_are_known_where_half_of_the_samples_have_a_value():
    values = iter([[n % 2 * 2.0 if n < known else np.nan for known in (100, 99)] for n in range(200)])
    found = displacement_correlation.bootstrap_scatter(lambda rows: np.array(next(values)), 4)
    assert found[0] == pytest.approx(np.sqrt(100 / 99)) and np.isnan(found[1])
    # of one value each, v and w: a mean of two drawn is v, w or, half of the time, between: σ = |v − w|/√8
    one, two, again = (
        displacement_correlation.bootstrap_scatter(lambda rows: rows.mean(keepdims=True), n)
        for n in (1, 2, 2)
    )
    assert np.isnan(one) and two == again == pytest.approx(1 / np.sqrt(8), rel=0.15)


def test_a_root_may_lie_on_a_bin_or_between():
    x = np.array([0.0, 0.1, 0.2, 0.3])
    assert first_root(x, np.array([1.0, 0.0, -1.0, 1.0])) == pytest.approx(0.1)
    assert first_root(x, np.array([1.0, 0.5, -1.5, 1.0])) == pytest.approx(0.125)
    assert np.isnan(first_root(x, np.array([1.0, 0.5, 0.1, 1e-9])))
    x = np.linspace(0.0, 0.4, 5)  # bins without pairs are none
    root, least = displacement_correlation.root_and_minimum(x, np.array([1.0, np.nan, -0.5, -0.7, np.nan]))
    assert root == pytest.approx(0.2 * 2 / 3) and least == pytest.approx(0.3)


@pytest.mark.parametrize(("odd", "counts"), [(1.29, False), (1.31, True), (12.9, True), (13.1, False)])
def test_lengths_near_a_disk_or_the_cell_are_left_out_of_the_spread(odd, counts):
    """Of three frequencies; the last length of one file is odd. L = 100 d."""
    omega = np.array([1e-3, 1e-2, 1e-1])
    length = np.array([6.0, 5.0, 4.0]) * (1 + 1j)
    other = length.copy()
    other[2] = odd * (1 + 1j)
    spread = length_spread([(omega, one, 100.0, 1e-3) for one in (length, other)], stokes_collapse)
    assert (spread > 1e-9) == counts


def test_lengths_collapse_below_a_pressure_of_k():
    x, y = stokes_collapse([1e-3], [4.0], 1e-4)
    assert x[0] == pytest.approx(0.1) and y[0] == pytest.approx(4 * np.log(1e4) ** 0.65)
    for pressure in (0.0, 1.0, -0.1, 2.0, np.nan):
        with pytest.raises(InputError, match="must lie between 0 and k for the collapse of lengths"):
            stokes_collapse([1.0], [1.0], pressure)


def test_units_count_as_often_as_they_are_drawn():
    """Drawn twice, a strip stands for itself; together strips weigh by their disks and pairs."""
    strips = [
        LaneSums(
            products=np.array([[[p, 3.0]]]), squares=np.array([[s]]), pairs=np.array([[n, 1.0]]),
            separations=np.array([[0.1, 0.2]]), disks=np.array([d]), width=0.5,
        )
        for p, s, n, d in ((1.0, 2.0, 4.0, 2.0), (6.0, 9.0, 3.0, 6.0))
    ]  # fmt: skip
    units = displacement_correlation.resampled_units(strips)
    for draws, expected in (
        ([2, 0], [1.0, 0.25, 3.0]),
        ([0, 1], [1.0, 2.0 / 1.5, 3.0 / 1.5]),
        ([1, 2], [1.0, 13 / 10 * 14 / 20, 3.0 * 14 / 20]),
    ):
        np.testing.assert_allclose(
            displacement_correlation.correlation_of_draws(units, np.array(draws))[0], expected, rtol=1e-15
        )


def sums_of(folder, name, cells, width, fields, phase):
    """Lane sums of a sweep of `write_sweep`, of real and imaginary part of u/γ, or of u/σ = (u/γ)/G*, in turn."""
    sweep, disks = load(folder / f"{name}.h5"), load(folder / f"packing-{name}.h5")
    turns = np.conj(sweep["G"]) / np.abs(sweep["G"]) if phase == "stress" else np.ones(len(sweep["G"]))
    transverse = [turns[number] * sweep["fields/displacement"][number][:, 1] for number in fields]
    parts = np.array([part for field in transverse for part in (field.real, field.imag)])
    return lane_sums(disks.positions, disks.cell, parts, width, cells)


@pytest.mark.parametrize("phase", ["stress", "strain"])
def test_every_array_of_a_file_of_correlations(tmp_path, capsys, phase):
    """Of two sweeps whose fields are not in order, in cells of other sizes: grid and edges are those of the first."""
    omega = np.array([1e-2, 1e-4, 1.0])
    shared = {"n": 144, "omega": omega, "lengths": (1, 2, 3), "unit": 2.0}
    G = np.exp([0.2j, 1j, 1.5j])
    paths = [
        write_sweep(tmp_path, f"s{k}", k, wide=wide, pressure=p, G=(k + 1) * G, **shared)
        for k, (wide, p) in enumerate(((1.0, 1e-3), (1.04, 1.005e-3)))
    ]
    chosen = ["--phase", phase] if phase == "strain" else []
    assert run(*paths, "--lane", "1,0.5", "--out", tmp_path / "c.h5", *chosen) == 0
    found = load(tmp_path / "c.h5")
    cells = grid_cells(24.0, 2.0)
    assert cells != grid_cells(1.04 * 24, 2.0)
    length, order = 24 * 1.02, (1, 0, 2)
    np.testing.assert_array_equal(found["omega"], [1e-4, 1e-2, 1.0])
    np.testing.assert_allclose(found["G"], 1.5 * G[[1, 0, 2]])
    assert found.attributes["phase"] == phase and found.law["law"] == "stokes"
    assert "packing" not in found.attributes  # what all have in common is kept
    for lane, width in enumerate((2.0, 1.0)):
        sums = [sums_of(tmp_path, f"s{k}", cells, width, order, phase) for k in (0, 1)]
        exact = correlate_displacements(sums)
        assert found["lane_width"][lane] == sums[0].width
        np.testing.assert_array_equal(found["delta"][lane], length * exact.separation)
        for name, values, unit in (
            ("C", exact.values, 1.0), ("C_error", exact.errors, 1.0), ("length", exact.root, length),
            ("length_error", exact.root_error, length), ("minimum", exact.minimum, length),
            ("minimum_error", exact.minimum_error, length),
        ):  # fmt: skip
            expected = (unit * values).reshape(3, 2, *values.shape[1:])
            np.testing.assert_allclose(found[name][lane], expected, rtol=1e-12, atol=1e-14)
        assert found.attributes["pairs"][lane] == exact.pairs
    a = found.attributes
    assert (a["packings"], a["mean_diameter"], a["L"]) == (2, 2.0, pytest.approx(length))
    assert a["pressure"] == pytest.approx(1.0025e-3) and a["sources"] == "s0.h5 s1.h5"
    said = capsys.readouterr().out.splitlines()
    assert f"2 packings, L = {length / 2:.4g} d, lanes of 1 d, {a['pairs'][0]} pairs" in said[0]
    assert said[0].endswith(f"in phase with the {phase}")
    assert any("lanes of 0.5 d: C differs by" in line for line in said)
    assert said[1].startswith(f"  omega 0.0001: l/d Re {found['length'][0, 0, 0] / 2:.3g} ± ")


@pytest.mark.parametrize(("off", "same"), [(1.0099, True), (1.0101, False), (0.9901, True), (0.9899, False)])
def test_sweeps_are_of_one_pressure_within_a_per_cent(tmp_path, off, same):
    paths = [write_sweep(tmp_path, f"s{k}", k, n=16, pressure=p) for k, p in enumerate((1e-3, off * 1e-3))]
    sweeps = [load(path) for path in paths]
    refused = pytest.raises(InputError, match=r"s1\.h5: pressure .*, but .*s0\.h5 has 0\.001\. Average")
    with nullcontext() if same else refused:
        refuse_mixture(sweeps)
    sweeps[1].attributes["load"] = "compression"
    with pytest.raises(InputError, match=r"s1\.h5: load compression, but s0\.h5 has xy\. Average"):
        refuse_mixture(sweeps)


# Pictures


def correlation_file(
    path, tau1=1.0, k=1.0, d=2.0, omega=(1e-3, 1e-2), lanes=2, pressure=1e-3, low=-0.7, G=None, **more
):
    """A file of correlations of known content, lengths in units of which a disk is d = 2; two lanes, four bins."""
    rng = np.random.default_rng(7)
    shape = (lanes, len(omega), 2)
    C = np.concatenate((np.ones((*shape, 1)), rng.uniform(-0.4, 0.9, (*shape, 3))), axis=-1)
    C[0, -1, 1, 2] = low
    values = {
        "omega": np.array(omega) / tau1, "lane_width": d * np.array([0.5, 1.0, 0.25][:lanes]),
        "delta": d * np.tile([0.0, 1.0, 2.0, 3.0], (lanes, 1)), "C": C, "C_error": 0.1 * np.abs(C),
        "length": d * rng.uniform(1.0, 3.0, shape), "length_error": d * rng.uniform(0.1, 0.3, shape),
    }  # fmt: skip
    if G is not None:
        values["G"] = G
    facts = {"mean_diameter": d, "L": 8.0 * d, "pressure": k * pressure, "k": k, "tau1": tau1}
    return load(stored(path, "correlation", values, **facts | {"law": "stokes", "particle_count": 64} | more))


def curve_of(path, **more):
    """What a picture draws of such a file."""
    return correlation_curve(correlation_file(path, **more))


def test_a_correlation_is_drawn_in_diameters_and_in_units_of_k_and_tau1(tmp_path):
    plain = curve_of(tmp_path / "a.h5")
    scaled = curve_of(tmp_path / "b.h5", tau1=4.0, k=3.0, d=5.0)
    for name in ("omega", "G", "bounds", "pressure", "C", "errors", "delta", "lanes", "size"):
        np.testing.assert_allclose(getattr(plain, name), getattr(scaled, name), rtol=1e-12)
    file = load(tmp_path / "a.h5")
    np.testing.assert_array_equal(plain.G, file["length"][0, :, 0] / 2 + 0.5j * file["length"][0, :, 1])
    np.testing.assert_array_equal(plain.bounds, file["length_error"][0].T / 2)
    assert plain.lanes.tolist() == [0.5, 1.0] and plain.size == 8.0
    assert plain.delta[0].tolist() == [0, 1, 2, 3]
    over, collapsed = figure_of(plot_lengths, [plain]).axes[:2]
    assert told(over)[-4:] == [r"Re $u_y/\gamma$", r"Im $u_y/\gamma$", "$L/4$", "medium"]
    levels = [y[0] for x, y, *_ in lines(over, 2) if x.tolist() == [0, 1]]
    assert levels == pytest.approx([0.25, 0.169, 0.246], abs=5e-4)
    for part in (0, 1):
        y, error, unit = (plain.G.real, plain.G.imag)[part], plain.bounds[part], np.log(1000) ** 0.65
        np.testing.assert_allclose(bars(over)[part], [plain.omega, y / 8, error / 8, error / 8])
        x = plain.omega * np.sqrt(1000)
        np.testing.assert_allclose(bars(collapsed)[part], [x, y * unit, error * unit, error * unit])


def test_files_are_compared_at_their_own_row_of_a_frequency(tmp_path):
    """Above against δ/d, below against δ/L; Re left and Im right, with bands; all of C is in sight."""
    first = curve_of(tmp_path / "a.h5")
    other = curve_of(tmp_path / "b.h5", omega=(1e-4, 1e-3, 1e-2), particle_count=256)
    fig = figure_of(plot_correlation, [first, other], omega=[1e-2])
    for number, ax in enumerate(fig.axes[:4]):
        part, scale = number % 2, 1.0 if number < 2 else 1 / 8
        drawn = lines(ax, 4)
        for (x, y, *_), band, curve, row in zip(drawn, bands(ax), (first, other), (1, 2), strict=True):
            np.testing.assert_allclose(x, scale * curve.delta[0])
            np.testing.assert_allclose(y, curve.C[0, row, part])
            error = curve.errors[0, row, part]
            np.testing.assert_allclose(band[1:], [y - error, y + error])
        assert ax.get_xlabel() == (r"$\delta/d$" if number < 2 else r"$\delta/L$")
        assert ax.get_ylabel() == rf"$C(\delta)$ of {('Re', 'Im')[part]} $u_y/\gamma$"
        assert ax.get_ylim() == pytest.approx((-0.75, 1.05)) and ax.get_xlim()[0] == 0.0
    assert told(fig.axes[1]) == ["$N=64$", "$N=256$", "standard error"]
    assert fig.axes[1].get_legend().get_title().get_text() == r"$\omega\tau_1=10^{-2}$"


def test_of_several_files_at_several_frequencies_colours_tell_these_and_dashes_the_files(tmp_path):
    curves = [correlation_curve(correlation_file(tmp_path / f"{n}.h5", particle_count=n)) for n in (64, 256)]
    fig = figure_of(plot_correlation, curves, omega=[1e-3, 1e-2])
    drawn = [line for line in fig.axes[3].get_lines() if len(line.get_xdata()) == 4]
    for line, (curve, row) in zip(drawn, [(c, row) for c in curves for row in (0, 1)], strict=True):
        np.testing.assert_allclose(line.get_ydata(), curve.C[0, row, 1])
    assert len({line.get_color() for line in drawn}) == len({line.get_linestyle() for line in drawn}) == 2
    assert drawn[0].get_color() == drawn[2].get_color() != drawn[1].get_color()
    assert told(fig.axes[1]) == [r"$\omega\tau_1=10^{-3}$", r"$\omega\tau_1=10^{-2}$", "$N=64$", "$N=256$"]


def test_lengths_against_that_of_a_medium(tmp_path):
    """√(|G* − iωη_F|/ω), in units of d, k and τ₁."""
    G = np.array([0.3 + 0.6j, 3.0 + 1.5j])
    curve = curve_of(tmp_path / "a.h5", tau1=4.0, k=3.0, eta_f=2.0, G=G)
    np.testing.assert_allclose(curve.modulus, [0.1 + 0.198j, 1.0 + 0.48j])
    x, y = bars(figure_of(plot_lengths, [curve]).axes[2])[0][:2]
    np.testing.assert_allclose(x, np.sqrt(np.abs(curve.modulus) / [1e-3, 1e-2]))
    np.testing.assert_allclose(y, curve.G.real)
    assert len(figure_of(plot_lengths, [replace(curve, modulus=None)]).axes) == 2


# The medium


def test_roots_of_a_medium_stirred_by_random_stresses():
    """At low frequency −ln 2 sin(πδ) falls to zero at 1/6, and lanes of a square cell move that a little; a field of
    1/k³ is nearly the longest wave. At finite frequency the length is √(|G*|/nω), with a number of order one.
    """
    assert [first_root_of(solid), first_root_of(dragged)] == pytest.approx(MEDIUM, rel=1e-9)
    assert pytest.approx((0.169, 0.246), abs=5e-4) == MEDIUM
    for part, slow in ((np.real, solid), (np.imag, dragged)):
        assert first_root_of(stokes(part, length=100.0)) == pytest.approx(first_root_of(slow), abs=1e-4)
    for angle, phase, wanted in (
        (0.0, "strain", (0.62, 1.82)), (np.pi / 4, "strain", (0.60, 1.85)), (np.pi / 4, "stress", (0.43, 0.84))
    ):  # fmt: skip
        roots = [first_root_of(stokes(part, angle, phase, 0.04)) / 0.04 for part in (np.real, np.imag)]
        np.testing.assert_allclose(roots, wanted, rtol=0.02)


def test_errors_that_nobody_knows_have_no_entry(tmp_path):
    curve = correlation_curve(correlation_file(tmp_path / "a.h5", low=-0.1))
    bare = replace(curve, errors=np.full_like(curve.errors, np.nan))
    fig = figure_of(plot_correlation, [bare], omega=[1e-2])
    assert "standard error" not in told(fig.axes[1])
    assert all(np.allclose(low, high) for ax in fig.axes for _, low, high in bands(ax))
    assert fig.axes[0].get_ylim() == pytest.approx((-0.5, 1.05))


@pytest.mark.parametrize(("count", "few", "bar"), [(3, True, False), (4, False, False), (8, False, True)])
def test_of_few_frequencies_other_lanes_are_shown_of_many_a_bar(tmp_path, count, few, bar):
    curve = curve_of(tmp_path / "a.h5", omega=np.logspace(-5, -5 + count - 1, count))
    fig = figure_of(plot_correlation, curve)
    thin = [line.get_linewidth() == 0.4 for line in fig.axes[0].get_lines() if len(line.get_xdata()) == 4]
    assert thin == [False, True] * count if few else thin == [False] * count
    spread = [np.ptp([low, high], axis=0).max() > 0 for _, low, high in bands(fig.axes[0])]
    assert spread == [True] * count
    words = told(fig.axes[1])
    assert any("tau" in ax.get_ylabel() for ax in fig.axes) == bar
    if not bar:
        assert words[:count] == [f"$10^{{{n - 5}}}$" if n < 5 else "$1$" for n in range(count)]
    assert words[0 if bar else count :] == ["standard error"] + [r"lanes of $1\,d$"] * few
    assert fig.axes[0].get_xlabel() == r"$\delta/L$"


def test_several_correlations_are_compared_at_the_lowest_frequency_or_the_one_asked_for(tmp_path):
    files = [
        correlation_file(tmp_path / f"{n}.h5", omega=(1e-2, 1e-3, 1e-1), pressure=p)
        for n, p in enumerate((1e-3, 1e-2))
    ]
    for some, omega, panels, said in (
        (files, None, 4, "correlation in 2 files at omega tau1 = 0.001, in phase with the strain"),
        (files[:1], [0.1], 4, "correlation in 1 file at omega tau1 = 0.1, in phase with the strain"),
        (files[:1], None, 2, "correlation at 3 frequencies, in phase with the strain"),
        (files, [0.1, 0.01], 4, "correlation in 2 files at omega tau1 = 0.1, 0.01, in phase with the strain"),
    ):
        drawn = plot_correlation.draw(some, omega=omega)
        assert (len(drawn.axes), drawn.text) == (panels, said)
    two = figure_of(plot_correlation, files[:1], omega=[0.001, 0.1]).axes[0]
    C = correlation_curve(files[0]).C
    np.testing.assert_allclose([y for _, y, *_ in lines(two, 4)][::2], C[0, [1, 2], 0])
    other = correlation_file(tmp_path / "other.h5", omega=(1e-2, 1e-3, 1e-1), phase="stress")
    for picture in (plot_correlation, plot_lengths):
        with pytest.raises(InputError, match=r"other\.h5: in phase with the stress, 0\.h5 with the strain"):
            picture([files[0], other])


def test_the_spread_of_lengths_is_told_of_those_within_the_cell(tmp_path):
    files = [
        correlation_file(tmp_path / f"{n}.h5", omega=(1e-3, 1e-2, 1e-1), pressure=p, **{"L": L})
        for n, (p, L) in enumerate(((1e-3, 40.0), (1.1e-3, 30.0)))
    ]
    curves = [correlation_curve(file) for file in files]
    said = plot_lengths.draw(files).text
    spread, whole = (
        length_spread([(c.omega, c.G, size(c), c.pressure, LOG_EXPONENT) for c in curves], stokes_collapse)
        for size in (lambda c: c.size, lambda c: 1e9)
    )
    assert spread != whole
    assert said == (
        "correlation lengths of 2 files, in phase with the strain; l (-ln p)^0.65 differs by "
        f"{100 * spread:.2g} % (rms) at equal omega/p^(1/2)"
    )
    assert plot_lengths.draw(files[:1]).text == "correlation lengths of 1 file, in phase with the strain"
    with pytest.raises(InputError, match=r"0\.h5: no correlation falls to zero"):
        plot_lengths([replace(curves[0], G=np.full(3, np.nan * (1 + 1j)))])

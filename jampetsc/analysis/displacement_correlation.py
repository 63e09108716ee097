"""Correlation of transverse displacements along the flow direction, in narrow lanes (BT Fig. 7).

    C(δ) = ⟨u_y(x) u_y(x + δ)⟩ / ⟨u_y²⟩ ,

averaged over pairs of disks in the same lane, a strip along x of given width, in 3D a bar of this width in y and in z
(`lane_sums`). u_y has no affine part under u_x = γ y, so C is of the non-affine motion. Real and imaginary part of a
field, in phase with the stress (or the strain) and with its rate, are correlated each with itself. In a periodic cell
a lane closes on itself after L = |a₁|, so C is even about δ = L/2.

In a square cell the non-affine u_x along y has the same C on average: simple shear along y differs by a rotation alone,
which damping feels by no more than overlaps over diameters. `across` exchanges the axes, `add_lanes` adds both.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.power_laws import collapse_spread
from jampetsc.analysis.statistics import draws_of, small_sample_factor
from jampetsc.errors import InputError

SIDE_TOLERANCE = 1e-9  # relative difference of sides that count as equal
STRIP_COUNT = 8  # strips of one packing, for the error
_GRID_SPACING = 1 / 8  # of the grid along x, in diameters
_MIN_BIN_WIDTH, _BIN_GROWTH = (
    4,
    0.08,
)  # width of a bin of δ: at least this number of grid cells, and this fraction of δ


@dataclass(frozen=True, eq=False)
class LaneSums:
    """Sums over pairs in the lanes of one packing. P blocks of lanes, F fields, D bins of δ."""

    products: np.ndarray  # (P, F, D) Σ u_i u_j of fields with ⟨u²⟩ = 1 over the packing
    squares: np.ndarray  # (P, F) Σ u²
    pairs: np.ndarray  # (P, D)
    separations: np.ndarray  # (P, D) Σ δ/L
    disks: np.ndarray  # (P,)
    width: float  # of a lane, such that lanes fill the cell; in 3D the root of its cross-section


def grid_cells(length: float, diameter: float) -> int:
    """Even number of grid cells along a cell of this length, for `lane_sums`."""
    return 2 * max(4, round(0.5 * length / (_GRID_SPACING * diameter)))


def bin_edges(cells: int):
    """First lag of each bin of δ, in grid cells from 1: bins half a diameter wide, wider at larger δ."""
    edges = [1]
    while (last := edges[-1] + max(_MIN_BIN_WIDTH, round(_BIN_GROWTH * edges[-1]))) <= cells // 2:
        edges.append(last)
    return np.array(edges)


def lane_sums(positions, cell, fields, width: float, cells: int) -> LaneSums:
    """Sums over pairs for positions (n, D), cell rows (D, D), real fields (F, n), lanes about `width` wide.

    cells: number of grid cells along x (`grid_cells`), the same for all packings to be averaged.
    Raises InputError for a width that is not positive or exceeds the cell, and for no disks.
    """
    positions, cell, fields = (np.asarray(a, float) for a in (positions, cell, fields))
    length, *heights = np.diag(cell)
    if not 0 < width <= min(heights):
        raise InputError(
            f"lane width {width:g}: must be positive and at most the height of the cell, {min(heights):g}"
        )
    if not len(positions):
        raise InputError("no disks to correlate, as all are rattlers. Give a jammed packing.")
    counts = [max(1, round(height / width)) for height in heights]
    lanes = math.prod(counts)
    reduced = (positions @ np.linalg.inv(cell)) % 1.0
    lane = np.zeros(len(positions), int)
    for count, places in zip(counts[::-1], reduced.T[:0:-1], strict=True):
        lane = count * lane + np.minimum((places * count).astype(int), count - 1)
    # a disk wrapped in y has moved by a₂, so in x too: the product with the cell's rows takes that along
    along = (reduced @ cell)[:, 0] / length % 1.0
    place = lane * cells + np.minimum((along * cells).astype(int), cells - 1)
    blocks = min(STRIP_COUNT, lanes)
    block_of = np.arange(lanes) * blocks // lanes
    starts, block = np.searchsorted(block_of, np.arange(blocks)), block_of[lane]

    def pair_sums(weights):
        """Σ w_i w_j by block and by lag of 0 … cells/2 grid cells."""
        density = np.bincount(place, weights, lanes * cells).reshape(lanes, cells)
        power = np.add.reduceat(np.abs(np.fft.rfft(density, axis=1)) ** 2, starts, axis=0)
        return np.fft.irfft(power, cells, axis=1)[:, : cells // 2 + 1]

    rms = np.sqrt(np.mean(fields**2, axis=1))
    fields = fields / np.where(rms > 0, rms, 1.0)[:, None]
    edges, lags = bin_edges(cells), np.arange(cells // 2 + 1)
    number = np.rint(pair_sums(None))

    def binned(sums):
        return np.add.reduceat(sums, edges, axis=-1)

    return LaneSums(
        products=np.stack([binned(pair_sums(field)) for field in fields], axis=1),
        squares=np.stack([np.bincount(block, field**2, blocks) for field in fields], axis=1),
        pairs=binned(number),
        separations=binned(number * lags / cells),
        disks=np.bincount(block, minlength=blocks).astype(float),
        width=(math.prod(heights) / lanes) ** (1.0 / len(heights)),
    )


def across(positions, cell):
    """Positions (n, D) and cell rows (D, D) with the axes x and y exchanged, for lanes along y.

    Raises InputError unless the cell is rectangular, with equal sides along x and y.
    """
    order = [1, 0, *range(2, len(cell))]
    if np.any(cell != np.diag(np.diag(cell))):
        raise InputError(
            "cell: tilted, so that lanes along y do not close on themselves. Choose lanes along x."
        )
    if not math.isclose(cell[0, 0], cell[1, 1], rel_tol=SIDE_TOLERANCE):
        raise InputError(
            f"cell: sides of {cell[0, 0]:g} along x and {cell[1, 1]:g} along y, which must be equal for lanes along y. "
            "Choose lanes along x."
        )
    return positions[:, order], cell[np.ix_(order, order)]


def add_lanes(axes) -> LaneSums:
    """The LaneSums of one packing over lanes along several axes, block by block."""
    summed = {
        name: sum(getattr(sums, name) for sums in axes)
        for name in ("products", "squares", "pairs", "separations", "disks")
    }
    return replace(axes[0], **summed)


MIN_RESAMPLED_PACKINGS = 5  # from this number on, whole packings are resampled
BOOTSTRAP_SAMPLES = 200  # of the bootstrap
ROUNDING_LIMIT = 1e-12  # rms displacement per strain, in diameters, below which a field may be rounding alone


@dataclass(frozen=True, eq=False)
class Correlation:
    """C(δ) with δ/L increasing from 0 to ½; errors are standard deviations. Empty bins are nan."""

    separation: np.ndarray  # (D + 1,) mean δ/L of the pairs in a bin, the first is 0
    values: np.ndarray  # (F, D + 1), 1 at δ = 0
    errors: np.ndarray  # (F, D + 1)
    root: np.ndarray  # (F,) δ/L where C first vanishes, nan where it does not
    root_error: np.ndarray  # (F,)
    minimum: np.ndarray  # (F,) δ/L of the smallest C
    minimum_error: np.ndarray  # (F,)
    pairs: int


def correlate_displacements(packings) -> Correlation:
    """C(δ) of many packings from their LaneSums of equal F and D, each packing normalised by itself.

    Errors by bootstrap over packings, or over strips of lanes where there are fewer than five packings.
    Strips next to each other are correlated over the length that is to be found: for few packings the errors
    are lower bounds. Raises InputError where no lane holds two disks.
    """
    packings = list(packings)
    units = resampled_units(packings)
    if not units.pairs.sum():
        raise InputError(f"lanes of width {packings[0].width:g} without pairs of disks. Use wider lanes.")
    count = len(units.disks)
    with np.errstate(invalid="ignore"):
        separation = np.r_[0.0, units.separations.sum(axis=0) / units.pairs.sum(axis=0)]

    def statistics(drawn):
        """(F, D + 3): C, its root and the place of its minimum, of the units numbered in `drawn`."""
        values = correlation_of_draws(units, np.bincount(drawn, minlength=count))
        return np.hstack((values, [root_and_minimum(separation, c) for c in values]))

    estimates = statistics(np.arange(count))
    errors = small_sample_factor(count) * bootstrap_scatter(statistics, count)
    values, (root, minimum) = estimates[:, :-2], estimates[:, -2:].T
    value_errors, (root_error, minimum_error) = errors[:, :-2], errors[:, -2:].T
    pairs = int(units.pairs.sum())
    return Correlation(separation, values, value_errors, root, root_error, minimum, minimum_error, pairs)


def resampled_units(packings) -> LaneSums:
    """The units that the bootstrap resamples, one row each: packings, or strips of lanes where packings are few."""
    joined = {}
    for name in ("products", "squares", "pairs", "separations", "disks"):
        parts = [getattr(sums, name) for sums in packings]
        if len(packings) >= MIN_RESAMPLED_PACKINGS:
            parts = [part.sum(axis=0, keepdims=True) for part in parts]
        joined[name] = np.concatenate(parts)
    return replace(packings[0], **joined)


def correlation_of_draws(units, draws):
    """C (F, D + 1) with each unit counted `draws` times."""
    pairs, squares = draws @ units.pairs, (draws @ units.squares) / (draws @ units.disks)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(pairs > 0, np.tensordot(draws, units.products, 1) / pairs, np.nan)
        values = mean / squares[:, None]
    return np.concatenate((np.ones((len(values), 1)), values), axis=1)


def bootstrap_scatter(statistic, count):
    """Standard deviation of statistic(rows) over draws of `count` units; nan where fewer than half have a value."""
    draws = draws_of(count, BOOTSTRAP_SAMPLES) if count > 1 else np.zeros((2, 1), int)
    samples = np.array([statistic(rows) for rows in draws])
    enough = (2 * np.isfinite(samples).sum(axis=0) >= len(samples)) & (count > 1)
    scatter = np.full(samples.shape[1:], np.nan)
    scatter[enough] = np.nanstd(samples[:, enough], axis=0, ddof=1)
    return scatter


def root_and_minimum(separation, values):
    """(first root, place of the minimum) of one C(δ)."""
    finite = np.isfinite(values)
    return first_root(separation[finite], values[finite]), separation[finite][np.argmin(values[finite])]


def first_root(separation, values) -> float:
    """Where C first falls through zero, by linear interpolation between bins; nan if it does not."""
    below = np.flatnonzero(values <= 0)
    if not len(below):
        return float("nan")
    n = below[0]
    (x, y), (c, d) = separation[n - 1 : n + 1], values[n - 1 : n + 1]
    return float(x + (y - x) * c / (c - d))


LOG_EXPONENT = 0.65  # of −ln p in BT's collapse of the Stokes length
MIN_LENGTH, MAX_LENGTH = 1.3, 0.13  # lengths that can collapse: above this in diameters, below this in L


def stokes_collapse(omega, length, pressure, exponent=LOG_EXPONENT):
    """(ω/p^½, l (−ln p)^exponent): collapse of the correlation length under Stokes drag, p in units of k.

    BT print the exponent 0.65. Lengths measured with this program, p from 1e-5 to 1e-2 and N up to 32768,
    grow as p falls at equal ω/p^½ and collapse with −0.65. Raises InputError unless 0 < p < 1.
    """
    if not 0 < pressure < 1:
        raise InputError(f"pressure {pressure:g}: must lie between 0 and k for the collapse of lengths")
    return np.asarray(omega) / np.sqrt(pressure), np.asarray(length) * (-np.log(pressure)) ** exponent


def medium_collapse(omega, length, G):
    """(√(|G*|/ω), l): l under Stokes drag against l in an elastic medium (docs/theory/linear_response.md).

    G (F,) complex in k is of the solid alone, without iωη_F; ω in 1/τ₁.
    """
    return np.sqrt(np.abs(G) / omega), np.asarray(length)


def length_spread(lengths, collapse) -> float:
    """How far from one curve collapsed lengths are: rms of the standard deviation of ln y between files.

    lengths    sequence of (omega, l/d (F,) complex for Re and Im, L/d, …)
    collapse   (omega, l/d, …) -> (x, y) with the rest of each entry, such as `stokes_collapse`

    Lengths near the size of a disk or of the cell are left out. Raises InputError if nothing overlaps.
    """
    scaled = []
    for omega, length, size, *more in lengths:
        parts = [
            np.where((part > MIN_LENGTH) & (part < MAX_LENGTH * size), part, 0.0)
            for part in (length.real, length.imag)
        ]
        x, y = collapse(omega, parts[0] + 1j * parts[1], *more)
        scaled.append((x, y, 1.0))
    return collapse_spread(scaled, end=np.inf)

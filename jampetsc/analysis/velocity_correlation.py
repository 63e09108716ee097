"""Correlation of transverse velocities along the flow (Vågberg, thesis eq. 4.23):

    g_y(x) = ⟨v_y(r) v_y(r + x x̂)⟩ / ⟨v_y²⟩ ,

over pairs of disks in the lane of width w around one of them, |y| < w/2, binned in |x|, both of the nearest image along
a lane; all pairs of all snapshots count alike. v_y has no affine part. Σ v_y = 0 makes g_y negative somewhere, by 1/N
even without correlations.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc import interrupts
from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.displacement_correlation import ROUNDING_LIMIT
from jampetsc.analysis.statistics import draws_of, small_sample_factor
from jampetsc.errors import InputError, named

DEFAULT_LANE_WIDTH, DEFAULT_BIN_WIDTH = 1.0, 1.0  # of a lane in y and of a bin in x, in mean diameters
SNAPSHOT_BLOCKS, BOOTSTRAP_SAMPLES = 10, 200  # for the errors of the minimum


@dataclass(frozen=True, eq=False)
class LaneCorrelation:
    """g_y in D bins of |x|; lengths in the units of the files."""

    edges: np.ndarray  # (D + 1,)
    values: np.ndarray  # (D,) nan where there are no pairs
    errors: np.ndarray  # (D,) one standard error, over snapshots; nan where values are
    pairs: np.ndarray  # (D,)
    mean_square: float  # ⟨u_y²⟩/γ̇²
    snapshots: int
    diameter: float  # mean diameter of the disks
    minimum_errors: tuple = (
        np.nan,
        np.nan,
    )  # of `minimum`, standard; nan for fewer than 2 SNAPSHOT_BLOCKS snapshots

    @property
    def centres(self):
        """Middle of each bin, (D,)."""
        return 0.5 * (self.edges[:-1] + self.edges[1:])

    @property
    def minimum(self) -> tuple[float, float]:
        """(x, g_y) of the least value; x at the vertex of a parabola through it and both neighbours, if they exist."""
        return _minimum(self.centres, self.values)


def _minimum(x, g):
    finite = np.flatnonzero(np.isfinite(g))
    row = finite[np.argmin(g[finite])]
    if 0 < row < len(x) - 1 and np.isfinite(g[row - 1 : row + 2]).all():
        curvature = g[row - 1] - 2 * g[row] + g[row + 1]
        if curvature > 0:
            vertex = x[row] + 0.5 * (g[row - 1] - g[row + 1]) / curvature * (x[row + 1] - x[row])
            return float(vertex), float(g[row])
    return float(x[row]), float(g[row])


def _minimum_errors(x, products, pairs, squares):
    """Standard errors of (x, g_y) of the minimum, by bootstrap over SNAPSHOT_BLOCKS of consecutive snapshots."""
    if len(squares) < 2 * SNAPSHOT_BLOCKS:
        return np.nan, np.nan
    parts = [np.array_split(array, SNAPSHOT_BLOCKS) for array in (products, pairs, squares)]
    products, pairs = (np.array([block.sum(0) for block in part]) for part in parts[:2])
    squares = np.array([block.mean() for block in parts[2]])
    minima = []
    for draw in draws_of(SNAPSHOT_BLOCKS, BOOTSTRAP_SAMPLES):
        with np.errstate(invalid="ignore"):
            g = products[draw].sum(0) / pairs[draw].sum(0) / squares[draw].mean()
        minima.append(_minimum(x, g))
    return tuple((small_sample_factor(SNAPSHOT_BLOCKS) * np.std(minima, axis=0, ddof=1)).tolist())


def lane_products(positions, cell, v, half_width, bins):
    """Sums over the pairs of one snapshot with |y_ij| < half_width, of a lane: (Σ v_i v_j (B,), pairs (B,)).

    In space also |z_ij| < half_width. positions (N, D) anywhere; cell (D, D) rows (Lx, 0), (γ Ly, Ly), in space
    (Lx, 0, 0), (γ Ly, Ly, 0), (0, 0, Lz); v (N,); bins: edges (B + 1,) of |x|, at most Lx/2.
    """
    width, height = cell[0, 0], cell[1, 1]
    turns = np.floor(positions[:, 1] / height)
    y = positions[:, 1] - turns * height
    order = np.argsort(y)
    x, y, v = (positions[:, 0] - turns * cell[1, 0])[order], y[order], v[order]
    n, depth = len(y), positions[order, 2:].T  # z, if there is one
    products, pairs = np.zeros(len(bins) - 1), np.zeros(len(bins) - 1)
    for shift in range(1, n):
        # the next disk up, beyond the top edge an image one cell higher
        across = np.arange(n) + shift >= n
        dy = np.roll(y, -shift) - y + height * across
        near = dy < half_width
        if not near.any():
            break
        for z in depth:
            dz = np.roll(z, -shift) - z
            near = near & (np.abs(dz - cell[2, 2] * np.round(dz / cell[2, 2])) < half_width)
        dx = np.roll(x, -shift) - x + cell[1, 0] * across
        dx = np.abs(dx - width * np.round(dx / width))[near]
        products += np.histogram(dx, bins, weights=(np.roll(v, -shift) * v)[near])[0]
        pairs += np.histogram(dx, bins)[0]
    return products, pairs


def correlate_velocities(
    snapshots, diameter: float, rate: float, lane: float, width: float
) -> LaneCorrelation:
    """g_y of snapshots of flows of one kind, in bins of |x|.

    snapshots   iterable of (positions (N, D), v_y (N,), cell (D, D)), one at least
    diameter    mean diameter of the disks; lengths in its units:
    lane        width of the lane around each disk, whose pairs have |y| < lane/2, in space also |z| < lane/2
    width       of a bin

    Raises InputError for lanes or bins that do not fit, and for velocities that are rounding.
    """
    products, pairs, squares = [], [], []
    edges = None
    for x, v, cell in snapshots:
        interrupts.check()
        if edges is None:
            edges = _bin_edges(cell, diameter, lane, width)
        sums = lane_products(x, cell, v, 0.5 * lane * diameter, edges)
        products.append(sums[0])
        pairs.append(sums[1])
        squares.append(np.mean(v**2))
    products, pairs = np.array(products), np.array(pairs)
    square, counts = float(np.mean(squares)), pairs.sum(0)
    if not square > (ROUNDING_LIMIT * rate * diameter) ** 2:
        raise InputError(
            f"|u_y| is rounding, as in a perfect crystal (at most {ROUNDING_LIMIT:g} mean diameters per strain). "
            "Give another flow."
        )
    squares = np.array(squares)
    with np.errstate(invalid="ignore", divide="ignore"):
        values = products.sum(0) / counts / square
        # what each snapshot adds to the ratio of these sums, to first order: motions that are faster are so in both
        terms = (products / square - values * pairs) * (len(pairs) / counts)
        terms -= values * (squares / square - 1.0)[:, None]
    errors = np.array([Average.of(column).error for column in terms.T])
    minimum_errors = _minimum_errors(0.5 * (edges[:-1] + edges[1:]), products, pairs, squares)
    mean_square = square / rate**2
    return LaneCorrelation(edges, values, errors, counts, mean_square, len(pairs), diameter, minimum_errors)


def _bin_edges(cell, diameter, lane, width):
    """Edges of the bins of |x|, up to half of the cell. Raises InputError for a lane or bin that does not fit."""
    step, half, height = width * diameter, 0.5 * cell[0, 0], cell.diagonal()[1:].min()
    if cell[2:, :2].any():
        raise InputError(
            "cell: tilted along z, not supported here. Give a flow that began in an upright cell."
        )
    if not 2.0 * (0.5 * lane * diameter) < height:
        raise InputError(
            f"{named('lane')} {lane:g}: must be less than the height of the cell, "
            f"{height / diameter:.4g} mean diameters"
        )
    if not step <= half:
        raise InputError(
            f"{named('bin')} {width:g}: must be at most half the width of the cell, "
            f"{half / diameter:.4g} mean diameters"
        )
    return step * np.arange(int(half / step + 1e-9) + 1)

"""g_y(x) of flow files: correlation of transverse velocities, averaged over snapshots, with errors."""

from dataclasses import dataclass

import numpy as np

from jampetsc import interrupts
from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.displacement_correlation import ROUNDING
from jampetsc.analysis.statistics import draws_of, small_sample_factor
from jampetsc.analysis.velocities import check_snapshots, lane_products
from jampetsc.errors import InputError, named

FORMAT = "jampetsc-velocity-correlation"
ALIKE = ("model", "rate", "particle_count", "mass")  # attributes that files averaged together must share
SAME_PHI = 1e-6
BLOCKS, DRAWS = 10, 200
LANE, BIN = 1.0, 1.0  # widths of a lane in y and of a bin in x, in mean diameters, by default


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
    minimum_errors: tuple = (np.nan, np.nan)  # of `minimum`, standard; nan for fewer than 2 BLOCKS snapshots

    @property
    def centres(self):
        """Middle of each bin, (D,)."""
        return 0.5 * (self.edges[:-1] + self.edges[1:])

    @property
    def minimum(self) -> tuple[float, float]:
        """(x, g_y) of the least value; x at the vertex of a parabola through it and both neighbours, if they exist."""
        return _minimum(self.centres, self.values)


def _minimum(x, g):
    known = np.flatnonzero(np.isfinite(g))
    at = known[np.argmin(g[known])]
    if 0 < at < len(x) - 1 and np.isfinite(g[at - 1 : at + 2]).all():
        bend = g[at - 1] - 2 * g[at] + g[at + 1]
        if bend > 0:
            return float(x[at] + 0.5 * (g[at - 1] - g[at + 1]) / bend * (x[at + 1] - x[at])), float(g[at])
    return float(x[at]), float(g[at])


def _minimum_errors(x, products, pairs, squares):
    """Standard errors of (x, g_y) of the minimum, by bootstrap over BLOCKS of consecutive snapshots."""
    if len(squares) < 2 * BLOCKS:
        return np.nan, np.nan
    parts = [np.array_split(array, BLOCKS) for array in (products, pairs, squares)]
    products, pairs = (np.array([block.sum(0) for block in part]) for part in parts[:2])
    squares = np.array([block.mean() for block in parts[2]])
    found = []
    for draw in draws_of(BLOCKS, DRAWS):
        with np.errstate(invalid="ignore"):
            g = products[draw].sum(0) / pairs[draw].sum(0) / squares[draw].mean()
        found.append(_minimum(x, g))
    return tuple((small_sample_factor(BLOCKS) * np.std(found, axis=0, ddof=1)).tolist())


def correlate_lanes(results, lane: float, width: float) -> LaneCorrelation:
    """g_y of the snapshots of all `results` (loaded flow files), in bins of |x|.

    lane   width of the lane around each disk, whose pairs have |y| < lane/2, in mean diameters
    width  of a bin, in mean diameters

    Raises InputError for files without snapshots or of different kinds, and for lanes or bins that do not fit.
    """
    first = results[0]
    products, pairs, squares = [], [], []
    edges = None
    for result in results:
        if "snapshots/velocities" not in result:
            raise InputError(f"{result.path}: holds no snapshots: run the flow with {named('snapshots')}")
        if "walls" in result.attributes:
            raise InputError(
                f"{result.path}: a flow between walls is not homogeneous: g_y(x) is of flow without them"
            )
        for name in ALIKE:
            mine, other = result.attributes.get(name), first.attributes.get(name)
            if mine != other:
                raise InputError(
                    f"{result.path}: {name} {mine}, but {first.path.name} has {other}: average one kind"
                )
        if abs(result.attributes["phi"] - first.attributes["phi"]) > SAME_PHI:
            raise InputError(f"{result.path}: another phi than {first.path.name}: average one kind")
        check_snapshots(result)
        positions, velocities, cells = (result[f"snapshots/{n}"] for n in ("positions", "velocities", "cell"))
        if edges is None:
            diameter = 2.0 * float(np.mean(first["state/radii"]))
            reach, step = 0.5 * lane * diameter, width * diameter
            half, height = 0.5 * cells[0][0, 0], cells[0][1, 1]
            if not 2.0 * reach < height:
                raise InputError(
                    f"{named('lane')} {lane:g}: must be less than the cell's height, "
                    f"{height / diameter:.4g} mean diameters"
                )
            if not step <= half:
                raise InputError(
                    f"{named('bin')} {width:g}: must be at most half of the cell's width, "
                    f"{half / diameter:.4g} mean diameters"
                )
            edges = step * np.arange(int(half / step + 1e-9) + 1)
        for x, u, cell in zip(positions, velocities, cells, strict=True):
            interrupts.check()
            found = lane_products(x, cell, u[:, 1], reach, edges)
            products.append(found[0])
            pairs.append(found[1])
            squares.append(np.mean(u[:, 1] ** 2))
    products, pairs = np.array(products), np.array(pairs)
    square, counts = float(np.mean(squares)), pairs.sum(0)
    rate = float(first.attributes["rate"])
    if not square > (ROUNDING * rate * diameter) ** 2:
        raise InputError(
            f"{first.path}: |u_y| is rounding, at most {ROUNDING:g} mean diameters per strain, as in a perfect "
            "crystal: nothing to correlate"
        )
    squares = np.array(squares)
    with np.errstate(invalid="ignore", divide="ignore"):
        values = products.sum(0) / counts / square
        # what each snapshot adds to the ratio of these sums, to first order: motions that are faster are so in both
        moved = (products / square - values * pairs) * (len(pairs) / counts)
        moved -= values * (squares / square - 1.0)[:, None]
    errors = np.array([Average.of(column).error for column in moved.T])
    least = _minimum_errors(0.5 * (edges[:-1] + edges[1:]), products, pairs, squares)
    return LaneCorrelation(edges, values, errors, counts, square / rate**2, len(pairs), diameter, least)

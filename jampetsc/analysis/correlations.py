"""Correlation of transverse displacements along the flow direction, in narrow lanes (BT Fig. 7).

    C(δ) = ⟨u_y(x) u_y(x + δ)⟩ / ⟨u_y²⟩ ,

averaged over pairs of disks in the same lane, a strip along x of given width (`lane_sums`). u_y has no affine part
under u_x = γ y, so C is that of the non-affine motion. Real and imaginary part of a field, in phase with the stress (or
the strain) and with its rate, are correlated each with itself. In a periodic cell a lane closes on itself after
L = |a₁|, so C is even about δ = L/2.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.lane_sums import LaneSums
from jampetsc.analysis.statistics import draws_of, small_sample_factor
from jampetsc.errors import InputError

ENOUGH_PACKINGS = 5  # from so many on, whole packings are resampled
SAMPLES = 200  # of the bootstrap
ROUNDING = 1e-12  # rms displacement per strain, in diameters, below which a field may be rounding alone


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


def correlate(packings) -> Correlation:
    """C(δ) of many packings from their LaneSums of equal F and D, each packing normalised by itself.

    Errors by bootstrap over packings, or over strips of lanes where there are fewer than five packings.
    Strips next to each other are correlated over the length that is to be found: for few packings the errors
    are lower bounds. Raises InputError where no lane holds two disks.
    """
    packings = list(packings)
    units = _units(packings)
    if not units.pairs.sum():
        raise InputError(f"lanes of width {packings[0].width:g} hold no two disks: use wider lanes")
    count = len(units.disks)
    with np.errstate(invalid="ignore"):
        separation = np.r_[0.0, units.separations.sum(axis=0) / units.pairs.sum(axis=0)]

    def found(drawn):
        """(F, D + 3): C, its root and the place of its minimum, of the units numbered in `drawn`."""
        values = _correlation(units, np.bincount(drawn, minlength=count))
        return np.hstack((values, [_places(separation, c) for c in values]))

    own = found(np.arange(count))
    errors = small_sample_factor(count) * _scatter(found, count)
    values, (root, minimum) = own[:, :-2], own[:, -2:].T
    value_errors, (root_error, minimum_error) = errors[:, :-2], errors[:, -2:].T
    pairs = int(units.pairs.sum())
    return Correlation(separation, values, value_errors, root, root_error, minimum, minimum_error, pairs)


def _units(packings) -> LaneSums:
    """The units that the bootstrap resamples, one row each: packings, or strips of lanes where packings are few."""
    joined = {}
    for name in ("products", "squares", "pairs", "separations", "disks"):
        parts = [getattr(sums, name) for sums in packings]
        if len(packings) >= ENOUGH_PACKINGS:
            parts = [part.sum(axis=0, keepdims=True) for part in parts]
        joined[name] = np.concatenate(parts)
    return replace(packings[0], **joined)


def _correlation(units, draws):
    """C (F, D + 1) with each unit counted `draws` times."""
    pairs, squares = draws @ units.pairs, (draws @ units.squares) / (draws @ units.disks)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(pairs > 0, np.tensordot(draws, units.products, 1) / pairs, np.nan)
        values = mean / squares[:, None]
    return np.concatenate((np.ones((len(values), 1)), values), axis=1)


def _scatter(statistic, count):
    """Standard deviation of statistic(rows) over draws of `count` units; nan where fewer than half have a value."""
    draws = draws_of(count, SAMPLES) if count > 1 else np.zeros((2, 1), int)
    samples = np.array([statistic(rows) for rows in draws])
    known = (2 * np.isfinite(samples).sum(axis=0) >= len(samples)) & (count > 1)
    scatter = np.full(samples.shape[1:], np.nan)
    scatter[known] = np.nanstd(samples[:, known], axis=0, ddof=1)
    return scatter


def _places(separation, values):
    """(first root, place of the minimum) of one C(δ)."""
    known = np.isfinite(values)
    return first_root(separation[known], values[known]), separation[known][np.argmin(values[known])]


def first_root(separation, values) -> float:
    """Where C first falls through zero, by linear interpolation between bins; nan if it does not."""
    below = np.flatnonzero(values <= 0)
    if not len(below):
        return float("nan")
    n = below[0]
    (x, y), (c, d) = separation[n - 1 : n + 1], values[n - 1 : n + 1]
    return float(x + (y - x) * c / (c - d))

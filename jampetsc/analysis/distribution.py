"""How quantities of a disordered network are distributed: over many decades, so medians and logarithmic bins
(BT Fig. 5).
"""

import math
from dataclasses import dataclass

import numpy as np

BINS = 10  # per decade
DECADES = 10  # below the decade of the largest value; what is smaller falls into the first bin


@dataclass(frozen=True, eq=False)
class Distribution:
    """Magnitudes of one quantity: moments and a histogram. Bins b hold edges[b] ≤ |x| < edges[b + 1]."""

    median: float
    mean: float
    rms: float
    edges: np.ndarray  # (b + 1,) zero, then powers of 10^(1/BINS), the same for every packing
    counts: np.ndarray  # (b,)

    @classmethod
    def of(cls, values) -> "Distribution":
        """Distribution of |values| (M,), or of lengths (M, 2)."""
        size = np.abs(values) if values.ndim == 1 else np.hypot(values[:, 0], values[:, 1])
        # by the C library, whose log10 is exact at powers of ten; numpy's own for some processors need not be
        top = math.floor(math.log10(size.max())) + 1 if size.any() else 0
        exponents = np.arange(BINS * (top - DECADES), BINS * top + 1) / BINS
        edges = np.append(0.0, 10.0**exponents)
        counts = np.bincount(np.searchsorted(edges, size, side="right") - 1, minlength=len(edges) - 1)
        return cls(
            float(np.median(size)),
            float(np.mean(size)),
            float(np.sqrt(np.mean(size**2))),
            edges,
            counts,
        )


def ensemble_slope(x, y, group, repeats=400, seed=1):
    """(slope, its standard error) of ln y against ln x over an ensemble, by bootstrap over packings.

    x, y (M,) positive; group (M,) names the packing (a seed) that a point comes from: the same one at several
    pressures is not independent, so whole packings are drawn. The fit is through medians of y at each x.
    """
    x, y, group = np.asarray(x), np.asarray(y), np.asarray(group)

    def fit(rows):
        u = np.unique(x[rows])
        v = [np.median(y[rows][x[rows] == value]) for value in u]
        return np.polyfit(np.log(u), np.log(v), 1)[0]

    members = [np.flatnonzero(group == name) for name in np.unique(group)]
    rng = np.random.default_rng(seed)
    draws = [
        fit(np.concatenate([members[k] for k in rng.integers(len(members), size=len(members))]))
        for _ in range(repeats)
    ]
    return float(fit(np.arange(len(x)))), float(np.std(draws))

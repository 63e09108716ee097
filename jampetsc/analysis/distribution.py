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
            float(np.median(size)), float(np.mean(size)), float(np.sqrt(np.mean(size**2))), edges, counts
        )

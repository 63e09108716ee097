"""Correlation of transverse velocities along the flow (Vågberg, thesis eq. 4.23):

    g_y(x) = ⟨v_y(r) v_y(r + x x̂)⟩ / ⟨v_y²⟩ ,

over pairs of disks in the lane of width w around one of them, |y| < w/2, binned in |x|, both of the nearest image along
a lane; all pairs of all snapshots count alike. v_y has no affine part. Σ v_y = 0 makes g_y negative somewhere, by 1/N
even without correlations.
"""

import numpy as np

from jampetsc.errors import about
from jampetsc.packing.disks import Disks


def lane_products(positions, cell, v, reach, bins):
    """Sums over the pairs of one snapshot with |y_ij| < reach, half the width of a lane: (Σ v_i v_j (D,), pairs (D,)).

    positions (N, 2) anywhere, cell (2, 2) rows (Lx, 0), (γ Ly, Ly), v (N,); bins: edges (D + 1,) of |x|, at most Lx/2.
    """
    width, height = cell[0, 0], cell[1, 1]
    turns = np.floor(positions[:, 1] / height)
    y = positions[:, 1] - turns * height
    order = np.argsort(y)
    x, y, v = (positions[:, 0] - turns * cell[1, 0])[order], y[order], v[order]
    n = len(y)
    products, pairs = np.zeros(len(bins) - 1), np.zeros(len(bins) - 1)
    for shift in range(1, n):
        # the next disk up, beyond the top edge an image one cell higher
        across = np.arange(n) + shift >= n
        dy = np.roll(y, -shift) - y + height * across
        near = dy < reach
        if not near.any():
            break
        dx = np.roll(x, -shift) - x + cell[1, 0] * across
        dx = np.abs(dx - width * np.round(dx / width))[near]
        products += np.histogram(dx, bins, weights=(np.roll(v, -shift) * v)[near])[0]
        pairs += np.histogram(dx, bins)[0]
    return products, pairs


def check_snapshots(result) -> None:
    """Raise InputError where the snapshots of a loaded flow file have positions or cells that no disks have."""
    radii = result.get("snapshots/radii", result.get("state/radii"))  # older files have them in the state
    if radii is not None:
        with about(result.path):
            for places, cell in zip(result["snapshots/positions"], result["snapshots/cell"], strict=True):
                Disks.from_positions(places, radii, cell)

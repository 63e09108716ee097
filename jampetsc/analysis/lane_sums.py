"""Sums over pairs of disks in narrow lanes along the flow, for correlations of their displacements.

Disks are put on a grid finer than the bins of δ, and pairs are counted by Fourier transforms lane by lane: the work is
N log N. Sums are kept for strips of neighbouring lanes, so that errors come from resampling them.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError

BLOCKS = 8  # strips of one packing, for the error
_CELL = 1 / 8  # of the grid along x, in diameters
_BIN, _GROWTH = 4, 0.08  # width of a bin of δ: at least so many grid cells, and this fraction of δ


@dataclass(frozen=True, eq=False)
class LaneSums:
    """Sums over pairs in the lanes of one packing. P blocks of lanes, F fields, D bins of δ."""

    products: np.ndarray  # (P, F, D) Σ u_i u_j of fields with ⟨u²⟩ = 1 over the packing
    squares: np.ndarray  # (P, F) Σ u²
    pairs: np.ndarray  # (P, D)
    separations: np.ndarray  # (P, D) Σ δ/L
    disks: np.ndarray  # (P,)
    width: float  # of a lane, such that lanes fill the cell


def grid_cells(length: float, diameter: float) -> int:
    """Even number of grid cells along a cell of this length, for `lane_sums`."""
    return 2 * max(4, round(0.5 * length / (_CELL * diameter)))


def bin_edges(cells: int):
    """First lag of each bin of δ, in grid cells from 1: bins half a diameter wide, wider at larger δ."""
    edges = [1]
    while (last := edges[-1] + max(_BIN, round(_GROWTH * edges[-1]))) <= cells // 2:
        edges.append(last)
    return np.array(edges)


def lane_sums(positions, cell, fields, width: float, cells: int) -> LaneSums:
    """Sums over pairs for positions (n, 2), cell rows (2, 2), real fields (F, n), lanes about `width` wide.

    cells: number of grid cells along x (`grid_cells`), the same for all packings to be averaged.
    Raises InputError for a width that is not positive or exceeds the cell, and for no disks.
    """
    positions, cell, fields = (np.asarray(a, float) for a in (positions, cell, fields))
    length, height = cell[0, 0], cell[1, 1]
    if not 0 < width <= height:
        raise InputError(f"lane width {width:g}: must be positive and at most the cell's height, {height:g}")
    if not len(positions):
        raise InputError("no disks to correlate: every one is a rattler")
    lanes = max(1, round(height / width))
    reduced = (positions @ np.linalg.inv(cell)) % 1.0
    lane = np.minimum((reduced[:, 1] * lanes).astype(int), lanes - 1)
    # a disk wrapped in y has moved by a₂, so in x too: the product with the cell's rows takes that along
    along = (reduced @ cell)[:, 0] / length % 1.0
    place = lane * cells + np.minimum((along * cells).astype(int), cells - 1)
    blocks = min(BLOCKS, lanes)
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
        width=height / lanes,
    )

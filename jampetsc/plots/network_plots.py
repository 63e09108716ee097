"""Networks: bonds as lines in the periodic cell, coloured by their force."""

import numpy as np
from matplotlib.collections import LineCollection

from jampetsc.plots.packing_plots import (
    clip_artists,
    frame_cells,
    lay_out,
    refuse_spheres,
    segment_images,
    wrap,
)
from jampetsc.plots.picture import picture
from jampetsc.plots.style import COLUMN, PAGE, hidden, number

MAX_VECTOR_BONDS = 15000  # beyond, vector files hold pixels
REST, PUSH, PULL = "0.15", "#b2182b", "#2166ac"  # colours of bonds without force, that push, that pull
WIDEST = 1.6  # points: of the largest force, and of bonds without any at half of it


@picture("network", "network", single=True)
def plot_network(results, page):
    """Bonds as lines; red pushes, blue pulls, as wide as the force, where bonds have forces.

    Bonds that cross the boundary appear on both sides of the cell, cut at its edge.
    """
    (network,) = results
    refuse_spheres(network)
    bonds = network.linear_bonds
    width = COLUMN if len(bonds) <= MAX_VECTOR_BONDS else PAGE
    ((ax, outline),) = frame_cells(page, [network.cell], 1, width)
    ax.set_xlabel(_caption(network), linespacing=1.4)
    lay_out(page, 1)
    start = wrap(network.positions, network.cell)[bonds.i]
    rows, starts = segment_images(start, bonds.r, network.cell)
    look = {"capstyle": "round", "zorder": 2, "label": hidden("bonds")}
    segments = np.stack((starts, starts + bonds.r[rows]), axis=1)
    drawn = LineCollection(segments, linewidths=_widths(bonds)[rows], colors=_colours(bonds)[rows], **look)
    ax.add_collection(drawn, autolim=False)
    clip_artists(outline, [drawn], rasterized=len(bonds) > MAX_VECTOR_BONDS)
    return f"network of {network.n} nodes and {len(bonds)} bonds"


def _widths(bonds):
    largest = np.abs(bonds.force).max()
    return np.full(len(bonds), WIDEST / 2) if not largest else WIDEST * np.abs(bonds.force) / largest


def _colours(bonds):
    return np.array([PULL, REST, PUSH])[np.sign(bonds.force).astype(int) + 1]


def _caption(network):
    parts = [f"$N={network.n}$", f"{len(network.bonds)} bonds"]
    if not network.tension.any():
        return "   ".join(parts)
    parts.append(f"$p/k={number(network.pressure / network.k)}$")
    return "   ".join(parts) + "\nred pushes, blue pulls;  line width $\\propto$ force"

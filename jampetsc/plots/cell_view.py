"""A cell of three dimensions as seen from outside, beside its slice: axes, edges, bonds that fade with the depth."""

from itertools import product

import numpy as np
from matplotlib.collections import LineCollection

from jampetsc.plots.cell_drawing import (
    CAPTION_HEIGHT,
    MAX_ASPECT,
    MAX_VECTOR_BONDS,
    frame_cell,
    segment_images,
    visible_shares,
    wrap,
)
from jampetsc.plots.style import PAGE

TO_EYE = (0.42, 0.36, 1.0)  # x to the right, y up, z out of the paper
SLICE_COLOUR = "#b2182b"
# colours fade behind the faces to this part, within this depth in mean bond lengths
BOND_FADING_DEPTH, DEEPEST_COLOUR = 2.5, 0.12
HALO_LENGTH = 0.7  # of the bond, so that the ends of its neighbours stay
HALO_WIDTH = 0.7  # points of white on both sides of a bond, which tells bonds in front from those behind
VIEW_NOTE = "$x$ right, $y$ up, $z$ to the front"


def frame_slices(page, sections, views):
    """([(axes, outline)] of slices, [axes] of views): a row for each slice and its view."""
    ratio = max(view.aspect for view in views)
    for (length, _), (tilt, side) in (section.cell for section in sections):
        ratio = max(ratio, min(side / (length + abs(tilt)), MAX_ASPECT))
    count = len(sections)
    axes = page.panels(count, 2, PAGE, count * (PAGE / 2 * ratio + CAPTION_HEIGHT), letters=False)
    slices, seen = np.reshape(axes, (-1, 2)).T
    for ax, view in zip(seen, views, strict=True):
        view.frame(ax)
    return [(ax, frame_cell(ax, section.cell)) for ax, section in zip(slices, sections, strict=True)], seen


class CellView:
    """A cell (3, 3) along TO_EYE, without perspective.

    axes        (3, 3) orthonormal rows: to the right, up, to the eye
    low, high   (2,) corners of the picture, which holds the cell and spheres at places (N, 3) with their radii (N,)
    """

    def __init__(self, cell, places=None, radii=None):
        eye = np.array(TO_EYE) / np.linalg.norm(TO_EYE)
        right = np.cross((0.0, 1.0, 0.0), eye)
        right /= np.linalg.norm(right)
        self.axes, self.cell = np.array([right, np.cross(eye, right), eye]), cell
        corners = self._place(list(product((0, 1), repeat=3)))
        self.low, self.high = corners.min(axis=0), corners.max(axis=0)
        margin = 0.01 * (self.high - self.low)
        if places is not None:
            centres = places @ self.axes[:2].T
            self.low = np.minimum(self.low, (centres - radii[:, None]).min(axis=0))
            self.high = np.maximum(self.high, (centres + radii[:, None]).max(axis=0))
        self.low, self.high = self.low - margin, self.high + margin

    @property
    def aspect(self) -> float:
        """Height over width."""
        width, height = self.high - self.low
        return height / width

    def _place(self, fractional):
        """Places on paper (…, 2) of fractional coordinates (…, 3)."""
        return np.asarray(fractional, float) @ self.cell @ self.axes[:2].T

    def frame(self, ax) -> None:
        """Limits of the picture on `ax`, without ticks."""
        (x0, y0), (x1, y1) = self.low, self.high
        ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
        ax.spines[:].set_visible(False)

    def depth_in_cell(self, points):
        """How far points (M, 3) in the axes of the view are behind the faces of the cell along the line of sight."""
        inverse = np.linalg.inv(self.cell)
        fractional, slopes = points @ self.axes @ inverse, self.axes[2] @ inverse
        crossed = slopes != 0
        ways = ((slopes > 0) - fractional)[:, crossed] / slopes[crossed]
        return np.maximum(ways.min(axis=1), 0.0)

    def draw_edges(self, ax, height) -> None:
        """The edges of the cell, and the edge of the slice on the faces that are seen."""
        seen = (self.axes[2] @ np.linalg.inv(self.cell)) > 0  # faces at 1 along a vector, else those at 0
        corners = np.array(list(product((0, 1), repeat=3)))
        edges = [(a, b) for a in corners for b in corners if (b - a).sum() == 1 and (b != a).sum() == 1]
        hidden = np.array([(a != seen).sum() == 3 or (b != seen).sum() == 3 for a, b in edges])
        places = self._place(edges)
        for mask, layer in ((hidden, 0), (~hidden, 3)):
            look = {"colors": "0.2", "linewidths": 0.6, "capstyle": "round", "zorder": layer}
            ax.add_collection(LineCollection(places[mask], **look), autolim=False)
        near, far = seen.astype(float), 1.0 - seen
        line = self._place([(far[0], near[1], height), (near[0], near[1], height), (near[0], far[1], height)])
        look = {"colors": SLICE_COLOUR, "linewidths": 0.9, "linestyles": "dashed", "zorder": 3}
        ax.add_collection(LineCollection([line], **look), autolim=False)

    def draw_bonds(self, ax, starts, vectors, widths, colours) -> None:
        """Bonds start → start + vector (M, 3) with their images, cut at the faces of the cell, the nearest in front.

        Colours (M, 3) fade with the depth behind the faces.
        """
        rows, starts = segment_images(wrap(starts, self.cell), vectors, self.cell)
        vectors, inverse = vectors[rows], np.linalg.inv(self.cell)
        first, last = visible_shares(starts @ inverse, vectors @ inverse, 0.0, 1.0)
        inside = last > first
        ends = starts[:, None] + np.stack((first, last), axis=1)[..., None] * vectors[:, None]
        ends, rows = ends[inside] @ self.axes.T, rows[inside]
        middles = ends.mean(axis=1)
        length = BOND_FADING_DEPTH * np.linalg.norm(vectors, axis=1).mean()
        share = DEEPEST_COLOUR + (1 - DEEPEST_COLOUR) * np.exp(-self.depth_in_cell(middles) / length)
        order = np.argsort(middles[:, 2])
        lines, middles, rows = ends[order, :, :2], middles[order, None, :2], rows[order]
        faded, white = 1 - share[order, None] * (1 - colours[rows]), np.ones((len(order), 3))
        halos, widths = middles + HALO_LENGTH * (lines - middles), widths[rows]
        drawn = LineCollection(
            np.stack((halos, lines), axis=1).reshape(-1, 2, 2),  # each halo below its bond
            colors=np.stack((white, faded), axis=1).reshape(-1, 3),
            linewidths=np.stack((widths + 2 * HALO_WIDTH, widths), axis=1).ravel(),
            capstyle="butt", zorder=1, in_layout=False, rasterized=len(lines) > MAX_VECTOR_BONDS,
        )  # fmt: skip
        ax.add_collection(drawn, autolim=False)

"""Drawing in a periodic, possibly sheared cell of the plane: its outline, images of disks and segments, force lines."""

from itertools import product

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.patches import Polygon

from jampetsc.plots.style import hidden

MAX_ASPECT = 2.5  # height over width of a cell; taller cells shrink
MAX_VECTOR_BONDS = 15000  # beyond, vector files hold pixels
CAPTION_HEIGHT = 0.42  # inches above and below a panel
EDGE_TOLERANCE = 1e-9  # of the cell: what lies on its edge counts as inside
MAX_FORCE_WIDTH = 2.0  # points: of the line of a mean force


def wrap(positions, cell):
    """Positions (N, D) moved by cell vectors into the cell."""
    fractional = positions @ np.linalg.inv(cell)
    return (fractional - np.floor(fractional)) @ cell


def disk_images(centres, radii, cell):
    """(rows, centres) of all images of the disks that reach into the cell; `centres` (N, 2) lie in it."""
    inverse = np.linalg.inv(cell)
    reach = radii[:, None] * np.linalg.norm(inverse, axis=0)  # in fractional coordinates
    return _images(centres @ inverse - reach, centres @ inverse + reach, centres, cell)


def segment_images(start, vector, cell):
    """(rows, starts) of all images that may cross the cell of segments start → start + vector, (M, D).

    Those along an edge of the cell have an image on both of its sides.
    """
    inverse = np.linalg.inv(cell)
    ends = np.stack((start @ inverse, (start + vector) @ inverse))
    low, high = ends.min(axis=0), ends.max(axis=0)
    margin = EDGE_TOLERANCE * (high - low < EDGE_TOLERANCE)
    return _images(low - margin, high + margin, start, cell)


def _images(low, high, anchors, cell):
    """Images of fractional boxes [low, high] that overlap the unit cell: their rows and shifted anchors."""
    rows, points = [], []
    for shift in np.array(list(product((-1, 0, 1), repeat=len(cell)))):
        seen = np.flatnonzero(((high + shift > 0) & (low + shift < 1)).all(axis=1))
        rows.append(seen)
        points.append(anchors[seen] + shift @ cell)
    return np.concatenate(rows), np.concatenate(points)


def visible_shares(starts, vectors, low, high):
    """(first, last) (…,) shares of vectors (…, K) between which start + share · vector lies from low to high.

    Along all K axes; where it does so nowhere, last ≤ first.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # of vectors along a face
        to_low = (low - EDGE_TOLERANCE - starts) / vectors
        to_high = (high + EDGE_TOLERANCE - starts) / vectors
    first, last = np.fmin(to_low, to_high).max(axis=-1), np.fmax(to_low, to_high).min(axis=-1)
    return np.maximum(first, 0.0), np.minimum(last, 1.0)


def frame_cells(page, cells, rows, width, linewidth=0.6) -> list:
    """[(axes, outline of its cell, at which `clip_artists` cuts its content)] of cells [(2, 2), …] in rows.

    No cell is higher than MAX_ASPECT times its width.
    """
    page.refuse_choice()
    columns = len(cells) // rows
    ratio = max(cell[1, 1] / (abs(cell[0, 0]) + abs(cell[1, 0])) for cell in cells)
    height = rows * (width / columns * min(ratio, MAX_ASPECT) + CAPTION_HEIGHT)
    axes = np.ravel(page.panels(rows, columns, width, height, letters=False))
    return [(ax, frame_cell(ax, cell, linewidth)) for ax, cell in zip(axes, cells, strict=True)]


def lay_out(page, rows, note=0.0) -> None:
    """Give framed axes their place on paper, which widths of lines follow; `note`: inches of what stands below them.

    A figure loses the height that they do not need.
    """
    page.figure.draw_without_rendering()
    if page.is_new and page.size is None:
        heights = np.reshape([ax.get_tightbbox().height for ax in page.axes], (rows, -1)) / page.figure.dpi
        needed = (heights.max(axis=1) + 0.12).sum() + note
        page.figure.set_figheight(min(needed, page.figure.get_figheight()))
        page.figure.draw_without_rendering()
    page.laid_out = True


def frame_cell(ax, cell, linewidth=0.6):
    """The outline (a polygon) of a cell (2, 2), which fills the axes."""
    corners = np.array([(0.0, 0.0), cell[0], cell[0] + cell[1], cell[1]])
    outline = Polygon(corners, closed=True, fill=False, edgecolor="0.3", linewidth=linewidth, zorder=5)
    ax.add_patch(outline)
    margin = 0.01 * np.ptp(corners, axis=0)
    (x0, y0), (x1, y1) = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
    ax.spines[:].set_visible(False)
    return outline


def clip_artists(outline, artists, rasterized=False) -> None:
    """Cut artists at an outline; they do not count for the layout."""
    for artist in artists:
        artist.set(clip_path=outline, in_layout=False, rasterized=rasterized)


def points_per_length(ax) -> float:
    """How long a unit of length is on paper, in points; of axes that are laid out."""
    ax.apply_aspect()
    (x0, _), (x1, _) = ax.transData.transform([(0, 0), (1, 0)])
    return (x1 - x0) * 72 / ax.figure.dpi


def draw_circles(ax, places, diameters, **look) -> EllipseCollection:
    """Circles (M,) at places (M, 2), drawn on `ax`."""
    look = {"offsets": places, "transOffset": ax.transData, "label": hidden("disks"), "zorder": 1} | look
    drawn = EllipseCollection(diameters, diameters, np.zeros(len(places)), units="xy", **look)
    return ax.add_collection(drawn, autolim=False)


def draw_disks(ax, places, radii, hollow, walls, cell, linewidth):
    """Disks (M,) at places (M, 2) in the cell with their images; masks (M,): `hollow` ones white, `walls` dark."""
    rows, places = disk_images(places, radii, cell)
    hollow, walls = hollow[rows, None], walls[rows]
    faces = np.where(hollow, (1.0, 1.0, 1.0, 1.0), (0.88, 0.88, 0.88, 1.0))
    faces[walls] = (0.45, 0.45, 0.45, 1.0)
    edges = np.where(hollow, (0.35, 0.35, 0.35, 1.0), (0.6, 0.6, 0.6, 1.0))
    look = {"facecolors": faces, "edgecolors": edges, "linewidths": linewidth}
    return draw_circles(ax, places, 2 * radii[rows], **look)


def draw_forces(ax, starts, vectors, forces, width, cell):
    """Lines start → start + vector (M, 2) with their images, as wide as forces (M,) times a width (a length)."""
    width = min(MAX_FORCE_WIDTH, width * points_per_length(ax))
    rows, starts = segment_images(starts, vectors, cell)
    segments = np.stack((starts, starts + vectors[rows]), axis=1)
    look = {"colors": "0.05", "capstyle": "round", "zorder": 2, "label": hidden("contacts")}
    return ax.add_collection(LineCollection(segments, linewidths=width * forces[rows], **look), autolim=False)

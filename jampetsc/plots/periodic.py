"""Drawing in a periodic, possibly sheared cell: parts that cross a border appear on the other side."""

import numpy as np
from matplotlib.patches import Polygon

TALLEST = 2.5  # heights beyond this many widths are shrunk to fit
CAPTION = 0.42  # inches above and below a panel
_SHIFTS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])


def wrap(positions, cell):
    """Positions (N, 2) moved by cell vectors into the cell."""
    fractional = positions @ np.linalg.inv(cell)
    return (fractional - np.floor(fractional)) @ cell


def disk_images(centres, radii, cell):
    """(rows, centres) of all images of the disks that reach into the cell; `centres` (N, 2) lie in it."""
    inverse = np.linalg.inv(cell)
    reach = radii[:, None] * np.linalg.norm(inverse, axis=0)  # in fractional coordinates
    return _images(centres @ inverse - reach, centres @ inverse + reach, centres, cell)


def segment_images(start, vector, cell):
    """(rows, starts) of all images that may cross the cell of segments start → start + vector, (M, 2)."""
    inverse = np.linalg.inv(cell)
    ends = np.stack((start @ inverse, (start + vector) @ inverse))
    return _images(ends.min(axis=0), ends.max(axis=0), start, cell)


def _images(low, high, anchors, cell):
    """Images of fractional boxes [low, high] that overlap the unit square: their rows and shifted anchors."""
    rows, points = [], []
    for shift in _SHIFTS:
        seen = np.flatnonzero(((high + shift > 0) & (low + shift < 1)).all(axis=1))
        rows.append(seen)
        points.append(anchors[seen] + shift @ cell)
    return np.concatenate(rows), np.concatenate(points)


def framed(page, cells, rows, width, linewidth=0.6) -> list:
    """[(axes, outline of its cell, at which `within` cuts what is in it)] of cells [(2, 2), …] in rows.

    No cell is higher than TALLEST times its width.
    """
    columns = len(cells) // rows
    ratio = max(cell[1, 1] / (abs(cell[0, 0]) + abs(cell[1, 0])) for cell in cells)
    height = rows * (width / columns * min(ratio, TALLEST) + CAPTION)
    axes = np.ravel(page.panels(rows, columns, width, height, letters=False))
    return [(ax, _frame(ax, cell, linewidth)) for ax, cell in zip(axes, cells, strict=True)]


def lay_out(page, rows, note=0.0) -> None:
    """Give framed axes their place on paper, which widths of lines follow; `note`: inches of what stands below them.

    A figure loses the height that they do not need.
    """
    page.figure.draw_without_rendering()
    if page.own and page.size is None:
        heights = np.reshape([ax.get_tightbbox().height for ax in page.axes], (rows, -1)) / page.figure.dpi
        needed = (heights.max(axis=1) + 0.12).sum() + note
        page.figure.set_figheight(min(needed, page.figure.get_figheight()))
        page.figure.draw_without_rendering()
    page.laid_out = True


def _frame(ax, cell, linewidth):
    corners = np.array([(0.0, 0.0), cell[0], cell[0] + cell[1], cell[1]])
    outline = Polygon(corners, closed=True, fill=False, edgecolor="0.3", linewidth=linewidth, zorder=5)
    ax.add_patch(outline)
    margin = 0.01 * np.ptp(corners, axis=0)
    (x0, y0), (x1, y1) = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
    ax.spines[:].set_visible(False)
    return outline


def within(outline, artists, rasterized=False) -> None:
    """Cut artists at an outline; they do not count for the layout."""
    for artist in artists:
        artist.set(clip_path=outline, in_layout=False, rasterized=rasterized)


def points_per_length(ax) -> float:
    """How long a unit of length is on paper, in points; of axes that are laid out."""
    ax.apply_aspect()
    (x0, _), (x1, _) = ax.transData.transform([(0, 0), (1, 0)])
    return (x1 - x0) * 72 / ax.figure.dpi

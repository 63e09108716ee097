"""Drawing in a periodic, possibly sheared cell: what sticks out on one side comes in on the other."""

import numpy as np
from matplotlib.patches import Polygon

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


def frame_cell(ax, cell, linewidth=0.6) -> Polygon:
    """Draw the outline of the cell and fit the axes to it; returns it as a clip path for the contents."""
    corners = np.array([(0.0, 0.0), cell[0], cell[0] + cell[1], cell[1]])
    outline = Polygon(corners, closed=True, fill=False, edgecolor="0.3", linewidth=linewidth, zorder=5)
    ax.add_patch(outline)
    margin = 0.01 * np.ptp(corners, axis=0)
    (x0, y0), (x1, y1) = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    ax.set_axis_off()
    return outline


def extent(cell):
    """Width and height of the cell's bounding box."""
    return abs(cell[0, 0]) + abs(cell[1, 0]), cell[1, 1]

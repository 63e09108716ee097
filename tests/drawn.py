"""What a picture shows, as numbers: the figure of a plot instead of its file."""

import sys

import numpy as np
import pytest


def figure_of(plot, *what, **settings):
    """The figure that a function of `jampetsc.plots` draws."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules[plot.__module__], "save", lambda fig, path: found.append(fig))
        plot(*what, path="no.png", **settings)
    (figure,) = found
    return figure


def require_inside(fig):
    """That nothing which is drawn reaches beyond the page, but for the width of a line."""
    fig.draw_without_rendering()
    drawn, (width, height) = fig.get_tightbbox(), fig.get_size_inches()
    assert min(drawn.x0, drawn.y0, width - drawn.x1, height - drawn.y1) > -0.02, drawn


def lines(ax, count=None):
    """[(x, y, line style, face of its markers)] of the lines of an axes, or of those with so many points."""
    found = []
    for line in ax.get_lines():
        x, y = (np.atleast_1d(np.asarray(values, float)) for values in line.get_data())
        if count in (None, len(x)):
            found.append((x, y, line.get_linestyle(), line.get_markerfacecolor()))
    return found


def bars(ax):
    """[(x, y, how far down, how far up)] of what has error bars."""
    found = []
    for container in ax.containers:
        x, y = (np.asarray(values, float) for values in container.lines[0].get_data())
        low, high = np.array([segment[:, 1] for segment in container.lines[2][0].get_segments()]).T
        found.append((x, y, y - low, high - y))
    return found


def bands(ax):
    """[(x, low, high)] of what `fill_between` has drawn."""
    found = []
    for collection in ax.collections:
        corners = np.concatenate([path.vertices for path in collection.get_paths()])
        x = np.unique(corners[:, 0])
        ends = [corners[corners[:, 0] == one, 1] for one in x]
        found.append((x, np.array([end.min() for end in ends]), np.array([end.max() for end in ends])))
    return found

"""What a picture shows, as numbers: the axes of a plot instead of its file."""

import re

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.text import Text

from jampetsc.io.reader import RESULTS
from jampetsc.io.result_file import ArrayInMemory
from jampetsc.plots.page import Page
from jampetsc.plots.style import MARKERS, drawn_in


def held(arrays, attributes, path="a.h5", format="jampetsc-jam"):
    """A result in memory under the name of a file, with these arrays and attributes alone."""
    arrays = {name: ArrayInMemory(np.array(values)) for name, values in arrays.items()}
    return RESULTS[format]({**attributes, "format": format}, arrays, path)


def with_arrays(result, arrays):
    """The same result with more arrays."""
    return held({**result, **arrays}, result.attributes, result.path, result.format)


def figure_of(plot, results, **settings):
    """The figure that a picture of `jampetsc.plots` draws of these results, or of one, with `require_told`."""
    page = plot.draw(results if isinstance(results, list | tuple) else [results], **settings)
    assert page.text  # what a command says
    require_told(page.figure)
    for line in (line for ax in page.figure.axes for line in ax.get_lines()):
        data = line.get_zorder() >= 2 and line.get_marker() not in "_|" and line.get_linestyle() != ":"
        named = not line.get_label().startswith("_child")  # else it is in no table of numbers
        assert named or not data or _is_grey(line)
    return page.figure


def _is_grey(line):
    """As what shows no data, and what legends name without a colour."""
    return len(set(to_rgb(line.get_color()))) == 1


def require_told(fig):
    """That legends have the colours and markers which tell data apart, words 7 to 10 points, lines a chosen colour."""
    shown = [line for ax in fig.axes for line in ax.get_lines()]
    named = [line for ax in fig.axes if ax.get_legend() for line in ax.get_legend().findobj(Line2D)]
    hues, told_hues = ({to_rgb(o.get_color()) for o in some if not _is_grey(o)} for some in (shown, named))
    assert (hues == told_hues or not told_hues) and not hues & {to_rgb(f"C{n}") for n in range(10)}
    markers, told_markers = ({one.get_marker() for one in some} & set(MARKERS) for some in (shown, named))
    assert markers <= told_markers or not named
    assert all(7 <= text.get_fontsize() <= 10 for text in fig.findobj(Text) if text.get_text())


def told(ax):
    """The words of a legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def require_arrows(ax, field):
    """That arrows are rows of a field (n, 2), as many times as is told: one that leaves the cell is drawn twice."""
    factor, arrows = float(re.search(r"arrows \$([\d.]+)", ax.get_xlabel())[1]), ax.collections[-1]
    apart = np.column_stack((arrows.U, arrows.V))[:, None] / factor - field
    assert (
        np.abs(apart).max(axis=2).min(axis=0).max() < 1e-9
        and np.abs(apart).max(axis=2).min(axis=1).max() < 1e-9
    )


def drawn_by(draw, *what, **settings):
    """The figure that a function which draws on a page makes."""
    with drawn_in():
        page = Page()
        draw(*what, page=page, **settings)
        page.finish()
    require_told(page.figure)
    return page.figure


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


def circle_radii(circles):
    """Radii of drawn circles: half of the widths that matplotlib keeps, which has no public name before 3.8."""
    return circles._widths

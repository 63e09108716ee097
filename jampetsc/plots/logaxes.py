"""Log axes: ticks of short ones, guide slopes, and corners that are clear of data."""

from contextlib import contextmanager
from itertools import pairwise

import numpy as np
from matplotlib.path import Path
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from jampetsc.analysis.power_laws import local_slope
from jampetsc.plots.style import GREY, number, power_text

_SHORT = 2.0  # decades, below which powers of ten are too few
_LABELS = 7  # of powers of ten at most
_STEPS = ((1, 2, 5), (1, 3), (1,))  # labels in a decade, as many as there is room for
_CLOSE = 0.12  # a guide is drawn where the data's slope is this close to it
_SHORTEST, _LONGEST = 0.6, 2.5  # decades of a guide
_CORNERS = (
    "lower right", "upper left", "center right", "lower left", "upper right", "upper center", "lower center"
)  # fmt: skip


def set_ticks(axis) -> bool:
    """Ticks of a log axis: few powers of ten, on less than two decades also between them; whether those may be many."""
    if axis.get_scale() != "log" or isinstance(axis.get_major_locator(), FixedLocator):
        return False
    low, high = np.log10(sorted(axis.get_view_interval()))
    axis.set_minor_formatter(NullFormatter())
    if high - low >= _SHORT:
        step = int(np.ceil((np.floor(high) - np.ceil(low) + 1) / _LABELS))
        axis.set_major_locator(LogLocator(10.0**step, numticks=99))
        between = {"base": 10.0} if step > 1 else {"subs": range(2, 10)}
        axis.set_minor_locator(LogLocator(**between, numticks=99))
        return False
    axis.set_minor_locator(LogLocator(subs=range(2, 10)))
    return _label(axis, _STEPS[0])


def thin_ticks(axis) -> None:
    """Take labels of a short log axis that is laid out away until they stand apart."""
    for steps in _STEPS:
        if not _label(axis, steps):
            return
        boxes = [label.get_window_extent().padded(0.03 * axis.figure.dpi) for label in _labels(axis)]
        if not any(one.overlaps(other) for one, other in pairwise(boxes)):
            return


def _label(axis, steps):
    """Label steps of each decade, written alike; even steps, and false, where there are less than two of them."""
    low, high = sorted(axis.get_view_interval())
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.log10(high))
    shown = [value for value in np.outer(decades, steps).ravel() if low <= value <= high]
    many = len(shown) > 1
    plain = all(1e-3 <= value < 1e4 for value in shown or (low, high))
    axis.set_major_locator(LogLocator(subs=steps) if many else MaxNLocator(4, steps=(1, 2, 5, 10)))
    axis.set_major_formatter(lambda value, _: f"${value:g}$" if plain else f"${number(value)}$")
    if not many:
        axis.set_minor_locator(NullLocator())
    return many


def _labels(axis):
    """The labels in sight."""
    (low, high), along = sorted(axis.get_view_interval()), "xy".index(axis.axis_name)
    return [label for label in axis.get_majorticklabels() if low <= label.get_position()[along] <= high]


@contextmanager
def limits_kept(ax, when=True):
    """What is drawn within it does not widen the limits of `ax`, or only `when` that holds."""
    kept = ax.dataLim.frozen()
    yield
    if when:
        ax.dataLim.set(kept)


def draw_guide(ax, x, y, exponent, symbol, above) -> None:
    """A line of slope `exponent` over the longest stretch where y(x) follows it, above or below all lines of `ax`.

    Nothing is drawn where there is no such stretch: a guide marks a regime, it does not claim one.
    """
    window = _regime(x, y, exponent)
    if window is None:
        return
    u = np.linspace(*window, 50)
    drawn = [np.log10(line.get_data()) for line in ax.get_lines() if len(line.get_xdata())]
    heights = np.array([np.interp(u, *one, left=np.nan, right=np.nan) for one in drawn])
    sign, edge = (1, np.nanmax(heights, axis=0)) if above else (-1, np.nanmin(heights, axis=0))
    gap = max(0.035 * np.ptp(np.log10(ax.get_ylim())), 0.12)
    v = exponent * u + sign * (np.max(sign * (edge - exponent * u)) + gap)
    ax.plot(10**u, 10**v, color=GREY, linewidth=0.8, solid_capstyle="butt", zorder=1.5)
    middle, aligned = len(u) // 2, ("right", "bottom") if above else ("left", "top")
    look = {"textcoords": "offset points", "ha": aligned[0], "va": aligned[1], "color": "0.25"}
    at = (10 ** u[middle], 10 ** v[middle])
    ax.annotate(f"${power_text(symbol, exponent)}$", at, (-2 * sign, 2 * sign), **look)
    ax.update_datalim([(10 ** u[0], 10 ** (v.max() + gap)), (10 ** u[0], 10 ** (v.min() - 0.5 * gap))])


def _regime(x, y, exponent):
    """(first, last) log10 x of a guide: the longest run with a slope near `exponent`; None if too short."""
    x, y = x[y > 0], y[y > 0]
    if len(x) < 3:
        return None
    u = np.log10(x)
    near = np.abs(local_slope(x, y) - exponent) <= _CLOSE
    edges = np.flatnonzero(np.diff(np.r_[0, near.astype(int), 0]))
    runs = [(u[a], u[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    first, last = max(runs, key=lambda run: run[1] - run[0], default=(0.0, 0.0))
    if last - first < _SHORTEST:
        return None
    spare = max(0.0, (last - first) - _LONGEST) / 2
    return first + spare, last - spare


def power_law(ax, x, y, exponent) -> None:
    """A dotted line ∝ x^exponent through the geometric middle of the points (x, y); limits stay as they are."""
    log = np.log(x)
    line = np.exp(np.mean(np.log(y)) + exponent * (log - np.mean(log)))
    with limits_kept(ax):
        ax.plot(x, line, color=GREY, linewidth=0.8, linestyle=":", zorder=1)


def clear_corner(ax, first, settings) -> str | None:
    """The corner in which a legend with these settings lies on no line, bar or text of `ax`; None where all do."""
    drawn, texts = _drawn(ax), [text.get_window_extent() for text in ax.texts]
    for corner in dict.fromkeys((first, *_CORNERS)):
        box = ax.legend(loc=corner, **settings).get_window_extent().padded(2.0 * ax.figure.dpi / 72)
        if not any(_covers(box, *one) for one in drawn) and not any(map(box.overlaps, texts)):
            return corner
    return None


def _drawn(ax):
    """[(path in pixels, whether its corners are joined by a line)] of all lines and error bars of `ax`."""
    found = []
    for line in ax.get_lines():
        path = line.get_transform().transform_path(line.get_path()).cleaned(remove_nans=True)
        path = Path(path.vertices[:-1], path.codes[:-1])  # without what says that it ends
        if len(path):
            found.append((path, line.get_linestyle() not in ("None", "", " ")))
    for bars in (bar for container in ax.containers for bar in container.lines[2]):
        found += [(bars.get_transform().transform_path(path), True) for path in bars.get_paths()]
    return found


def _covers(box, path, joined):
    return box.count_contains(path.vertices) or (joined and path.intersects_bbox(box, filled=False))

"""Log-log axes readable over one decade or twenty: limits, ticks, guide slopes, a legend beside the data."""

import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter, LogFormatterMathtext, MaxNLocator, NullFormatter

from jampetsc.analysis.scaling import local_slope
from jampetsc.plots.style import GREY, power_text, tick_text

_TICKS = 7  # labelled decades at most
_SHORT_AXIS = 2.0  # decades
_CLOSE = 0.12  # a guide is drawn where the data's slope is this close to it
_SHORTEST, _LONGEST = 0.6, 2.5  # decades of a guide
_CORNERS = (
    "lower right",
    "upper left",
    "center right",
    "lower left",
    "upper right",
    "upper center",
    "lower center",
)


def set_log_axes(ax, lines) -> None:
    """Log scales, limits around the positive points of `lines` [(x, y), …], ticks at powers of ten."""
    ax.set(xscale="log", yscale="log")
    for axis, values in ((ax.xaxis, [x for x, _ in lines]), (ax.yaxis, [y for _, y in lines])):
        low, high = (f(f(v) for v in values) for f in (min, max))
        low, high = np.log10(low), np.log10(high)
        margin = max(0.04 * (high - low), 0.1)
        axis.axes.set(**{f"{axis.axis_name}lim": (10 ** (low - margin), 10 ** (high + margin))})
        set_ticks(axis, low - margin, high + margin)


def set_ticks(axis, low, high):
    """Ticks from 10^low to 10^high: labels at powers of ten, if these are few also between them."""
    floors = np.arange(np.floor(low), np.floor(high) + 1)
    decades = np.arange(np.ceil(low), np.floor(high) + 1)
    between = np.concatenate([np.log10(np.arange(1, 10)) + d for d in floors])
    step = int(np.ceil(len(decades) / _TICKS))
    if high - low < _SHORT_AXIS:
        labelled = np.concatenate([np.log10([1, 2, 5]) + d for d in floors])
        labelled = labelled[(labelled >= low) & (labelled <= high)]
        if len(labelled) < 2:  # so short that even steps will do
            even = MaxNLocator(4, steps=(1, 2, 5, 10)).tick_values(10.0**low, 10.0**high)
            labelled = np.log10(even[(even >= 10.0**low) & (even <= 10.0**high)])
    else:
        labelled = decades[np.mod(decades, step) == 0]
    axis.set_major_locator(FixedLocator(10.0**labelled))
    axis.set_minor_locator(FixedLocator(10.0 ** (between if step == 1 else decades)))
    if high - low < _SHORT_AXIS:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"${tick_text(value)}$"))
    else:
        axis.set_major_formatter(LogFormatterMathtext())
    axis.set_minor_formatter(NullFormatter())


def draw_guide(ax, x, y, exponent, symbol, lines, above) -> None:
    """A line of slope `exponent` over the longest stretch where y(x) follows it, above or below all `lines`.

    Nothing is drawn where there is no such stretch: a guide marks a regime, it does not claim one.
    """
    window = _regime(x, y, exponent)
    if window is None:
        return
    u = np.linspace(*window, 50)
    heights = np.array([np.interp(u, np.log10(a), np.log10(b), left=np.nan, right=np.nan) for a, b in lines])
    edge = np.nanmax(heights, axis=0) if above else np.nanmin(heights, axis=0)
    span = np.log10(ax.get_ylim()[1] / ax.get_ylim()[0])
    gap = max(0.035 * span, 0.12)
    level = np.max(edge - exponent * u) + gap if above else np.min(edge - exponent * u) - gap
    v = exponent * u + level
    ax.plot(10**u, 10**v, color=GREY, linewidth=0.8, solid_capstyle="butt", zorder=1.5)
    middle = len(u) // 2
    ax.annotate(
        f"${power_text(symbol, exponent)}$",
        (10 ** u[middle], 10 ** v[middle]),
        xytext=(-2, 2) if above else (2, -2),
        textcoords="offset points",
        ha="right" if above else "left",
        va="bottom" if above else "top",
        color="0.25",
    )
    top, bottom = 10 ** (v.max() + 1.5 * gap), 10 ** (v.min() - 0.5 * gap)
    ax.set_ylim(min(ax.get_ylim()[0], bottom), max(ax.get_ylim()[1], top))


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


def place_legend(fig, ax, title, handles, lines):
    """The legend in the corner that covers no data, or above the axes if every corner does."""
    settings = {"handles": handles, "title": title, "title_fontsize": 8.5}
    fig.draw_without_rendering()  # once: lays out the axes, which a legend inside them does not move
    for corner in _CORNERS:
        legend = ax.legend(loc=corner, **settings)
        if not _covers(ax, legend, lines):
            return legend
    letter = 14 / 72 if ax.get_title(loc="left") else 0.0  # inches that the letter of a panel takes
    base = 1.01 + letter * fig.dpi / ax.get_window_extent().height
    settings |= {"loc": "lower left", "bbox_to_anchor": (0, base), "borderaxespad": 0, "borderpad": 0}
    room = fig.bbox.x1 - ax.get_window_extent().x0
    for columns in (4, 3, 2, 1):
        legend = ax.legend(ncol=columns, columnspacing=1.2, **settings)
        legend.set_in_layout(False)  # the figure grows for it instead of the axes shrinking
        box = legend.get_window_extent()
        if box.width <= room:
            break
    height = fig.get_figheight()
    fig.set_figheight(height + letter + box.height / fig.dpi)
    fig.get_layout_engine().set(rect=(0, 0, 1, height / fig.get_figheight()))
    return legend


def _covers(ax, legend, lines):
    """Whether the legend lies on a data line or a guide."""
    box = legend.get_window_extent().padded(2.0 * ax.figure.dpi / 72)
    drawn = [line.get_xydata().T for line in ax.get_lines()]
    for x, y in [*lines, *drawn]:
        points = ax.transData.transform(np.column_stack((x, y)))
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) == 0:
            continue
        steps = np.arange(0, len(points) - 1 + 1e-9, 0.02) if len(points) < 200 else np.arange(len(points))
        x, y = (np.interp(steps, np.arange(len(points)), points[:, axis]) for axis in range(2))
        if ((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)).any():
            return True
    texts = [text.get_window_extent() for text in ax.texts]
    return any(box.overlaps(text) for text in texts)

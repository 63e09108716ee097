"""Time against true error of each setting of a trade."""

import math

from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from jampetsc.plots.page import Page
from jampetsc.plots.style import GREY, LOSS, PAGE, STORAGE, colours, drawn_in, entry, number

HEIGHT = 4.2  # inches
_GROUPS = {  # group -> (marker, shade from dark to light, in the legend)
    "accuracy": ("o", 0, "rational sweep, by --accuracy"),
    "method": ("s", 2, "one frequency after another"),
    "frequencies": ("^", 4, "number of frequencies, interpolated"),
    "physics": ("D", 3, "other physics (a deviation)"),
    "ensemble": ("P", 1, "mean over other packings (a deviation)"),
}
_JOINED = ("accuracy", "frequencies")  # groups of one setting with several values


def plot_trade(rows, certified, path) -> None:
    """Write `draw_trade` to a file. Raises JampetscError."""
    with drawn_in():
        page = Page()
        draw_trade(rows, certified, page)
        page.save(path)


def draw_trade(rows, certified, page) -> None:
    """Largest relative error of G' (filled) and of G'' (open) against the seconds of the run, log-log.

    rows: of `studies.trade_report.TradeRow`; rows without a time or an error are left out. certified: relative
    bound of the reference; smaller errors are not resolved and are drawn there.
    """
    shown = [row for row in rows if row.group in _GROUPS and not math.isnan(row.error) and row.seconds > 0]
    groups = [group for group in _GROUPS if any(row.group == group for row in shown)]
    shades = colours(len(_GROUPS))
    colour = {group: shades[shade] for group, (_, shade, _) in _GROUPS.items()}
    named = {"x": "time of the run [s]", "y": f"largest relative error of {STORAGE}, {LOSS}"}
    ax = page.panels(1, 1, PAGE, HEIGHT, **named, log="xy")
    for group in groups:
        members = [row for row in shown if row.group == group]
        if group in _JOINED:
            heights = [max(row.error, certified) for row in members]
            ax.plot([row.seconds for row in members], heights, color=colour[group], linewidth=0.7, zorder=1)
        for row in members:
            _draw(ax, row, colour[group], certified)
    if shown:  # room for the names beside the points
        ax.margins(x=0.06, y=0.1)
        left, right = (math.log10(limit) for limit in ax.get_xlim())
        width = max(right - left, 0.5)
        ax.set_xlim(10 ** (left - 0.05 * width), 10 ** (left + 1.15 * width))
    handles = _handles(groups, colour)
    if any(min(row.error_storage, row.error_loss) < certified for row in shown):
        what = "errors below are not resolved"
        handles.append(ax.axhline(certified, color=GREY, linewidth=0.6, linestyle=":", label=what))
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncol=3, columnspacing=1.2)
    page.finish()
    _write_names(page.figure, ax, shown, certified)


def _draw(ax, row, colour, floor):
    """Both errors of a row and a line between them."""
    marker = _GROUPS[row.group][0]
    heights = [max(error, floor) for error in (row.error_storage, row.error_loss)]
    ax.plot([row.seconds] * 2, heights, color=colour, linewidth=0.7, zorder=1)
    for height, face in zip(heights, (colour, "white"), strict=True):
        ax.plot(row.seconds, height, marker, color=colour, mfc=face, mew=0.8, ms=4.5)


def _write_names(fig, ax, rows, floor):
    """The names of the rows beside their larger errors, moved up or down where they would cover something."""
    fig.draw_without_rendering()
    points = [(row.seconds, max(e, floor)) for row in rows for e in (row.error_storage, row.error_loss)]
    taken = [Bbox([at, at]).padded(3.5 * fig.dpi / 72) for at in ax.transData.transform(points)]
    for row, name in _names(rows):
        point = (row.seconds, max(row.error, floor))
        text = ax.annotate(name, point, (5, 0), textcoords="offset points", va="center", fontsize=7)
        text.set(color="0.2", path_effects=[withStroke(linewidth=1.5, foreground="white")])
        right = text.get_window_extent()
        left = right.translated(-right.width - 10 * fig.dpi / 72, 0)
        places = [(_rise(box, taken, ax.bbox), box, side) for box, side in ((right, "left"), (left, "right"))]
        rise, box, side = min(places, key=lambda place: abs(place[0]))
        taken.append(box.translated(0, rise))
        text.set(ha=side, position=(5 if side == "left" else -5, rise * 72 / fig.dpi))


def _rise(box, taken, frame):
    """The least rise of a box, up or down, after which it lies in the frame and overlaps no taken box."""
    step = 0.25 * box.height
    for n in range(int(2 * frame.height / step)):
        rise = step * ((n + 1) // 2) * (1 if n % 2 else -1)
        moved = box.translated(0, rise)
        inside = frame.x0 < moved.x0 and moved.x1 < frame.x1 and frame.y0 < moved.y0 and moved.y1 < frame.y1
        if inside and not any(moved.overlaps(other) for other in taken):
            return rise
    return frame.height


def _names(rows):
    """(row, what to write beside it), large errors first; equal results of --accuracy share a name."""
    names = {}
    for row in sorted(rows, key=lambda row: (-row.error, row.seconds)):
        if row.group == "accuracy":
            equal = [other for other in rows if other.group == "accuracy" and other.error == row.error]
            power = ", ".join(f"${number(float(other.choice.split()[-1]))}$" for other in equal)
            names[max(equal, key=lambda other: other.seconds)] = power
        else:
            short = row.choice.removeprefix("direct, ").removesuffix(".opts")
            names[row] = short.removesuffix(" frequencies")
    return names.items()


def _handles(groups, colour):
    dot = {"linestyle": "", "mew": 0.8, "ms": 4.5}
    entries = [entry(_GROUPS[g][2], colour[g], marker=_GROUPS[g][0], **dot) for g in groups]
    filled, empty = f"{STORAGE} (filled)", f"{LOSS} (open)"
    return [*entries, entry(filled, marker="o", **dot), entry(empty, marker="o", mfc="white", **dot)]

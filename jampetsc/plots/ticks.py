"""Ticks of log axes: few powers of ten, steps between on short ones; and the layout that they take part in."""

from itertools import pairwise

import numpy as np
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from jampetsc.plots.style import number

MIN_POWER_DECADES = 2.0  # of an axis that has labels at powers of ten alone
MAX_LABELS = 7  # of powers of ten at most
_STEPS = ((1, 2, 5), (1, 3), (1,))  # labels in a decade, many to few


def set_ticks(axis) -> bool:
    """Set ticks of a log axis: few powers of ten, on less than two decades also steps between; whether it has steps."""
    if axis.get_scale() != "log" or isinstance(axis.get_major_locator(), FixedLocator):
        return False
    low, high = np.log10(sorted(axis.get_view_interval()))
    axis.set_minor_formatter(NullFormatter())
    if high - low >= MIN_POWER_DECADES:
        step = int(np.ceil((np.floor(high) - np.ceil(low) + 1) / MAX_LABELS))
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
        boxes = [label.get_window_extent().padded(0.03 * axis.figure.dpi) for label in visible_labels(axis)]
        if not any(first.overlaps(second) for first, second in pairwise(boxes)):
            return


def _label(axis, steps):
    """Label steps of each decade; with less than two in sight even steps, and false."""
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


def visible_labels(axis):
    """The labels in sight."""
    (low, high), along = sorted(axis.get_view_interval()), "xy".index(axis.axis_name)
    return [label for label in axis.get_majorticklabels() if low <= label.get_position()[along] <= high]


def lay_out_figure(figure) -> None:
    """Give all on a figure its place: less work than to draw it, and half of that without minor ticks."""
    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    minor = {
        axis: axis.get_minor_locator()
        for axis in axes
        if isinstance(axis.get_minor_formatter(), NullFormatter)  # they take no room
    }
    for axis in minor:
        axis.set_minor_locator(NullLocator())
    figure.get_layout_engine().execute(figure)
    for axis, locator in minor.items():
        axis.set_minor_locator(locator)

"""The panels of a picture, on a new figure or on axes of the caller; limits, ticks, legends."""

import string

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jampetsc.errors import InputError
from jampetsc.plots.logaxes import clear_corner, limits_kept, set_ticks, thin_ticks
from jampetsc.plots.style import COLUMN, hidden

HEIGHT = 2.9  # inches of a picture of one panel
_LEAST = 1.6  # highest over lowest of a log axis


class Page:
    """The axes of a picture.

    axes     axes of the caller; None: `panels` makes a figure
    size     (width, height) of that figure in inches, None: the default of the picture
    labels   words that replace those of the legends, in their order
    xlim     (low, high) of x for all panels, or one, or None, for each

    own      whether the figure is new
    text     description of the picture in words
    """

    def __init__(self, axes=None, size=None, labels=(), xlim=None):
        self.own, self.size, self.labels, self.text = axes is None, size, list(labels), ""
        self.xlim = xlim
        self.axes, self._given = [] if axes is None else list(np.ravel(axes)), axes
        self.lettered, self.laid_out, self._legends, self._raised = False, False, [], False

    def panels(
        self, rows=1, columns=1, width=COLUMN, height=HEIGHT, *, x="", y="", log="", letters=True, count=None, **grid
    ):  # fmt: skip
        """(count,) axes, row by row; a single one for one panel.

        width, height   inches of the figure
        x, y            names of the axes: one for each panel, or one for all, which shared axes have at the edge only
        log             "x", "y" or "xy": which axes are logarithmic, in all panels or a list for each
        letters         whether several panels have letters (a), (b), …
        count           number of panels, if the last row is not full
        grid            keywords of `Figure.subplots`

        Raises InputError if the caller gave another number of axes.
        """
        count = count or rows * columns
        if self.own:
            self._make(width, height)
            made = self._figure.subplots(rows, columns, squeeze=False, **grid).ravel()
            self.axes, self.lettered = list(made[:count]), letters and count > 1
            for ax in made[count:]:
                ax.remove()
        elif len(self.axes) != count:
            raise InputError(f"ax: {len(self.axes)} axes: this picture of these files takes {count}, or none")
        for n, ax in enumerate(self.axes):
            inner = (
                bool(grid.get("sharex")) and n < count - columns,
                bool(grid.get("sharey")) and n % columns > 0,
            )
            for axis, names, within in zip("xy", (x, y), inner, strict=True):
                name = names[n] if not isinstance(names, str) else "" if within else names
                ax.set(**{f"{axis}label": name})
            for axis in log if isinstance(log, str) else log[n]:
                ax.set(**{f"{axis}scale": "log"})
        return self._one_or_all()

    def _one_or_all(self):
        return self.axes[0] if len(self.axes) == 1 else np.array(self.axes)

    @property
    def given_back(self):
        """The axes of the caller, as they were given; else the new ones: one, or (panels,) of them."""
        return self._one_or_all() if self.own else self._given

    def _make(self, width, height):
        self._figure = Figure(figsize=self.size or (width, height), layout="constrained")
        FigureCanvasAgg(self._figure)

    def mosaic(self, names, width, height, heights) -> list:
        """Axes with the names of a mosaic (`Figure.subplot_mosaic`), rows of these heights; errors as `panels`."""
        if not self.own:
            return list(np.ravel(self.panels(1, len({name for row in names for name in row}))))
        self._make(width, height)
        self.axes = list(self._figure.subplot_mosaic(names, gridspec_kw={"height_ratios": heights}).values())
        self.lettered = True
        return self.axes

    @property
    def figure(self):
        """The figure that the axes are on."""
        return self.axes[0].figure

    def legend(self, ax, handles=None, title=None, first="lower right", named=True, **settings):
        """A legend that covers no data, placed by `finish`.

        handles   its artists; None: all of `ax` that have a label
        first     the corner that is tried first
        named     whether `labels` replace its entries
        """
        handles = ax.get_legend_handles_labels()[0] if handles is None else list(handles)
        words = [handle.get_label() for handle in handles]
        taken = min(len(words), len(self.labels)) if named else 0
        words[:taken], self.labels = self.labels[:taken], self.labels[taken:]
        if handles:
            self._legends.append(
                (ax, first, settings | {"handles": handles, "labels": words, "title": title})
            )

    def _place(self, ax, first, settings):
        """Put a legend in a free corner; without one, the first goes above the panels of a new figure, which grows."""
        corner = clear_corner(ax, first, settings)
        if corner or not self.own or self._raised:
            ax.legend(loc=corner or "best", **settings)
            return
        self._raised = True
        left = min(one.get_window_extent().x0 for one in self.axes) / self.figure.bbox.width
        place = {"loc": "upper left", "bbox_to_anchor": (left, 1), "bbox_transform": self.figure.transFigure}
        for columns in (4, 3, 2, 1):
            legend = ax.legend(
                **settings | place | {"ncol": columns, "columnspacing": 1.2, "borderaxespad": 0.2}
            )
            if legend.get_window_extent().width <= (1 - left) * self.figure.bbox.width:
                break
        legend.set_in_layout(False)
        rise, height = legend.get_window_extent().height / self.figure.dpi + 0.05, self.figure.get_figheight()
        if self.size is None:
            self.figure.set_figheight(height + rise)
        self.figure.get_layout_engine().set(rect=(0, 0, 1, 1 - rise / self.figure.get_figheight()))

    def seen(self, x):
        """Where x (M,) of a picture of one panel is in sight, a mask."""
        limits = self.xlim if self.xlim is None or np.isscalar(self.xlim[0]) else self.xlim[0]
        low, high = limits or (-np.inf, np.inf)
        return (x >= low) & (x <= high)

    def finish(self, ylim=None) -> None:
        """Limits, letters of panels, legends and ticks of log axes.

        ylim   (low, high) for all panels, or one, or None, for each
        """
        for name, limits in (("xlim", self.xlim), ("ylim", ylim)):
            if limits is None:
                continue
            pairs = [limits] * len(self.axes) if np.isscalar(limits[0]) else list(limits)
            if len(pairs) != len(self.axes):
                raise InputError(
                    f"{name}: {len(pairs)} pairs for {len(self.axes)} panels: give one, or each its own"
                )
            for ax, pair in zip(self.axes, pairs, strict=True):
                if pair is not None:
                    ax.set(**{name: pair})
        if self.labels:
            raise InputError(f"label {self.labels[0]}: the legends have no entry that is left: give fewer")
        for ax, letter in zip(self.axes, string.ascii_lowercase, strict=False):
            if self.lettered:
                ax.set_title(f"({letter})", loc="left", pad=3)
            low, high = ax.get_ylim()
            if ax.get_yscale() == "log" and ax.get_autoscaley_on() and high < _LEAST * low:
                middle = (low * high) ** 0.5  # small changes are not magnified
                ax.set_ylim(middle / _LEAST**0.5, middle * _LEAST**0.5)
        axes = self.figure.axes if self.own else self.axes
        short = [axis for ax in axes for axis in (ax.xaxis, ax.yaxis) if set_ticks(axis)]
        if not self.laid_out:  # which also makes the ticks
            if self.own:
                self.figure.get_layout_engine().execute(self.figure)  # less work than to draw it
            else:
                self.figure.draw_without_rendering()
        for wanted in self._legends:
            self._place(*wanted)
        for axis in short:
            thin_ticks(axis)


def band(ax, x, low, high, name, **look) -> None:
    """A band from `low` to `high` over x, which does not widen the limits of log axes."""
    with limits_kept(ax, when=ax.get_yscale() == "log"):
        ax.fill_between(x, low, high, label=hidden(name), **{"alpha": 0.25, "linewidth": 0} | look)


def points(ax, x, y, error=None, **look):
    """Points or a line (m,), with error bars if there are errors; values that are nan or not shown are left out.

    Log axes show only what is positive, and bars widen their limits by a factor of three at most. Gives the container.
    """
    x, y, log = np.asarray(x, float), np.asarray(y, float), ax.get_yscale() == "log"
    known = np.isfinite(y) & ((y > 0) | (not log))
    x, y, seen = x[known], y[known], np.zeros((2, known.sum()))
    if error is not None:
        error = np.asarray(error, float)[..., known]
        seen = np.broadcast_to(np.where(np.isfinite(error), error, 0.0), seen.shape)
        error = seen if np.isfinite(error).any() else None
    with limits_kept(ax, when=log):
        drawn = ax.errorbar(x, y, error, **{"elinewidth": 0.6, "markeredgewidth": 0.7} | look)
    if log:
        for ends in (np.maximum(y - seen[0], y / 3), np.minimum(y + seen[1], 3 * y)):
            ax.update_datalim(np.column_stack((x, ends)))
    return drawn

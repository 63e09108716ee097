"""The panels of a picture on a new figure or on axes of the caller: limits, ticks, guide slopes and legends."""

import string
from contextlib import contextmanager

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from jampetsc.analysis.power_laws import power_law_window
from jampetsc.errors import InputError, named
from jampetsc.plots.legends import clear_corner, with_earlier
from jampetsc.plots.style import COLUMN, GREY, PAGE, hidden, power_text, save
from jampetsc.plots.ticks import lay_out_figure, set_ticks, thin_ticks

HEIGHT = 2.9  # inches of a picture of one panel
MIN_LOG_RATIO = 1.6  # of the limits of a log axis


def panel_rows(text) -> list:
    """Rows of letters of panels, [("a", "b"), …], of "a,b/c,d" or of a list of letters. Raises InputError."""
    rows = text.split("/") if isinstance(text, str) else [",".join(map(str, text))]
    rows = [tuple(letter.strip() for letter in row.split(",")) for row in rows]
    if not all(len(letter) == 1 and letter in string.ascii_lowercase for row in rows for letter in row):
        raise InputError(f"{named('panels')} {text}: not letters of panels. Write e.g. a,c or a,b/c,d.")
    return rows


class Page:
    """The axes of a picture.

    axes     axes of the caller; None: `panels` makes a figure
    size     (width, height) of that figure in inches, None: the default of the picture
    labels   words for groups of the legends, in their order, or for each file
    xlim     (low, high) of x for all panels, or one, or None, for each
    chosen   rows of letters of the panels to show, [("a", "b"), …]; None: all

    is_new   whether the figure is new
    text     description of the picture in words
    """

    def __init__(self, axes=None, size=None, labels=(), xlim=None, chosen=None):
        self.is_new, self.size, self.labels, self.text = axes is None, size, list(labels), ""
        self.xlim, self.chosen = xlim, chosen
        self.axes, self._given = [] if axes is None else list(np.ravel(axes)), axes
        listed = [ax.get_legend_handles_labels()[0] for ax in self.axes if ax.get_legend() is not None]
        self._earlier = {
            id(handle) for handles in listed for handle in handles
        }  # in legends of earlier pictures
        self.lettered, self.laid_out, self._legends = False, False, []
        self._has_legend_above, self._is_final = False, False

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

        Panels that are not `chosen` are drawn on a figure that nobody sees. Raises InputError if the caller gave
        another number of axes, and for panels that the picture does not have.
        """
        count = count or rows * columns
        if self.chosen is not None:
            return self._choose(count, columns, (width, height / rows), x, y, log, letters)
        if self.is_new:
            self._make(width, height)
            axes = self._figure.subplots(rows, columns, squeeze=False, **grid).ravel()
            self.axes, self.lettered = list(axes[:count]), letters and count > 1
            for ax in axes[count:]:
                ax.remove()
        elif len(self.axes) != count:
            raise InputError(
                f"ax: {len(self.axes)} axes, but this picture needs {count}. Give {count} or none."
            )
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

    def _choose(self, count, columns, size, x, y, log, letters):
        """All `count` panels as `panels` gives them, of which those chosen are on the figure to be seen.

        size   (width of the picture, height of a row) in inches
        """
        places = self._chosen_places(count)
        number = sum(map(len, places))
        shown = self if not self.is_new else Page(size=self.size)
        if self.is_new:
            across = max(map(len, places))
            width, height = (COLUMN, HEIGHT) if across == 1 else (PAGE, size[1] * PAGE / size[0])
            height = max(height, HEIGHT * 2 / (1 + across))
            shown.panels(len(places), across, width, len(places) * height)
            for row in reversed(range(len(places))):
                for column in range(across):
                    if column >= len(places[row]):
                        shown.axes[row * across + column].remove()
            shown.axes = [
                shown.axes[row * across + n] for row, own in enumerate(places) for n in range(len(own))
            ]
        elif len(self.axes) != number:
            raise InputError(
                f"ax: {len(self.axes)} axes, but {number} panels are chosen. Give {number} or none."
            )
        hidden_page = Page()
        axes = np.ravel(hidden_page.panels(-(-count // columns), columns, count=count)).tolist()
        for place, ax in zip((place for row in places for place in row), shown.axes, strict=True):
            axes[place] = ax
        for n, ax in enumerate(axes):
            words = (names if isinstance(names, str) else names[n] for names in (x, y))
            ax.set(**dict(zip(("xlabel", "ylabel"), words, strict=True)))
            ax.set(**{f"{axis}scale": "log" for axis in (log if isinstance(log, str) else log[n])})
        self.axes, self.lettered = shown.axes, self.is_new and letters and number > 1
        return axes[0] if count == 1 else np.array(axes)

    def _chosen_places(self, count):
        """Numbers of the chosen panels, row by row. Raises InputError for letters that no panel has, or twice."""
        available, letters = string.ascii_lowercase[:count], [letter for row in self.chosen for letter in row]
        for letter in letters:
            if letter not in available or letters.count(letter) > 1:
                why = "given twice" if letter in available else "no such panel"
                choices = f"a to {available[-1]}" if count > 1 else "a alone"
                raise InputError(f"{named('panels')} {letter}: {why}. This picture has {choices}.")
        return [[available.index(letter) for letter in row] for row in self.chosen]

    def refuse_choice(self) -> None:
        """Raise InputError where panels of a picture of cells are chosen."""
        if self.chosen is not None:
            raise InputError(f"{named('panels')}: pictures of cells have fixed panels. Leave it out.")

    def _one_or_all(self):
        return self.axes[0] if len(self.axes) == 1 else np.array(self.axes)

    @property
    def returned_axes(self):
        """The axes of the caller, as they were given; else the new ones: one, or (panels,) of them."""
        return self._one_or_all() if self.is_new else self._given

    def _make(self, width, height):
        self._figure = Figure(figsize=self.size or (width, height), layout="constrained")
        FigureCanvasAgg(self._figure)

    def mosaic(self, names, width, height, heights) -> list:
        """Axes with the names of a mosaic (`Figure.subplot_mosaic`), rows of these heights; errors as `panels`."""
        if not self.is_new or self.chosen is not None:
            count = len({name for row in names for name in row})
            return list(np.ravel(self.panels(1, count, width, max(heights))))
        self._make(width, height)
        self.axes = list(self._figure.subplot_mosaic(names, gridspec_kw={"height_ratios": heights}).values())
        self.lettered = True
        return self.axes

    @property
    def figure(self):
        """The figure that the axes are on."""
        return self.axes[0].figure

    def file_labels(self, count) -> list:
        """The labels, if there is one for each of `count` files, which then are used."""
        if len(self.labels) != count:
            return []
        labels, self.labels = self.labels, []
        return labels

    def legend(self, ax, handles=None, title=None, first="lower right", groups=None, **settings):
        """A legend that covers no data, placed by `finish`; of a panel that is not shown on the first that is.

        handles   its artists; None: all of `ax` that have a label
        first     the corner that is tried first
        groups    number of its first entries that stand for files or groups, whose words `labels` replace; None: all
        """
        if handles is None:
            handles = [
                handle for handle in ax.get_legend_handles_labels()[0] if id(handle) not in self._earlier
            ]
        words = [handle.get_label() for handle in handles]
        taken = min(len(words) if groups is None else groups, len(self.labels))
        words[:taken], self.labels = self.labels[:taken], self.labels[taken:]
        if self.chosen is not None and ax not in self.axes:
            taken = [other for other, *_ in self._legends]
            ax = min(self.axes, key=lambda shown: shown in taken or shown.get_legend() is not None)
        if handles:
            self._legends.append(
                (ax, first, settings | {"handles": handles, "labels": words, "title": title})
            )

    def _place(self, ax, first, settings):
        """Put a legend in a free corner; without one, the first goes above the panels of a new figure, which grows."""
        if not self.is_new or self.chosen is not None:
            settings = settings | with_earlier(ax, settings)
        corner = clear_corner(ax, first, settings)
        if corner or not self.is_new or self._has_legend_above:
            ax.legend(loc=corner or "best", **settings)
            return
        self._has_legend_above = True
        left = min(panel.get_window_extent().x0 for panel in self.axes) / self.figure.bbox.width
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

    def visible_mask(self, x):
        """Mask of the x (M,) within the limits of a picture of one panel."""
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
                    f"{named(name)}: {len(pairs)} pairs for {len(self.axes)} panels. Give one pair, or one for "
                    "each panel."
                )
            for ax, pair in zip(self.axes, pairs, strict=True):
                if pair is not None:
                    ax.set(**{name: pair})
        if self.labels:
            raise InputError(
                f"{named('label')} {self.labels[-1]}: more labels than entries of legends. Give one for each file, "
                "or fewer."
            )
        for ax, letter in zip(self.axes, string.ascii_lowercase, strict=False):
            if self.lettered:
                ax.set_title(f"({letter})", loc="left", pad=3)
            low, high = ax.get_ylim()
            if ax.get_yscale() == "log" and ax.get_autoscaley_on() and high < MIN_LOG_RATIO * low:
                middle = (low * high) ** 0.5  # small changes are not magnified
                ax.set_ylim(middle / MIN_LOG_RATIO**0.5, middle * MIN_LOG_RATIO**0.5)
        axes = self.figure.axes if self.is_new else self.axes
        short = [axis for ax in axes for axis in (ax.xaxis, ax.yaxis) if set_ticks(axis)]
        if not self.laid_out:  # which also makes the ticks
            if self.is_new:
                lay_out_figure(self.figure)
                self._is_final = True
            else:
                self.figure.draw_without_rendering()
        for legend in self._legends:
            self._place(*legend)
        for axis in short:
            thin_ticks(axis)
        if self._has_legend_above:
            lay_out_figure(self.figure)

    def save(self, path) -> None:
        """Write the finished picture as `style.save` does. Raises JampetscError."""
        save(self.figure, path, laid_out=self._is_final)


def shown_colours(axes) -> list:
    """Colours of the lines on axes that are not grey, (r, g, b) each."""
    shades = dict.fromkeys(to_rgb(line.get_color()) for ax in axes for line in ax.get_lines())
    return [shade for shade in shades if len(set(shade)) > 1]


def draw_band(ax, x, low, high, name, **look) -> None:
    """A band from `low` to `high` over x, which does not widen the limits of log axes."""
    with limits_kept(ax, when=ax.get_yscale() == "log"):
        ax.fill_between(x, low, high, label=hidden(name), **{"alpha": 0.25, "linewidth": 0} | look)


def draw_points(ax, x, y, error=None, **look):
    """Points or a line (m,), with error bars if there are errors; values that are nan or not shown are left out.

    Log axes show positive values only; bars widen their limits by a factor of at most three. Returns the container.
    """
    x, y, log = np.asarray(x, float), np.asarray(y, float), ax.get_yscale() == "log"
    drawable = np.isfinite(y) & ((y > 0) | (not log))
    x, y, half_widths = x[drawable], y[drawable], np.zeros((2, drawable.sum()))
    if error is not None:
        error = np.asarray(error, float)[..., drawable]
        half_widths = np.broadcast_to(np.where(np.isfinite(error), error, 0.0), half_widths.shape)
        error = half_widths if np.isfinite(error).any() else None
    with limits_kept(ax, when=log):
        drawn = ax.errorbar(x, y, error, **{"elinewidth": 0.6, "markeredgewidth": 0.7} | look)
    if log:
        for ends in (np.maximum(y - half_widths[0], y / 3), np.minimum(y + half_widths[1], 3 * y)):
            ax.update_datalim(np.column_stack((x, ends)))
    return drawn


@contextmanager
def limits_kept(ax, when=True):
    """Artists drawn within it do not widen the limits of `ax`, or only `when` that holds."""
    kept = ax.dataLim.frozen()
    yield
    if when:
        ax.dataLim.set(kept)


def draw_guide(ax, x, y, exponent, symbol, above) -> None:
    """A line of slope `exponent` over the longest stretch where y(x) follows it, above or below all lines of `ax`.

    Without such a stretch nothing is drawn: a guide marks a regime, it does not claim one.
    """
    window = power_law_window(x, y, exponent)
    if window is None:
        return
    u = np.linspace(*window, 50)
    with np.errstate(invalid="ignore", divide="ignore"):  # of bars that reach below 0
        drawn = [np.log10(line.get_data()) for line in ax.get_lines() if len(line.get_xdata())]
    heights = np.array([np.interp(u, *line, left=np.nan, right=np.nan) for line in drawn])
    sign, edge = (1, np.nanmax(heights, axis=0)) if above else (-1, np.nanmin(heights, axis=0))
    gap = max(0.035 * np.ptp(np.log10(ax.get_ylim())), 0.12)
    v = exponent * u + sign * (np.max(sign * (edge - exponent * u)) + gap)
    ax.plot(10**u, 10**v, color=GREY, linewidth=0.8, solid_capstyle="butt", zorder=1.5)
    middle, aligned = len(u) // 2, ("right", "bottom") if above else ("left", "top")
    look = {"textcoords": "offset points", "ha": aligned[0], "va": aligned[1], "color": "0.25"}
    at = (10 ** u[middle], 10 ** v[middle])
    ax.annotate(f"${power_text(symbol, exponent)}$", at, (-2 * sign, 2 * sign), **look)
    ax.update_datalim([(10 ** u[0], 10 ** (v.max() + gap)), (10 ** u[0], 10 ** (v.min() - 0.5 * gap))])


def draw_power_law(ax, x, y, exponent) -> None:
    """A dotted line ∝ x^exponent through the geometric middle of the points (x, y); limits stay as they are."""
    log = np.log(x)
    line = np.exp(np.mean(np.log(y)) + exponent * (log - np.mean(log)))
    with limits_kept(ax):
        ax.plot(x, line, color=GREY, linewidth=0.8, linestyle=":", zorder=1)

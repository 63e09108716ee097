"""The numbers of a picture as a table with named columns: coordinates of its lines, points, bars and bands."""

import re
import string

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection, PathCollection, PolyCollection
from matplotlib.quiver import Quiver

from jampetsc.columns import comma_separated

# panel, names of its axes, of what is drawn there, and as what
COLUMNS = ("panel", "x", "y", "series", "what")


def table_rows(axes) -> list[dict]:
    """Rows of all artists on `axes` that have a name (`style.hidden`, or one of the legend).

    Columns: COLUMNS, then, by the kind of artist, x_value, y_value; y_low and y_high, x_low and x_high of bars and
    bands; u, v of arrows; x_end, y_end and width of lines of contacts; diameter of disks; colour, as a number.
    """
    rows = []
    for ax, letter in zip(axes, string.ascii_lowercase, strict=False):
        panel = dict(
            zip(COLUMNS, (letter, plain_text(ax.get_xlabel()), plain_text(ax.get_ylabel())), strict=False)
        )
        for artist, what, columns in _named_artists(ax):
            name = artist.get_label()
            values = np.broadcast_arrays(*columns.values())
            about = panel | {"series": plain_text(name.removeprefix("_:")), "what": what}
            numbers = zip(*map(np.ravel, values), strict=True)
            rows += [about | dict(zip(columns, row, strict=True)) for row in numbers]
    return rows


def table_bytes(axes) -> bytes:
    """`table` as comma-separated values, every number with all its digits."""
    rows = table_rows(axes)
    names = list(dict.fromkeys([*COLUMNS, *(name for row in rows for name in row)]))
    digits = (
        {name: value if name in COLUMNS else repr(float(value)) for name, value in row.items()}
        for row in rows
    )
    return comma_separated(names, digits).encode(errors="backslashreplace")  # names of files may be no text


def _is_named(artist):
    """Whether an artist shows data; guides, frames and zero lines have names by matplotlib, which begin with _."""
    return not artist.get_label().startswith("_") or artist.get_label().startswith("_:")


def _named_artists(ax):
    """(artist, its kind, {column: values}) of all artists that show data."""
    barred = {bars.lines[0] for bars in ax.containers}
    for bars in filter(_is_named, ax.containers):
        data, _, lines = bars.lines
        columns, lines, finite = _points(data), list(lines), _finite_points(data)
        for axis, has_bars in ((0, bars.has_xerr), (1, bars.has_yerr)):
            if has_bars:
                segments = lines.pop(0).get_segments()  # without ends that are nan
                pairs = [segment if len(segment) == 2 else np.full((2, 2), np.nan) for segment in segments]
                ends = np.reshape(pairs, (-1, 2, 2))[finite, :, axis]
                columns |= {f"{'xy'[axis]}_low": ends[:, 0], f"{'xy'[axis]}_high": ends[:, 1]}
        yield bars, "points", columns
    for line in filter(_is_named, ax.get_lines()):
        if line not in barred:
            yield line, "line", _points(line)
    for collection in filter(_is_named, ax.collections):
        if isinstance(collection, Quiver):
            yield (
                collection,
                "arrows",
                {"x_value": collection.X, "y_value": collection.Y, "u": collection.U, "v": collection.V},
            )
        elif isinstance(collection, PathCollection | EllipseCollection):
            x, y = collection.get_offsets().T
            disks = isinstance(collection, EllipseCollection)
            more = {"diameter": 2 * collection._widths} if disks else {"colour": collection.get_array()}
            yield collection, "points", {"x_value": x, "y_value": y} | more
        elif isinstance(collection, LineCollection):
            (x, y), (x_end, y_end) = np.moveaxis(collection.get_segments(), 0, -1)
            ends = {"x_end": x_end, "y_end": y_end, "width": collection.get_linewidths()}
            yield collection, "lines", {"x_value": x, "y_value": y} | ends
        elif isinstance(collection, PolyCollection):
            yield collection, "band", _band(collection)


def _finite_points(line):
    """Mask of the points of a line that are numbers."""
    return np.isfinite(_values(line)).all(axis=0)


def _values(line):
    return np.array([np.ma.filled(np.ma.asarray(values, float), np.nan) for values in line.get_data()])


def _points(line):
    return dict(zip(("x_value", "y_value"), _values(line)[:, _finite_points(line)], strict=True))


def _band(collection):
    corners = np.concatenate([path.vertices for path in collection.get_paths()] or [np.zeros((0, 2))])
    x, which = np.unique(corners[:, 0], return_inverse=True)
    low, high = np.full(len(x), np.inf), np.full(len(x), -np.inf)
    np.minimum.at(low, which, corners[:, 1])
    np.maximum.at(high, which, corners[:, 1])
    return {"x_value": x, "y_low": low, "y_high": high}


def plain_text(text) -> str:
    """A label without TeX: omega tau_1, p/k=10^-3."""
    text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"\1/\2", text)
    text = re.sub(r"\\[, ]", " ", re.sub(r"\\(?:rm|mathrm|left|right)\b *", "", text))
    text = re.sub(r"[${}]", "", re.sub(r"\\([A-Za-z]+)", r" \1 ", text))
    return re.sub(r" (?=[/_^)\],])|(?<=[(\[]) ", "", " ".join(text.split()))

"""Draws any kind of picture: the list of kinds, and the choice of the one that suits files and options."""

import difflib
import importlib
import json
import os
import re
import string
from pathlib import Path

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection, PathCollection, PolyCollection
from matplotlib.quiver import Quiver

from jampetsc.columns import comma_separated
from jampetsc.errors import InputError, named
from jampetsc.io.atomic import write_whole
from jampetsc.io.ensemble import Ensemble
from jampetsc.io.outputs import PICTURE, TABLE, check_output
from jampetsc.io.reader import load
from jampetsc.options.values import refuse_repeated
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.plots.page import Page, panel_rows
from jampetsc.plots.picture import PICTURES, Picture, drawing_errors
from jampetsc.plots.style import FORMATS

MODULES = (  # with pictures; without a kind the first picture that suits files and options is drawn
    "moduli_plots", "tensor_plots", "spectrum_plots", "step_strain_plots", "correlation_plots", "quasistatic_plots",
    "probe_plots", "exponent_plots", "crossover_plots", "mode_plots", "flow_plots", "jamming_plots", "event_plots",
    "rearrangement_plots", "scaling_plots", "yielding_plots", "start_plots", "oscillation_plots", "field_plots",
    "packing_plots",
)  # fmt: skip
COMMANDS = {  # format -> its command, if that has another name
    "correlation": "correlate",
    "velocity-correlation": "correlate",
    "packing": "pack",
}
# panel, names of its axes and of the series, kind of artist
COLUMNS = ("panel", "x", "y", "series", "what")


def pictures() -> dict[str, Picture]:
    """{kind: Picture} of all kinds."""
    for module in MODULES:
        importlib.import_module(f"jampetsc.plots.{module}")
    # not the order of imports, as modules import each other; pictures of the user's own come last
    order = {f"jampetsc.plots.{module}": n for n, module in enumerate(MODULES)}
    return dict(sorted(PICTURES.items(), key=lambda item: order.get(item[1].function.__module__, len(order))))


def plot(
    results,
    kind=None,
    ax=None,
    *,
    out=None,
    csv=None,
    size=None,
    xlim=None,
    ylim=None,
    label=(),
    color=(),
    panels=None,
    style=None,
    **more,
):
    """Draw the content of files; returns the axes, one or (panels,) of them.

    results      a file or the folder of a study, the object that `jampetsc.load` gives for it, or a list of these
    kind         of picture, see `jampetsc plot --help`; None: chosen from the files and options
    ax           axes to draw on, one for each panel of the picture; None: axes of a new figure
    out          file to write the picture to: .png, .pdf or .svg
    csv          file to write the drawn numbers to
    size         (width, height) of a new figure in inches
    xlim, ylim   (low, high) for all panels, or one for each
    label        words for each file, in their order, or for the groups of the legend, in its order
    color        colours of matplotlib for these groups, one or several, in the same order
    panels       letters of the panels to show, "a,c", in rows "a,b/c,d"; None: all
    style        a style file of matplotlib, or {name: value}, on top of the package's style; its axes.prop_cycle
                 colours the groups
    more         options of the kind: statistic="median", omega=[1e-3], …; None: its default

    Raises InputError for files that no picture shows, and for options that the kind does not have.
    """
    items = list(results) if isinstance(results, list | tuple) else [results]
    if panels is not None:
        panels = panel_rows(panels)
    chosen = {"size": size, "xlim": xlim, "ylim": ylim, "label": label, "style": style}
    chosen |= {"color": color, "panels": panels}
    return draw(items, kind, ax, out=out, csv=csv, chosen=chosen, **more).returned_axes


def draw(items, kind=None, ax=None, *, out=None, csv=None, chosen=None, **options) -> Page:
    """As `plot`, but gives the page; chosen: size, xlim, ylim, label, color, panels and style."""
    options = {name: value for name, value in options.items() if value is not None}
    if not items:
        raise InputError("results: empty. Give at least one file or result.")
    kinds = possible_kinds(kind, options)
    results, names, studies = [], [], False
    for item in items:
        name = os.fspath(item) if isinstance(item, str | os.PathLike) else ""
        result = load(name) if name else item
        loaded = study_results(result, kinds) if isinstance(result, Ensemble) else [result]
        studies = studies or isinstance(result, Ensemble)
        results, names = results + loaded, names + [str(getattr(part, "path", name)) for part in loaded]
    picture = PICTURES[choose_kind(kinds, results, names)]
    if studies and "statistic" in picture.keywords:
        options.setdefault("statistic", "mean")
    refuse_repeated(results)
    inputs = [name for name in (*names, options.get("packing")) if name]
    for name, place, what, endings in (("out", out, PICTURE, FORMATS), ("csv", csv, TABLE, (".csv",))):
        if place is None:
            continue
        if Path(place).suffix.lower() not in endings:
            raise InputError(
                f"{named(name)} {place}: unknown ending. Give it the ending {' or '.join(endings)}."
            )
        check_output(place, what, inputs)
    page = picture.draw(results, ax, **chosen or {}, **options)
    if out is not None:
        with drawing_errors(results):
            page.save(out)
    if csv is not None:
        write_whole(csv, table_bytes(page.axes))
    return page


def possible_kinds(kind, options) -> list[str]:
    """Kinds that have all these options; kind: the only one, or None. Raises InputError if none has them."""
    known_kinds = pictures()
    if kind is not None and kind not in known_kinds:
        close = difflib.get_close_matches(kind, known_kinds, n=1)
        hint = f"; did you mean {close[0]}?" if close else f". Give one of {', '.join(known_kinds)}."
        raise InputError(f"{named('kind')} {kind}: no such kind of picture{hint}")
    kinds = list(known_kinds) if kind is None else [kind]
    for name in options:
        owners = [kind for kind, picture in known_kinds.items() if name in picture.keywords]
        if not owners:
            raise InputError(f"{name}: not an option of any picture. Leave it out.")
        previous, kinds = kinds, [kind for kind in kinds if kind in owners]
        if not kinds:
            words = f"an option of {' or '.join(owners)} pictures, not of {' or '.join(previous)}"
            raise InputError(f"{named(name)}: {words}. Leave it out.")
    return kinds


def study_results(study, kinds) -> list:
    """The results of a study that one of the kinds can show. Raises InputError if none can."""
    rows_done = study.where(state="done")
    candidates = [(_drawable_rows(rows_done, PICTURES[kind]), PICTURES[kind]) for kind in kinds]
    for rows, picture in candidates:
        if rows.rows == 1 or (rows.rows > 1 and not picture.single):
            return _distinct(rows.results())
    kinds_text = f"{' or '.join(kinds)} pictures" if len(kinds) < len(PICTURES) else "pictures"
    if any(rows.rows for rows, _ in candidates):
        raise InputError(f"{study.path}: a study, but {kinds_text} show a single file. Give the file in it.")
    commands = ", ".join(sorted(set(rows_done["command"].tolist()))) or "nothing"
    raise InputError(
        f"{study.path}: a study with {commands}, but {kinds_text} need {_needed_files(kinds)}. Draw another kind."
    )


def _distinct(results) -> list:
    """Results of a study, each once where seeds made the same packing, as of a lattice that keeps all of its bonds."""
    distinct = {}
    for number, result in enumerate(results):
        attributes = getattr(result, "attributes", {})
        key = number
        if "request" in attributes and "packing_sha256" in attributes:
            request = json.loads(attributes["request"])
            request.pop("inputs", None)
            key = attributes["packing_sha256"], str(request), str(result.settings)
        distinct.setdefault(key, result)
    return list(distinct.values())


def _drawable_rows(rows, picture):
    """Rows of a study whose files a kind of picture shows: of one format, or of all if it is `mixed`."""
    commands = [COMMANDS.get(name, name) for name in picture.of]
    if not picture.mixed:
        commands = [
            next((command for command in commands if command in rows["command"].tolist()), commands[0])
        ]
    return rows.where(command=commands)


def choose_kind(kinds, items, names) -> str:
    """The kind of picture for these items, which have these names, out of `kinds`.

    Raises InputError if no kind shows this mixture of files, files of this format, or this number of them.
    """
    formats = [_format(item) for item in items]
    names = [name or _with_article(of) for name, of in zip(names, formats, strict=True)]
    different = next((n for n, file_format in enumerate(formats) if file_format != formats[0]), None)
    if different is not None:
        kinds = [kind for kind in kinds if PICTURES[kind].mixed and set(formats) <= set(PICTURES[kind].of)]
        if not kinds:
            hint = f" Give the packing of a sweep by {named('packing')}." if "packing" in formats else ""
            nouns = " and ".join(_with_article(_file_noun(formats[n])) for n in (0, different))
            raise InputError(f"{names[0]}, {names[different]}: {nouns}. Draw them in two pictures.{hint}")
    able = [kind for kind in kinds if formats[0] in PICTURES[kind].of] or kinds
    kind = next((kind for kind in able if all(map(PICTURES[kind].suits, items))), able[0])
    if formats[0] not in PICTURES[kind].of:
        raise InputError(
            f"{names[0]}: {_with_article(formats[0], 'file')}. For {kind} pictures give {_needed_files([kind])}."
        )
    if PICTURES[kind].single and len(items) > 1:
        raise InputError(f"{len(items)} {formats[0]} files: {kind} pictures show one. Plot them one by one.")
    return kind


def _format(item):
    if isinstance(item, Packing):
        return "packing"
    if isinstance(item, Network):
        return "network"
    if not hasattr(item, "format"):
        raise InputError(f"{item!r}: neither a file nor a result of jampetsc.load. Give one of them.")
    return item.format.removeprefix("jampetsc-")


def _needed_files(kinds):
    """The files that pictures of these kinds show, in words."""
    return " or ".join(dict.fromkeys(_plural(name) for kind in kinds for name in PICTURES[kind].of))


def _plural(word):
    return {"packing": "a packing", "network": "a network", "spectrum": "spectra"}.get(
        word, f"{_file_noun(word)}s"
    )


def _with_article(*words):
    """The words with their article."""
    return " ".join(("an" if words[0][0] in "aeio" else "a", *words))


def _file_noun(word):
    return word if word in ("packing", "network", "sweep", "spectrum", "correlation") else f"{word} file"


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
            disks, colour = isinstance(collection, EllipseCollection), collection.get_array()
            more = {"diameter": 2 * collection._widths} if disks else {}
            more |= {} if colour is None else {"colour": np.ma.filled(colour, np.nan)}
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

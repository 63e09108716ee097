"""Draws any kind of picture: the list of kinds, and the choice of the one that suits files and options."""

import difflib
import importlib
import os
from pathlib import Path

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import write_whole
from jampetsc.io.ensemble import Ensemble
from jampetsc.io.outputs import PICTURE, TABLE, check_output
from jampetsc.io.reader import load
from jampetsc.options.values import refuse_repeated
from jampetsc.packing.disks import Disks
from jampetsc.plots import picture_table
from jampetsc.plots.page import Page
from jampetsc.plots.picture import PICTURES, Picture, drawable
from jampetsc.plots.style import FORMATS, save

MODULES = (  # with pictures; a file shows by itself the first that suits it and the options given
    "moduli_plots", "spectrum_plots", "correlation_plots", "quasistatic_plots", "exponent_plots", "mode_plots",
    "flow_plots", "jamming_plots", "scaling_plots", "field_plots", "packing_plots",
)  # fmt: skip
COMMANDS = {  # format -> the command, where they have two names
    "correlation": "correlate",
    "velocity-correlation": "correlate",
    "packing": "pack",
}


def pictures() -> dict[str, Picture]:
    """{kind: Picture} of all kinds."""
    for module in MODULES:
        importlib.import_module(f"jampetsc.plots.{module}")
    order = [f"jampetsc.plots.{module}" for module in MODULES]  # one imports the other
    return dict(sorted(PICTURES.items(), key=lambda item: order.index(item[1].function.__module__)))


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
    style=None,
    **more,
):
    """Draw the content of files; returns the axes, one or (panels,) of them.

    results      a file or the folder of a study, the object that `jampetsc.load` gives for it, or a list of these
    kind         of picture, see `jampetsc plot --help`; None: chosen from the files and options
    ax           axes to draw on, as many as the picture has panels; None: those of a new figure
    out          file to write the picture to: .png, .pdf or .svg
    csv          file to write the drawn numbers to
    size         (width, height) of a new figure in inches
    xlim, ylim   (low, high) for all panels, or one for each
    label        words that replace those of the legend, in its order
    style        a style file of matplotlib, or {name: value}, on top of the package's style
    more         options of the kind: statistic="median", omega=[1e-3], …; None is not given

    Raises InputError for files that no picture shows, and for options that the kind does not have.
    """
    items = list(results) if isinstance(results, list | tuple) else [results]
    chosen = {"size": size, "xlim": xlim, "ylim": ylim, "label": label, "style": style}
    return draw(items, kind, ax, out=out, csv=csv, chosen=chosen, **more).given_back


def draw(items, kind=None, ax=None, *, out=None, csv=None, chosen=None, **options) -> Page:
    """As `plot`; chosen: size, xlim and so on."""
    options = {name: value for name, value in options.items() if value is not None}
    if not items:
        raise InputError("results: an empty list: give at least one file or result")
    kinds = asked_kinds(kind, options)
    found, names, studies = [], [], False
    for item in items:
        name = os.fspath(item) if isinstance(item, str | os.PathLike) else ""
        one = load(name) if name else item
        some = of_study(one, kinds) if isinstance(one, Ensemble) else [one]
        studies = studies or isinstance(one, Ensemble)
        found, names = found + some, names + [str(getattr(part, "path", name)) for part in some]
    picture = PICTURES[choose(kinds, found, names)]
    if studies and "statistic" in picture.keywords:
        options.setdefault("statistic", "mean")
    refuse_repeated(found)
    inputs = [name for name in (*names, options.get("packing")) if name]
    for name, place, what, endings in (("out", out, PICTURE, FORMATS), ("csv", csv, TABLE, (".csv",))):
        if place is None:
            continue
        if Path(place).suffix.lower() not in endings:
            raise InputError(f"{name} {place}: give it the ending {' or '.join(endings)}")
        check_output(place, what, inputs)
    drawn = picture.draw(found, ax, **chosen or {}, **options)
    if out is not None:
        with drawable(found):
            save(drawn.figure, out)
    if csv is not None:
        write_whole(csv, picture_table.written(drawn.axes))
    return drawn


def asked_kinds(kind, options) -> list[str]:
    """The kinds that are possible for a kind, or None, and options. Raises InputError if there is none."""
    known = pictures()
    if kind is not None and kind not in known:
        near = difflib.get_close_matches(kind, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        raise InputError(f"{named('kind')} {kind}: {hint}")
    kinds = list(known) if kind is None else [kind]
    for name, value in options.items():
        meant = [one for one, picture in known.items() if name in picture.keywords]
        if not meant:
            raise InputError(f"{name}: is no option of any picture")
        others, kinds = kinds, [one for one in kinds if one in meant]
        if not kinds:
            words = f"belongs to {' or '.join(meant)} pictures, not to {' or '.join(others)}"
            raise InputError(f"{named(name)} {value}: {words}: leave it out")
    return kinds


def of_study(study, kinds) -> list:
    """The results of a study that one of the kinds can show. Raises InputError if none can."""
    done = study.where(state="done")
    suited = [(_shown(done, PICTURES[kind]), PICTURES[kind]) for kind in kinds]
    for rows, picture in suited:
        if rows.rows == 1 or (rows.rows > 1 and not picture.single):
            return rows.results()
    what = f"{' or '.join(kinds)} pictures" if len(kinds) < len(PICTURES) else "pictures"
    if any(rows.rows for rows, _ in suited):
        raise InputError(f"{study.path}: a study: {what} show a single file: name the file in it")
    held = ", ".join(sorted(set(done["command"].tolist()))) or "nothing"
    raise InputError(f"{study.path}: a study with {held}: {what} need {_needed(kinds)}")


def _shown(done, picture):
    """The rows of a study whose files a kind of picture shows; unless it is `mixed`, of the first format found."""
    made = [COMMANDS.get(name, name) for name in picture.of]
    if not picture.mixed:
        made = [next((command for command in made if command in done["command"].tolist()), made[0])]
    return done.where(command=made)


def choose(kinds, items, names) -> str:
    """The kind of picture for these items, which have these names, out of `kinds`.

    Raises InputError if no kind shows this mixture of files, files of this format, or this number of them.
    """
    held = [_format(item) for item in items]
    names = [name or "a packing" for name in names]
    other = next((n for n, one in enumerate(held) if one != held[0]), None)
    if other is not None:
        kinds = [kind for kind in kinds if PICTURES[kind].mixed and set(held) <= set(PICTURES[kind].of)]
        if not kinds:
            hint = f"; the packing of a sweep goes with {named('packing')}" if "packing" in held else ""
            raise InputError(
                f"{names[0]} is {_one(_noun(held[0]))}, {names[other]} {_one(_noun(held[other]))}: "
                f"one picture shows one or the other{hint}"
            )
    kind = next((one for one in kinds if held[0] in PICTURES[one].of), kinds[0])
    if held[0] not in PICTURES[kind].of:
        raise InputError(f"{names[0]}: is {_one(held[0], 'file')}: {kind} pictures need {_needed([kind])}")
    if PICTURES[kind].single and len(items) > 1:
        raise InputError(f"{len(items)} {held[0]} files: {kind} pictures show one; plot them one by one")
    return kind


def _format(item):
    if isinstance(item, Disks):
        return "packing"
    if not hasattr(item, "format"):
        raise InputError(f"{item!r}: is no file, and nothing that jampetsc.load gives")
    return item.format.removeprefix("jampetsc-")


def _needed(kinds):
    """The files that pictures of these kinds show, in words."""
    return " or ".join(dict.fromkeys(_plural(what) for kind in kinds for what in PICTURES[kind].of))


def _plural(word):
    return {"packing": "a packing", "spectrum": "spectra"}.get(word, f"{_noun(word)}s")


def _one(*words):
    """The words with their article."""
    return " ".join(("an" if words[0][0] in "aeio" else "a", *words))


def _noun(word):
    return word if word in ("packing", "sweep", "spectrum", "correlation") else f"{word} file"

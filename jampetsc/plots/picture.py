"""A kind of picture: the function that draws it, the formats of its files, and its options.

    @picture("lanes", "velocity-correlation", "flow", options=(…))
    def plot_lanes(results, page, …):
        ax = page.panels()
        …
        return "what it shows, in words"

The function draws on the axes of `page`. The decorated one takes the caller's axes or makes a figure, and returns the
axes: plot_lanes(results, ax=None, …).
"""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, JampetscError
from jampetsc.io.results import Result
from jampetsc.options.parameters import SWITCH, WORD, Parameter
from jampetsc.plots.page import Page
from jampetsc.plots.style import drawn_in

LARGEST = 1e150  # of the numbers that matplotlib can be asked to draw
PICTURES = {}  # kind -> Picture; `plots.draw` loads all of them


def option(name, kind, help, metavar="", **told) -> Parameter:
    """What a picture may be asked for: a keyword of its function, a long option of the command."""
    default = False if kind is SWITCH else None
    return Parameter(name, help, kind, default, metavar=metavar, group="of some kinds", **told)


PACKING = option("packing", WORD, "the packing, if it is not beside the file", "FILE")


@dataclass(frozen=True)
class Picture:
    """A kind of picture; calling it draws."""

    kind: str
    function: Callable  # (results, page, **options) -> what it shows
    of: tuple[str, ...]  # what files it needs: packing, sweep, …
    options: tuple[Parameter, ...]
    single: bool  # one file at a time
    mixed: bool  # files of several of these formats at once

    @property
    def keywords(self) -> dict:
        """{name: Parameter}."""
        return {option.name: option for option in self.options}

    def __call__(self, results, ax=None, **settings):
        """Draw, and return the axes. Parameters and errors as `draw`."""
        return self.draw(results, ax, **settings).given_back

    def draw(
        self, results, ax=None, *, size=None, xlim=None, ylim=None, label=(), style=None, **options
    ) -> Page:  # fmt: skip
        """Draw results of `jampetsc.load` on the axes `ax` or on a new figure; `text` of the Page describes them.

        Parameters as in `draw.plot`; options: those of this kind of picture, `keywords`.

        Raises InputError for files that it cannot show, and for values that an option cannot have.
        """
        for name, value in options.items():
            self.keywords[name].read(value)
        page = Page(ax, size, [label] if isinstance(label, str) else label, xlim)
        if ax is not None and size is not None:
            raise InputError("size: is of a new figure: leave it out where ax is given")
        with drawable(results), drawn_in(style, own=ax is None):
            page.text = self.function(results, page, **options)
            page.finish(ylim)
        return page


@contextmanager
def drawable(results):
    """Context: an error of drawing numbers that no result has becomes an InputError that names them."""
    try:
        yield
    except JampetscError:
        raise
    except (ArithmeticError, LookupError, ValueError):
        for result in results:
            if why := _unsound(result):
                raise InputError(
                    f"{result.path}: {why}, so that no picture shows it. Make the file again."
                ) from None
        raise


def _unsound(result) -> str:
    """Which attribute or dataset of a result has numbers beyond LARGEST, nan, or negative errors; empty if none has."""
    if not isinstance(result, Result):
        return ""
    for name, value in result.attributes.items():
        if isinstance(value, float) and not abs(value) < LARGEST:
            return f"attribute {name}: not finite, or beyond {LARGEST:g}"
    for name in result:
        if result.stored(name).dtype.kind in "fc":
            array = result[name]
            if "error" in name and (array.real < 0).any():
                return f"dataset {name}: negative"
            if not (np.abs(array) < LARGEST).all():
                return f"dataset {name}: not finite, or beyond {LARGEST:g}"
    return ""


def picture(kind, *of, options=(), single=False, mixed=False):
    """A decorator that makes a `Picture` of a function and enters it in PICTURES."""

    def enter(function):
        PICTURES[kind] = Picture(kind, function, of, tuple(options), single, mixed)
        PICTURES[kind].__dict__["__doc__"] = function.__doc__
        return PICTURES[kind]

    return enter


def grouped(results, key) -> dict:
    """{key(result): results}, in the order of the first result of each key."""
    found = {}
    for result in results:
        found.setdefault(key(result), []).append(result)
    return found


def differing(parts, varied) -> list[str]:
    """A label for each of `parts`, rows of words: the words of columns that are `varied`, without empty ones."""
    return [", ".join(word for word, used in zip(row, varied, strict=True) if used and word) for row in parts]


def count(items, one="sweep", many="sweeps") -> str:
    """So many of them, in words."""
    return f"{len(items)} {one if len(items) == 1 else many}"

"""A kind of picture: the function that draws it, the formats of its files, its options, and the units of its numbers.

    @picture("lanes", "velocity-correlation", "flow", options=(…))
    def plot_lanes(results, page, …):
        ax = page.panels()
        …
        return "what it shows, in words"

The function draws on the axes of `page`. The decorated one takes the caller's axes or makes a figure, and returns the
axes: plot_lanes(results, ax=None, …).
"""

import math
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jampetsc.errors import InputError, JampetscError
from jampetsc.io.provenance import recorded_dimension
from jampetsc.io.results import Result
from jampetsc.options.parameters import SWITCH, WORD, Parameter
from jampetsc.packing.potentials import Potential
from jampetsc.plots.page import Page, shown_colours
from jampetsc.plots.style import drawn_in, read_colours

MAX_DRAWN = 1e150  # larger numbers matplotlib may fail to draw
# what pictures of samples and flows tell of particles, if they differ, in words of their own
PARTICLE_COLUMNS = ("n", "dimension", "phi", "pressure", "sizes", "potential", "exponent")
PICTURES = {}  # kind -> Picture; `plots.draw` loads all of them


def option(name, kind, help, metavar="", **limits) -> Parameter:
    """An option of some kinds of pictures: a keyword of their functions; limits: low, high, choices."""
    default = False if kind is SWITCH else None
    return Parameter(name, help, kind, default, metavar=metavar, group="options of some kinds", **limits)


PACKING = option(
    "packing", WORD, "fields, response, mode: file of the packing (default: as the result records it)", "FILE"
)


@dataclass(frozen=True)
class Picture:
    """A kind of picture; calling it draws."""

    kind: str
    function: Callable  # (results, page, **options) -> what it shows
    of: tuple[str, ...]  # formats of files that it shows: packing, sweep, …
    options: tuple[Parameter, ...]
    single: bool  # one file at a time
    mixed: bool  # files of several of these formats at once
    suits: Callable  # result -> whether it has what the picture needs; asked where no kind is given

    @property
    def keywords(self) -> dict:
        """{name: Parameter}."""
        return {option.name: option for option in self.options}

    def __call__(self, results, ax=None, **settings):
        """Draw, and return the axes. Parameters and errors as `draw`."""
        return self.draw(results, ax, **settings).returned_axes

    def draw(
        self, results, ax=None, *, size=None, xlim=None, ylim=None, label=(), color=(), panels=None, style=None,
        **options,
    ) -> Page:  # fmt: skip
        """Draw results of `jampetsc.load` on the axes `ax` or on a new figure; `text` of the Page describes them.

        Parameters as in `draw.plot`; options: `keywords` of this kind of picture.

        Raises InputError for files that it cannot show, and for values that an option cannot have.
        """
        for name, value in options.items():
            self.keywords[name].read(value)
        page = Page(ax, size, [label] if isinstance(label, str) else label, xlim, panels)
        if ax is not None and size is not None:
            raise InputError("size, ax: both given. Give size only for a new figure.")
        chosen = read_colours(color) if np.size(color) else []
        with drawing_errors(results), drawn_in(style, ax is None, chosen, shown_colours(page.axes)):
            page.text = self.function(results, page, **options)
            page.finish(ylim)
        return page


@contextmanager
def drawing_errors(results):
    """Context: an error of drawing becomes an InputError if a result has numbers that cannot be drawn."""
    try:
        yield
    except JampetscError:
        raise
    except (ArithmeticError, LookupError, ValueError):
        for result in results:
            if why := _unsound(result):
                raise InputError(f"{result.path}: {why}. Make the file again.") from None
        raise


def _unsound(result) -> str:
    """Which attribute or dataset has numbers beyond MAX_DRAWN, nan, or negative errors; empty if none has."""
    if not isinstance(result, Result):
        return ""
    for name, value in result.attributes.items():
        if isinstance(value, float) and not abs(value) < MAX_DRAWN:
            return f"attribute {name}: not finite, or beyond {MAX_DRAWN:g}"
    for name in result:
        if result.stored(name).dtype.kind in "fc":
            array = result[name]
            if "error" in name and (array.real < 0).any():
                return f"dataset {name}: negative"
            if not (np.abs(array) < MAX_DRAWN).all():
                return f"dataset {name}: not finite, or beyond {MAX_DRAWN:g}"
    return ""


def picture(kind, *of, options=(), single=False, mixed=False, suits=lambda result: True):
    """A decorator that makes a `Picture` of a function and enters it in PICTURES."""

    def enter(function):
        PICTURES[kind] = Picture(kind, function, of, tuple(options), single, mixed, suits)
        PICTURES[kind].__dict__["__doc__"] = function.__doc__
        return PICTURES[kind]

    return enter


def group_by(results, key) -> dict:
    """{key(result): results}, in the order of the first result of each key."""
    groups = {}
    for result in results:
        groups.setdefault(key(result), []).append(result)
    return groups


def setting_text(name, value) -> str:
    """A column that a study has set and its value in words; None: left at its default."""
    words = name.replace("_", " ")
    if value is None:
        return f"{words} by default"
    return f"{words} {value:.6g}" if isinstance(value, float) else f"{words} {value}"


def other_settings(result, columns) -> str:
    """What a study has set for a result beside these columns and PARTICLE_COLUMNS, in words."""
    known, settings = {*PARTICLE_COLUMNS, *columns}, getattr(result, "settings", {})
    return ", ".join(setting_text(name, value) for name, value in settings.items() if name not in known)


def potential_text(attributes) -> str:
    """The potential that a file records, in words; empty where it records none."""
    return str(Potential.of_record(attributes)) if "potential" in attributes else ""


def join_varied(parts, varied) -> list[str]:
    """A label for each of `parts`, rows of words: the words of columns that are `varied`, without empty ones."""
    return [", ".join(word for word, used in zip(row, varied, strict=True) if used and word) for row in parts]


def count_text(items, singular="sweep", plural="sweeps") -> str:
    """Their number and noun: 1 sweep, 3 sweeps."""
    return f"{len(items)} {singular if len(items) == 1 else plural}"


@dataclass(frozen=True)
class Units:
    """Units by which the numbers of a result are divided, and its pressure in them."""

    k: float  # stiffness of a contact
    tau1: float  # damping time
    pressure: float | None  # p/k; None if the file does not have it


def units_of(result) -> Units:
    """Units of a `io.results.Result`; k and τ₁ are 1 if it has none.

    Raises InputError, naming the file, for units that are not positive and for a pressure that is not finite.
    """
    values = {}
    for name in ("k", "tau1", "pressure"):
        value = result.attributes.get(name, None if name == "pressure" else 1.0)
        is_number = isinstance(value, (int, float)) and math.isfinite(value)
        if value is not None and not (is_number and (name == "pressure" or value > 0)):
            requirement = "a number" if name == "pressure" else "a positive number"
            raise InputError(
                f"{result.path}: attribute {name} = {value}: not {requirement}. Make the file again."
            )
        values[name] = None if value is None else float(value)
    pressure = values["pressure"]
    return Units(values["k"], values["tau1"], None if pressure is None else pressure / values["k"])


class StressUnit(NamedTuple):
    """TeX of the unit of stress, of a stress over it (behind its symbol), and of the unit of viscosity."""

    name: str
    over: str
    viscosity: str


STRESS_UNITS = {  # D -> unit, with d the unit of length
    2: StressUnit("k", "/k", r"k\tau_1"),
    3: StressUnit("k/d", r"\,d/k", r"k\tau_1/d"),
}
# D -> TeX of the mean diameter, which labels of spheres tell from d, the unit of length
MEAN_DIAMETER = {2: "d", 3: r"\langle d\rangle"}
_MIXED_UNIT = StressUnit(r"k\,d^{2-D}", r"\,d^{D-2}/k", r"k\tau_1\,d^{2-D}")


def stress_unit(results) -> StressUnit:
    """That of disks, or of spheres and networks in three dimensions; with the power of D for results of both."""
    dimensions = {recorded_dimension(result.attributes) for result in results}
    return _MIXED_UNIT if len(dimensions) > 1 else STRESS_UNITS[dimensions.pop()]


UNITS = ("energy", "stress", "rate", "viscosity", "length")
_RATE = r"k_{\rm e}/k_{\rm d}d_{\rm s}^2"
_VAGBERG = {  # D -> names of his units, of spheres with stress as energy over volume
    2: (r"k_{\rm e}", r"k_{\rm e}/d_{\rm s}^2", _RATE, r"k_{\rm d}", r"d_{\rm s}"),
    3: (r"k_{\rm e}", r"k_{\rm e}/d_{\rm s}^3", _RATE, r"k_{\rm d}/d_{\rm s}", r"d_{\rm s}"),
}


@dataclass(frozen=True)
class FlowUnits:
    """Units by which numbers of flow, shear and jam files are divided: energies and stresses by k, rates by 1/τ₁."""

    k: float
    tau1: float
    names: tuple  # of UNITS in TeX without dollars; "" for the length of a packing, which has none

    def label(self, symbol, unit) -> str:
        """Words for an axis: the symbol in TeX, and the name of one of UNITS if it has one."""
        text = self.names[UNITS.index(unit)]
        return rf"${symbol}\ [{text}]$" if text else f"${symbol}$"


def flow_units(results) -> FlowUnits:
    """The common units of files: Vågberg's (thesis sec. 4.1), or the units of a packing.

    Raises InputError, naming the file, if they differ.
    """
    first_units = None
    for result in results:
        attributes, scales = result.attributes, units_of(result)
        if str(attributes.get("units", "")).startswith("k_e"):
            texts = _VAGBERG[recorded_dimension(attributes)]
        elif attributes.get("stiffness") == "inverse-square-diameter":
            over = {2: "", 3: "/d^3"}[recorded_dimension(attributes)]  # in the plane over the unit of area
            texts = (r"k_{\rm e}", rf"k_{{\rm e}}{over}", r"1/\tau_1", rf"k_{{\rm e}}\tau_1{over}", "")
        else:
            D = recorded_dimension(attributes)
            energy, unit = {2: "k", 3: r"k\,d^2"}[D], STRESS_UNITS[D]  # in the plane times the unit of area
            texts = (energy, unit.name, r"1/\tau_1", unit.viscosity, "")
        units = FlowUnits(scales.k, scales.tau1, texts)
        first_units = first_units or units
        if units != first_units:
            raise InputError(
                f"{result.path}: units {attributes.get('units', 'unknown')}, but {results[0].path.name} has others. "
                "Draw files of equal units in one picture."
            )
    return first_units

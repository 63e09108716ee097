"""The look of all pictures: sizes, colours that survive grey scale and colour blindness, numbers, saving.

Figures are made without pyplot: no display, no global state, and the same bytes from the same data.
"""

import io
import itertools
import os
import re
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.colors import LinearSegmentedColormap, is_color_like, to_rgb, to_rgba
from matplotlib.lines import Line2D

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import write_whole

COLUMN, PAGE = 3.4, 7.0  # inches: one and two columns of a journal
GREY = "0.45"
DASHED, DOTTED = (0, (4, 1.6)), (0, (1, 1.2))
OPEN = {"markerfacecolor": "white", "linestyle": DASHED}  # the second of two quantities in one colour
STORAGE, LOSS = "$G$\u2032", "$G$\u2033"  # mathtext sets its own primes too small and too far off
MARKERS = "osD^vP<X>*ph"
CYCLE = "axes.prop_cycle"
_DEFAULT_CYCLE = matplotlib.rcParamsDefault[CYCLE]
MAX_BESIDE = 16  # colours of groups on axes that show some already
FORMATS = {  # what to leave out so that the same data give the same file
    ".png": {"Software": None},
    ".pdf": {"Creator": None, "Producer": None, "CreationDate": None},
    ".svg": {"Date": None, "Creator": None},
}
STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 10,
    "axes.titlesize": 9,
    "legend.fontsize": 8,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.6,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "legend.labelspacing": 0.3,
    "savefig.dpi": 300,
    "figure.dpi": 300,
    "svg.hashsalt": "jampetsc",
    "pdf.fonttype": 42,  # text stays text
    "axes.unicode_minus": True,
    "errorbar.capsize": 1.0,
    "legend.title_fontsize": 8.5,
}


def colours(count):
    """`count` colours: the user's in their cycle; else from dark to light, with contrast for a thin line on white."""
    if has_chosen_colours():
        cycle = itertools.cycle(entry["color"] for entry in matplotlib.rcParams[CYCLE])
        return [to_rgba(colour) for colour in itertools.islice(cycle, count)]
    return [sequential()(x) for x in np.linspace(0, 1, count)]


def has_chosen_colours() -> bool:
    """Whether a style, `color` or what axes show already decides the colours of groups."""
    return "color" in matplotlib.rcParams[CYCLE].keys and matplotlib.rcParams[CYCLE] != _DEFAULT_CYCLE


def colours_beside(shown) -> list:
    """MAX_BESIDE colours of `sequential`, far apart, without those that axes show already, (r, g, b) each."""
    halves = (1.0, *((2 * step + 1) / 2**level for level in range(1, 6) for step in range(2 ** (level - 1))))
    shades = [sequential()(x) for x in (0.0, *halves)]
    return [shade for shade in shades if not any(np.allclose(shade[:3], own) for own in shown)][:MAX_BESIDE]


def read_colours(colours) -> list:
    """Colours of matplotlib as (r, g, b, a) each. Raises InputError for anything else."""
    colours = [colours] if isinstance(colours, str) or is_color_like(colours) else list(colours)
    wrong = [colour for colour in colours if not is_color_like(colour)]
    if wrong or not colours:
        raise InputError(
            f"{named('color')} {wrong[0] if wrong else '[]'}: not a colour of matplotlib. Give a name such as "
            "tab:red, or #rrggbb."
        )
    return [to_rgba(colour) for colour in colours]  # also C0, which a cycle may not hold


def sequential():
    """Colour map for positive quantities, dark to light, monotonic in grey scale: blue, purple, orange.

    It ends where the contrast with white is 3, what readable graphics need at least (WCAG 2, 1.4.11).
    """
    plasma = matplotlib.colormaps["plasma"]
    return LinearSegmentedColormap.from_list("plasma-dark", plasma(np.linspace(0.0, 0.64, 256)))


def number(value) -> str:
    """A number of two digits in TeX without dollars, such as 10^{-3}, 1.2\\times10^{-3} or 0.84."""
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.1e}".split("e")
    if -2 < int(exponent) < 4:
        return f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"
    mantissa = mantissa.removesuffix(".0")
    power = f"10^{{{int(exponent)}}}"
    return {"1": power, "-1": f"-{power}"}.get(mantissa, rf"{mantissa}\times{power}")


def power_or_number(value) -> str:
    """As `number`, but a power of ten below one is always written as such."""
    power = np.log10(value) if value > 0 else 0.0
    exact = power < 0 and abs(power - round(power)) < 1e-3
    return f"10^{{{round(power)}}}" if exact else number(value)


def exponent_text(value) -> str:
    """An exponent in TeX, as a fraction if its denominator is at most 6."""
    fraction = Fraction(float(value)).limit_denominator(6)
    return str(fraction) if abs(fraction - value) * fraction.denominator < 1e-9 else f"{value:.3g}"


def power_text(base, exponent) -> str:
    """base^exponent in TeX, without an exponent of 1."""
    return base if exponent == 1 else f"{base}^{{{exponent_text(exponent)}}}"


def looks(kinds) -> list[tuple]:
    """[(kind, its colour and marker as keywords of matplotlib), …] of kinds of points."""
    kinds = list(kinds)
    shades = zip(kinds, colours(len(kinds)), itertools.cycle(MARKERS), strict=False)
    return [(kind, {"color": shade, "marker": marker}) for kind, shade, marker in shades]


def entry(label, color="0.2", **look) -> Line2D:
    """An entry of a legend that stands for no single line."""
    return Line2D([], [], color=color, label=label, **look)


def hidden(name) -> str:
    """The label of a series that the table of numbers names and the legend does not."""
    return f"_:{name}"


@contextmanager
def drawn_in(style=None, own=True, chosen=(), shown=()):
    """Within it pictures have the package's style, whatever the user's matplotlibrc says, or the user's if not `own`.

    style    settings on top of it: a file of matplotlib, or {name: value}
    chosen   colours of groups, in their order, before the colours of the style
    shown    colours that the axes show already, [(r, g, b)], which groups do not get

    Raises InputError for a file that cannot be read as a style.
    """
    with matplotlib.rc_context():
        if own:
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(STYLE)
        try:
            if style is not None and not isinstance(style, dict):
                style = matplotlib.rc_params_from_file(style, use_default_template=False)
            matplotlib.rcParams.update(style or {})
        except (OSError, ValueError, KeyError, TypeError) as error:
            why = getattr(error, "strerror", None) or str(error).splitlines()[0]
            raise InputError(f"{named('style')} {style}: {why}. Give a style file of matplotlib.") from None
        cycle = chosen or _unused_colours(shown)
        if cycle:
            matplotlib.rcParams[CYCLE] = cycler(color=cycle)
        yield


def _unused_colours(shown) -> list:
    """Colours for groups beside those that axes show already; empty where these show none of such colours."""
    if not has_chosen_colours():
        palette = sequential()(np.arange(sequential().N))[:, :3]
        own = [colour for colour in shown if np.isclose(palette, colour).all(axis=1).any()]
        return colours_beside(own) if own else []
    cycle = [entry["color"] for entry in matplotlib.rcParams[CYCLE]]
    return [colour for colour in cycle if to_rgb(colour) not in shown] or cycle


def save(fig, path, laid_out=False) -> None:
    """Write the picture in the format of its ending, complete or not at all. Raises JampetscError.

    laid_out   whether all has its place already: to find it again would double the work
    """
    suffix = Path(os.path.realpath(path)).suffix.lower()
    image, engine = io.BytesIO(), fig.get_layout_engine()
    with drawn_in():
        if laid_out:
            fig.set_layout_engine(None)  # with "none" matplotlib 3.6 draws twice
        try:
            fig.savefig(image, format=suffix[1:], metadata=FORMATS[suffix])
        except (ValueError, OverflowError) as error:
            date = os.environ.get("SOURCE_DATE_EPOCH")
            if not date or suffix not in (".pdf", ".svg"):
                raise
            why = f"SOURCE_DATE_EPOCH {date}: no date for a picture ({error}). Give seconds since 1970, or unset it."
            raise InputError(why) from None
        finally:
            if engine is not None:
                fig.set_layout_engine(engine)
    content = image.getvalue()
    if suffix == ".svg":
        content = _numbered_clips(content)
    write_whole(path, content)


def _numbered_clips(svg: bytes) -> bytes:
    """The same SVG with clip paths named by number: matplotlib names them after places in memory."""
    for number, name in enumerate(dict.fromkeys(re.findall(rb'<clipPath id="(\w+)"', svg))):
        svg = re.sub(rb'(?<=["#])%s(?=[")])' % name, b"clip%d" % number, svg)
    return svg

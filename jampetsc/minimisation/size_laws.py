"""Laws of particle sizes: radii of mean diameter 1 that follow a distribution by number, the same for every seed.

    monodisperse                     all alike
    bidisperse[:RATIO[:SHARE]]       a SHARE of the particles is RATIO times as large as the others (1.4, 0.5)
    lognormal:SIGMA                  ln ρ is normal, with standard deviation SIGMA
    uniform:LOW:HIGH                 ρ between LOW and HIGH in any unit, each as likely
    powerlaw:EXPONENT:RATIO          n(ρ) ~ ρ^(−EXPONENT) from the smallest radius to RATIO times that

Radii are the quantiles of the law at (k + ½)/N, k = 0 … N − 1, scaled to their mean: without noise of sampling, so that
packings of other seeds differ in their places alone.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing import elementary

DEFAULT_SIZES = "bidisperse"
MAX_RATIO = 100.0  # largest radius over the smallest one
NORMAL_DECIMALS = 12  # of quantiles of the normal distribution, whose last digits are the C library's
MIN_LENGTH, MAX_LENGTH = 1e-6, 1e6  # radii of a law that has a unit


class Number(NamedTuple):
    """A number of a law."""

    name: str
    low: float  # least value
    high: float  # largest value
    default: float | None = None  # None: it must be given


class SizeLaw(NamedTuple):
    """A law of sizes: radii(n, *numbers) gives n of them in any unit; raises ValueError or InputError."""

    radii: Callable
    numbers: tuple[Number, ...] = ()

    def form(self, name: str) -> str:
        """How it is written."""
        needed = [number.name for number in self.numbers if number.default is None]
        optional = [number.name for number in self.numbers if number.default is not None]
        return ":".join((name, *needed)) + "".join(f"[:{word}" for word in optional) + "]" * len(optional)


# of arrays, the same digits whatever the C library
_exp, _log = (np.vectorize(function, otypes=[float]) for function in (elementary.exp, elementary.log))


def _monodisperse(n):
    return np.full(n, 0.5)


def _bidisperse(n, ratio, share):
    # evenly interleaved, so that sizes are mixed in the order of the particles as well
    is_large = np.diff(np.floor(np.arange(n + 1) * share + 1e-9)) > 0
    if is_large.all() or not is_large.any():
        raise ValueError(
            f"all {n} particles would be {'large' if is_large.all() else 'small'}. Give a SHARE nearer to 0.5, or more "
            "particles."
        )
    small = 1.0 / (2.0 * (1.0 - share) + 2.0 * share * ratio)
    return np.where(is_large, ratio * small, small)


def _quantiles(n):
    return (np.arange(n) + 0.5) / n


def _lognormal(n, sigma):
    from scipy.special import ndtri  # here, as it takes long to load

    return _exp(sigma * np.round(ndtri(_quantiles(n)), NORMAL_DECIMALS))


def _uniform(n, low, high):
    if not low <= high <= MAX_RATIO * low:
        raise ValueError(f"HIGH must lie in [LOW, {MAX_RATIO:g} LOW]")
    return low + (high - low) * _quantiles(n)


def _powerlaw(n, exponent, ratio):
    rise, span, quantiles = 1.0 - exponent, elementary.log(ratio), _quantiles(n)
    if rise * span == 0.0:
        return _exp(span * quantiles)
    growth = quantiles * elementary.expm1(rise * span)
    rounded = 1.0 + growth - 1.0  # ln(1 + x) with all digits for small x, as x over what 1 + x has of it
    share = np.divide(growth, rounded, out=np.ones(n), where=rounded != 0.0)
    return _exp(np.where(rounded != 0.0, _log(1.0 + growth) * share, growth) / rise)


LAWS = {
    "bidisperse": SizeLaw(
        _bidisperse, (Number("RATIO", 1.0, MAX_RATIO, 1.4), Number("SHARE", 0.0, 1.0, 0.5))
    ),
    "monodisperse": SizeLaw(_monodisperse),
    "lognormal": SizeLaw(_lognormal, (Number("SIGMA", 0.0, 1.0),)),
    "uniform": SizeLaw(_uniform, tuple(Number(name, MIN_LENGTH, MAX_LENGTH) for name in ("LOW", "HIGH"))),
    "powerlaw": SizeLaw(_powerlaw, (Number("EXPONENT", -20.0, 20.0), Number("RATIO", 1.0, MAX_RATIO))),
}
FORMS = ", ".join(law.form(name) for name, law in LAWS.items())
SIZES_HELP = f"particle sizes: {FORMS}; bidisperse has RATIO 1.4 and a SHARE of 0.5 of large ones"


def _numbers_of(text: str) -> tuple[str, list[float]]:
    """(name, all numbers) of a law; raises ValueError that says what is wrong with it."""
    name, *words = text.split(":")
    if name not in LAWS:
        raise ValueError(f"not supported. Choose one of {FORMS}.")
    law, values = LAWS[name], []
    how = f"Write {law.form(name)}."
    if len(words) > len(law.numbers):
        raise ValueError(f"too many numbers ({len(words)}, at most {len(law.numbers)}). {how}")
    for place, number in enumerate(law.numbers):
        if place >= len(words) and number.default is None:
            raise ValueError(f"{number.name} is missing. {how}")
        try:
            value = float(words[place]) if place < len(words) else number.default
        except ValueError:
            raise ValueError(f"{number.name} must be a number, not {words[place]!r}. {how}") from None
        if not number.low <= value <= number.high:
            raise ValueError(f"{number.name} must lie in [{number.low:g}, {number.high:g}]")
        values.append(value)
    return name, values


def read_sizes(value) -> str:
    """The text of a law in one form for all ways to write it; raises ValueError."""
    name, values = _numbers_of(str(value))
    while values and values[-1] == LAWS[name].numbers[len(values) - 1].default:
        values.pop()
    return ":".join((name, *(repr(value).removesuffix(".0") for value in values)))


def is_law(text) -> bool:
    """Whether the text is a law of sizes, not a name of a list of radii."""
    try:
        return read_sizes(text) == text
    except ValueError:
        return False


def radii_of(sizes: str, n: int):
    """N radii of mean diameter 1 (N,) by a law of sizes. Raises InputError where so few particles cannot follow it."""
    name, values = _numbers_of(sizes)
    try:
        radii = LAWS[name].radii(n, *values)
    except ValueError as error:
        raise InputError(f"{named('sizes')} {sizes}: {error}") from None
    return radii if name in ("bidisperse", "monodisperse") else radii * (0.5 / np.mean(radii))

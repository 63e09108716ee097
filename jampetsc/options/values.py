"""Kinds of values besides numbers and words: packings, results, frequencies and other lists of numbers.

One grammar for lists: `a,b,c` as they are, `low:high:count` a logarithmic grid, `lin:low:high:count` an even one;
from python any list or array.
"""

import operator
import os
from collections.abc import Iterable, Sequence
from functools import partial

from jampetsc.errors import InputError, named
from jampetsc.laws.damping import MAX_OMEGA, MIN_OMEGA
from jampetsc.options.parameters import ValueType, format_value

Numbers = str | Sequence[float]
MAX_GRID_SIZE = 100_000  # numbers of a grid
STRESS_UNIT = "the unit of k, in three dimensions that of k/length"
TIME_UNIT = "1/time, the time that tau1 is in"
MAX_SEED = 2**63 - 1  # largest that a file can record
MAX_SEEDS = 1_000_000
POSITIVE = 1e-300, 1e300  # range of positive numbers in units that are not known yet
MAX_THREADS = 256


def split_list(values) -> tuple:
    """A tuple of values: the words between commas of a string, the entries of a list or array, or a single value."""
    if isinstance(values, str):
        return tuple(values.split(","))
    return tuple(values) if getattr(values, "ndim", 1) and hasattr(values, "__iter__") else (values,)


def number_list(low, high, metavar="LIST", unit="", even=False) -> ValueType:
    """Several numbers within [low, high], read as an array (M,), increasing and without repeats.

    unit   what follows the limits in a message
    even   whether low:high:count is an even grid, without lin:
    """

    def read(value):
        if even and isinstance(value, str) and ":" in value:
            value = f"lin:{value.removeprefix('lin:')}"
        return _numbers(value, low, high, unit)

    python = 'numbers or "low:high:count"'
    return ValueType(read, partial(format_numbers, even=even), metavar=metavar, python=python)


def _numbers(value, low, high, unit):
    import numpy as np

    if isinstance(value, str):
        numbers = _parse_grid(value)
    else:
        try:
            numbers = np.unique(np.asarray(value, float).ravel())
        except (TypeError, ValueError, OverflowError):
            raise ValueError("must be numbers") from None
    if not len(numbers):
        raise ValueError("must be at least one number")
    for number in numbers:
        if not low <= number <= high:  # nan as well
            raise ValueError(f"{format_value(float(number))} must lie between {low:g} and {high:g}{unit}")
    return numbers


def _integers(value):
    try:
        return [int(word) for word in split_list(value)]
    except (TypeError, ValueError):
        raise ValueError("must be whole numbers with commas, e.g. 1,2,5") from None


def _parse_grid(text):
    """Numbers of the grammar above."""
    import numpy as np

    even = text.startswith("lin:")
    try:
        if ":" not in text:
            return np.unique([float(word) for word in text.split(",")])
        low, high, count = text.removeprefix("lin:").split(":")
        low, high, count = float(low), float(high), int(count)
    except ValueError:
        raise ValueError("must be low:high:count, e.g. 1e-3:1e2:51, lin:low:high:count, or a,b,…") from None
    if not (
        np.isfinite([low, high]).all() and low < high and 2 <= count <= MAX_GRID_SIZE and (even or low > 0)
    ):
        raise ValueError(
            f"must have {'' if even else '0 < '}low < high and a count from 2 to {MAX_GRID_SIZE}"
        )
    grid = (np.linspace if even else np.geomspace)(low, high, count)
    return np.unique(
        np.clip(grid, low, high)
    )  # rounding may make neighbours equal, or put them in another order


def format_numbers(values, even=False) -> str:
    """Numbers (M,) written in the grammar above, such that reading gives the same to the last bit.

    even   whether low:high:count is an even grid, without lin:
    """
    import numpy as np

    values = np.asarray(values, float)
    if len(values) > 2:
        ends = f"{float(values[0])!r}:{float(values[-1])!r}:{len(values)}"
        if not even and values[0] > 0 and np.array_equal(_parse_grid(ends), values):
            return ends
        if np.array_equal(_parse_grid(f"lin:{ends}"), values):
            return ends if even else f"lin:{ends}"
    return ",".join(repr(float(value)) for value in values)


def read_seeds(value) -> Sequence[int]:
    """The seeds that `FIRST:LAST`, both included, or `a,b,…` stands for; one or several whole numbers.

    Raises ValueError.
    """
    try:
        if isinstance(value, str):
            first, colon, last = value.partition(":")
            value = range(int(first), int(last) + 1) if colon else tuple(map(int, value.split(",")))
        elif not isinstance(value, Iterable):
            value = (value,)
        seeds = value if isinstance(value, range) else tuple(operator.index(seed) for seed in value)
    except (TypeError, ValueError):
        raise ValueError("must be FIRST:LAST, e.g. 1:20, or a,b,…") from None
    if not seeds:
        raise ValueError("must have a last seed that is not below the first")
    if len(seeds[: MAX_SEEDS + 1]) > MAX_SEEDS:  # len() of a longer range may overflow
        raise ValueError(f"must be at most {MAX_SEEDS} seeds")
    if not isinstance(seeds, range) and len(set(seeds)) < len(seeds):
        raise ValueError("must not have a seed twice")
    if not 0 <= min(seeds) <= max(seeds) <= MAX_SEED:
        raise ValueError(f"must lie in [0, {MAX_SEED}]")
    return seeds


def _seeds_text(seeds) -> str:
    first, last = min(seeds), max(seeds)
    return f"{first}:{last}" if list(seeds) == list(range(first, last + 1)) else ",".join(map(str, seeds))


def _radii(value):
    from jampetsc.minimisation.sizes import Radii

    if isinstance(value, Radii):
        return value
    return Radii.read(os.fspath(value)) if isinstance(value, str | os.PathLike) else Radii(value)


def _sizes(value):
    from jampetsc.minimisation.size_laws import read_sizes

    return read_sizes(value)


def _read_as(names, what):
    """The `read` of a parameter for a packing or a result: the name of its file, or the object if it is in memory only.

    names   classes of objects in memory that are accepted, of "Packing", "Network" and "Result"
    what    describes them in messages
    """

    def read(value):
        from jampetsc.io.results import Result
        from jampetsc.packing.packing import Packing
        from jampetsc.packing.spring_network import Network

        classes = tuple({"Packing": Packing, "Network": Network, "Result": Result}[name] for name in names)
        if isinstance(value, Result):
            if isinstance(value, classes) and (value.file is None or value.packing is not None):
                return value  # also one that was saved, for the packing that it knows
            place = value.file
        elif isinstance(value, classes):
            return value
        else:
            place = getattr(value, "path", value)  # of a study's table
        try:
            return os.fsdecode(place)
        except TypeError:
            raise ValueError(f"must be {what} or the name of its file") from None

    return read


def load_source(source):
    """A packing or a result of a job's parameters, loaded if it is the name of a file."""
    from jampetsc.io.reader import load

    return load(source) if isinstance(source, str) else source


def input_name(source) -> str:
    """A packing or a result in messages: the name of its file, or a description if it is in memory."""
    if hasattr(source, "bonds"):
        return f"<network of {source.n} nodes>"
    return f"<{source.n} disks>" if hasattr(source, "potential") else str(getattr(source, "path", source))


def refuse_repeated(sources) -> None:
    """Raise InputError where two sources are one file, also through links, or one object: it would count twice."""
    seen = {}
    for source in sources:
        file = source if isinstance(source, str | os.PathLike) else getattr(source, "file", None)
        key, name = id(source) if file is None else os.path.realpath(file), input_name(source)
        if key in seen:
            same = f"the same file as {seen[key]}" if name != seen[key] else "given twice"
            raise InputError(f"{name}: {same}. Give each file once.")
        seen[key] = name


PACKING = ValueType(
    _read_as(["Packing"], "a packing"),
    input_name,
    metavar="PACKING",
    python="Packing or the name of its file",
)
RESULT = ValueType(
    _read_as(["Result"], "a result"), input_name, metavar="FILE", python="result or the name of its file"
)
PACKING_OR_NETWORK = ValueType(
    _read_as(["Packing", "Network"], "a packing, a network"),
    input_name,
    metavar="PACKING",
    python="Packing, Network or the name of its file",
)
PACKING_NETWORK_OR_RESULT = ValueType(
    _read_as(["Packing", "Network", "Result"], "a packing, a network, a result"),
    input_name,
    metavar="FILE",
    python="Packing, Network, result or the name of its file",
)
PACKING_OR_RESULT = ValueType(
    _read_as(["Packing", "Result"], "a packing, a result"),
    input_name,
    metavar="FILE",
    python="Packing, result or the name of its file",
)
INTEGERS = ValueType(_integers, lambda integers: ",".join(map(str, integers)), python="integers")
SEEDS = ValueType(read_seeds, _seeds_text, metavar="FIRST:LAST|LIST", python='integers or "first:last"')
RADII = ValueType(
    _radii,
    lambda radii: radii.path or radii.text,
    metavar="FILE",
    python="array (N,) or the name of a text file",
)
SIZES = ValueType(_sizes, metavar="LAW")
FREQUENCIES = number_list(*POSITIVE, "LOW:HIGH:COUNT|LIST")


def check_frequencies(omega, tau1: float) -> None:
    """Raise InputError for frequencies (M,) in 1/time whose products with τ₁ are out of range."""
    for end in (min(omega), max(omega)):
        if not MIN_OMEGA <= end * tau1 <= MAX_OMEGA:
            raise InputError(
                f"{named('omega')} {end:g}: must lie between {MIN_OMEGA / tau1:g} and {MAX_OMEGA / tau1:g} (limits "
                f"ω → 0 and ∞: quasistatic)"
            )

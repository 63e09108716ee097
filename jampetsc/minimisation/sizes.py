"""Radii of the particles: by a law of sizes, or a list that the user gives."""

import hashlib
import itertools
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import open_regular
from jampetsc.minimisation.size_laws import DEFAULT_SIZES, radii_of

MIN_RADIUS, MAX_RADIUS = 1e-6, 1e6  # radius
MIN_DISKS, MAX_DISKS = 16, 10_000_000  # disks
MAX_SHOWN_TEXT = 40  # characters of a line in a message


def in_small_diameters(radii):
    """The radii (N,) in units of the smallest diameter, as Vågberg has them."""
    return radii * (0.5 / radii.min())


@dataclass(frozen=True, eq=False)
class Radii:
    """Radii that the user gives.

    values   (N,), positive
    path     the file that they were read from, None for an array

    Raises InputError for values that cannot be radii.
    """

    values: np.ndarray
    path: str | None = None

    def __post_init__(self):
        try:
            values = np.array(self.values, float)
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{self}: not numbers. Give one number per particle.") from None
        object.__setattr__(self, "values", values)
        if values.ndim != 1:
            raise InputError(
                f"{self}: not a list of numbers (shape {values.shape}). Give one for each particle."
            )
        for number in np.flatnonzero(~(np.isfinite(values) & (values > 0)))[:1]:
            raise InputError(
                f"{self}{self._place(number)}: not a positive number ({values[number]:g}). Give one for each particle."
            )
        if not MIN_DISKS <= len(values) <= MAX_DISKS:
            raise InputError(
                f"{self}: {len(values)} particles: not supported. Give {MIN_DISKS} to {MAX_DISKS}."
            )
        if not MIN_RADIUS <= values.min() <= values.max() <= MAX_RADIUS:
            raise InputError(
                f"{self}: radii from {values.min():g} to {values.max():g}: outside "
                f"[{MIN_RADIUS:g}, {MAX_RADIUS:g}]. Choose another unit of length."
            )

    @classmethod
    def read(cls, path) -> "Radii":
        """Radii from a text file, one number per line. Raises InputError."""
        try:
            with open_regular(path) as file, warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of an empty file, which has too few
                values = np.loadtxt(file, dtype=float, ndmin=1, max_rows=MAX_DISKS + 1)
            lines = values.ndim
        except InputError:
            raise
        except OSError as error:
            raise InputError(
                f"{path}: not a list of radii ({error.strerror}). Write one number per line."
            ) from None
        except ValueError:
            lines = 0
        if lines != 1:
            number, line = next(_lines_without_number(path), (1, ""))
            raise InputError(f"{path}: line {number}: {line!r}, not a radius. Write one number per line.")
        return cls(values, str(path))

    def __str__(self):
        return self.path or named("radii")

    def _place(self, number):
        """Where radius `number` stands, in words: a line of the file or a place in the array."""
        if self.path is None:
            return f"[{number}]"
        lines = (line for line, text in _lines(self.path) if text)
        return f": line {next(itertools.islice(lines, int(number), None))}"

    @property
    def text(self) -> str:
        """Their description in files."""
        if self.path:
            return f"radii of {Path(self.path).name}"
        return f"radii with sha256 {hashlib.sha256(self.values.tobytes()).hexdigest()[:16]}"


def _lines(path):
    """Generates (number from 1, text without comment) of the lines of a text file."""
    with open_regular(path) as file:
        for number, line in enumerate(file, 1):
            yield number, line.partition(b"#")[0].decode(errors="replace").strip()


def _lines_without_number(path):
    """Generates (number, text) of the lines that hold something else than one number."""
    for number, text in _lines(path):
        try:
            text and float(text)
        except ValueError:
            yield number, text if len(text) <= MAX_SHOWN_TEXT else f"{text[:MAX_SHOWN_TEXT]} …"


def radii_asked(n: int | None, sizes: str | None, radii: Radii | None):
    """Radii (N,) of one's own, or of n particles by a law of sizes. Raises InputError for both and for neither."""
    if radii is None:
        if n is None:
            raise InputError(
                f"{named('n')}: missing. Give the number of particles, or their {named('radii')}."
            )
        return radii_of(sizes or DEFAULT_SIZES, n)
    for name, value in (("n", n), ("sizes", sizes)):
        if value is not None:
            raise InputError(f"{named(name)}: fixed by {radii}. Leave it out.")
    return radii.values


def sizes_text(sizes: str | None, radii: Radii | None) -> str:
    """Description of the sizes of the disks in files."""
    return sizes or DEFAULT_SIZES if radii is None else radii.text

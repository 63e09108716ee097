"""A kind of picture that `jampetsc plot` can draw, and what the pictures of all rooms share."""

from collections.abc import Callable
from dataclasses import dataclass

from jampetsc.errors import InputError


@dataclass(frozen=True)
class Picture:
    """A kind of picture. `draw(args, items)` draws the opened files and returns what it shows, in words."""

    draw: Callable
    of: tuple[str, ...]  # what files it needs: packing, sweep, …
    options: tuple[str, ...]  # options of the command that it takes, besides --out
    single: bool  # one file at a time
    mixed: bool  # files of several of these formats at once


def entering(table: dict[str, Picture]):
    """The decorator @picture(kind, format, …) that enters a function `draw` into this table."""

    def picture(kind: str, *of: str, options=(), single: bool = False, mixed: bool = False):
        def enter(draw):
            table[kind] = Picture(draw, of, tuple(options), single, mixed)
            return draw

        return enter

    return picture


def count(items, one="sweep", many="sweeps") -> str:
    """So many of them, in words."""
    return f"{len(items)} {one if len(items) == 1 else many}"


def within(args, option, low, high, default):
    """The value of an option. Raises InputError unless it lies from low to high."""
    value = vars(args)[option]
    if value is not None and not low <= value <= high:
        raise InputError(f"--{option.replace('_', '-')} {value:g}: must lie between {low} and {high}")
    return default if value is None else value

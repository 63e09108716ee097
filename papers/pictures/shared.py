"""Shared by the pictures: their list, results of a folder, the folder of another figure."""

from pathlib import Path

import jampetsc

PICTURES = {}  # {name: function(page, folder)}


def drawn(name):
    """Decorator that enters a picture by the name of its file."""

    def enter(function):
        PICTURES[name] = function
        return function

    return enter


def results(folder, **chosen):
    """The results of the rows of a figure's study that are done and have these values."""
    return jampetsc.load(folder).where(state="done", **chosen).results()


def beside(folder, figure) -> Path | None:
    """The folder of another figure of the same sizes, where it has been made."""
    own = Path(folder).resolve()
    mode = own.name.rpartition("-")[2]
    for place in (own.parent / f"{figure}-{mode}", own.parent / figure):
        if (place / "table.csv").exists():
            return place
    return None

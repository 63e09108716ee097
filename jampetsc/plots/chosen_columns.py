"""The columns by which curves differ where the user chooses them."""

from dataclasses import replace

from jampetsc.errors import InputError, named
from jampetsc.options.values import split_list
from jampetsc.plots.curves import PROPERTIES, Curve


def chosen_properties(curves, by) -> list[Curve]:
    """The curves, which differ by these columns alone. Raises InputError for a column that none of them has."""
    by = split_list(by)
    if not by:
        return curves
    names = tuple(PROPERTIES.get(name.replace("-", "_"), name.replace("-", "_")) for name in by)
    chosen = []
    for curve in curves:
        recorded = {name: _rounded(curve.attributes[name]) for name in names if name in curve.attributes}
        settings = recorded | {name: value for name, value in curve.settings.items() if value is not None}
        if "phi" in names:
            settings["pressure"] = None
        chosen.append(replace(curve, settings=settings, by=()))
    available = dict.fromkeys(
        key for curve in chosen for key, value in curve.description.items() if value is not None
    )
    for name, word in zip(names, by, strict=True):
        if name not in available:
            columns = {key: column for column, key in reversed(PROPERTIES.items())}
            choices = ", ".join(dict.fromkeys(columns.get(key, key) for key in available))
            raise InputError(
                f"{named('by')} {word}: no such column of these results. Choose among: {choices}."
            )
    return [replace(curve, by=names) for curve in chosen]


def mixed_text(curves) -> str:
    """What differs among curves beside the columns that the user chose, in words; "" where none are chosen."""
    if not curves[0].by:
        return ""
    descriptions = [replace(curve, by=()).description for curve in curves]
    names = [
        name
        for name in dict.fromkeys(key for description in descriptions for key in description)
        if name not in curves[0].by
    ]
    values = {
        name: dict.fromkeys(str(description.get(name)) for description in descriptions) for name in names
    }
    return "; ".join(f"{name} {', '.join(words)}" for name, words in values.items() if 1 < len(words))


def _rounded(value):
    return round(value, 9) if isinstance(value, float) else value

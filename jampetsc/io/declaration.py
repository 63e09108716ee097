"""The content of a format, declared as tables, and the check of a file against them before it is read.

A line of a table is a row, whose cells stand between bars; an indented line continues it.

    names | shape | type | unit | meaning         of datasets
    names | type | unit | meaning                 of attributes

Names may be patterns such as `eta0_*`. The type is float, complex, int, bool or text, or one for each name, followed by
? where not every file has the row; attributes of a type with > 0 are positive, of a type `in A B` one of these values.
Entries of a shape are numbers or named lengths, which are the same in all datasets of a file: capitals are at
least 1, D, the dimension, is 2 or 3 and the one of the attribute `dimension` where that is declared. A dataset may have
several shapes, with `or` between them. The shape of an attribute, if it is a list, stands before its type.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

import h5py
import numpy as np

from jampetsc.errors import InputError

MAX_DEPTH = 8  # groups inside each other
MAX_OBJECTS = 10_000  # datasets and groups of a file
MAX_SHOWN_LENGTH = 40  # characters of a value in a message
TYPES = {  # type -> (kinds of numpy that hold it, what arrays are read as, how a message has it)
    "float": ("fiu", np.float64, "real numbers"),
    "complex": ("fiuc", np.complex128, "complex numbers"),
    "int": ("iu", np.int64, "whole numbers"),
    "bool": ("b", np.bool_, "true or false"),
    "text": ("SO", None, "text"),
}
PYTHON_TYPES = {"float": (int, float), "int": int, "bool": bool, "text": str}  # of attributes
DIMENSION, DIMENSIONS = "D", (2, 3)  # a named length and what it may be
DIMENSION_ATTRIBUTE = "dimension"  # of results; missing in those in two dimensions
HEADER = ("format", "format_version")  # which `hdf5.check_format` has checked
KIND_WORDS = {  # of numpy -> in words, where its own are not
    "S": "text", "O": "text or references", "V": "compound or opaque values", "b": "true or false",
}  # fmt: skip
MAX_BYTES = {"f": 8, "c": 16}  # of a number; not every machine has more
_ENTRY = re.compile(r"([A-Za-z]\w*)?\s*(?:([+−])?\s*(\d+))?")


@dataclass(frozen=True)
class FormatRow:
    """A line of a table for one name."""

    name: str  # or a pattern
    shapes: tuple | None  # each of entries (length or "", number to add); None: any
    type: str
    positive: bool
    choices: tuple  # the allowed values of an attribute; empty: any
    optional: bool
    unit: str
    meaning: str

    def check(self, path, name, data, lengths: dict) -> None:
        """Raise InputError unless a dataset has this type and shape; named lengths of `lengths` are filled in."""
        kinds, _, words = TYPES[self.type]
        if not isinstance(data, h5py.Dataset):
            _refuse(path, name, f"is a group, must hold {words}")
        kind, size = data.dtype.kind, data.dtype.itemsize
        if kind not in kinds or size > MAX_BYTES.get(kind, size):
            _refuse(path, name, f"holds {KIND_WORDS.get(kind, data.dtype)}, must hold {words}")
        if self.shapes is None:
            return
        fitting = (_lengths_with(data.shape, entries, lengths) for entries in self.shapes)
        fit = next((more for more in fitting if more is not None), None)
        if fit is None:
            known_lengths = [
                f"{length} = {lengths[length]}"
                for entries in self.shapes
                for length, _ in entries
                if lengths.get(length, 0) > 0
            ]
            where = f" with {', '.join(dict.fromkeys(known_lengths))}" if known_lengths else ""
            shapes = " or ".join(map(shape_text, self.shapes))
            _refuse(path, name, f"shape {data.shape}, must be {shapes}{where}")
        lengths.update(fit)

    def check_attribute(self, path, name, value) -> None:
        """Raise InputError unless the value of an attribute, as `hdf5.attributes` gives it, has this type."""
        is_list = self.shapes is not None
        values = value.tolist() if is_list and isinstance(value, np.ndarray) else [value]
        for entry in values:
            if not isinstance(entry, PYTHON_TYPES[self.type]) or isinstance(entry, bool) != (
                self.type == "bool"
            ):
                words = TYPES[self.type][2]
                words = words if is_list or not words.endswith("numbers") else f"a {words[:-1]}"
                raise InputError(
                    f"{path}: attribute {name} = {_shortened(value)}: must be {words}. Make the file again."
                )
        if self.choices and value not in self.choices:
            allowed = ", ".join(map(str, self.choices))
            raise InputError(
                f"{path}: attribute {name} = {_shortened(value)}: must be one of {allowed}. Make the file again."
            )
        if self.positive and not value > 0:
            raise InputError(
                f"{path}: attribute {name} = {value}: must be a positive number. Make the file again."
            )


class Table:
    """Rows by name, read from text; `lines` are the rows as they are written, several names in one."""

    def __init__(self, text: str, has_shapes: bool):
        joined = re.sub(r"\n +", " ", text.strip())
        lines = (re.split(r" \|(?= )", line) for line in joined.splitlines() if line)
        self.lines = [tuple(cell.strip() for cell in cells) for cells in lines]
        self.rows = {}
        for cells in self.lines:
            if not has_shapes:
                cells = (cells[0], *_divided(cells[1]), *cells[2:])
            names, *shape, types, unit, meaning = cells
            names, optional = names.split(", "), types.endswith("?")
            kinds = types.removesuffix("?").split(", ")
            entries = _shapes(shape[0]) if shape else None
            for name, kind in zip(names, kinds * len(names) if len(kinds) == 1 else kinds, strict=True):
                kind, above, _ = kind.partition(" > 0")
                kind, _, choices = kind.partition(" in ")
                read = PYTHON_TYPES[kind] if choices else str
                choices = tuple(map(read, choices.split()))
                self.rows[name] = FormatRow(
                    name, entries, kind, bool(above), choices, optional, unit, meaning
                )
        self._patterns = [row for name, row in self.rows.items() if "*" in name]

    def row(self, name: str) -> FormatRow | None:
        """The row of a name; None where it is not declared."""
        return self.rows.get(name) or next((r for r in self._patterns if fnmatchcase(name, r.name)), None)


class Format:
    """Datasets and attributes of a kind of file; common: a Table of attributes that it shares with other kinds."""

    def __init__(self, datasets: str, attributes: str, common: Table | None = None):
        self.datasets, self.attributes = Table(datasets, True), Table(attributes, False)
        self.common = common

    def attribute(self, name: str) -> FormatRow | None:
        """The row of an attribute; None where it is not declared."""
        return self.attributes.row(name) or (self.common.row(name) if self.common else None)

    def check(self, path, datasets: Mapping, attributes: Mapping) -> None:
        """Raise InputError where datasets or attributes are not as declared; others of a user's own may be anything.

        datasets   name -> dataset, of which nothing is read, or group
        """
        for name, value in attributes.items():
            if name not in HEADER and (row := self.attribute(name)):
                row.check_attribute(path, name, value)
        lengths = {}
        if self.attribute(DIMENSION_ATTRIBUTE):
            lengths[DIMENSION] = attributes.get(DIMENSION_ATTRIBUTE, DIMENSIONS[0])
        # in the order of the table: the first dataset with a length sets it
        declared = [name for name in self.datasets.rows if name in datasets]
        for name in dict.fromkeys([*declared, *datasets]):
            if row := self.datasets.row(name):
                row.check(path, name, datasets[name], lengths)

    def dtype(self, name: str, stored):
        """The dtype as which a dataset that is stored as the dtype `stored` is read."""
        row = self.datasets.row(name)
        return np.dtype((row and TYPES[row.type][1]) or stored)


def _lengths_with(shape, entries, lengths):
    """`lengths` with the lengths that a shape adds; None where it does not have these entries."""
    if shape is None or len(shape) != len(entries):
        return None
    lengths = dict(lengths)
    for size, (name, more) in zip(shape, entries, strict=True):
        stored_size = lengths.setdefault(name, size - more) if name else 0
        is_allowed = stored_size in DIMENSIONS if name == DIMENSION else stored_size >= name[:1].isupper()
        if size != stored_size + more or not is_allowed:
            return None
    return lengths


def _shortened(value) -> str:
    text = repr(value)
    return text if len(text) <= MAX_SHOWN_LENGTH else f"{text[:MAX_SHOWN_LENGTH]} …"


def _refuse(path, name, why):
    raise InputError(f"{path}: dataset {name}: {why}. Make the file again.")


def contents(h5, path) -> dict:
    """{name: dataset or group} of an open file, by hard links only, in the order of their names.

    Raises InputError for more than a file of ours can hold, also where a group holds itself.
    """
    items = {}

    def walk(group, prefix, depth):
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            if depth > MAX_DEPTH or len(items) >= MAX_OBJECTS:
                limit = (
                    f"{MAX_DEPTH} groups inside each other" if depth > MAX_DEPTH else f"{MAX_OBJECTS} objects"
                )
                raise InputError(f"{path}: too large (more than {limit}). Make the file again.")
            item = group[name]
            if isinstance(item, h5py.Dataset | h5py.Group):
                items[f"{prefix}{name}"] = item
            if isinstance(item, h5py.Group):
                walk(item, f"{prefix}{name}/", depth + 1)

    walk(h5, "", 1)
    return items


def shape_text(entries) -> str:
    """A shape as it is written: (M, 2), (M,), scalar."""
    words = [
        str(more) if not length else f"{length} {'+' if more > 0 else '−'} {abs(more)}" if more else length
        for length, more in entries
    ]
    return f"({', '.join(words)}{',' * (len(words) == 1)})" if words else "() of one number"


def _shapes(text):
    """The shapes of a cell such as (n,) or (n, 3); None for any shape."""
    return None if text == "any" else tuple(map(_entries, text.split(" or ")))


def _entries(text):
    """The entries of a shape such as (M, 2), (D + 1,) or scalar."""
    if text == "scalar":
        return ()
    entries = []
    for word in filter(None, (word.strip() for word in text.strip("()").split(","))):
        length, sign, number = _ENTRY.fullmatch(word).groups()
        entries.append((length or "", int(number or 0) * (-1 if sign == "−" else 1)))
    return tuple(entries)


def _divided(cell):
    """[shape] or [], and the type, of an attribute's cell such as float or (w,) int."""
    shape, _, kind = cell.rpartition(") ")
    return ([f"{shape})"] if shape else []) + [kind]

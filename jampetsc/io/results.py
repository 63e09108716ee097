"""A result as a mapping of numpy arrays with attributes, from a file or from memory. Needs neither PETSc nor MPI.

A note warns of the numbers of a result, e.g. that its errors are rough. It is a line
`KIND: what is the case. What to do`; notes of one kind differ after the colon. Notes are printed below the summary of
a run, kept in the attribute `notes` of its file, and counted by kind in a study.
"""

import difflib
import html
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from jampetsc.errors import InputError
from jampetsc.io.formats import FORMATS, check_file
from jampetsc.io.hdf5 import open_file, retry_if_replaced
from jampetsc.io.parts import PartList
from jampetsc.io.provenance import law_of
from jampetsc.io.result_file import ResultArray, new_run_id, write_result
from jampetsc.version import FORMAT_VERSION

OLDER_VERSION = "1.0"  # of files whose `contacts/pairs` are rows of `particles`
_MAX_SHOWN = 6  # datasets that a line about a result names
_MAX_ATTRIBUTE_LENGTH = 60  # characters of an attribute in a table


class StoredArray(ResultArray):
    """A dataset that stays in its file, of which every rank reads selections.

    Raises InputError on reading if the file was replaced, or one of its parts went, since it was loaded.
    """

    def __init__(self, path, name, data, dtype, run_id):
        self._path, self._name, self._run_id = Path(path).resolve(), name, run_id
        self.shape, self.dtype = data.shape, dtype

    def __getitem__(self, selection):
        np.broadcast_to(False, self.shape)[selection]  # an IndexError is the caller's, no damage of the file
        return retry_if_replaced(self._read)(self._path, selection)

    def _read(self, path, selection):
        with open_file(path) as h5:
            parts = PartList(h5, path)
            if parts.run_id != self._run_id:
                raise InputError(f"{path}: replaced by another run since it was loaded. Load it again.")
            data = h5[self._name]
            if data.shape != self.shape:
                raise InputError(f"{path}: {self._name} changed since it was loaded. Load it again.")
            return np.asarray(parts.read(data, selection), self.dtype)[()]

    def __repr__(self):
        return f"<{self._name} {self.shape} {self.dtype} in {self._path.name}>"


class NumberedRows(ResultArray):
    """Numbers of particles in place of rows of `particles`, both stored arrays, which older files have."""

    def __init__(self, rows, particles):
        self._rows, self._particles = rows, particles
        self.shape, self.dtype = rows.shape, particles.dtype

    def __getitem__(self, selection):
        return self._particles[...][self._rows[selection]]


class Attributes(dict):
    """Attributes of a result; asking for one that is missing is an InputError that names the file."""

    def __init__(self, path, values):
        super().__init__(values)
        self.path = path

    def __missing__(self, name):
        near = difflib.get_close_matches(name, self, n=1, cutoff=0.8)
        remedy = f"Did you mean {near[0]}?" if near else self._remedy(name)
        raise InputError(f"{self.path}: attribute {name}: missing. {remedy}")

    def _remedy(self, name):
        """Where a missing attribute is to be found."""
        own = FORMATS.get(self.get("format"))
        if own is None or own.attribute(name) is not None:
            return "Make the file again."
        datasets = [key for key in own.datasets.rows if key.rpartition("/")[2] == name]
        kinds = [
            key.removeprefix("jampetsc-")
            for key, format in FORMATS.items()
            if format is not own and name in format.attributes.rows
        ]
        places = [f"the dataset {key}" for key in datasets[:1]] + [f"a file of `{kind}`" for kind in kinds]
        *several, last = places or ["its attributes"]
        before = f"{', '.join(several)} or " if several else ""
        return f"A file of `{self['format'].removeprefix('jampetsc-')}` has none. See {before}{last}."


class Named(Mapping):
    """Arrays by name. A missing one is an InputError, or the default of `get`."""

    def __init__(self, arrays: dict):
        self._arrays = arrays

    def named(self, name, kind, place):
        """The array of this name. Raises InputError, "`place`: no `kind` `name`", for a missing one."""
        if name not in self._arrays:
            near = difflib.get_close_matches(name, self._arrays, n=1)
            hint = (
                f"Did you mean {near[0]}?" if near else f"Choose among: {', '.join(self._arrays) or 'none'}."
            )
            raise InputError(f"{place}: no {kind} {name}. {hint}")
        return self._arrays[name]

    def get(self, name, default=None):
        """The array of this name, or `default` for a missing one."""
        return self[name] if name in self else default

    def __iter__(self):
        return iter(self._arrays)

    def __len__(self):
        return len(self._arrays)

    def __contains__(self, name):
        return name in self._arrays


class Result(Named):
    """A result: `attributes` (how it came about), and a mapping of dataset names to numpy arrays.

    path      its file; for a result in memory its name in messages, such as "sweep in memory"
    packing   Packing that the result was made from, if it was in memory with it; else None
    settings  {column: value} of what a study has set for it, if it was loaded out of its table

    A file's array is read on access; `stored(name)` leaves it in the file, to read slices of it. In memory
    a distributed array is this rank's rows, and `stored(name).rows` says which.
    """

    def __init__(self, attributes: dict, arrays: dict, path, comm=None):
        super().__init__(arrays)
        self.attributes, self._comm = Attributes(path, attributes), comm
        self.path, self.packing, self.settings = Path(path), None, {}

    @classmethod
    def read(cls, h5, path) -> "Result":
        """The result in an open file; `path` is for messages and later reading."""
        format, attrs, items = check_file(h5, path)
        run_id, declared = attrs.get("run_id", ""), FORMATS[format]
        arrays = {
            name: StoredArray(path, data.name[1:], data, declared.dtype(name, data.dtype), run_id)
            for name, data in items.items()
            if isinstance(data, h5py.Dataset)
        }
        if attrs.get("format_version") == OLDER_VERSION and "contacts/pairs" in arrays:
            arrays["contacts/pairs"] = NumberedRows(arrays["contacts/pairs"], arrays["particles"])
            attrs["format_version"] = FORMAT_VERSION  # as it is saved again
        return cls(attrs, arrays, Path(path).resolve())

    @property
    def file(self) -> Path | None:
        """Its file; None in memory."""
        return self.path if self.path.is_absolute() else None

    def gathered(self) -> "Result":
        """The same with all rows of distributed arrays on every rank. Collective for a result in memory."""
        if all(array.axis is None for array in self._arrays.values()):
            return self
        arrays = {
            name: array if array.axis is None else array.gathered(self._comm)
            for name, array in self._arrays.items()
        }
        result = type(self)(self.attributes, arrays, self.path, self._comm)
        result.packing, result.settings = self.packing, self.settings
        return result

    def __getstate__(self):
        """The content of copies, also in other processes: without ranks, so rows of several are gathered first."""
        if self._comm is not None and self._comm.size > 1:
            if any(array.axis is not None for array in self._arrays.values()):
                raise InputError(
                    f"{self.path}: distributed over {self._comm.size} ranks. Copy the result of gathered()."
                )
        return vars(self) | {"_comm": None}

    def save(self, path) -> None:
        """Write it to a file, which `path` is from then on; an earlier result of its kind there is replaced.

        Collective for a result in memory: every rank writes its rows. Raises as `write_result`.
        """
        run_id = new_run_id() if self._comm is None else self._comm.bcast(new_run_id())
        write_result(path, self.attributes | {"run_id": run_id}, self._arrays, self._comm)
        self.path = self.attributes.path = Path(path).resolve()
        self.attributes["run_id"] = run_id
        # arrays in memory stay there
        if any(isinstance(array, StoredArray) for array in self._arrays.values()):
            with open_file(path) as h5:
                self._arrays = type(self).read(h5, path)._arrays

    def __repr__(self):
        shown = ", ".join(f"{name} {self._arrays[name].shape}" for name in list(self)[:_MAX_SHOWN])
        more = f" and {len(self) - _MAX_SHOWN} more" if len(self) > _MAX_SHOWN else ""
        return f"<{type(self).__name__} {self.path.name}: {shown}{more}>"

    def _repr_html_(self):
        """A table of shapes and attributes for notebooks."""
        rows = [(name, f"{array.shape} {array.dtype}") for name, array in self._arrays.items()]
        rows += [(name, _text(value)) for name, value in self.attributes.items()]
        cells = "".join(f"<tr><td>{html.escape(a)}</td><td>{html.escape(b)}</td></tr>" for a, b in rows)
        title = html.escape(f"{type(self).__name__} {self.path.name}")
        return f"<table><caption>{title}</caption>{cells}</table>"

    def __getitem__(self, name):
        return self.stored(name)[...]

    def stored(self, name) -> StoredArray:
        """A dataset without reading it. Raises InputError for a missing one."""
        return self.named(name, "dataset", self.path)

    @property
    def format(self) -> str:
        """What kind of file it is, such as "jampetsc-modes"."""
        return self.attributes["format"]

    @property
    def law(self) -> dict:
        """The damping law and its parameters: {"law": "contact", "beta": 1.0, …}."""
        return law_of(self.attributes)


def _text(value):
    text = " ".join(str(value).split())
    return text if len(text) <= _MAX_ATTRIBUTE_LENGTH else f"{text[:_MAX_ATTRIBUTE_LENGTH]} …"


NOTE_SEPARATOR = "; "  # notes in an attribute; so none has one inside


def noted(notes: list[str]) -> str | None:
    """Notes as the attribute of a file; None for none."""
    return NOTE_SEPARATOR.join(notes) or None


def note_lines(notes: list[str]) -> list[str]:
    """Notes as lines below a summary."""
    return [f"  note: {note}" for note in notes]


def notes_in(attributes) -> list[str]:
    """The notes of a result with these attributes, or of a packing with this record."""
    return list(filter(None, str(attributes.get("notes") or "").split(NOTE_SEPARATOR)))


def notes_of_sources(results) -> list[str]:
    """Notes that a result inherits from those it was computed from: the first one of each kind."""
    notes = {}
    for result in results:
        for note in notes_in(result.attributes):
            notes.setdefault(note.partition(":")[0], note)
    return list(notes.values())


def unstable_to_shear(modulus: float, name: str) -> list[str]:
    """The note, if any, that a shear modulus of this name is negative."""
    if not modulus < 0.0:
        return []
    return [
        f"unstable to shear: {name} = {modulus:.3g}. For packings with a positive one: pack --stabilise shear"
    ]


def count_notes(rows: list[dict]) -> list[str]:
    """A line for each command and kind of note in a study's table: in how many rows, and the first of them."""
    notes_by_kind, tasks = {}, Counter(row["command"] for row in rows)
    for row in rows:
        for note in notes_in(row):
            notes_by_kind.setdefault((row["command"], note.partition(":")[0]), []).append((note, row["file"]))
    return [
        f"  note in {len(notes)} of {tasks[command]} {command} tasks, which count like the others: "
        f"{notes[0][0]} ({notes[0][1]})"
        for (command, _), notes in notes_by_kind.items()
    ]

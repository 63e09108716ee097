"""Parameters of jobs, each defined once, as a field of a frozen dataclass.

    @dataclass(frozen=True)
    class Sweep(Job):
        packing: Packing = asked(help="packing", kind=PACKING)
        law: Law = part(DAMPING)                               # several options that make one object
        accuracy: float = asked(1e-6, "relative error allowed in G' and in G'' each", low=1e-12, high=0.1)

The signature of the python function, the option of the command, the key of a study, the request that a file records and
the documentation follow from it. A value is read in the same way from python objects, words of a command line and TOML.
"""

import dataclasses
import difflib
import functools
import math
import operator
import types
import typing
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass
from decimal import Decimal
from pathlib import Path

from jampetsc.errors import InputError, as_float, named

MOST_SHOWN = 200  # characters of a value in a message
NAME_LIKENESS = 0.75  # likeness of a name to what may have been meant
EXACT = 2.0**53  # whole numbers up to this are exact as floats
# where a command line has it: --name, its place, all its places
OPTION, FILE, FILES = ("option", "file", "files")


@dataclass(frozen=True)
class Kind:
    """How a value is read and written.

    read       value as given → value; raises ValueError that says what it must be
    serialise  value → what TOML, JSON and a command line can hold; `read` turns it back into the value
    metavar    its placeholder in the help
    """

    read: Callable
    serialise: Callable = lambda value: value
    metavar: str = ""


def _number(value):
    if isinstance(value, bool):
        raise ValueError("must be a number")
    try:
        return as_float(value)
    except (TypeError, ValueError):
        raise ValueError("must be a number") from None


def _count(value):
    with suppress(TypeError, ValueError):
        return int(value) if isinstance(value, str) else operator.index(value if value is not True else None)
    with suppress(TypeError, ValueError):
        number = float(value) if isinstance(value, str | float) else math.nan
        if number.is_integer() and abs(number) <= EXACT:  # 1e3
            return int(number)
    raise ValueError("must be a whole number")


def _switch(value):
    if value not in (True, False):
        raise ValueError("must be True or False")
    return bool(value)


def _path(value):
    try:
        return Path(value)
    except TypeError:
        raise ValueError("must be the name of a file") from None


NUMBER = Kind(_number)
COUNT = Kind(_count)
SWITCH = Kind(_switch)
WORD = Kind(str)
PATH = Kind(_path, str, metavar="FILE")
KINDS = {float: NUMBER, int: COUNT, bool: SWITCH, str: WORD, Path: PATH}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a job.

    low, high   closed range of a number; above: open lower end
    choices     the allowed values, a sequence or the keys of a table
    off         of a switch that is on by default: help of the option that turns it off
    unit        unit of the value, for help and documentation
    group       heading in the help
    remedy      what to do where a value is out of range or no choice
    also        a second name of its option on the command line
    place       OPTION, FILE or FILES
    """

    name: str
    help: str
    kind: Kind
    default: object = MISSING
    low: float | None = None
    high: float | None = None
    above: float | None = None
    choices: tuple = ()
    off: str = ""
    unit: str = ""
    metavar: str = ""
    group: str = ""
    remedy: str = ""
    also: str = ""
    place: str = OPTION

    @property
    def required(self) -> bool:
        """Whether a value must be given."""
        return self.default is MISSING

    @property
    def word(self) -> str:
        """Its option on a command line; for a switch that is on by default, --no-NAME."""
        name = self.name.removesuffix("_").replace("_", "-")
        return f"--no-{name}" if self.default is True else f"--{name}"

    def read(self, value):
        """The value, converted and checked. Raises InputError that names the parameter."""
        if value is None and self.default is None:
            return None
        try:
            value = self.kind.read(value)
            if self.choices and value not in self.choices:
                raise ValueError(f"choose one of {', '.join(self.choices)}{self._remedy}")
            if isinstance(value, int | float) and not isinstance(value, bool):
                self._check_range(value)
            return value
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            said, text = shown(value), str(error)
            text = (
                text[len(said) :] if text.startswith((f"{said} ", f"{said}:")) else text
            )  # it is said before
            raise InputError(f"{named(self.name)} {said}: {text.removeprefix(':').strip()}") from None

    @property
    def _remedy(self):
        return f". {self.remedy}" if self.remedy else ""

    def _check_range(self, value):
        low, high, above = self.low, self.high, self.above
        inside = (low is None or value >= low) and (high is None or value <= high)
        if inside and (above is None or value > above) and value == value:  # nan is not
            return
        if low is not None and high is not None:
            raise ValueError(f"must lie in [{low:g}, {high:g}]{self._remedy}")
        limits = [
            *(["positive" if above == 0 else f"above {above:g}"] if above is not None else []),
            *([f"at least {low:g}"] if low is not None else []),
            *([f"at most {high:g}"] if high is not None else []),
        ]
        raise ValueError(f"must be {' and '.join(limits) or 'a number'}")


@dataclass(frozen=True)
class Part:
    """Several options that together describe one object, such as a damping law.

    options      those options, or a function that returns them
    make         called with the given ones as keywords → the object; raises InputError
    serialise    the object → {option: value}; `make` turns it back into the object
    type         class of the object
    help         what it is, in python
    written      called with options → python text that makes the object, for messages
    optional     whether None is allowed
    """

    options: Sequence[Parameter] | Callable
    make: Callable
    serialise: Callable
    type: type
    help: str = ""
    written: Callable | None = None
    optional: bool = False

    @property
    def parameters(self) -> Sequence[Parameter]:
        """The options."""
        return self.options() if callable(self.options) else self.options


def asked(default=MISSING, help="", *, kind=None, place=OPTION, **more):
    """A field of a job that is a `Parameter`; for float, int, bool, str and Path the kind follows from the type."""
    more["choices"] = tuple(more.get("choices", ()))
    said = Parameter("", help, kind, default, place=place, **more)  # name and kind follow from the field
    return dataclasses.field(default=default, metadata={"asked": said}, kw_only=place == OPTION)


optional = functools.partial(asked, None)  # a field of a parameter that need not be given


def part(part: Part, default=MISSING):
    """A field of a job that several options describe; if none is given `default`, or else `part.make()`.

    `make` gets only the options that are not at their defaults.
    """
    said = dataclasses.replace(part, optional=default is None)
    default = {"default_factory": part.make} if default is MISSING else {"default": default}
    return dataclasses.field(**default, metadata={"asked": said})


@functools.cache
def fields(job) -> dict[str, Parameter | Part]:
    """{name: Parameter or Part} of the fields of a class of jobs."""
    found = {}
    for field in dataclasses.fields(job):
        said = field.metadata["asked"]
        if isinstance(said, Parameter):
            said = dataclasses.replace(said, name=field.name, kind=said.kind or KINDS[_plain(field.type)])
        found[field.name] = said
    return found


@functools.cache
def parameters(job) -> dict[str, Parameter]:
    """{name: Parameter} of a class of jobs, including those of its parts."""
    found = {}
    for name, said in fields(job).items():
        found |= {one.name: one for one in said.parameters} if isinstance(said, Part) else {name: said}
    return found


def made(job, given: dict):
    """An instance of the class `job` from values {name: value}; None counts as not given.

    Raises InputError for an unknown name, a required one that is missing, and as the job does.
    """
    known = parameters(job)
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if name not in known and name not in fields(job):
            raise InputError(f"{name}: no such parameter{did_you_mean(name, known)}")
    missing = []
    for field, said in fields(job).items():
        if isinstance(said, Parameter):
            missing += [named(field)] if said.required and field not in given else []
            continue
        mine = {one: one.read(given.pop(one.name)) for one in said.parameters if one.name in given}
        mine = {one.name: value for one, value in mine.items() if one.default is None or value != one.default}
        if mine:
            given[field] = said.make(**mine)
    if missing:
        raise InputError(f"{', '.join(missing)}: must be given")
    return job(**given)


def did_you_mean(name, known) -> str:
    """End of a message: `; did you mean …?` with the known name most like this one, empty if none is similar."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=NAME_LIKENESS)
    return f"; did you mean {near[0]}?" if near else ""


def shown(value) -> str:
    """A value as messages show it, in one line, the middle of a long one left out."""
    if isinstance(value, int) and value.bit_length() > 64:
        return f"{Decimal(value):.6g}"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    text = text if text.isprintable() else ascii(text)
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN // 2]} … {text[-MOST_SHOWN // 4 :]}"


def _plain(annotation):
    """The type behind `T | None`."""
    if isinstance(annotation, types.UnionType):  # T | None
        return next(one for one in typing.get_args(annotation) if one is not type(None))
    return annotation

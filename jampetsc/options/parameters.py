"""Parameters of jobs, each defined once, as a field of a frozen dataclass.

    @dataclass(frozen=True)
    class Sweep(Job):
        packing: Packing | str = parameter(help="packing", value_type=PACKING)
        law: Law = composite_parameter(DAMPING)                # several options that make one object
        accuracy: float = parameter(1e-6, "relative error allowed in G' and in G'' each", low=1e-12, high=0.1)

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

from jampetsc.errors import InputError, as_float, named, python_value

MAX_TEXT_LENGTH = 200  # characters of a value in a message
MIN_NAME_SIMILARITY = 0.75  # of a misspelt name and the one suggested
MAX_EXACT_INTEGER = 2.0**53  # whole numbers up to this are exact as floats
# where a command line has it: --name, its place, all its places
OPTION, FILE, FILES = ("option", "file", "files")
DECLARATION = "parameter"  # key of a field's metadata


@dataclass(frozen=True)
class ValueType:
    """How a value is read and written.

    read       value as the user writes it → value; raises ValueError that says what it must be
    serialise  value → what TOML, JSON and a command line can hold; `read` turns it back into the value
    metavar    its placeholder in the help
    python     what python code passes, for the documentation of functions
    """

    read: Callable
    serialise: Callable = lambda value: value
    metavar: str = ""
    python: str = "str"


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
        if number.is_integer() and abs(number) <= MAX_EXACT_INTEGER:  # 1e3
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


NUMBER = ValueType(_number, python="number")
COUNT = ValueType(_count, python="integer")
SWITCH = ValueType(_switch, python="bool")
WORD = ValueType(str)
PATH = ValueType(_path, str, metavar="FILE", python="name of a file")
VALUE_TYPES = {float: NUMBER, int: COUNT, bool: SWITCH, str: WORD, Path: PATH}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a job.

    low, high   closed range of a number; above: open lower end
    choices     the allowed values, a sequence or the keys of a table
    off         of a switch that is on by default: help of the option that turns it off
    unit        unit of the value, for help and documentation
    group       heading in the help
    remedy      what to do where a value is out of range or no choice
    several     what to do where several values are given
    in_identity whether the result depends on it: not on the number of threads, or on files written besides
    also        a second name of its option on the command line
    place       OPTION, FILE or FILES
    """

    name: str
    help: str
    value_type: ValueType
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
    several: str = ""
    in_identity: bool = True
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

    @property
    def python(self) -> str:
        """What python code passes, in words: the allowed texts, or the kind of value."""
        texts = [f'"{choice}"' for choice in self.choices]
        return " or ".join([", ".join(texts[:-1]), texts[-1]]) if len(texts) > 1 else self.value_type.python

    def read(self, value):
        """The value, converted and checked. Raises InputError that names the parameter."""
        if value is None and self.default is None:
            return None
        try:
            value = self.value_type.read(value)
            if self.choices and value not in self.choices:
                raise ValueError(f"not supported. Choose one of {', '.join(self.choices)}.{self._remedy}")
            if isinstance(value, int | float) and not isinstance(value, bool):
                self._check_range(value)
            return value
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            text, reason = format_value(value), str(error)
            if self.several and _is_list(value):
                reason = f"not a single value. {self.several}"
            if reason.startswith((f"{text} ", f"{text}:")):  # the message begins with the value
                reason = reason[len(text) :].removeprefix(":").strip()
            raise InputError(f"{named(self.name)} {text}: {reason}") from None

    @property
    def _remedy(self):
        return f" {self.remedy}" if self.remedy else ""

    def _check_range(self, value):
        low, high, above = self.low, self.high, self.above
        inside = (low is None or value >= low) and (high is None or value <= high)
        if inside and (above is None or value > above) and value == value:  # nan is not
            return
        if low is not None and high is not None:
            raise ValueError(f"must lie in [{low:g}, {high:g}]{self._remedy and '.'}{self._remedy}")
        limits = [
            *(["positive" if above == 0 else f"above {above:g}"] if above is not None else []),
            *([f"at least {low:g}"] if low is not None else []),
            *([f"at most {high:g}"] if high is not None else []),
        ]
        raise ValueError(f"must be {' and '.join(limits) or 'a number'}")


@dataclass(frozen=True)
class CompositeParameter:
    """Several options that together describe one object, such as a damping law.

    options      the options, or a function that returns them
    make         called with the options that the user gave, as keywords → the object; raises InputError
    serialise    the object → {option: value}; `make` turns it back into the object
    type         class of the object
    help         what it is
    python       what python code passes, in words
    code         called with options → python text that makes the object, for messages
    optional     whether None is allowed
    """

    options: Sequence[Parameter] | Callable
    make: Callable
    serialise: Callable
    type: type
    help: str = ""
    python: str = ""
    code: Callable | None = None
    optional: bool = False

    @property
    def parameters(self) -> Sequence[Parameter]:
        """The options."""
        return self.options() if callable(self.options) else self.options


def parameter(default=MISSING, help="", *, value_type=None, place=OPTION, **settings):
    """A field of a job that is a `Parameter`; float, int, bool, str and Path have their own value types."""
    settings["choices"] = tuple(settings.get("choices", ()))
    declaration = Parameter("", help, value_type, default, place=place, **settings)  # `fields` adds the name
    return dataclasses.field(default=default, metadata={DECLARATION: declaration}, kw_only=place == OPTION)


optional_parameter = functools.partial(parameter, None)  # a field of a parameter that may be left out


def composite_parameter(composite: CompositeParameter, default=MISSING):
    """A field of a job that several options describe; without any of them `default`, or what `make` gives.

    `make` gets only the options that are not at their defaults.
    """
    declaration = dataclasses.replace(composite, optional=default is None)
    default = {"default_factory": composite.make} if default is MISSING else {"default": default}
    return dataclasses.field(**default, metadata={DECLARATION: declaration})


@functools.cache
def fields(job) -> dict[str, Parameter | CompositeParameter]:
    """{name: Parameter or CompositeParameter} of the fields of a class of jobs."""
    declarations = {}
    for field in dataclasses.fields(job):
        declaration = field.metadata[DECLARATION]
        if isinstance(declaration, Parameter):
            value_type = declaration.value_type or VALUE_TYPES[_without_none(field.type)]
            declaration = dataclasses.replace(declaration, name=field.name, value_type=value_type)
        declarations[field.name] = declaration
    return declarations


@functools.cache
def parameters(job) -> dict[str, Parameter]:
    """{name: Parameter} of a class of jobs, with the options of its composite parameters."""
    single = {}
    for name, declaration in fields(job).items():
        if isinstance(declaration, CompositeParameter):
            single |= {option.name: option for option in declaration.parameters}
        else:
            single[name] = declaration
    return single


def build_job(job, values: dict):
    """An instance of the class `job` from {name: value}; None counts as left out.

    Raises InputError for an unknown name, a required one that is missing, and as the job does.
    """
    declared = parameters(job)
    values = {name: value for name, value in values.items() if value is not None}
    for name in values:
        if name not in declared and name not in fields(job):
            raise InputError(f"{name}: no such parameter{suggest_name(name, declared)}")
    missing = []
    for field, declaration in fields(job).items():
        if isinstance(declaration, Parameter):
            missing += [named(field)] if declaration.required and field not in values else []
            continue
        options = [option for option in declaration.parameters if option.name in values]
        read = {option: option.read(values.pop(option.name)) for option in options}
        changed = {
            option.name: value
            for option, value in read.items()
            if option.default is None or value != option.default
        }
        if changed:
            values[field] = declaration.make(**changed)
    if missing:
        raise InputError(f"{', '.join(missing)}: missing. Give {'it' if len(missing) == 1 else 'them'}.")
    return job(**values)


def suggest_name(name, valid_names) -> str:
    """End of a message: `; did you mean …?` with the valid name most like this one, empty if none is similar."""
    similar = difflib.get_close_matches(name, valid_names, n=1, cutoff=MIN_NAME_SIMILARITY)
    return f"; did you mean {similar[0]}?" if similar else ""


def format_value(value) -> str:
    """A value as messages show it, in one line, the middle of a long one left out."""
    if isinstance(value, int) and value.bit_length() > 64:
        return f"{Decimal(value):.6g}"
    value = python_value(value)
    text = f"{value:g}" if isinstance(value, float) else str(value) or "''"
    text = text if text.isprintable() else ascii(text)
    if len(text) <= MAX_TEXT_LENGTH:
        return text
    return f"{text[: MAX_TEXT_LENGTH // 2]} … {text[-MAX_TEXT_LENGTH // 4 :]}"


def _is_list(value) -> bool:
    """Whether a value that cannot be read was meant as several."""
    return any(mark in value for mark in ",:") if isinstance(value, str) else hasattr(value, "__iter__")


def _without_none(annotation):
    """The type T of `T | None`."""
    if isinstance(annotation, types.UnionType):
        return next(member for member in typing.get_args(annotation) if member is not type(None))
    return annotation

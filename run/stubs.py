"""jampetsc/__init__.pyi: signatures for editors and type checkers, as functions of jobs are made at run time."""

import inspect
import textwrap

import jampetsc
from jampetsc.commands import JOBS, job_class
from jampetsc.io.reader import RESULTS
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import MODELS, Model
from jampetsc.options.functions import RUN_PARAMETERS
from jampetsc.options.parameters import CompositeParameter, fields

HEAD = '''\
"""Written by run/generate.py from the declarations of the jobs. Editors and type checkers read it."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from jampetsc.io.ensemble import Ensemble
from jampetsc.io.reader import {results}
from jampetsc.io.results import Result
from jampetsc.laws.flow_models import Model
{homes}

_Path = str | PathLike[str]
_Array = NDArray[Any]
_Numbers = str | float | Sequence[float] | _Array
_Integers = str | int | Sequence[int] | _Array

__version__: str
'''
TYPES = {  # words of `Parameter.python` -> annotation; words without a row become Any
    "integer": "int",
    "number": "float",
    "bool": "bool",
    "str": "str",
    "name of a file": "_Path",
    "names of files": "Sequence[_Path]",
    "numbers": "_Numbers",
    'numbers or "low:high:count"': "_Numbers",
    'integers or "first:last"': "_Integers",
    "integers": "_Integers",
    "array (N,) or the name of a text file": "_Array | Sequence[float] | _Path",
    "str, array (D, D) or one of `jampetsc.loads`": "Any",
    "Packing or the name of its file": "Packing | _Path",
    "Packing, Network or the name of its file": "Packing | Network | _Path",
    "Packing, result or the name of its file": "Packing | Result | _Path",
    "Packing, Network, result or the name of its file": "Packing | Network | Result | _Path",
    "result or the name of its file": "Result | Ensemble | _Path",
    "integer or (NX, NY)": "int | Sequence[int]",
    'integer or "auto"': 'int | Literal["auto"]',
    "(low, high)": "tuple[float, float]",
    "dict or the name of a TOML file": "dict[str, Any] | _Path",
    "texts": "str | Sequence[str]",
}
COMPOSITE_TYPES = {Law: "Law | str", Model: "Model | Law | str"}
RETURNS = {  # first words of GIVES, or the format
    "the name of the file": "Path",
    "the names of the files": "list[Path]",
    "the result": "Result",
    "str": "str",
    "jampetsc-packing": "Packing",
    "jampetsc-network": "Network",
    "table": "Ensemble",
}


def stub() -> str:
    """The text of jampetsc/__init__.pyi. Raises KeyError for a job whose result has no row in RETURNS."""
    homes, modules = (vars(jampetsc)[table] for table in ("_HOMES", "_MODULES"))
    lines = [f"from {home} import {name} as {name}" for name, home in homes.items()]
    for name, module in modules.items():
        if name != "models":  # its functions are made at run time
            lines.append("from {} import {} as {}".format(*module.rsplit(".", 1), name))
    text = HEAD.format(results=", ".join(_result_classes()), homes="\n".join(sorted(lines)))
    text += "\nclass models:\n" + textwrap.indent(_docstring(inspect.getdoc(jampetsc.models)), "    ")
    for name in MODELS:
        model = getattr(jampetsc.models, name)
        arguments = ["*", *(f"{option} = {parameter.default!r}" for option, parameter in _options(model))]
        text += textwrap.indent(
            "\n@staticmethod\n" + _function(name, arguments, "Model", model.__doc__), "    "
        )
    for name in JOBS:
        if name != "import" and name not in homes:
            text += _of_job(name)
    return text


def _options(model):
    """(option with its type, parameter) of the function of a model."""
    for name, parameter in inspect.signature(model).parameters.items():
        optional = " | None" if parameter.default is None else ""
        yield f"{name}: float{optional}", parameter


def _result_classes():
    return sorted({value.__name__ for value in RESULTS.values()} - {"Result"})


def _of_job(name):
    """The function of a job."""
    job, function = job_class(name), getattr(jampetsc, name)
    return "\n" + _function(name, _arguments(job, function), _returned(job), function.__doc__)


def _arguments(job, function):
    """Parameters of a job's function with types and defaults."""
    arguments, keyword = [], inspect.Parameter.KEYWORD_ONLY
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind == keyword and not any(word.startswith("*") for word in arguments):
            arguments.append("*")
        star = "*" if parameter.kind == inspect.Parameter.VAR_POSITIONAL else ""
        arguments.append(f"{star}{name}: {_annotation(job, name)}{_default(parameter)}")
    return arguments


def _default(parameter):
    default = parameter.default
    if default is parameter.empty:
        return ""
    return f" = {default!r}" if default is None or isinstance(default, str | int | float) else " = ..."


def _annotation(job, name):
    if name in RUN_PARAMETERS:
        default = RUN_PARAMETERS[name][0]
        return "bool" if isinstance(default, bool) else "_Path | None"
    declaration = fields(job)[name]
    if isinstance(declaration, CompositeParameter):
        words, may_be_none = COMPOSITE_TYPES.get(declaration.type, "Any"), declaration.optional
    else:
        choices = ", ".join(f'"{choice}"' for choice in declaration.choices)
        words = f"Literal[{choices}]" if choices else TYPES.get(declaration.python, "Any")
        may_be_none = declaration.default is None
    return f"{words} | None" if may_be_none and words != "Any" else words


def _returned(job):
    key = job.GIVES.partition(",")[0] or job.FORMAT
    return RESULTS[key].__name__ if key in RESULTS else RETURNS[key]


def _function(name, arguments, returned, docstring=None):
    written = "".join(f"    {argument},\n" for argument in arguments)
    body = _docstring(docstring) if docstring else "...\n"
    return f"def {name}(\n{written}) -> {returned}:\n{textwrap.indent(body, '    ')}"


def _docstring(text):
    return f'"""{text.rstrip()}\n"""\n'.replace("\\", "\\\\")

"""Pages that follow from the code: docs/reference/api.md of docstrings, docs/reference/commands.md of declarations.

`run/generate.py` writes them. A job is declared once (`jampetsc.options.parameters`): its python function and its
command have the same parameters, and both pages show them as tables.
"""

import dataclasses
import functools
import inspect
import re
import textwrap

import jampetsc
from jampetsc import errors
from jampetsc.commands import JOBS, job_class
from jampetsc.io.disk_motion import Snapshot
from jampetsc.io.ensemble import AverageCurve, Averages, Ensemble
from jampetsc.io.reader import FlowResult, SpectrumResult, SweepResult
from jampetsc.io.results import Result
from jampetsc.laws.flow_models import MODELS
from jampetsc.options.functions import RUN_PARAMETERS
from jampetsc.options.parameters import (
    FILES,
    OPTION,
    CompositeParameter,
    fields,
    format_value,
    parameters,
)
from jampetsc.response.assembled_matrices import PackingMatrices

LOADS = ("simple_shear", "pure_shear", "compression", "uniaxial")  # functions that make a Load
RETURNED = (
    *(Result, SweepResult, FlowResult, SpectrumResult, Snapshot),
    *(Ensemble, Averages, AverageCurve, PackingMatrices),
    *(errors.InputError, errors.ConvergenceError),
)
PROPERTIES = (property, functools.cached_property)
MAX_SIGNATURE = 74  # characters in a line of the page
_DEFINITION = re.compile(r"(\S.*?)\s{2,}(\S.*)")


def api_page(text: str) -> str:
    """docs/reference/api.md: the text above its first entry, and the entries."""
    return _introduction(text) + reference()


def commands_page(text: str) -> str:
    """docs/reference/commands.md: the text above its first entry, and the entries."""
    return _introduction(text) + command_reference()


def _introduction(text):
    return text.partition("\n## ")[0].rstrip("\n") + "\n"


def reference() -> str:
    """Markdown of functions and classes. Raises ValueError for an object without a docstring."""
    public = {
        f"jampetsc.{name}": getattr(jampetsc, name) for name in jampetsc.__all__ if name != "__version__"
    }
    public |= {f"jampetsc.models.{name}": getattr(jampetsc.models, name) for name in MODELS}
    public |= {f"jampetsc.loads.{name}": getattr(jampetsc.loads, name) for name in LOADS}
    objects = {name: value for name, value in public.items() if inspect.getdoc(value)}
    returned = {f"{value.__module__}.{value.__name__}": value for value in RETURNED}
    return "".join(_entry(name, value) for name, value in (objects | returned).items())


def command_reference() -> str:
    """Markdown of all commands."""
    return "".join(_command(name) for name in JOBS)


def _entry(name, value):
    short = name.rpartition(".")[2]
    if short in JOBS and name == f"jampetsc.{short}" and short != "plot":
        return f"\n## {name}\n\n{_call(short, value)}\n{_of_job(job_class(short))}"
    text = f"\n## {name}\n\n{_described(name, value)}"
    if not inspect.isclass(value):
        return text
    for member, attribute in vars(value).items():
        attribute = getattr(attribute, "__func__", attribute)  # of a classmethod
        is_documented = inspect.isroutine(attribute) or isinstance(attribute, PROPERTIES)
        if is_documented and not member.startswith("_") and inspect.getdoc(attribute):
            text += f"\n### {short}.{member}\n\n{_described(member, attribute)}"
    return text


def _described(name, value):
    """Call and docstring of a function, a class or a property."""
    if not inspect.getdoc(value):
        raise ValueError(f"{name} has no docstring")
    head, made_by_users = "", name.removeprefix("jampetsc.") in jampetsc.__all__
    if callable(value) and (made_by_users or not inspect.isclass(value)):
        head = _call(name.rpartition(".")[2], value) + "\n"
    return head + prose(inspect.getdoc(value))


def _call(name, function):
    """The call of a function with its defaults, without types, in lines that fit the page."""
    arguments = [
        f"{'*' if parameter.kind == parameter.VAR_POSITIONAL else ''}"
        f"{'**' if parameter.kind == parameter.VAR_KEYWORD else ''}{parameter.name}"
        f"{'' if parameter.default is parameter.empty else f'={parameter.default!r}'}"
        for parameter in inspect.signature(function).parameters.values()
        if parameter.name not in ("self", "cls")
    ]
    line = f"{name}({', '.join(arguments)})"
    if len(line) > MAX_SIGNATURE:
        body = textwrap.fill(", ".join(arguments), MAX_SIGNATURE - 4, break_long_words=False)
        line = f"{name}(\n{textwrap.indent(body, '    ')}\n)"
    return f"```python\n{line}\n```\n"


def prose(docstring) -> str:
    """Markdown of a docstring: paragraphs, and a table for each list of names with their meanings."""
    text = ""
    for block in re.split(r"\n\s*\n", docstring):
        lines = textwrap.dedent(block).splitlines()
        heads = [line for line in lines if not line.startswith(" ")]
        if all(_DEFINITION.fullmatch(line) for line in heads) and not re.match(r"(import|>>>)", lines[0]):
            text += _definitions(lines)
        else:
            text += f"{_escaped(' '.join(line.strip() for line in lines))}\n\n"
    return re.sub(r"docs/((?:\w|\\_|/)+\.md)", _page_link, text)


def _page_link(match):
    """A link in place of the name of a page in a docstring."""
    target = match[1].replace("\\_", "_")
    return f"[{target.rpartition('/')[2].removesuffix('.md').replace('_', ' ')}](../{target})"


def _definitions(lines):
    """A table of lines `name   meaning`, whose further lines are indented."""
    rows = []
    for line in lines:
        if line.startswith(" "):
            rows[-1][1] += f" {line.strip()}"
        else:
            rows.append(list(_DEFINITION.fullmatch(line).groups()))
    names = [", ".join(f"`{name}`" for name in row[0].split(", ")) for row in rows]
    return _table(("name", "meaning"), [(name, row[1]) for name, row in zip(names, rows, strict=True)])


def _of_job(job):
    """Description, parameters and result of the function of a class of jobs."""
    rows = [_row_of_function(field, fields(job)[field.name]) for field in dataclasses.fields(job)]
    for name, (default, meaning) in RUN_PARAMETERS.items():
        passed = "bool" if isinstance(default, bool) else "name of a file"
        rows.append((f"`{name}`", passed, f"`{default}`", meaning))
    result = job.GIVES or f"what `jampetsc.load` gives for a file `{job.FORMAT}`"
    return (
        prose(inspect.cleandoc(job.__doc__))
        + _table(("parameter", "pass", "default", "meaning"), rows)
        + f"Returns {result}. Raises `InputError` for values that cannot be used, and `ConvergenceError`. Collective.\n"
    )


def _row_of_function(field, declaration):
    if isinstance(declaration, CompositeParameter):
        default = "`None`" if declaration.optional else f"`{declaration.make()!r}`"
        return f"`{field.name}`", declaration.python or "keywords", default, declaration.help
    several = "*" if declaration.place == FILES else ""
    default = "required" if declaration.required else f"`{declaration.default!r}`"
    meaning = declaration.help + _limits(declaration)
    return f"`{several}{field.name}`", declaration.python, default, meaning


def _command(name):
    """Entry of a command: description, options by group, examples."""
    job = job_class(name)
    text = f"\n## {name}\n\n{prose(inspect.cleandoc(job.__doc__))}"
    groups = {}
    for declaration in parameters(job).values():
        groups.setdefault(declaration.group, []).append(_row_of_command(declaration))
    if job.OUT:
        default = "required" if job.OUT == "required" else ""
        groups.setdefault("", []).append(("`--out FILE`", default, job.OUT_HELP))
    for group, rows in groups.items():
        text += (f"**{_escaped(group)}**\n\n" if group else "") + _table(
            ("option", "default", "meaning"), rows
        )
    examples, _, notes = textwrap.dedent(job.EPILOG).partition("\n\n")
    for part in (examples, notes):
        if part.startswith("examples:"):
            lines = textwrap.dedent(part.partition("\n")[2])
            text += f"```bash\n{lines}\n```\n\n"
        elif part:
            text += prose(part)
    if name != "import":
        text += (
            f"In python: [`jampetsc.{name}`](api.md#jampetsc{name}).\n" if name in jampetsc.__all__ else ""
        )
    return text


def _row_of_command(declaration):
    choices = ", ".join(declaration.choices)
    shown = declaration.metavar or declaration.value_type.metavar
    value = shown or ("" if choices else declaration.name.removesuffix("_").upper())
    is_switch = isinstance(declaration.default, bool)
    words = (declaration.word, declaration.also) if declaration.place == OPTION else (value,)
    if is_switch or declaration.place != OPTION:
        value = ""
    option = ", ".join(f"`{f'{word} {value}'.strip().replace('|', ' or ')}`" for word in words if word)
    default = "required" if declaration.required else ""
    if not declaration.required and declaration.default is not None and not is_switch:
        default = f"`{format_value(declaration.default)}`"
    meaning = declaration.off or declaration.help
    return option, default, meaning + (f": {choices}" if choices else "") + _limits(declaration)


def _limits(declaration):
    """Unit and range of a parameter, as they follow its meaning."""
    low, high, above = declaration.low, declaration.high, declaration.above
    unit = f", in {declaration.unit}" if declaration.unit else ""
    if low is not None and high is not None:
        return f"{unit}; from {low:g} to {high:g}"
    bounds = ((">", above), ("≥", low), ("≤", high))
    limits = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
    return unit + (f"; {' and '.join(limits)}" if limits else "")


def _table(heads, rows):
    lines = [" | ".join(heads), " | ".join(["---"] * len(heads))]
    lines += [" | ".join(_escaped(cell) for cell in row) for row in rows]
    return "".join(f"| {line} |\n" for line in lines) + "\n"


def _escaped(text):
    """Text without characters that mean something in Markdown or HTML, except in pieces of code."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(
        piece if piece.startswith("`") else re.sub(r"([|*_<>])", r"\\\1", piece) for piece in pieces
    )

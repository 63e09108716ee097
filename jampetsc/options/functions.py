"""A job as a python function: its signature and its documentation follow from the job's class."""

import contextlib
import dataclasses
import inspect

from jampetsc import progress
from jampetsc.errors import in_words
from jampetsc.io.outlet import Outlet
from jampetsc.options.parameters import FILES, OPTION, Part, did_you_mean, fields, shown

HOW = {  # parameters of every function, beside those of its job
    "out": (None, "file of the result; without one it stays in memory, see `Result.save`"),
    "checkpoint": (
        None,
        "file beside which a long run saves finished steps, to continue from them (default: out)",
    ),
    "overwrite": (
        False,
        "compute again and replace a finished result at out; otherwise one of the same settings and inputs is "
        "returned, and another one is an error",
    ),
    "progress": (False, "report progress on stderr"),
}


def function_of(job):
    """The python function of a class of jobs: it makes the job from its arguments, runs it and returns the result.

    That function is collective.
    """
    signature = signature_of(job)

    def call(*given, **options):
        _refuse_unknown(job, signature, options)
        bound = signature.bind(*given, **options)
        bound.apply_defaults()
        out, checkpoint, overwrite, shown = (bound.arguments.pop(name) for name in HOW)
        asked, to = job(**bound.arguments), Outlet(out, out if checkpoint is None else checkpoint)
        with progress.reporting(True) if shown else contextlib.nullcontext():
            said = asked.perform(to, argv=asked.line(out), overwrite=overwrite)
            if to.finished:
                progress.note(in_words(said, str))
        return asked.answer(to, said)

    call.__name__ = call.__qualname__ = job.NAME
    call.__module__ = "jampetsc"
    call.__doc__ = documentation_of(job)
    call.__signature__ = signature
    return call


def _refuse_unknown(job, signature, options):
    """Raise TypeError for a keyword that the function does not have, with what to write instead."""
    unknown = [name for name in options if name not in signature.parameters]
    if not unknown:
        return
    for field, part in fields(job).items():
        if isinstance(part, Part) and part.written:
            known = {one.name for one in part.parameters}
            mine = {name: value for name, value in options.items() if name in known and name in unknown}
            if mine:
                remedy = f"give {field}={part.written(**mine)}"
                raise TypeError(f"{job.NAME}() has no keyword {', '.join(mine)}: {remedy}")
    raise TypeError(
        f"{job.NAME}() has no keyword {unknown[0]}{did_you_mean(unknown[0], signature.parameters)} "
        f"(see help(jampetsc.{job.NAME}))"
    )


def signature_of(job) -> inspect.Signature:
    """The signature of the function of a class of jobs."""
    kinds = inspect.Parameter
    places = {OPTION: kinds.KEYWORD_ONLY, FILES: kinds.VAR_POSITIONAL}
    found = []
    for field in dataclasses.fields(job):
        kind = places.get(getattr(fields(job)[field.name], "place", None), kinds.POSITIONAL_OR_KEYWORD)
        if kind == kinds.VAR_POSITIONAL:
            found.append(kinds(field.name, kind))
            continue
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        default = kinds.empty if default is dataclasses.MISSING else default
        found.append(kinds(field.name, kind, default=default, annotation=field.type))
    found += [kinds(name, kinds.KEYWORD_ONLY, default=default) for name, (default, _) in HOW.items()]
    return inspect.Signature(sorted(found, key=lambda one: one.kind))


def documentation_of(job) -> str:
    """The docstring of the function of a class of jobs, in numpydoc form."""
    lines = [inspect.cleandoc(job.__doc__), "", "Collective.", "", "Parameters", "----------"]
    for field in dataclasses.fields(job):
        said = fields(job)[field.name]
        if isinstance(said, Part):
            default = ", optional" if said.optional else f", default {said.make()!r}"
            lines += [f"{field.name} : {said.type.__name__}{default}", f"    {said.help}"]
            continue
        kind = getattr(field.type, "__name__", str(field.type))
        default = "" if said.required else f", default {shown(said.default)}"
        unit = f", in {said.unit}" if said.unit else ""
        choices = f"; one of {', '.join(said.choices)}" if said.choices else ""
        lines += [f"{field.name} : {kind}{default}", f"    {said.help}{unit}{choices}"]
    for name, (default, help) in HOW.items():
        lines += [f"{name} : default {default}", f"    {help}"]
    lines += ["", "Returns", "-------", job.GIVES or f"what `load` gives for a {job.FORMAT} file"]
    lines += ["", "Raises", "------", "InputError", "    for values that cannot be used, naming them"]
    return "\n".join([*lines, "ConvergenceError", "    where a solver does not converge"])

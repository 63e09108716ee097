"""A job as a python function: its signature and its documentation follow from the job's class."""

import contextlib
import dataclasses
import inspect

from jampetsc import progress
from jampetsc.errors import in_words
from jampetsc.options.execution import run_job
from jampetsc.options.parameters import FILES, OPTION, CompositeParameter, fields, format_value, suggest_name

RUN_PARAMETERS = {  # parameters of every function, beside the parameters of its job
    "out": (None, "file of the result (default: in memory; see `Result.save`)"),
    "checkpoint": (
        None,
        "file beside which a long run saves its finished steps, to resume from them (default: out)",
    ),
    "overwrite": (
        False,
        "compute again and replace a finished result at out; otherwise a finished result of the same settings and "
        "inputs is returned, and one of other settings raises InputError",
    ),
    "progress": (False, "whether to report progress on stderr"),
}


def make_function(job):
    """The python function of a class of jobs: it makes the job from its arguments, runs it and returns the result.

    That function is collective.
    """
    signature = signature_of(job)

    def call(*arguments, **options):
        _refuse_unknown(job, signature, options)
        bound = signature.bind(*arguments, **options)
        bound.apply_defaults()
        out, checkpoint, overwrite, shows_progress = (bound.arguments.pop(name) for name in RUN_PARAMETERS)
        request, checkpoint = job(**bound.arguments), out if checkpoint is None else checkpoint
        with progress.reporting(True) if shows_progress else contextlib.nullcontext():
            to = run_job(request, out, checkpoint, argv=request.line(out), overwrite=overwrite)
            if to.finished:
                progress.note(in_words(to.summary, str))
        return request.python_result(to)

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
    for field, declaration in fields(job).items():
        if isinstance(declaration, CompositeParameter) and declaration.code:
            names = [option.name for option in declaration.parameters if option.name in unknown]
            if names:
                remedy = f"Give {field}={declaration.code(**{name: options[name] for name in names})}"
                raise TypeError(f"{job.NAME}() has no keyword {', '.join(names)}. {remedy}.")
    raise TypeError(
        f"{job.NAME}() has no keyword {unknown[0]}{suggest_name(unknown[0], signature.parameters)} "
        f"(see help(jampetsc.{job.NAME}))"
    )


def signature_of(job) -> inspect.Signature:
    """The signature of the function of a class of jobs."""
    kinds = inspect.Parameter
    places = {OPTION: kinds.KEYWORD_ONLY, FILES: kinds.VAR_POSITIONAL}
    arguments = []
    for field in dataclasses.fields(job):
        kind = places.get(getattr(fields(job)[field.name], "place", None), kinds.POSITIONAL_OR_KEYWORD)
        if kind == kinds.VAR_POSITIONAL:
            arguments.append(kinds(field.name, kind))
            continue
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        default = kinds.empty if default is dataclasses.MISSING else default
        arguments.append(kinds(field.name, kind, default=default, annotation=field.type))
    arguments += [
        kinds(name, kinds.KEYWORD_ONLY, default=default) for name, (default, _) in RUN_PARAMETERS.items()
    ]
    return inspect.Signature(sorted(arguments, key=lambda argument: argument.kind))


def documentation_of(job) -> str:
    """The docstring of the function of a class of jobs, in numpydoc form."""
    lines = [inspect.cleandoc(job.__doc__), "", "Collective.", "", "Parameters", "----------"]
    for field in dataclasses.fields(job):
        declared = fields(job)[field.name]
        if isinstance(declared, CompositeParameter):
            default = ", optional" if declared.optional else f", default {declared.make()!r}"
            passed = declared.python or declared.type.__name__
            lines += [f"{field.name} : {passed}{default}", f"    {declared.help}"]
            continue
        default = "" if declared.required else f", default {format_value(declared.default)}"
        unit = f", in {declared.unit}" if declared.unit else ""
        lines += [f"{field.name} : {declared.python}{default}", f"    {declared.help}{unit}"]
    for name, (default, help) in RUN_PARAMETERS.items():
        passed = "bool" if isinstance(default, bool) else "name of a file"
        lines += [f"{name} : {passed}, default {default}", f"    {help}"]
    lines += ["", "Returns", "-------", job.GIVES or f"what `load` gives for a {job.FORMAT} file"]
    lines += ["", "Raises", "------", "InputError", "    for values that cannot be used, naming them"]
    return "\n".join([*lines, "ConvergenceError", "    where a solver does not converge"])

"""A job as a python function: its signature and its documentation follow from the job's class."""

import dataclasses
import inspect

from jampetsc.asking.parameters import FILES, OPTION, Part, shown
from jampetsc.asking.perform import answer

HOW = {  # parameters of every function, beside those of its job
    "out": (None, "file of the result; without one it stays in memory, see `Result.save`"),
    "checkpoint": (
        None,
        "file beside which a long run keeps what it has finished, to go on from (default: out)",
    ),
    "overwrite": (False, "replace a finished result of other settings at out, which is refused otherwise"),
    "progress": (False, "tell on stderr how far a long run has come"),
}


def function_of(job):
    """The function that makes a job of this class of its arguments, does it and gives the result. Collective."""
    signature = signature_of(job)

    def call(*given, **options):
        bound = signature.bind(*given, **options).arguments
        how = {name: bound.pop(name, default) for name, (default, _) in HOW.items()}
        sources = []
        for field in dataclasses.fields(job):
            said = field.metadata.get("asked")
            if isinstance(said, dict) and said["place"] == FILES:
                sources.append((field.name, bound.pop(field.name, ())))
        made = job(**bound, **dict(sources))
        return answer(
            made, how["out"], checkpoint=how["checkpoint"], overwrite=how["overwrite"], told=how["progress"]
        )

    call.__name__ = call.__qualname__ = job.NAME
    call.__module__ = "jampetsc"
    call.__doc__ = documentation_of(job)
    call.__signature__ = signature
    return call


def signature_of(job) -> inspect.Signature:
    """What the function of a job takes."""
    kinds = inspect.Parameter
    found = []
    for field in dataclasses.fields(job):
        said = field.metadata.get("asked")
        place = said["place"] if isinstance(said, dict) else None
        kind = {OPTION: kinds.KEYWORD_ONLY, FILES: kinds.VAR_POSITIONAL}.get(
            place, kinds.POSITIONAL_OR_KEYWORD
        )
        default = field.default
        if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        if default is dataclasses.MISSING or kind == kinds.VAR_POSITIONAL:
            default = kinds.empty
        annotation = kinds.empty if kind == kinds.VAR_POSITIONAL else field.type
        found.append(kinds(field.name, kind, default=default, annotation=annotation))
    found += [kinds(name, kinds.KEYWORD_ONLY, default=default) for name, (default, _) in HOW.items()]
    return inspect.Signature(sorted(found, key=lambda one: one.kind))


def documentation_of(job) -> str:
    """The docstring of the function of a job, numpydoc form."""
    lines = [inspect.cleandoc(job.__doc__), "", "Collective.", "", "Parameters", "----------"]
    for field in dataclasses.fields(job):
        said = field.metadata.get("asked")
        if isinstance(said, Part):
            options = ", ".join(one.name for one in said.parameters)
            lines += [f"{field.name} : {said.type.__name__}", f"    made of {options}"]
            continue
        kind = getattr(field.type, "__name__", str(field.type))
        default = "" if field.default is dataclasses.MISSING else f", default {shown(field.default)}"
        unit = f", in {said['unit']}" if said.get("unit") else ""
        choices = f"; one of {', '.join(said['choices'])}" if said.get("choices") else ""
        lines += [f"{field.name} : {kind}{default}", f"    {said['help']}{unit}{choices}"]
    for name, (default, told) in HOW.items():
        lines += [f"{name} : default {default}", f"    {told}"]
    lines += ["", "Returns", "-------", job.GIVES or f"what `load` gives for a {job.FORMAT} file"]
    lines += ["", "Raises", "------", "InputError", "    for values that cannot be used, naming them"]
    return "\n".join([*lines, "ConvergenceError", "    where it does not get there"])

"""The page docs/reference/api.md of the site: signatures and docstrings of the package, by mkdocs' hooks."""

import inspect

import jampetsc
from jampetsc import errors
from jampetsc.io.disk_motion import Snapshot
from jampetsc.io.ensemble import AverageCurve, Averages, Ensemble
from jampetsc.io.reader import FlowResult, SpectrumResult, SweepResult
from jampetsc.io.results import Result
from jampetsc.laws.flow_models import MODELS
from jampetsc.response.assembled_matrices import PackingMatrices

RETURNED = (
    *(
        Result,
        SweepResult,
        FlowResult,
        SpectrumResult,
        Snapshot,
        Ensemble,
        Averages,
        AverageCurve,
        PackingMatrices,
    ),
    *(errors.InputError, errors.ConvergenceError),
)


def on_page_markdown(markdown, page, **_):
    """The text of a page: that of the reference has its entries added."""
    return markdown + reference() if page.file.src_uri == "reference/api.md" else markdown


def reference() -> str:
    """Markdown of all entries. Raises ValueError for one without a docstring."""
    offered = {
        f"jampetsc.{name}": getattr(jampetsc, name) for name in jampetsc.__all__ if name != "__version__"
    }
    offered |= {f"jampetsc.models.{name}": getattr(jampetsc.models, name) for name in MODELS}
    found = {
        name: thing for name, thing in offered.items() if inspect.isroutine(thing) or inspect.isclass(thing)
    }
    own = {f"{thing.__module__}.{thing.__name__}": thing for thing in RETURNED}
    return "".join(_entry(name, thing) for name, thing in (found | own).items())


def _entry(name, thing):
    text = f"\n## {name}\n\n{_said(name, thing)}"
    if inspect.isclass(thing):
        for member, value in vars(thing).items():
            value = getattr(value, "__func__", value)  # of a classmethod
            documented = inspect.isroutine(value) or isinstance(value, property)
            if documented and not member.startswith("_") and inspect.getdoc(value):
                text += f"\n### {thing.__name__}.{member}\n\n{_said(member, value)}"
    return text


def _said(name, thing):
    """Signature and docstring, in the layout that it has."""
    if not inspect.getdoc(thing):
        raise ValueError(f"{name} has no docstring")
    head = ""
    if not isinstance(thing, property) and not issubclass(type(thing), type):
        head = f"{name.rpartition('.')[2]}{inspect.signature(thing)}\n\n"
    return f"```text\n{head}{inspect.getdoc(thing)}\n```\n"

"""What follows from the code is in the repository as run/generate.py writes it."""

import ast
import inspect

import launch
import pytest

import jampetsc
from jampetsc.commands import JOBS

COMMAND = ".venv/bin/python run/generate.py"


@pytest.fixture(scope="module")
def generate():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(launch.ROOT / "run"))
        import generate

        yield generate


def test_generated_files_are_up_to_date(generate):
    for path, text in generate.generated().items():
        assert path.read_text() == text, f"{path.relative_to(launch.ROOT)} is out of date. Run {COMMAND}."


def parameters_of(definition):
    """[(name, kind, whether it has a default)] of a function in a stub."""
    kinds, given = inspect.Parameter, definition.args
    defaults = [None] * (len(given.args) - len(given.defaults)) + given.defaults
    rows = [
        (argument.arg, kinds.POSITIONAL_OR_KEYWORD, default)
        for argument, default in zip(given.args, defaults, strict=True)
    ]
    rows += [(given.vararg.arg, kinds.VAR_POSITIONAL, None)] if given.vararg else []
    keywords = zip(given.kwonlyargs, given.kw_defaults, strict=True)
    rows += [(argument.arg, kinds.KEYWORD_ONLY, default) for argument, default in keywords]
    return [(name, kind, default is not None) for name, kind, default in rows]


def test_the_stub_has_every_name_and_the_signatures_of_run_time(generate):
    tree = ast.parse(generate.STUB.read_text())
    imported = {
        alias.asname for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    (models,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    names = imported | {node.name for node in (*functions, models)} | {"__version__"}
    assert names - {None} == set(jampetsc.__all__) and models.name == "models"
    made = [(node, getattr(jampetsc, node.name)) for node in functions]
    made += [
        (node, getattr(jampetsc.models, node.name))
        for node in models.body
        if isinstance(node, ast.FunctionDef)
    ]
    assert {node.name for node, _ in made} == {*jampetsc.models.MODELS, *JOBS} - {"import", "plot"}
    for node, function in made:
        parameters = inspect.signature(function).parameters.values()
        expected = [(one.name, one.kind, one.default is not one.empty) for one in parameters]
        found = parameters_of(node)
        assert [row[:2] for row in found] == [row[:2] for row in expected]
        if not node.decorator_list or models.body.count(node):  # an overload requires what tells it apart
            assert found == expected


def test_choices_and_types_of_the_stub(generate):
    """A type checker sees them: mypy and pyright read annotations alone."""
    tree = ast.parse(generate.STUB.read_text())
    sweep = next(node for node in tree.body if getattr(node, "name", "") == "sweep")
    annotations = {one.arg: ast.unparse(one.annotation) for one in (*sweep.args.args, *sweep.args.kwonlyargs)}
    assert annotations["packing"] == "Packing | Network | _Path" and annotations["law"] == "Law | str"
    assert annotations["method"] == "Literal['rational', 'direct']" and annotations["accuracy"] == "float"
    assert ast.unparse(sweep.returns) == "SweepResult"

"""Names in backticks, in docstrings and comments of the package, are names that it has."""

import ast
import builtins
import io
import itertools
import re
import tokenize
from pathlib import Path

import jampetsc

PACKAGE = Path(jampetsc.__file__).parent
MAX_NAME_LENGTH = 40  # of a text whose words count as names: of options, datasets and settings
NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(?=$|\()")


def names_of(tree):
    """Names that code has or defines; its docstrings are none of it."""
    nodes = list(ast.walk(tree))
    docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    return {name for node in nodes if id(node) not in docstrings for name in _names_of(node)}


def _names_of(node):
    for field in ("id", "attr", "arg", "name"):
        if isinstance(value := getattr(node, field, None), str):
            yield from value.split(".")
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < MAX_NAME_LENGTH:
        yield from re.findall(r"\w+", node.value)


def quoted(source, tree):
    """(line, name) of what stands in backticks in docstrings and comments."""
    texts = [(token.start[0], token.string) for token in tokenize.generate_tokens(io.StringIO(source).readline)
             if token.type == tokenize.COMMENT]  # fmt: skip
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            texts.append((getattr(node, "lineno", 1), ast.get_docstring(node, clean=False) or ""))
    for line, text in texts:
        for content in re.findall(r"`([^`\n]+)`", text):
            if found := NAME.match(content):
                yield line, found[0]


def test_names_in_backticks_exist():
    """Each part of a dotted name; of MODULE.NAME and CLASS.NAME the second must be in the first."""
    trees = {path: ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}
    known, homes = set(dir(builtins)), {}
    for path, tree in trees.items():
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        known.update(parts)
        inside = names_of(tree)
        known |= inside
        homes.setdefault(parts[-1], set()).update(inside)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, set()).update(names_of(node))
        for room, module in itertools.pairwise(parts):
            homes.setdefault(room, set()).add(module)
    assert len(homes) > 400
    wrong = []
    for path, tree in trees.items():
        for line, name in quoted(path.read_text(), tree):
            parts = name.split(".")
            pairs = itertools.pairwise(parts)
            if not known.issuperset(parts) or any(
                inner not in homes.get(outer, known) for outer, inner in pairs
            ):
                wrong.append(f"{path.relative_to(PACKAGE)}:{line} `{name}`")
    assert not wrong, "\n".join(wrong)

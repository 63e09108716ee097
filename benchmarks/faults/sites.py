"""Small faults that a source can have: every place where an operator, a comparison, a constant, a sign, an argument
or a statement can be another one, and the source with it so.
"""

import ast
import random
from dataclasses import dataclass

ARITHMETIC = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
PAIRS = [("min", "max"), ("any", "all"), ("floor", "ceil"), ("sin", "cos"), ("argmin", "argmax")]
PAIRS += [("minimum", "maximum"), ("real", "imag"), ("sum", "max"), ("MIN", "MAX")]
NAMES = dict(PAIRS) | {b: a for a, b in PAIRS}
SYMMETRIC = {"min", "max", "minimum", "maximum", "hypot"}  # functions whose arguments may be in any order
# a call whose value nobody takes, what is added to, an entry that is set, what is refused, an end of a loop
STATEMENTS = (ast.Expr, ast.AugAssign, ast.Raise, ast.Break, ast.Continue, ast.Delete)


@dataclass(frozen=True)
class Fault:
    """What stands at lines `first` to `last`, from 1, and what is put there: bytes `start` to `stop` of the source."""

    kind: str
    first: int
    last: int
    start: int
    stop: int
    put: str

    def applied(self, source: str) -> str:
        """The source with this fault."""
        content = source.encode()
        return (content[: self.start] + self.put.encode() + content[self.stop :]).decode()


def faults(source: str) -> list[Fault]:
    """All faults of one source, in its order; none in what it says in words and in annotations."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def fault(kind, node, put):
        text = put if isinstance(put, str) else f"({ast.unparse(ast.fix_missing_locations(put))})"
        start = starts[node.lineno - 1] + node.col_offset
        stop = starts[node.end_lineno - 1] + node.end_col_offset
        return Fault(kind, node.lineno, node.end_lineno, start, stop, text)

    return [fault(*one) for node in walk(ast.parse(source)) for one in of_node(node)]


def walk(node):
    """Nodes below this one, but for text, annotations, what a dataclass may not do, and the import of names."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns") or (name == "decorator_list" and isinstance(node, ast.ClassDef)):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(
                child, ast.JoinedStr | ast.Import | ast.ImportFrom
            ):
                yield child
                yield from walk(child)


def of_node(node):
    """(kind, node, what is put there) of every fault at one node."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in ARITHMETIC and not text(left) and not text(right):
            yield "operator", node, ast.BinOp(left, ARITHMETIC[type(op)](), right)
        case ast.AugAssign(target, op, value) if type(op) in ARITHMETIC:
            yield "operator", node, ast.unparse(ast.AugAssign(target, ARITHMETIC[type(op)](), value))
        case ast.Compare(left, [op], [right]):
            for other in COMPARISONS[type(op)]:
                yield "comparison", node, ast.Compare(left, [other()], [right])
        case ast.BoolOp(op, values):
            other = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield "and, or", node, ast.BoolOp(other, values)
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield "sign", node, operand
        case ast.Constant(bool(value)):
            yield "constant", node, ast.Constant(not value)
        case ast.Constant(int(value)):
            yield "constant", node, ast.Constant(value + 1)
        case ast.Constant(float(value)) if value:
            yield "constant", node, ast.Constant(2.0 * value)
        case ast.Attribute(value, name) if name in NAMES:
            yield "name", node, ast.Attribute(value, NAMES[name])
        case ast.Name(name) if name in NAMES:
            yield "name", node, ast.Name(NAMES[name])
        case ast.If(test) | ast.While(test) | ast.IfExp(test):
            yield "condition", test, ast.UnaryOp(ast.Not(), test)
    if isinstance(node, ast.Call):
        plain = [arg for arg in node.args if not isinstance(arg, ast.Starred)]
        name = getattr(node.func, "attr", getattr(node.func, "id", None))
        swap = len(plain) == len(node.args) > 1 and name not in SYMMETRIC
        if swap and not text(plain[0]) and not text(plain[1]):
            swapped = [plain[1], plain[0], *plain[2:]]
            yield "arguments", node, ast.Call(node.func, swapped, node.keywords)
        for left_out in node.keywords:
            kept = [one for one in node.keywords if one is not left_out]
            yield "argument left out", node, ast.Call(node.func, node.args, kept)
    if isinstance(node, STATEMENTS) and not (isinstance(node, ast.Expr) and text(node.value)):
        yield "statement", node, "pass"
    if isinstance(node, ast.Assign) and not isinstance(node.targets[0], ast.Name | ast.Tuple):
        yield "statement", node, "pass"
    if isinstance(node, ast.Return) and node.value is not None:
        yield "statement", node, "return None"


def text(node) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def drawn(sources: dict[str, str], count: int, seed: int) -> list[tuple[str, Fault]]:
    """(name of the source, fault) so many times, the same for the same seed: a line at random, then a fault of it."""
    lines = {}
    for name, source in sorted(sources.items()):
        for fault in faults(source):
            lines.setdefault((name, fault.first), []).append(fault)
    rng = random.Random(seed)
    chosen = rng.sample(sorted(lines), min(count, len(lines)))
    return [(name, rng.choice(lines[name, line])) for name, line in chosen]

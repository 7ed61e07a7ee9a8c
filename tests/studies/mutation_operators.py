"""Small changes of a program: what a mutation score is made of.

Changed are operators, comparisons (their edge and their sense), numbers, truth values, conditions, results, statements,
and the pairs that numerical code confuses (real and imaginary part, sine and cosine, smallest and largest, any and all,
a conjugate or a transpose left out). Left alone: texts, docstrings, annotations, what stands outside functions, and the
`strict=True` of zip, which is an assertion.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

_ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
               ast.MatMult: ast.Mult, ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr,
               ast.BitOr: ast.BitAnd}  # fmt: skip
_EDGE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
_SENSE = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
          ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is}  # fmt: skip
_PAIRS = (("real", "imag"), ("cos", "sin"), ("min", "max"), ("minimum", "maximum"), ("any", "all"), ("median", "mean"))
_NAMES = {a: b for pair in _PAIRS for a, b in (pair, pair[::-1])} | {"argmax": "argmin", "argmin": "argmax"}


@dataclass
class Mutant:
    """One change: its number, where (first and last line of its statement), what, how it is made and undone."""

    number: int
    line: int
    first: int
    last: int
    what: str
    function: str
    make: Callable[[], None]
    undo: Callable[[], None]


def mutants(tree: ast.Module) -> list[Mutant]:
    """Every change that can be made to a program; each is made on the tree itself, one at a time."""
    found: list[Mutant] = []
    for function, name in _functions(tree, ""):
        for statement in _statements(function.body):
            first, last = statement.lineno, _last_line(statement)
            changes = [*_of_statement(statement), *(c for node in _own_nodes(statement) for c in _of_node(node))]
            for line, what, make, undo in changes:
                found.append(Mutant(len(found), line, first, last, what, name, make, undo))
        for node in [d for d in (*function.args.defaults, *function.args.kw_defaults) if d is not None]:
            for line, what, make, undo in _of_node(node):
                found.append(Mutant(len(found), line, function.body[0].lineno, _last_line(function), f"default {what}",
                                    name, make, undo))  # fmt: skip
    return found


def _functions(node: ast.AST, prefix: str) -> Iterator[tuple[ast.FunctionDef, str]]:
    """Functions and methods with their dotted names; those inside functions belong to the outer one."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            yield child, prefix + child.name
        elif isinstance(child, ast.ClassDef):
            yield from _functions(child, f"{prefix}{child.name}.")


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """All statements, those of inner blocks too; docstrings and imports left out."""
    for statement in body:
        text = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        if not text and not isinstance(statement, (ast.Import, ast.ImportFrom)):
            yield statement
        for name in ("body", "orelse", "finalbody"):
            yield from _statements(getattr(statement, name, []))
        for handler in getattr(statement, "handlers", []):
            yield from _statements(handler.body)


def _last_line(statement: ast.stmt | ast.FunctionDef) -> int:
    """Last line of a statement's own head (a block's lines are its statements')."""
    if isinstance(statement, ast.FunctionDef):
        return statement.end_lineno or statement.lineno
    own = [n.end_lineno for n in _own_nodes(statement) if getattr(n, "end_lineno", None)]
    return max([statement.lineno, *(n for n in own if n)])


def _own_nodes(statement: ast.AST) -> Iterator[Any]:
    """Expressions of a statement without its inner statements, annotations and texts."""
    for name, value in ast.iter_fields(statement):
        if name in ("annotation", "returns", "args") and isinstance(statement, (ast.AnnAssign, ast.FunctionDef)):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.JoinedStr) or not isinstance(child, ast.AST):
                continue
            if isinstance(child, ast.keyword) and child.arg == "strict":
                continue
            if isinstance(child, (ast.stmt, ast.ExceptHandler)) or isinstance(statement, ast.Raise):
                continue
            yield child
            yield from _own_nodes(child)


_Change = tuple[int, str, Callable[[], None], Callable[[], None]]


def _set(node: Any, field: str, new: Any, what: str) -> _Change:
    old = getattr(node, field)
    return node.lineno, what, lambda: setattr(node, field, new), lambda: setattr(node, field, old)


def _of_statement(statement: Any) -> Iterator[_Change]:
    if isinstance(statement, (ast.If, ast.While)):
        yield _set(statement, "test", ast.UnaryOp(ast.Not(), statement.test), "condition negated")
    elif isinstance(statement, ast.Return) and statement.value is not None:
        if not (isinstance(statement.value, ast.Constant) and statement.value.value is None):
            yield _set(statement, "value", ast.Constant(None), "returns None")
    elif isinstance(statement, ast.AugAssign) and type(statement.op) in _ARITHMETIC:
        new = _ARITHMETIC[type(statement.op)]
        yield _set(statement, "op", new(), f"{type(statement.op).__name__}= -> {new.__name__}=")
    if _can_go(statement):
        # the node itself turns into `pass`, so that the block that holds it need not be known
        was = statement.__class__

        def go() -> None:
            statement.__class__ = ast.Pass

        def back() -> None:
            statement.__class__ = was

        yield statement.lineno, f"no {was.__name__}", go, back


def _can_go(statement: Any) -> bool:
    """Whether a statement can be left out and the program still have all its names."""
    if isinstance(statement, ast.Assign):
        return all(isinstance(t, (ast.Subscript, ast.Attribute)) for t in statement.targets)
    return isinstance(statement, (ast.AugAssign, ast.Raise, ast.Continue, ast.Break, ast.Expr))


def _of_node(node: Any) -> Iterator[_Change]:
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        new = _ARITHMETIC[type(node.op)]
        yield _set(node, "op", new(), f"{type(node.op).__name__} -> {new.__name__}")
    elif isinstance(node, ast.Compare):
        for table in (_EDGE, _SENSE):
            if type(node.ops[0]) in table:
                other = table[type(node.ops[0])]
                yield _set(node, "ops", [other(), *node.ops[1:]], f"{type(node.ops[0]).__name__} -> {other.__name__}")
    elif isinstance(node, ast.BoolOp):
        swap = ast.Or if isinstance(node.op, ast.And) else ast.And
        yield _set(node, "op", swap(), f"-> {swap.__name__}")
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield _set(node, "op", ast.UAdd(), "no USub")
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.Invert)):
        what = type(node.op).__name__
        yield _set(node, "operand", ast.UnaryOp(node.op, node.operand), f"no {what}")
    elif isinstance(node, ast.IfExp):
        yield _set(node, "test", ast.UnaryOp(ast.Not(), node.test), "condition negated")
    elif isinstance(node, ast.Constant):
        yield from _of_constant(node)
    elif isinstance(node, ast.Attribute) and node.attr in _NAMES:
        yield _set(node, "attr", _NAMES[node.attr], f"{node.attr} -> {_NAMES[node.attr]}")
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in ("min", "max", "any", "all"):
        yield _set(node, "id", _NAMES[node.id], f"{node.id} -> {_NAMES[node.id]}")
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "conj":
        yield _set(node.func, "attr", "copy", "no conj")
    elif isinstance(node, ast.Attribute) and node.attr == "T":
        yield _set(node, "value", ast.Attribute(node.value, "T", ast.Load()), "no T")


def _of_constant(node: ast.Constant) -> Iterator[_Change]:
    value = node.value
    if isinstance(value, bool):
        yield _set(node, "value", not value, f"{value} -> {not value}")
    elif isinstance(value, (int, float, complex)):
        new = value + 1 if value in (0, 1) else value * 2
        yield _set(node, "value", new, f"{value} -> {new}")

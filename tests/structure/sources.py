"""The sources of the three packages, each parsed once."""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
OURS = ("rigdata", "model", "tpjb_ident")
SOURCES = sorted(p for top in OURS for p in (ROOT / top).rglob("*.py"))
Spoken = ast.Import | ast.ImportFrom | ast.Call
Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def relative(path: Path) -> str:
    """Path from the checkout, with slashes."""
    return path.relative_to(ROOT).as_posix()


@functools.cache
def texts() -> dict[str, str]:
    """Every source of the three packages by its path."""
    return {relative(p): p.read_text(encoding="utf-8") for p in SOURCES}


parsed = functools.cache(ast.parse)  # by text: what one test has parsed, the others need not


@functools.cache
def trees() -> dict[str, ast.Module]:
    """Every source of the three packages, parsed, by its path."""
    return {path: parsed(text) for path, text in texts().items()}


def docstrings(text: str) -> Iterator[ast.stmt]:
    """Every docstring of a source."""
    for node in ast.walk(parsed(text)):
        if isinstance(node, Documented) and ast.get_docstring(node, clean=False) is not None:
            yield node.body[0]


@functools.cache
def statements(tree: ast.AST) -> tuple[ast.stmt, ...]:
    """Every statement of `tree` at any depth; what stands inside expressions is not visited (a tenth of the nodes).

    What is imported for types only is left out.
    """
    return tuple(_statements(tree))


def _statements(tree: ast.AST) -> Iterator[ast.stmt]:
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.stmt):
            yield node
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            waiting += node.orelse
            continue
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            below = getattr(node, part, ())
            waiting += below if isinstance(below, list) else ()


@functools.cache
def imports_and_calls(source: str) -> tuple[Spoken, ...]:
    """Every import and every call in `source`, at any depth."""
    found: list[Spoken] = []
    waiting: list[ast.AST] = [parsed(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Spoken):
            found.append(node)
        # ast.walk also visits the marks (Load, Add, ...) that nearly every node carries: twice as many
        for value in node.__dict__.values():
            if isinstance(value, list):
                waiting += [item for item in value if isinstance(item, ast.AST)]
            elif isinstance(value, ast.AST) and value._fields:
                waiting.append(value)
    return tuple(found)

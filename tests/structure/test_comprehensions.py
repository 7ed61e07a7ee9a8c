"""Comprehensions read at a glance: one loop, none inside another, an element and its clauses on two lines at most.

What needs two loops or a condition that needs thinking is a loop; what arrays say at once is an expression of numpy.
"""

import ast

import pytest

from tests.structure.sources import docstrings, parsed, texts

COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
MOST_LINES = 2
#: Of a thousand lines of code; this may only fall.
MOST_OF_A_THOUSAND = 49.2
Comprehension = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp


def comprehensions(text: str) -> list[Comprehension]:
    """Every comprehension of a source, those inside others too."""
    return [node for node in ast.walk(parsed(text)) if isinstance(node, COMPREHENSIONS)]


def density(node: Comprehension) -> str:
    """What makes a comprehension hard to read; "" where nothing does. Lines with brackets alone do not count."""
    if len(node.generators) > 1:
        return "two loops"
    if sum(isinstance(part, COMPREHENSIONS) for part in ast.walk(node)) > 1:
        return "one inside another"
    lines = {part.lineno for part in ast.walk(node) if part is not node and isinstance(part, ast.expr)}
    return "more than two lines" if max(lines) - min(lines) >= MOST_LINES else ""


def code_lines(text: str) -> int:
    """Lines of a source without docstrings, comments and blank lines."""
    told: set[int] = set()
    for node in docstrings(text):
        told.update(range(node.lineno, (node.end_lineno or 0) + 1))
    lines = enumerate(text.splitlines(), start=1)
    return sum(number not in told and bool(line.partition("#")[0].strip()) for number, line in lines)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[name for name in names if name]", ""),
        ("tuple(\n    first(name)\n    for name in names\n)", ""),
        ("[name for part in parts for name in part]", "two loops"),
        ("[[number for number in row] for row in rows]", "one inside another"),
        ("[row for row in rows if any(number for number in row)]", "one inside another"),
        ("{\n    name: table[name]\n    for name in names\n    if name in table\n}", "more than two lines"),
    ],
)
def test_dense_comprehensions_are_seen(text, expected):
    assert density(comprehensions(text)[0]) == expected


def test_docstrings_comments_and_blank_lines_are_no_code():
    assert code_lines('"""Text,\n\nmore of it."""\n\n\ndef f(a):  # why\n    """Say."""\n    # so\n    return a\n') == 2


def test_comprehensions_read_at_a_glance():
    dense = []
    for path, text in texts().items():
        dense += [f"{path}:{node.lineno}: {density(node)}" for node in comprehensions(text) if density(node)]
    assert dense == []


def test_comprehensions_become_no_more():
    count = sum(len(comprehensions(text)) for text in texts().values())
    lines = sum(map(code_lines, texts().values()))
    assert count <= MOST_OF_A_THOUSAND / 1000 * lines, f"{count} in {lines} lines of code: {1000 * count / lines:.1f}"

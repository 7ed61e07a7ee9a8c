"""Size of the house by room: thousand tokens of code and lines, which may only fall.

Tokens are names, operators, numbers and strings without docstrings: what a reader takes in, however it is laid out.
A room that shrank lowers its figures here; one that must grow takes them from another room and says so in the commit.
"""

import ast
import io
import sys
import tokenize
from collections import Counter

import pytest

from tests.structure.sources import docstrings, parsed, texts

#: Thousand tokens and lines of each room.
LIMITS = {
    "measurement": (120.28, 14_286),
    "model": (75.24, 10_167),
    "rigdata": (59.74, 8_080),
    "diagnosis": (38.50, 4_755),
    "cli": (21.81, 3_011),
    "report": (22.49, 2_883),
    "pivot": (21.00, 2_687),
    "clearance": (10.61, 1_243),
    "compare": (11.97, 1_577),
    "watch": (5.17, 632),
    "top level": (4.52, 880),
    "runtime": (6.97, 1_109),
    "exports": (4.38, 690),
    "view": (3.70, 472),
}
MEASUREMENT = ("check", "phasors", "bands", "estimate", "terms", "estimators", "runs", "identification", "results")
#: Words that name nothing, and how many of a thousand names may be such: `np.where` and the like among them.
NO_NOUNS = {
    "found", "one", "ones", "own", "seen", "told", "tell", "what", "which", "left", "right", "known", "kept",
    "keep", "rest", "other", "others", "those", "these", "this", "that", "its", "said", "say", "says", "stated",
    "given", "give", "gives", "taken", "takes", "made", "makes", "whole", "apart", "beside", "beyond", "same",
    "both", "each", "every", "all", "any", "some", "here", "there", "where",
}  # fmt: skip
MOST_NO_NOUNS = 9.0
COUNTED = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)


def room(path: str) -> str:
    """Room of a file, as the table names it."""
    parts = path.split("/")
    if parts[0] != "tpjb_ident":
        return parts[0]
    if len(parts) == 2:
        return "top level"
    return "measurement" if parts[1] in MEASUREMENT else parts[1]


def tokens(text: str) -> int:
    """Count the tokens of a source without its docstrings, comments and layout."""
    told = {(node.lineno, node.col_offset) for node in docstrings(text)}
    found = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(token.type in COUNTED and token.start not in told for token in found)


def test_docstrings_and_comments_are_no_tokens():
    assert tokens('"""Text."""\n\n\ndef f(a):  # why\n    """Say."""\n    return a + 1\n') == 10


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="from 3.12 on a formatted text is many tokens")
def test_rooms_do_not_grow():
    sizes, lines = Counter(), Counter()
    for path, text in texts().items():
        sizes[room(path)] += tokens(text)
        lines[room(path)] += len(text.splitlines())
    assert set(sizes) == set(LIMITS)
    grown = [
        f"{name}: {sizes[name]} tokens, {lines[name]} lines; {most} thousand and {longest} are its limits"
        for name, (most, longest) in LIMITS.items()
        if sizes[name] > 1000 * most or lines[name] > longest
    ]
    assert grown == []


def name_of(node: ast.AST) -> str | None:
    """The name that a node reads, sets or declares."""
    if isinstance(node, ast.Attribute):
        return node.attr
    return getattr(node, "id" if isinstance(node, ast.Name) else "arg", None)


def test_names_are_nouns():
    names = [name for text in texts().values() for name in map(name_of, ast.walk(parsed(text))) if name]
    others = Counter(name for name in names if name.strip("_") in NO_NOUNS)
    assert others.total() < MOST_NO_NOUNS / 1000 * len(names), others.most_common(20)

"""No warning is swallowed, and a floating-point exception is silenced only with its reason beside it."""

from __future__ import annotations

import ast

import pytest

from tests.structure.sources import imports_and_calls, texts

#: A source without any of them need not be parsed.
WORDS = ("filter", "seterr", "errstate")


def _name(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def offenders(text: str) -> list[str]:
    """What of a source swallows a warning or an exception of arithmetic without a word."""
    lines, found = text.splitlines(), []
    for call in imports_and_calls(text):
        if not isinstance(call, ast.Call):
            continue
        words = [a.value for a in (*call.args, *(k.value for k in call.keywords)) if isinstance(a, ast.Constant)]
        if _name(call) in ("simplefilter", "filterwarnings", "seterr") and "ignore" in words:
            found.append(f"line {call.lineno}: {_name(call)}")
        if _name(call) == "errstate" and "#" not in lines[call.lineno - 1]:
            found.append(f"line {call.lineno}: errstate without a reason")
    return found


def test_no_source_swallows_one():
    told = {name: offenders(text) for name, text in texts().items() if any(word in text for word in WORDS)}
    assert {name: found for name, found in told.items() if found} == {}


@pytest.mark.parametrize(
    "text",
    [
        "import warnings\nwarnings.simplefilter('ignore')",
        "warnings.filterwarnings('ignore', category=RuntimeWarning)",
        "warnings.filterwarnings(action='ignore')",
        "np.seterr(all='ignore')",
        "with np.errstate(divide='ignore'):\n    pass",
    ],
)
def test_the_search_finds_what_it_is_for(text):
    assert offenders(text)

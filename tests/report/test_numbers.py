"""Numbers as a reader wants them."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

import pytest

from tpjb_ident.report.condition_words import MEANING, SERIOUS, condition_name, is_serious, meaning
from tpjb_ident.rounding import fixed, percent, signed, with_interval


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((163.2841e6, 162.0e6, 164.6e6, 1e6), "163.3 ± 1.3"),
        ((-0.4849e6, -1.04e6, 0.07e6, 1e6), "−0.48 ± 0.56"),
        ((652.1e6, 640e6, 664e6, 1e6), "652 ± 12"),
        ((0.00001e6, -0.5e6, 0.5e6, 1e6), "0.00 ± 0.50"),
        ((5.0, math.nan, math.nan), "5"),
        ((math.nan, 1.0, 2.0), "no answer"),
    ],
)
def test_digits_follow_the_interval(arguments, expected):
    assert with_interval(*arguments) == expected


def test_signs():
    assert signed(0.04) == "0.0"
    assert signed(-0.04) == "0.0"
    assert signed(1.25) == "+1.2"
    assert signed(-1.26) == "−1.3"
    assert signed(math.nan) == "–"
    assert percent(-0.123) == "−12.3\N{NO-BREAK SPACE}%"
    assert fixed(math.inf) == "–"


def test_every_serious_condition_is_explained():
    assert set(MEANING) >= SERIOUS


def condition_heads(source):
    """Names of conditions that a module can give: first arguments of Condition(..) and of list.append(..)."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and node.args:
            called = getattr(node.func, "id", getattr(node.func, "attr", ""))
            first = node.args[0].left if isinstance(node.args[0], ast.BinOp) else node.args[0]
            first = first.values[0] if isinstance(first, ast.JoinedStr) else first
            if called in ("Condition", "append") and isinstance(getattr(first, "value", None), str):
                found = re.match(r"[a-z0-9]+([- ][a-z0-9]+)+(?=:|$)", first.value)
                if found:
                    yield found[0]


def test_every_condition_has_its_plain_words():
    package = Path(__file__).parents[2] / "tpjb_ident"
    files = [p for room in ("dynamic", "pivot", "clearance", "slow_records") for p in package.glob(f"{room}/**/*.py")]
    heads = {head for file in files for head in condition_heads(file.read_text(encoding="utf-8"))}
    assert len(heads) > 25
    assert {head for head in heads if condition_name(head) not in MEANING} == set()


def test_conditions_are_known_by_their_name_whatever_the_detail():
    assert is_serious("ill-conditioned: condition number 80")
    assert not is_serious("large-amplitude")
    assert "mains frequency" in meaning("mains on excitation line")
    assert meaning("something-new: 7") == "something-new: 7"

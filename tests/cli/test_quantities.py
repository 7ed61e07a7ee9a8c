"""Lists and ranges with units on the command line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tpjb_ident.cli.inputs import parse_value, parse_values
from tpjb_ident.errors import BadInputError


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("5 kN", "force", [5000.0]),
        ("5kN", "force", [5000.0]),
        ("2.5 kN, 5 kN", "force", [2500.0, 5000.0]),
        ("2.5, 5, 7.5 kN", "force", [2500.0, 5000.0, 7500.0]),
        ("2500 N; 5 kN", "force", [2500.0, 5000.0]),
        ("2.5..8.75:1.25 kN", "force", [2500.0, 3750.0, 5000.0, 6250.0, 7500.0, 8750.0]),
        ("2.5 kN..5000 N:1250 N", "force", [2500.0, 3750.0, 5000.0]),
        ("1 kN, 2..4:1 kN", "force", [1000.0, 2000.0, 3000.0, 4000.0]),
        ("3..1:-1 kN", "force", [3000.0, 2000.0, 1000.0]),
        ("1..2:0.7 kN", "force", [1000.0, 1700.0]),
        ("22 Hz", "speed", [2 * math.pi * 22]),
        ("1320 rpm", "speed", [2 * math.pi * 22]),
        ("-90 deg, 0 deg", "angle", [-math.pi / 2, 0.0]),
        ("-90..90:90 deg", "angle", [-math.pi / 2, 0.0, math.pi / 2]),
        ("1e3 N", "force", [1000.0]),
        (" 5 kN , ", "force", [5000.0]),
    ],
)
def test_what_is_understood(text, dimension, expected):
    assert parse_values(text, dimension, "--x") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (" , ", "is empty"),
        ("5", "has no unit"),
        ("2,5 kN", "comma between digits"),
        ("5 Hz", "not one of force"),
        ("5 kNx", "is not known"),
        ("five kN", "not a number with a unit"),
        ("kN", "not a number with a unit"),
        ("1..5 kN", "has no step"),
        ("1..5:0 kN", "never reaches its end"),
        ("1..5:-1 kN", "never reaches its end"),
        ("1..5:1e-9 kN", "more than 10000 values"),
        ("1e999 kN", "finite|number"),
        ("nan kN", "not a number with a unit"),
        ("1..2..3:1 kN", "not a number with a unit"),
        ("5 kN\x1b[31m", "--x"),
    ],
)
def test_what_is_refused_says_why(text, says):
    with pytest.raises(BadInputError, match=says) as caught:
        parse_values(text, "force", "--x")
    assert str(caught.value).startswith("--x")


def test_one_value_means_one():
    assert parse_value("5e8 N/m", "stiffness", "--pivots") == pytest.approx(5e8)
    with pytest.raises(BadInputError, match="takes one value, got 2"):
        parse_value("1 kN, 2 kN", "force", "--load")


@given(
    start=st.integers(-50, 50), step=st.integers(1, 9), count=st.integers(1, 40), scale=st.sampled_from([1, 10, 1000])
)
def test_a_range_holds_its_end_when_the_steps_reach_it(start, step, count, scale):
    first, pace, last = start / scale, step / scale, (start + step * (count - 1)) / scale
    values = parse_values(f"{first:.3f}..{last:.3f}:{pace:.3f} kN", "force", "--load")
    assert len(values) == count
    assert values[-1] == pytest.approx(1e3 * last, abs=1e-6)

"""What of many cases the quick run takes: the first; the others are of the whole one."""

from typing import Any

import pytest


def first_quick(*cases: Any) -> list[Any]:
    """Cases for `pytest.mark.parametrize`, tuples of several arguments or values of one; all but the first are slow."""
    slow = [pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow) for case in cases[1:]]
    return [cases[0], *slow]


def seeds(count: int) -> list[Any]:
    """So many seeds of a test that draws."""
    return first_quick(*range(count))

"""Seeds of a test that draws: the first in the quick run, the others in the whole one."""

from __future__ import annotations

from typing import Any

import pytest


def seeds(count: int, first: int = 0) -> list[Any]:
    """So many seeds for `pytest.mark.parametrize`; all but the first are slow."""
    return [first, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(first + 1, first + count))]

"""A spectrum in one line of text."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

BARS = " ▁▂▃▄▅▆▇█"
PLAIN = " .:-=+*#@"
#: What lies this far below the highest bar is blank.
DECADES = 3.0


def sparkline(values: Sequence[float], width: int = 48, plain: bool = False) -> str:
    """Draw positive values on a logarithmic scale, the largest of neighbours where they share a cell.

    Parameters
    ----------
    values : sequence of float
    width : int
        Cells.
    plain : bool
        Letters of ASCII instead of block elements.

    >>> sparkline([1.0, 10.0, 100.0, 1000.0], width=4)
    ' ▃▅█'
    """
    finite = [v if math.isfinite(v) and v > 0 else 0.0 for v in values]
    top = max(finite, default=0.0)
    if top <= 0:
        return " " * min(width, len(finite))
    width = min(width, len(finite))
    edges = [round(i * len(finite) / width) for i in range(width + 1)]
    letters = PLAIN if plain else BARS
    out = []
    for first, last in itertools.pairwise(edges):
        peak = max(finite[first:last])
        share = 1.0 + math.log10(peak / top) / DECADES if peak > 0 else 0.0
        out.append(letters[max(0, min(len(letters) - 1, round(share * (len(letters) - 1))))])
    return "".join(out)

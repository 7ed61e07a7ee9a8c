"""From a table: K and C alone as observations, as a paper's figures or another program give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tpjb_ident.compare.coefficient_table import read_coefficients
from tpjb_ident.diagnosis.observations.observe import DynamicTest, Element, Layout, Observations, Tolerance

#: A small coefficient is read off the same axis as the large ones: its error is no smaller than that of a value of this
#: share of the direct ones.
AXIS = 0.1


def observe_table(path: Path, reading_error: float | None = None, tolerance: Tolerance | None = None) -> Observations:
    """Read a table of coefficients."""
    tolerance = tolerance or Tolerance()
    rows: list[tuple[Element, float, float, float]] = []
    tests: dict[tuple[float, float, float], list[float]] = {}
    for one in read_coefficients(path, reading_error):
        tests.setdefault((one.load, one.direction, one.speed), []).append(one.omega)
        where = (("load", one.load), ("direction", one.direction), ("speed", one.speed), ("excitation", one.omega))
        for part in "kc":
            factor = one.omega if part == "c" else 1.0
            mine = {n: v for n, v in one.coefficients.items() if n[0] == part}
            direct = [abs(v) for name, (v, _) in mine.items() if name in {f"{part}xx", f"{part}yy"}]
            scale = factor * float(np.mean(direct or [abs(v) for v, _ in mine.values()] or [1.0]))
            least = AXIS * scale * (reading_error or 0.0)
            for name, (value, error) in mine.items():
                sigma = max(factor * error, least)
                rows.append((Element("h", name, where), factor * value, sigma, tolerance.stiffness * scale))
    dynamic = tuple(DynamicTest(*key, tuple(lines)) for key, lines in tests.items())
    value, error, sigma = np.array([row[1:] for row in rows]).T
    elements = tuple(row[0] for row in rows)
    return Observations(Layout(dynamic), value, np.diag(error**2), sigma, elements)

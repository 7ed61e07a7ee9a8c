"""From a table: K and C alone as observations, as a paper's figures or another program give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tpjb_ident.compare.coefficient_table import read_coefficients
from tpjb_ident.diagnosis.deciding.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import DynamicTest, Element, Layout, Observations, Tolerance


def observe_table(path: Path, reading_error: float | None = None, tolerance: Tolerance | None = None) -> Observations:
    """Read a table of coefficients."""
    tolerance = tolerance or Tolerance()
    rows: list[tuple[Element, float, float, float]] = []
    tests: dict[tuple[float, float, float], list[float]] = {}
    for entry in read_coefficients(path, reading_error):
        point = entry.point
        static = (point.static_load, point.static_load_direction, point.spin)
        tests.setdefault(static, []).append(point.excitation)
        where = tuple(zip(("load", "direction", "speed", "excitation"), (*static, point.excitation), strict=True))
        for part in "kc":
            factor = point.excitation if part == "c" else 1.0
            part_coefficients = {n: v for n, v in entry.coefficients.items() if n[0] == part}
            direct = [abs(v) for name, (v, _) in part_coefficients.items() if name in {f"{part}xx", f"{part}yy"}]
            scale = factor * float(np.mean(direct or [abs(v) for v, _ in part_coefficients.values()] or [1.0]))
            least = Deciding.axis * scale * (reading_error or 0.0)
            for name, (value, error) in part_coefficients.items():
                sigma = max(factor * error, least)
                rows.append((Element("h", name, where), factor * value, sigma, tolerance.stiffness * scale))
    dynamic = tuple(DynamicTest(*key, tuple(lines)) for key, lines in tests.items())
    value, error, sigma = np.array([row[1:] for row in rows]).T
    elements = tuple(row[0] for row in rows)
    return Observations(Layout(dynamic), value, np.diag(error**2), sigma, elements)

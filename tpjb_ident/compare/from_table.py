"""Prediction beside a table of coefficients: what `compare --coefficients` does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from model.bearing import Bearing
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.coefficient_table import TableRow, TableSource, read_coefficients
from tpjb_ident.compare.comparison import CompareSettings, Comparison, Variant
from tpjb_ident.compare.model_side import possible_variants
from tpjb_ident.compare.predictions import ModelSettings, predict_points
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.schema import ENTRIES

METHOD = "table"


def compare_table(
    path: Path,
    bearing: Bearing,
    settings: CompareSettings | None = None,
    reading_error: float | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Comparison:
    """Predict the operating points of a table of coefficients with every pivot model but measured ones."""
    settings = settings or CompareSettings()
    tell = progress or (lambda text, done, total: None)
    points = tuple(_point(row) for row in read_coefficients(path, reading_error))
    names, remarks = possible_variants(tuple(v for v in settings.variants if v != "measured"), (), bearing)
    if "measured" in settings.variants:
        remarks.append("Measured pivots are left out: a table holds no dry tests.")
    variants = []
    for name in names:
        model = ModelSettings(name, settings.thermal, settings.effects)
        found = predict_points(bearing, [p.point for p in points], model, tell)
        variants.append(Variant(name, found))
    identification = Identification(path.stem, METHOD, points, np.zeros((0, 8 * len(points))))
    source = TableSource(path.stem)
    return Comparison(source, bearing, settings, identification, (), None, None, tuple(variants), tuple(remarks))


def _point(row: TableRow) -> PointResult:
    """A row as if it had been identified; what it does not hold is NaN."""
    value, error = np.full(8, np.nan), np.full(8, np.nan)
    for j, entry in enumerate(ENTRIES):
        value[j], error[j] = row.coefficients.get(f"k{entry}", (np.nan, np.nan))
        value[4 + j], error[4 + j] = row.omega * np.array(row.coefficients.get(f"c{entry}", (np.nan, np.nan)))
    h = (value[:4] + 1j * value[4:]).reshape(2, 2)
    stiffness = DynamicStiffness(h, row.omega, np.diag(error**2), np.full(8, np.inf), METHOD, np.zeros((0, 2)))
    nothing = np.full(2, np.nan)
    point = OperatingPoint(row.load, row.direction, row.speed, row.omega)
    return PointResult(
        point, stiffness, {METHOD: stiffness}, row.load, nothing, nothing, {}, 0, 0, 0.0, np.nan, np.nan, (), (), ()
    )

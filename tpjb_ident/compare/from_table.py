"""A table of coefficients in the place of a campaign: its points, and what the model predicts for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from model.bearing import Bearing
from tpjb_ident.compare.coefficient_table import TableRow, TableSource, read_coefficients
from tpjb_ident.compare.comparison import CompareSettings, Comparison, Variant, possible_variants
from tpjb_ident.compare.predictions import ModelSettings, predict_points
from tpjb_ident.condition_kinds import KINDS
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult

_METHOD = "table"


def compare_table(
    path: Path,
    bearing: Bearing | None,
    settings: CompareSettings | None = None,
    reading_error: float | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Comparison:
    """Predict the operating points of a table of coefficients with every pivot model but measured ones.

    Without a bearing nothing is predicted here: tables of other programs are put beside it.
    """
    settings = settings or CompareSettings()
    points = tuple(_point(row) for row in read_coefficients(path, reading_error))
    variants: list[Variant] = []
    remarks: list[str] = []
    if bearing is not None:
        names, remarks = possible_variants(tuple(v for v in settings.variants if v != "measured"), (), bearing)
        if "measured" in settings.variants:
            remarks.append("Measured pivots are left out: a table holds no dry tests.")
        for name in names:
            model = ModelSettings(name, settings.thermal, settings.effects)
            predictions = predict_points(bearing, [p.point for p in points], model, progress)
            variants.append(Variant(name, predictions))
    identification = Identification(path.stem, _METHOD, points, np.zeros((1, 8 * len(points))))
    source = TableSource(path.stem)
    return Comparison(source, bearing, settings, identification, (), None, None, tuple(variants), tuple(remarks))


def _point(row: TableRow) -> PointResult:
    """A row as if it had been identified; what it does not hold is NaN."""
    omega = row.point.excitation
    h, errors = row.k.astype(complex), row.errors * np.repeat([1.0, omega], 4)
    h.imag = omega * row.c  # a sum would lose a stiffness that stands without its damping
    stiffness = DynamicStiffness(h, omega, np.diag(errors**2), np.full(8, np.inf), _METHOD, np.zeros((0, 2)))
    nowhere = np.full(2, np.nan)
    quality = tuple(Condition(name) for name in row.status if name in KINDS)
    return PointResult(
        row.point, stiffness, {_METHOD: stiffness}, row.point.static_load, nowhere, nowhere, {}, n_records=0,
        n_windows=0, outlier_fraction=0.0, coherence=np.nan, amplitude=np.nan, quality=quality, rejected=(), runs=(),
    )  # fmt: skip

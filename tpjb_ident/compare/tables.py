"""Tables of other programs: coefficients in the place of a campaign, predictions that stand beside ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from model.bearing import Bearing
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.coefficient_table import (
    TableRow,
    TableSource,
    partners,
    read_coefficients,
    read_rows,
)
from tpjb_ident.compare.comparison import VARIANTS, CompareSettings, Comparison, Variant, possible_variants
from tpjb_ident.compare.predictions import ModelSettings, point_columns, predict_points
from tpjb_ident.condition_kinds import KINDS
from tpjb_ident.conditions import Condition
from tpjb_ident.errors import BadInputError
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult

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
    h, errors = row.values[:4].astype(complex).reshape(2, 2), row.errors * np.repeat([1.0, omega], 4)
    h.imag = omega * row.values[4:].reshape(2, 2)  # a sum would lose a stiffness that stands without its damping
    stiffness = DynamicStiffness(h, omega, np.diag(errors**2), np.full(8, np.inf), _METHOD, np.zeros((0, 2)))
    nowhere = np.full(2, np.nan)
    quality = tuple(Condition(name) for name in row.status if name in KINDS)
    return PointResult(
        row.point, stiffness, {_METHOD: stiffness}, row.point.static_load, nowhere, nowhere, {}, n_records=0,
        n_windows=0, outlier_fraction=0.0, coherence=np.nan, amplitude=np.nan, quality=quality, rejected=(), runs=(),
    )  # fmt: skip


#: What set points are rounded by in tables.
_ROUNDED = (0.01, 1.0, 0.005)
_TOLERANCES = "its load within 1 %, direction within 1 deg, speed and excitation within 0.5 %, the same rotation"
#: Points and lines that a remark lists.
_MOST = 6


@dataclass(frozen=True)
class PredictionTable:
    """Another program's prediction, under the name of its file."""

    name: str
    file: str
    rows: tuple[TableRow, ...] = field(repr=False)


def read_predictions(paths: Sequence[Path]) -> tuple[PredictionTable, ...]:
    """Read tables of predictions; each is called by its file's name."""
    tables: list[PredictionTable] = []
    for path in paths:
        name = path.stem if path.stem not in VARIANTS else path.name
        if any(table.name == name for table in tables):
            raise BadInputError(f"--prediction {path}: another table is called {name!r} too. Rename one of the files.")
        tables.append(PredictionTable(name, path.name, read_rows(path)))
    return tuple(tables)


def with_predictions(comparison: Comparison, tables: Sequence[PredictionTable]) -> Comparison:
    """Put tables beside the predictions of a comparison, and say which points and rows have no partner."""
    points = [measured.point for measured in comparison.identification.points]
    variants, remarks = list(comparison.variants), list(comparison.remarks)
    for table in tables:
        theirs = pd.DataFrame([point_columns(row.point) for row in table.rows])
        nearest = partners(pd.DataFrame(map(point_columns, points)), theirs, _ROUNDED)
        met = [None if index < 0 else table.rows[index] for index in nearest]
        unmet = [row for row in table.rows if not any(row is other for other in met)]
        if len(unmet) == len(table.rows):
            raise BadInputError(
                f"--prediction {table.file}: no row meets an operating point ({_TOLERANCES}). Its first row is "
                f"{table.rows[0].point}; the first measured point is {points[0]}. Check units and signs of its columns."
            )
        variants.append(Variant(table.name, tuple(map(_at, points, met))))
        alone = [str(point) for point, row in zip(points, met, strict=True) if row is None]
        remarks.append(_remark(table, len(points), alone, unmet))
    if tables:
        remarks.append(f"A row of a table meets a point where it has {_TOLERANCES}; nothing is interpolated.")
    return replace(comparison, variants=tuple(variants), remarks=tuple(remarks))


def _at(point: OperatingPoint, row: TableRow | None) -> TableRow:
    """A row at the point that it meets; without one, a row of nothing."""
    nothing = np.full(8, np.nan)
    return replace(row, point=point) if row else TableRow(0, point, nothing, nothing, status=("no row of the table",))


def _remark(table: PredictionTable, total: int, alone: Sequence[str], unmet: Sequence[TableRow]) -> str:
    """Say how many points a table meets, and what has no partner."""
    sentences = [f"{table.file} predicts {total - len(alone)} of {total} points"]
    lines = [f"line {row.line} ({row.point})" for row in unmet]
    for words, texts in (("without a row", alone), ("rows that meet no point", lines)):
        if texts:
            more = f"; and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
            sentences.append(f"{words}: {'; '.join(texts[:_MOST])}{more}")
    return "; ".join(sentences) + "."

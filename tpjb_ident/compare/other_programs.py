"""Predictions of other programs: tables that stand beside ours, point by point; nothing is interpolated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.coefficient_table import TableRow, read_rows
from tpjb_ident.compare.comparison import VARIANTS, Comparison, Variant
from tpjb_ident.compare.predictions import TablePoint
from tpjb_ident.errors import BadInputError
from tpjb_ident.schema import ENTRIES

#: How far a row may be from an operating point that it predicts: what set points are rounded by in tables.
_LOAD, _DIRECTION, _FREQUENCY = 0.01, math.radians(1.0), 0.005
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
        met = [_nearest(table.rows, point) for point in points]
        unmet = [row for row in table.rows if row not in met]
        if len(unmet) == len(table.rows):
            raise BadInputError(
                f"--prediction {table.file}: no row meets an operating point ({_TOLERANCES}). Its first row is "
                f"{table.rows[0].point}; the first measured point is {points[0]}. Check units and signs of its columns."
            )
        variants.append(Variant(table.name, tuple(map(_table_point, points, met))))
        alone = [str(point) for point, row in zip(points, met, strict=True) if row is None]
        remarks.append(_remark(table, len(points), alone, unmet))
    if tables:
        remarks.append(f"A row of a table meets a point where it has {_TOLERANCES}; nothing is interpolated.")
    return replace(comparison, variants=tuple(variants), remarks=tuple(remarks))


def _nearest(rows: Sequence[TableRow], point: OperatingPoint) -> TableRow | None:
    """The row of a point, the nearest where several are within the tolerances."""
    distances = [(_distance(row, point), row.line, row) for row in rows]
    distance, _, row = min(distances)
    return row if distance <= 1.0 else None


def _distance(row: TableRow, point: OperatingPoint) -> float:
    """Largest deviation of a row from an operating point, over its tolerance."""
    if row.point.rotation != point.rotation:
        return math.inf
    excitation = point.excitation or point.shaft_speed
    turn = row.point.static_load_direction - point.static_load_direction
    return max(
        _share(row.point.static_load, point.static_load) / _LOAD,
        abs(math.remainder(turn, 2.0 * math.pi)) / _DIRECTION,
        _share(row.point.shaft_speed, point.shaft_speed) / _FREQUENCY,
        _share(row.point.excitation, excitation) / _FREQUENCY,
    )


def _share(value: float, of: float) -> float:
    return abs(value - of) / of if of > 0.0 else math.inf


def _table_point(point: OperatingPoint, row: TableRow | None) -> TablePoint:
    values = {} if row is None else row.coefficients
    k, c = (np.array([values.get(kind + entry, (math.nan,))[0] for entry in ENTRIES]).reshape(2, 2) for kind in "kc")
    if row is None:
        return TablePoint(point, k, c, status=("no row of the table",))
    return TablePoint(point, k, c, row.position, row.converged)


def _remark(table: PredictionTable, total: int, alone: Sequence[str], unmet: Sequence[TableRow]) -> str:
    """Say how many points a table meets, and what has no partner."""
    sentences = [f"{table.file} predicts {total - len(alone)} of {total} points"]
    if alone:
        sentences.append(f"without a row: {_listed(alone)}")
    if unmet:
        lines = [f"line {row.line} ({row.point})" for row in unmet]
        sentences.append(f"rows that meet no point: {_listed(lines)}")
    return "; ".join(sentences) + "."


def _listed(texts: Sequence[str]) -> str:
    more = f"; and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
    return "; ".join(texts[:_MOST]) + more

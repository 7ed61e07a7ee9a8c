"""A table of coefficients, as a paper's figures or another program give them: K and C with how far they hold."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rigdata.operating_point import ROTATIONS, OperatingPoint
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, coefficient_column

HZ = 2.0 * math.pi
_NEEDED = ("static_load_N", "shaft_speed_Hz")
#: A column that looks like a coefficient: misspelt, it would be silently left out.
_COEFFICIENT = re.compile(r"[A-Za-z]{1,5}_[A-Za-z_]*per_(?:m|in)(_se|_lo|_hi|)")


@dataclass(frozen=True)
class TableSource:
    """A table of coefficients in the place of a campaign: what pages call it."""

    id: str
    description: str = "K and C from a table"


@dataclass(frozen=True)
class TableRow:
    """Coefficients of one operating point, each with its standard error, NaN where nothing states it."""

    line: int
    point: OperatingPoint
    coefficients: dict[str, tuple[float, float]]
    position: tuple[float, float]  #: [m], NaN where the table has none
    converged: bool


def read_coefficients(path: Path, reading_error: float | None = None) -> tuple[TableRow, ...]:
    """Read a table of coefficients that says how far each holds."""
    rows = []
    for row in read_rows(path):
        coefficients = {}
        for name, (value, stated) in row.coefficients.items():
            error = stated if math.isfinite(stated) or reading_error is None else reading_error * abs(value)
            if not math.isfinite(error):
                column = coefficient_column(name)
                raise BadInputError(
                    f"{path.name}, line {row.line}, {column}: nothing says how far it holds. "
                    f"Add {column}_se, _lo and _hi, or --reading-error."
                )
            coefficients[name] = (value, error)
        rows.append(replace(row, coefficients=coefficients))
    return tuple(rows)


def read_rows(path: Path) -> tuple[TableRow, ...]:
    """Read a table of coefficients, measured or predicted; rows that hold none are left out."""
    rows: list[TableRow] = []
    places: set[OperatingPoint] = set()
    frame = read_table(path, _NEEDED, _COEFFICIENT)
    for line, cells in zip(frame.attrs["lines"], frame.to_dict("records"), strict=True):
        row = _row(cells, line, f"{path.name}, line {line}")
        if not row.coefficients:
            continue
        if row.point in places:
            raise BadInputError(f"{path.name}, line {line}: a second row for the same point. Keep one of them.")
        places.add(row.point)
        rows.append(row)
    if not rows:
        raise BadInputError(f"{path.name}: holds no coefficient. Name columns as in coefficients.csv: kxx_N_per_m, ...")
    return tuple(rows)


def _row(cells: Mapping[Any, Any], line: int, place: str) -> TableRow:
    load, speed = cells["static_load_N"], HZ * cells["shaft_speed_Hz"]
    if not (load > 0.0 and speed > 0.0):
        raise BadInputError(f"{place}: static_load_N and shaft_speed_Hz must be positive numbers.")
    direction, excitation = cells.get("static_load_direction_deg", math.nan), cells.get("excitation_Hz", math.nan)
    rotation = cells.get("rotation") or ROTATIONS[0]
    if rotation not in ROTATIONS:
        raise BadInputError(f"{place}: rotation {rotation[:40]!r} is not known. Write {' or '.join(ROTATIONS)}.")
    point = OperatingPoint(
        load,
        math.radians(-90.0 if math.isnan(direction) else direction),
        speed,
        speed if math.isnan(excitation) else HZ * excitation,
        rotation,
    )
    position = (cells.get("x_m", math.nan), cells.get("y_m", math.nan))
    return TableRow(line, point, _coefficients(cells), position, cells.get("converged") is not False)


def _coefficients(cells: Mapping[Any, Any]) -> dict[str, tuple[float, float]]:
    """Value and standard error of every coefficient that a row holds."""
    coefficients = {}
    for column in COEFFICIENT_COLUMNS:
        value, error, low, high = (cells.get(column + ending, math.nan) for ending in ("", "_se", "_lo", "_hi"))
        if not math.isnan(value):
            coefficients[column[:3]] = (value, (high - low) / (2 * 1.96) if math.isnan(error) else error)
    return coefficients

"""A table of coefficients, as a paper's figures or another program give them: K and C with how far they hold."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import ENTRIES

HZ = 2.0 * math.pi
_UNITS = {"k": "N_per_m", "c": "Ns_per_m"}
_NEEDED = ("static_load_N", "shaft_speed_Hz")
#: A column that looks like a coefficient: misspelt, it would be silently left out.
_COEFFICIENT = re.compile(r"[A-Za-z]{1,5}_Ns?_per_m(_se|_lo|_hi|)")


@dataclass(frozen=True)
class TableSource:
    """A table of coefficients in the place of a campaign: what pages call it."""

    id: str
    description: str = "K and C from a table"


@dataclass(frozen=True)
class TableRow:
    """Coefficients of one operating point."""

    load: float
    direction: float
    speed: float
    omega: float
    coefficients: dict[str, tuple[float, float]]


def read_coefficients(path: Path, reading_error: float | None = None) -> tuple[TableRow, ...]:
    """Read a table of coefficients."""
    rows: list[TableRow] = []
    points: set[tuple[float, ...]] = set()
    frame = read_table(path, _NEEDED, _COEFFICIENT)
    for number, row in zip(frame.attrs["lines"], frame.to_dict("records"), strict=True):
        row_name = f"{path.name}, line {number}"
        place = _place(row, row_name)
        coefficients = _coefficients(row, reading_error, row_name)
        if not coefficients:
            continue
        if place in points:
            raise BadInputError(f"{row_name}: a second row for the same point. Keep one of them.")
        points.add(place)
        rows.append(TableRow(*place, coefficients))
    if not rows:
        raise BadInputError(f"{path.name}: holds no coefficient. Name columns as in coefficients.csv: kxx_N_per_m, ...")
    return tuple(rows)


def _place(row: Mapping[Any, Any], row_name: str) -> tuple[float, float, float, float]:
    load, speed = row["static_load_N"], HZ * row["shaft_speed_Hz"]
    direction, line = row.get("static_load_direction_deg", math.nan), HZ * row.get("excitation_Hz", math.nan)
    if not (load > 0.0 and speed > 0.0):
        raise BadInputError(f"{row_name}: static_load_N and shaft_speed_Hz must be positive numbers.")
    return load, math.radians(-90.0 if math.isnan(direction) else direction), speed, speed if math.isnan(line) else line


def _coefficients(row: Mapping[Any, Any], reading_error: float | None, row_name: str) -> dict[str, tuple[float, float]]:
    """Value and standard error of every coefficient that a row holds."""
    out = {}
    for part, unit in _UNITS.items():
        for entry in ENTRIES:
            name = f"{part}{entry}_{unit}"
            value, error, low, high = (row.get(name + ending, math.nan) for ending in ("", "_se", "_lo", "_hi"))
            if math.isnan(value):
                continue
            if math.isnan(error):
                error = (high - low) / (2 * 1.96)
            if not math.isfinite(error) and reading_error is not None:
                error = reading_error * abs(value)
            if not math.isfinite(error):
                raise BadInputError(
                    f"{row_name}, {name}: nothing says how far it holds. "
                    f"Add {name}_se, _lo and _hi, or --reading-error."
                )
            out[f"{part}{entry}"] = (value, error)
    return out

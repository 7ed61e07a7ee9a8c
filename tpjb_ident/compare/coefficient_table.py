"""A table of coefficients, as a paper's figures or another program give them: K and C with how far they hold."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigdata.near_names import nearest_name
from tpjb_ident.errors import BadInputError
from tpjb_ident.schema import ENTRIES

if TYPE_CHECKING:
    import pandas as pd

HZ = 2.0 * math.pi
_UNITS = {"k": "N_per_m", "c": "Ns_per_m"}
_KNOWN = tuple(f"{part}{entry}_{unit}" for part, unit in _UNITS.items() for entry in ENTRIES)
#: A column that looks like a coefficient: misspelt, it would be silently left out.
_COEFFICIENT = re.compile(r"([A-Za-z]{1,5}_Ns?_per_m)(_se|_lo|_hi|)")


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
    for number, row in enumerate(_read(path).to_dict("records"), start=2):
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


def _read(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        frame = pd.read_csv(path, sep=None, engine="python", comment="#", encoding="utf-8-sig")
    except (OSError, ValueError, csv.Error) as error:  # csv.Error: no delimiter is to be found, as in an empty file
        raise BadInputError(
            f"{path}: cannot be read as a table ({error}). Save it as CSV with a line of names."
        ) from error
    columns = [str(name) for name in frame.columns]
    for name in ("static_load_N", "shaft_speed_Hz"):
        if name not in columns:
            near = nearest_name(name, columns)
            hint = f"; {near!r} is not it" if near else ""
            raise BadInputError(f"{path.name}: column {name} is missing{hint}. Add it.")
    for name in columns:
        stem = _COEFFICIENT.fullmatch(name)
        if stem is not None and stem[1] not in _KNOWN:
            near = nearest_name(stem[1], _KNOWN)
            raise BadInputError(f"{path.name}: column {name!r} is no coefficient. Did you mean {near}{stem[2]}?")
    return frame


def _number(row: Mapping[Any, Any], name: str, row_name: str) -> float:
    value = row.get(name)
    try:
        return float(value) if value is not None and value != "" else math.nan
    except (TypeError, ValueError) as error:
        raise BadInputError(
            f"{row_name}, {name}: {value!r} is no number. Leave the cell empty where nothing is known."
        ) from error


def _place(row: Mapping[Any, Any], row_name: str) -> tuple[float, float, float, float]:
    load, speed = _number(row, "static_load_N", row_name), HZ * _number(row, "shaft_speed_Hz", row_name)
    direction = _number(row, "static_load_direction_deg", row_name)
    line = HZ * _number(row, "excitation_Hz", row_name)
    if not (load > 0.0 and speed > 0.0):
        raise BadInputError(f"{row_name}: static_load_N and shaft_speed_Hz must be positive numbers.")
    return load, math.radians(-90.0 if math.isnan(direction) else direction), speed, speed if math.isnan(line) else line


def _coefficients(row: Mapping[Any, Any], reading_error: float | None, row_name: str) -> dict[str, tuple[float, float]]:
    """Value and standard error of every coefficient that a row holds."""
    out = {}
    for part, unit in _UNITS.items():
        for entry in ENTRIES:
            name = f"{part}{entry}_{unit}"
            value = _number(row, name, row_name)
            if math.isnan(value):
                continue
            error = _number(row, f"{name}_se", row_name)
            if math.isnan(error):
                error = (_number(row, f"{name}_hi", row_name) - _number(row, f"{name}_lo", row_name)) / (2 * 1.96)
            if math.isnan(error) and reading_error is not None:
                error = reading_error * abs(value)
            if not error >= 0.0:
                raise BadInputError(
                    f"{row_name}, {name}: nothing says how far it holds. "
                    f"Add {name}_se, _lo and _hi, or --reading-error."
                )
            out[f"{part}{entry}"] = (value, error)
    return out

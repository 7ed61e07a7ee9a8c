"""A table of coefficients, as a paper's figures or another program give them: K and C with how far they hold."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.operating_point import ROTATIONS, OperatingPoint
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

HZ = 2.0 * math.pi
_NEEDED = ("static_load_N", "shaft_speed_Hz")
#: A column that looks like a coefficient: misspelt, it would be silently left out.
_COEFFICIENT = re.compile(r"[A-Za-z]{1,5}_[A-Za-z_]*per_(?:m|in)(_se|_lo|_hi|)")


@dataclass(frozen=True)
class TableSource:
    """A table of coefficients in the place of a campaign: what pages call it."""

    id: str
    description: str = "K and C from a table"

    def fingerprint(self) -> dict[str, str]:
        """None: what was read is an input of the command."""
        return {}


@dataclass(frozen=True)
class TableRow:
    """Coefficients of one operating point, each with its standard error; NaN where nothing states it."""

    line: int
    point: OperatingPoint
    values: FloatArray = field(repr=False)  #: (8,) kxx .. kyy [N/m], cxx .. cyy [N s/m]
    errors: FloatArray = field(repr=False)  #: (8,)
    position: tuple[float, float] = (math.nan, math.nan)  #: [m]
    converged: bool = True
    status: tuple[str, ...] = ()
    extrapolated: bool = False

    @property
    def coefficients(self) -> dict[str, tuple[float, float]]:
        """Value and standard error of what the row holds, ``"kxx"`` .. ``"cyy"``."""
        pairs = zip(COEFFICIENT_COLUMNS, self.values, self.errors, strict=True)
        return {column[:3]: (float(value), float(error)) for column, value, error in pairs if not math.isnan(value)}


def read_coefficients(path: Path, reading_error: float | None = None) -> tuple[TableRow, ...]:
    """Read a table of coefficients that says how far each holds."""
    rows = []
    for row in read_rows(path):
        errors = row.errors
        if reading_error is not None:
            errors = np.where(np.isfinite(errors), errors, reading_error * np.abs(row.values))
        for column in np.array(COEFFICIENT_COLUMNS)[~np.isnan(row.values) & ~np.isfinite(errors)]:
            raise BadInputError(
                f"{path.name}, line {row.line}, {column}: nothing says how far it holds. "
                f"Add {column}_se, _lo and _hi, or --reading-error."
            )
        rows.append(replace(row, errors=errors))
    return tuple(rows)


def read_rows(path: Path) -> tuple[TableRow, ...]:
    """Read a table of coefficients, measured or predicted; rows that hold none are left out."""
    rows: list[TableRow] = []
    places: set[OperatingPoint] = set()
    frame = read_table(path, _NEEDED, _COEFFICIENT)
    for line, cells in zip(frame.attrs["lines"], frame.to_dict("records"), strict=True):
        row = _row(cells, line, f"{path.name}, line {line}")
        if np.isnan(row.values).all():
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
    point = OperatingPoint(
        load,
        math.radians(-90.0 if math.isnan(direction) else direction),
        speed,
        speed if math.isnan(excitation) else HZ * excitation,
        cells.get("rotation", ROTATIONS[0]),
    )
    values, errors, low, high = (
        np.array([cells.get(column + end, math.nan) for column in COEFFICIENT_COLUMNS])
        for end in ("", "_se", "_lo", "_hi")
    )
    stated = (high - low) / (2 * 1.96)  # our own tables have both: the interval holds calibration too
    errors = np.where(np.isnan(stated), errors, stated)
    text = cells.get("quality") or cells.get("status") or ""
    status = tuple(name for name in str(text).split("; ") if name not in ("", "ok", "nan"))
    status += ("excitation-not-stated",) if math.isnan(excitation) else ()
    position = (cells.get("x_m", math.nan), cells.get("y_m", math.nan))
    return TableRow(line, point, values, errors, position, cells.get("converged") is not False, status)


def partners(rows: pd.DataFrame, others: pd.DataFrame, within: tuple[float, float, float]) -> IntArray:
    """The nearest of other rows that is of the same operating point, for every row (n,); -1 where none is.

    `within` says how far two rows of one point may be apart: share of the load, direction [deg], share of the
    frequencies of shaft and excitation.
    """
    load, direction, frequency = within
    if not len(others):
        return np.full(len(rows), -1)
    left, right = (frame[list(POINT_COLUMNS)].to_numpy(float) for frame in (rows, others))
    apart = np.abs(right[None] - left[:, None])
    apart[..., 1] = np.minimum(apart[..., 1] % 360.0, -apart[..., 1] % 360.0)
    most = np.abs(left) * [load, 0.0, frequency, frequency] + [0.0, direction, 0.0, 0.0]
    with np.errstate(invalid="ignore", divide="ignore"):  # a load or speed of zero has no share: equal or apart
        distance = np.nan_to_num(apart / most[:, None], nan=0.0, posinf=np.inf).max(axis=2)
    senses = [frame["rotation"].to_numpy(str) if "rotation" in frame else ROTATIONS[0] for frame in (rows, others)]
    distance[np.reshape(senses[0], (-1, 1)) != senses[1]] = np.inf
    return np.where(distance.min(axis=1) <= 1.0, distance.argmin(axis=1), -1)

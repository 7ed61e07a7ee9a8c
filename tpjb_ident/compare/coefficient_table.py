"""A table of coefficients, as a paper's figures or another program give them: K and C with how far they hold."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rigdata.arrays import IntArray
from rigdata.operating_point import ROTATIONS, OperatingPoint
from tpjb_ident.columns import amount, spinning
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, HALF_INTERVAL, POINT_COLUMNS, POINT_KEY, with_endings

HZ = 2.0 * math.pi
VALUES = list(COEFFICIENT_COLUMNS)
ERRORS = [f"{name}_se" for name in VALUES]
_NEEDED = ("static_load_N", "shaft_speed_Hz")
#: A column that looks like a coefficient: misspelt, it would be silently left out.
_COEFFICIENT = re.compile(r"[A-Za-z]{1,5}_[A-Za-z_]*per_(?:m|in)(_se|_lo|_hi|)")
#: Cells of columns that are not there.
_DEFAULTS = {"rotation": ROTATIONS[0], "converged": True, "quality": "", "status": ""}


@dataclass(frozen=True)
class TableSource:
    """A table of coefficients in the place of a campaign: what pages call it."""

    id: str
    description: str = "K and C from a table"

    def fingerprint(self) -> dict[str, str]:
        """None: what was read is an input of the command."""
        return {}


def read_coefficients(path: Path, reading_error: float | None = None) -> pd.DataFrame:
    """Rows of a table of coefficients that says how far each holds; see `read_rows`."""
    rows = read_rows(path)
    values, errors = rows[VALUES].to_numpy(), rows[ERRORS].to_numpy()
    if reading_error is not None:
        errors = np.where(np.isfinite(errors), errors, reading_error * np.abs(values))
    for row, column in np.argwhere(~np.isnan(values) & ~np.isfinite(errors)):
        name = VALUES[column]
        raise BadInputError(
            f"{path.name}, line {rows['line'][row]}, {name}: nothing says how far it holds. "
            f"Add {name}_se, _lo and _hi, or --reading-error."
        )
    rows[ERRORS] = errors
    return rows


def read_rows(path: Path) -> pd.DataFrame:
    """Read a table of coefficients, measured or predicted; rows that hold none are left out.

    Columns as in ``prediction.csv``, beside them ``line`` and the standard errors; NaN where nothing states a number.
    """
    table = read_table(path, _NEEDED, _COEFFICIENT)
    ends = with_endings("_lo", "_hi")
    absent: dict[str, Any] = {name: value for name, value in _DEFAULTS.items() if name not in table}
    columns = [*POINT_KEY, *VALUES, *ERRORS, *ends, "x_m", "y_m", "converged", "quality", "status"]
    rows = table.assign(**absent).reindex(columns=columns).assign(line=table.attrs["lines"])
    for line in rows["line"][~(rows[list(_NEEDED)] > 0.0).all(axis=1)]:
        raise BadInputError(f"{path.name}, line {line}: static_load_N and shaft_speed_Hz must be positive numbers.")
    assumed = rows["excitation_Hz"].isna().map({True: "excitation-not-stated", False: ""})
    rows["excitation_Hz"] = rows["excitation_Hz"].fillna(rows["shaft_speed_Hz"])
    rows["static_load_direction_deg"] = rows["static_load_direction_deg"].fillna(-90.0)
    low, high = rows[ends[::2]].to_numpy(float), rows[ends[1::2]].to_numpy(float)
    deviations = (high - low) / (2 * HALF_INTERVAL)  # our own tables have both: the interval holds calibration too
    rows[ERRORS] = np.where(np.isnan(deviations), rows[ERRORS], deviations)
    flags = rows["quality"].where(rows["quality"] != "", rows["status"]).astype(object) + "; " + assumed
    rows["status"] = flags.map(_flags)
    rows["converged"] = rows["converged"].ne(False)
    rows = rows.drop(columns=ends).dropna(subset=VALUES, how="all").reset_index(drop=True)
    for line in rows["line"][rows.duplicated(list(POINT_KEY))]:
        raise BadInputError(f"{path.name}, line {line}: a second row for the same point. Keep one of them.")
    if rows.empty:
        raise BadInputError(f"{path.name}: holds no coefficient. Name columns as in coefficients.csv: kxx_N_per_m, ...")
    return rows


def _flags(text: str) -> str:
    return "; ".join(name for name in text.split("; ") if name not in ("", "ok", "nan"))


def points_of(rows: pd.DataFrame) -> list[OperatingPoint]:
    """Operating points of the rows of a table."""
    points = []
    for load, direction, speed, excitation, rotation in rows[list(POINT_KEY)].itertuples(index=False, name=None):
        points.append(OperatingPoint(load, math.radians(direction), HZ * speed, HZ * excitation, rotation))
    return points


def described(rows: pd.DataFrame) -> list[str]:
    """Operating points of the rows of a table in words, in the units that people read."""
    texts = []
    for row in rows.to_dict("records"):
        load = f"{amount(row['static_load_N'], 'load')} at {row['static_load_direction_deg']:g}°"
        shaft = spinning(row["shaft_speed_Hz"], row.get("rotation", ROTATIONS[0]))
        texts.append(f"{load}, shaft at {shaft}, {row['excitation_Hz']:g} Hz")
    return texts


def partners(rows: pd.DataFrame, candidates: pd.DataFrame, within: tuple[float, float, float]) -> IntArray:
    """The nearest of other rows that is of the same operating point, for every row (n,); -1 where none is.

    `within` says how far two rows of one point may be apart: share of the load, direction [deg], share of the
    frequencies of shaft and excitation.
    """
    load, direction, frequency = within
    if rows.empty or candidates.empty:
        return np.full(len(rows), -1)
    keys = rows[list(POINT_COLUMNS)].to_numpy(float)
    candidate_keys = candidates[list(POINT_COLUMNS)].to_numpy(float)
    gaps = np.abs(candidate_keys[None] - keys[:, None])
    gaps[..., 1] = np.minimum(gaps[..., 1] % 360.0, -gaps[..., 1] % 360.0)
    most = np.abs(keys) * [load, 0.0, frequency, frequency] + [0.0, direction, 0.0, 0.0]
    with np.errstate(invalid="ignore", divide="ignore"):  # a load or speed of zero has no share: equal or apart
        distance = np.nan_to_num(gaps / most[:, None], nan=0.0, posinf=np.inf).max(axis=2)
    senses = [frame["rotation"].to_numpy(str) if "rotation" in frame else ROTATIONS[0] for frame in (rows, candidates)]
    distance = np.where(np.reshape(senses[0], (-1, 1)) != senses[1], np.inf, distance)
    return np.where(distance.min(axis=1) <= 1.0, distance.argmin(axis=1), -1)

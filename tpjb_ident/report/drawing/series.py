"""Series of operating points: which of them vary over load or over frequency alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.schema import STATIC_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.results.point_result import PointResult

AXES = {
    "load": ("static_load_N", 1e3, "static load, kN"),
    "frequency": ("excitation_Hz", 1.0, "excitation frequency, Hz"),
}
DIRECT = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")


def as_table(source: Identification | pd.DataFrame) -> pd.DataFrame:
    """Table of coefficients of whatever was given."""
    from tpjb_ident.dynamic.results.identification import Identification

    return source.to_frame() if isinstance(source, Identification) else source


def longest_series(table: pd.DataFrame, axis: str) -> pd.DataFrame | None:
    """Rows of the longest series over load (at one frequency) or over frequency (at one load); None if none varies."""
    column = AXES[axis][0]
    fixed = ["excitation_Hz" if axis == "load" else "static_load_N", *STATIC_COLUMNS[1:]]
    best, length = None, 1
    for _, group in table.groupby(fixed, sort=True):
        if group[column].nunique() > length:
            best, length = group, group[column].nunique()
    return best


def constant_along(series: pd.DataFrame, axis: str) -> str:
    """What is constant along a series, in words."""
    first = series.iloc[0]
    fixed = f"{first.excitation_Hz:g} Hz excitation" if axis == "load" else f"{first.static_load_N / 1e3:g} kN"
    return f"{fixed}, {first.shaft_speed_Hz:g} Hz shaft speed"


def point_label(p: PointResult) -> str:
    """Load and excitation of a point, in words."""
    return f"{p.point.static_load / 1e3:g} kN, {p.point.excitation_hz:g} Hz"


def with_errors(rows: pd.DataFrame, column: str, scale: float) -> tuple[FloatArray, FloatArray]:
    """Values (n,) of a column, and the lengths (2, n) of their intervals below and above."""
    value, low, high = (rows[f"{column}{end}"].to_numpy(float) / scale for end in ("", "_lo", "_hi"))
    return value, np.abs([value - low, high - value])

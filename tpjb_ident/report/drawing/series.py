"""Series of operating points: which of them vary over load or over frequency alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, place_of, size, spinning, symbol
from tpjb_ident.schema import STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.results.point_result import PointResult

#: Column that a series runs over, its quantity and its name.
_AXES = {
    "load": ("static_load_N", "load", "static load"),
    "frequency": ("excitation_Hz", "frequency", "excitation frequency"),
}
#: Points from which on a line joins them; between fewer nobody knows what it would do.
CURVE = 5
DIRECT = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")


def axis_of(over: str) -> tuple[str, float, str]:
    """Column that a series runs over, the size of its unit and its label."""
    column, quantity, name = _AXES[over]
    return column, size(quantity), f"{name}, {symbol(quantity)}"


def as_table(source: Identification | pd.DataFrame) -> pd.DataFrame:
    """Table of coefficients of whatever was given."""
    from tpjb_ident.dynamic.results.identification import Identification

    return source.to_frame() if isinstance(source, Identification) else source


def longest_series(table: pd.DataFrame, axis: str) -> pd.DataFrame | None:
    """Rows of the longest series over load (at one frequency) or over frequency (at one load); None if none varies."""
    column = _AXES[axis][0]
    fixed = ["excitation_Hz" if axis == "load" else "static_load_N", *STATIC_KEY[1:]]
    best, length = None, 1
    for _, group in table.groupby([name for name in fixed if name in table], sort=True):
        if group[column].nunique() > length:
            best, length = group, group[column].nunique()
    return best


def constant_along(series: pd.DataFrame, axis: str) -> str:
    """What is constant along a series, in words."""
    first = series.iloc[0]
    fixed = f"{first.excitation_Hz:g} Hz excitation" if axis == "load" else amount(first.static_load_N, "load")
    return f"{fixed}, shaft at {spinning(first.shaft_speed_Hz, first.get('rotation', ROTATIONS[0]))}"


def point_label(p: PointResult) -> str:
    """Load and excitation of a point, in words."""
    return place_of(p.point.static_load, p.point.excitation_hz)


def with_errors(rows: pd.DataFrame, column: str, scale: float) -> tuple[FloatArray, FloatArray]:
    """Values (n,) of a column, and the lengths (2, n) of their intervals below and above."""
    value, low, high = (rows[f"{column}{end}"].to_numpy(float) / scale for end in ("", "_lo", "_hi"))
    return value, np.abs([value - low, high - value])

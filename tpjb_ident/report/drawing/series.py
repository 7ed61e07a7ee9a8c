"""Series of operating points: which of them vary over load or over frequency alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from rigdata.arrays import FloatArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, per, place_of, size, spinning, symbol
from tpjb_ident.report.drawing.picture import SMALL, shrink
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_KEY, STATIC_KEY

if TYPE_CHECKING:
    from tpjb_ident.results.point_result import PointResult

#: Column that a series runs over, its quantity and its name.
_AXES = {
    "load": ("static_load_N", "load", "static load"),
    "frequency": ("excitation_Hz", "frequency", "excitation frequency"),
}
#: Points from which on a line joins them; between fewer nobody knows what it would do.
CURVE = 5
#: Height of a further line of ticks [inches].
_LINE = 0.16
COEFFICIENTS = tuple(column[:3] for column in COEFFICIENT_COLUMNS)
DIRECT = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")


def axis_of(over: str) -> tuple[str, float, str]:
    """Column that a series runs over, the size of its unit and its label."""
    column, quantity, name = _AXES[over]
    return column, size(quantity), f"{name}, {symbol(quantity)}"


def as_table(source: Any) -> pd.DataFrame:
    """Table of coefficients of a result, or the table that was given."""
    return source if isinstance(source, pd.DataFrame) else source.to_dataframe()


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


def points_table(points: Sequence[PointResult]) -> pd.DataFrame:
    """Set points of results, by the columns of every table."""
    return pd.DataFrame([p.point.key for p in points], columns=list(POINT_KEY))


def point_labels(table: pd.DataFrame) -> list[str]:
    """Load and excitation of every row, in words, and what else tells the rows apart."""
    return [", ".join([place_of(load, excitation), *others]) for load, excitation, others in _set_points(table)]


def set_point_ticks(axes: Axes, table: pd.DataFrame) -> None:
    """Name places 0 to n - 1 of a panel by operating points: a line for load, excitation and what else differs."""
    lines = [[f"{load * per('load'):.4g}", f"{hz:g}", *others] for load, hz, others in _set_points(table)]
    axes.set_xticks(range(len(lines)), ["\n".join(texts) for texts in lines], fontsize=SMALL)
    shrink(axes, bottom=0.09 + _LINE * (len(lines[0]) - 1 if lines else 0))


def _set_points(table: pd.DataFrame) -> list[tuple[float, float, list[str]]]:
    """Load, excitation and, in words, what of these differs between rows: direction of the load, speed and sense."""
    forms = {"static_load_direction_deg": "{:g}°", "shaft_speed_Hz": "shaft {:g} Hz", "rotation": "{}"}
    varied = [name for name in forms if name in table and len(table[name].drop_duplicates()) > 1]
    short = table.replace({"rotation": dict(zip(ROTATIONS, ("ccw", "cw"), strict=True))}) if varied else table
    return [
        (row["static_load_N"], row["excitation_Hz"], [forms[name].format(row[name]) for name in varied])
        for row in short.to_dict("records")
    ]


def thinned(time: FloatArray, values: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Lows and highs of as many blocks as a screen can show; short records as they are."""
    step = -(-len(values) // (most // 2))
    if step <= 2:
        return time, values
    count = len(values) // step
    blocks = np.ma.masked_invalid(values[: count * step].reshape(count, step))
    ends = np.stack([blocks.min(axis=1).filled(np.nan), blocks.max(axis=1).filled(np.nan)], axis=1)
    return np.repeat(time[: count * step : step], 2), ends.ravel()


def with_errors(rows: pd.DataFrame, column: str, scale: float) -> tuple[FloatArray, FloatArray]:
    """Values (n,) of a column, and the lengths (2, n) of their intervals below and above."""
    value, low, high = (rows[f"{column}{end}"].to_numpy(float) / scale for end in ("", "_lo", "_hi"))
    return value, np.abs([value - low, high - value])

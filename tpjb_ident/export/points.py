"""Coefficients sorted by static point, as every export wants them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.errors import TpjbError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_COLUMNS, STATIC_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]
COLUMNS = {name[:3]: name for name in COEFFICIENT_COLUMNS}


class ExportError(TpjbError):
    """The table cannot be exported; says which column or point and what to do."""


@dataclass(frozen=True)
class StaticPoint:
    """Coefficients of one static load and speed over excitation frequency.

    Attributes
    ----------
    load : float
        [N]
    direction : float
        [deg]
    speed : float
        [Hz]
    frequency : (n,) ndarray
        Excitation [rad/s], rising.
    coefficients : dict of str to (n,) ndarray
        ``"kxx"`` .. ``"cyy"`` [N/m], [N s/m].
    """

    load: float
    direction: float
    speed: float
    frequency: FloatArray = field(repr=False)
    coefficients: dict[str, FloatArray] = field(repr=False)

    @property
    def tag(self) -> str:
        """Name that says what the frequency axis means."""
        return f"{self.load:.0f}N_{self.direction:g}deg_{self.speed:g}Hz_excitation"


def static_points(frame: pd.DataFrame) -> tuple[tuple[StaticPoint, ...], tuple[str, ...]]:
    """Sort a coefficient table by static point.

    Parameters
    ----------
    frame : DataFrame
        As in coefficients.csv or prediction.csv.

    Returns
    -------
    points : tuple of StaticPoint
    left_out : tuple of str
        Points without finite coefficients, which no program can use.

    Raises
    ------
    ExportError
        A column is missing, a point stands twice, or nothing is left.
    """
    needed = [*POINT_COLUMNS, *COLUMNS.values()]
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise ExportError(f"the table has no column {missing[0]}. Give a coefficients.csv or prediction.csv of tpjb.")
    finite = np.isfinite(frame[needed].to_numpy(dtype=float)).all(axis=1)
    left_out = tuple(
        f"{row.static_load_N:g} N, {row.excitation_Hz:g} Hz" for row in frame[~finite].itertuples(index=False)
    )
    if not finite.any():
        raise ExportError("no point of the table has finite coefficients. Identify or predict again.")
    points = []
    for keys, group in frame[finite].groupby(list(STATIC_COLUMNS), sort=True):
        ordered = group.sort_values("excitation_Hz")
        if ordered["excitation_Hz"].duplicated().any():
            raise ExportError(f"the point {keys[0]:g} N stands twice at one frequency. Export one method at a time.")
        omega = 2 * math.pi * ordered["excitation_Hz"].to_numpy(dtype=float)
        values = {short: ordered[column].to_numpy(dtype=float) for short, column in COLUMNS.items()}
        points.append(StaticPoint(float(keys[0]), float(keys[1]), float(keys[2]), omega, values))
    return tuple(points), left_out

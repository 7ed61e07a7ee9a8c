"""Residuals of a comparison or a diagnosis as one table: what the two plots of residuals draw."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rigdata.operating_point import ROTATIONS
from tpjb_ident.compare.comparison import Comparison, comparison_frame
from tpjb_ident.diagnosis.observations.gap import residuals
from tpjb_ident.report.drawing.series import COEFFICIENTS
from tpjb_ident.schema import POINT_KEY, coefficient_column

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.diagnose import Diagnosis

_COLUMNS = ("model", "entry", *POINT_KEY, "z")

_TWO_SIDED_95 = 1.959964


def residual_frame(source: Diagnosis | Comparison | pd.DataFrame) -> pd.DataFrame:
    """Give (measured - predicted) / sigma of every coefficient: a row per model, coefficient and point.

    A table of comparison.csv does as well as a `Comparison` or a `Diagnosis`.
    """
    if isinstance(source, pd.DataFrame):
        return source if {"model", "entry", "z"} <= set(source.columns) else _of_comparison(source)
    if isinstance(source, Comparison):
        return _of_comparison(comparison_frame(source))
    return _of_diagnosis(source)


def _of_diagnosis(diagnosis: Diagnosis) -> pd.DataFrame:
    rows = []
    models = [("before", diagnosis.problem.base)]
    models += [("after", diagnosis.after)] if diagnosis.verdict.effects else []
    for model, prediction in models:
        z = residuals(diagnosis.observations, prediction)
        for element, value in zip(diagnosis.observations.elements, z, strict=True):
            if element.family == "h":
                direction = round(math.degrees(element.place("direction")), 6)
                speed, excitation = (round(element.place(name) / (2 * np.pi), 6) for name in ("speed", "excitation"))
                point = (element.place("load"), direction, abs(speed), excitation, ROTATIONS[speed < 0.0])
                rows.append((model, element.observable, *point, float(value)))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _of_comparison(table: pd.DataFrame) -> pd.DataFrame:
    frames = []
    for entry in COEFFICIENTS:
        key = coefficient_column(entry)
        sigma = (table[f"{key}_hi"] - table[f"{key}_lo"]) / (2 * _TWO_SIDED_95)
        place = table[[name for name in POINT_KEY if name in table]]
        residual = (table[key] - table[f"{key}_predicted"]) / sigma
        frames.append(place.assign(model=table["pivots"], entry=entry, z=residual))
    return pd.concat(frames, ignore_index=True)

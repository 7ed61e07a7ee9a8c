"""Residuals of a comparison or a diagnosis as one table: what the two plots of residuals draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from tpjb_ident.compare.comparison import Comparison, comparison_frame
from tpjb_ident.diagnosis.observations.gap import residuals
from tpjb_ident.schema import COEFFICIENT_COLUMNS, coefficient_column

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.diagnose import Diagnosis

#: Names of the eight coefficients of a residual: kxx to cyy.
COEFFICIENTS = tuple(column[:3] for column in COEFFICIENT_COLUMNS)

_COLUMNS = ("model", "entry", "static_load_N", "excitation_Hz", "z")

_TWO_SIDED_95 = 1.959964


def residual_frame(source: Diagnosis | Comparison | pd.DataFrame) -> pd.DataFrame:
    """Give (measured - predicted) / sigma of every coefficient: a row per model, coefficient and point.

    A table of comparison.csv does as well as a `Comparison` or a `Diagnosis`.
    """
    if isinstance(source, pd.DataFrame):
        return source if set(_COLUMNS) <= set(source.columns) else _of_comparison(source)
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
                frequency = element.place("excitation") / (2 * np.pi)
                rows.append((model, element.observable, element.place("load"), round(frequency, 6), float(value)))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _of_comparison(table: pd.DataFrame) -> pd.DataFrame:
    frames = []
    for entry in COEFFICIENTS:
        key = coefficient_column(entry)
        sigma = (table[f"{key}_hi"] - table[f"{key}_lo"]) / (2 * _TWO_SIDED_95)
        frames.append(
            pd.DataFrame(
                {
                    "model": table["pivots"],
                    "entry": entry,
                    "static_load_N": table["static_load_N"],
                    "excitation_Hz": table["excitation_Hz"],
                    "z": (table[key] - table[f"{key}_predicted"]) / sigma,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)

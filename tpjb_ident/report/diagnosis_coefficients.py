"""K and C measured, predicted before and predicted with the effects that were found, as a comparison's table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.dynamic.results.identification_tables import coefficient_columns, point_columns
from tpjb_ident.schema import DAMPING, ENTRIES, STIFFNESS, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.diagnose.diagnose import Diagnosis
    from tpjb_ident.dynamic.results.identification import Identification

#: Names of the two models in the column ``pivots``, as pictures label them.
BEFORE, AFTER = "model before", "with the effects found"


def before_and_after(diagnosis: Diagnosis, identification: Identification | None) -> pd.DataFrame:
    """Make a table as comparison.csv of a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
    identification : Identification or None
        That it was made from; without one, from a table of coefficients, there are no rows.

    Returns
    -------
    DataFrame
        One row per operating point and model: ``pivots`` is `BEFORE` or `AFTER`; the latter only where effects were
        named. Points that the diagnosis left out have no prediction.
    """
    import pandas as pd

    models = [(BEFORE, diagnosis.problem.base)]
    models += [(AFTER, diagnosis.after)] if diagnosis.verdict.effects else []
    frames = []
    for name, prediction in models:
        predicted = _by_point(diagnosis, prediction)
        for p in identification.points if identification is not None else ():
            own = predicted.get((round(p.point.static_load, 6), round(p.point.excitation, 6)), {})
            row: dict[str, Any] = {"pivots": name, **point_columns(p), **coefficient_columns(p.stiffness)}
            for kind, omega in ((STIFFNESS, 1.0), (DAMPING, p.point.excitation)):
                for entry in ENTRIES:
                    column = kind.column(entry)
                    row[f"{column}_predicted"] = own.get(f"{kind.symbol}{entry}", math.nan) / omega
                    row[f"{column}_ratio"] = row[f"{column}_predicted"] / row[column]
            frames.append(row)
    return pd.DataFrame(frames)


def _by_point(diagnosis: Diagnosis, prediction: FloatArray) -> dict[tuple[float, float], dict[str, float]]:
    """Re h and Im h [N/m] by load [N] and excitation [rad/s]."""
    out: dict[tuple[float, float], dict[str, float]] = {}
    for element, value in zip(diagnosis.observations.elements, prediction, strict=True):
        if element.family == "h":
            key = (round(element.place("load"), 6), round(element.place("excitation"), 6))
            out.setdefault(key, {})[element.observable] = float(value)
    return out


def median_deviations(table: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Median of predicted / measured - 1 before and after, of every direct coefficient.

    Parameters
    ----------
    table : DataFrame
        As `before_and_after` gives it.

    Returns
    -------
    dict of str to (float, float)
        Equal where no effect was named.
    """
    found: dict[str, tuple[float, float]] = {}
    if table.empty:
        return found
    for name in ("kxx", "kyy", "cxx", "cyy"):
        off = (table[f"{coefficient_column(name)}_ratio"] - 1.0).groupby(table["pivots"]).median()
        if BEFORE in off and np.isfinite(off[BEFORE]):
            found[name] = (float(off[BEFORE]), float(off.get(AFTER, off[BEFORE])))
    return found

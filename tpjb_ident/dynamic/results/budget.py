"""The uncertainty budget: what every source adds to every coefficient, GUM style.

The intervals are its sum: the random sources together with Student's t of their degrees of freedom, the systematic
ones normal, the two added as root sum of squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.dynamic.estimators.stiffness import ENTRIES, DynamicStiffness

#: Sources that scatter from run to run; all others are common to the runs.
RANDOM = ("random", "load miss", "mains")
BUDGET_COLUMNS = ("coefficient", "unit", "source", "kind", "standard_uncertainty", "share", "dof")


def with_systematic(est: DynamicStiffness, parts: Mapping[str, FloatArray]) -> DynamicStiffness:
    """The estimate with the sum of some systematic covariances (8, 8).

    Parameters
    ----------
    est : DynamicStiffness
    parts : mapping of str to (8, 8) ndarray
        By source [N^2/m^2].
    """
    return replace(est, systematic=np.sum(list(parts.values()), axis=0) if parts else np.zeros((8, 8)))


def budget_rows(
    point: Mapping[str, Any], est: DynamicStiffness, parts: Mapping[str, FloatArray]
) -> list[dict[str, Any]]:
    """Rows of ``budget.csv`` of one point.

    Parameters
    ----------
    point : mapping
        Columns that name the point.
    est : DynamicStiffness
    parts : mapping of str to (8, 8) ndarray
        Covariance by source [N^2/m^2].
    """
    variances = {name: np.maximum(np.diag(part), 0.0) for name, part in parts.items()}
    total = np.sum(list(variances.values()), axis=0) if variances else np.zeros(8)
    rows = []
    for i in range(8):
        symbol, unit, factor = ("k", "N/m", 1.0) if i < 4 else ("c", "Ns/m", 1 / est.omega)
        for name, variance in variances.items():
            rows.append(
                {
                    **point,
                    "coefficient": f"{symbol}{ENTRIES[i % 4]}",
                    "unit": unit,
                    "source": name,
                    "kind": "random" if name in RANDOM else "systematic",
                    "standard_uncertainty": float(np.sqrt(variance[i])) * factor,
                    "share": float(variance[i] / total[i]) if total[i] > 0 else 0.0,
                    "dof": float(est.dof[i]) if name in RANDOM else np.inf,
                }
            )
    return rows

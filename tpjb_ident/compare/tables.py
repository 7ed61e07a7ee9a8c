"""comparison.csv: one row per operating point and pivot model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.compare.predictions import PointPrediction, coefficient_names, point_columns
from tpjb_ident.dynamic.results.identification import coefficient_columns

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison, Variant
    from tpjb_ident.dynamic.results.point_result import PointResult

NAMES = (*coefficient_names("k"), *coefficient_names("c"))
DIRECT = tuple(name for name in NAMES if name[1:3] in ("xx", "yy"))


def comparison_frame(comparison: Comparison) -> pd.DataFrame:
    """Build comparison.csv."""
    import pandas as pd

    rows = [
        _row(variant, measured, predicted)
        for variant in comparison.variants
        for measured, predicted in zip(comparison.identification.points, variant.points, strict=True)
    ]
    return pd.DataFrame(rows)


def _row(variant: Variant, measured: PointResult, predicted: PointPrediction) -> dict[str, Any]:
    row: dict[str, Any] = {"pivots": variant.name, **point_columns(measured.point)}
    row["static_load_measured_N"] = measured.static_load_measured
    values = coefficient_columns(measured.stiffness)
    model = dict(zip(NAMES, np.concatenate([predicted.k.ravel(), predicted.c.ravel()]), strict=True))
    for name in NAMES:
        low, high = values[f"{name}_lo"], values[f"{name}_hi"]
        row[name], row[f"{name}_lo"], row[f"{name}_hi"] = values[name], low, high
        row[f"{name}_predicted"] = model[name]
        row[f"{name}_difference"] = model[name] - values[name]
        row[f"{name}_ratio"] = model[name] / values[name] if low * high > 0 else np.nan
    p = predicted.prediction
    row.update(
        x_m_predicted=p.position[0],
        y_m_predicted=p.position[1],
        converged=p.converged,
        pivot_extrapolated=pivot_extrapolated(predicted),
        quality="; ".join(str(c) for c in measured.quality) or "ok",
        status="; ".join(p.status),
    )
    return row


def pivot_extrapolated(predicted: PointPrediction) -> bool:
    """Whether a pad that carries presses its pivot harder than the dry test did."""
    p = predicted.prediction
    loads = zip(p.setup.pivots, p.pad_load, strict=True)
    return any(load > getattr(law, "valid_to", np.inf) for law, load in loads)

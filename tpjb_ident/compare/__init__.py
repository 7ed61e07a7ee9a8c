"""Prediction beside measurement; the only package besides `diagnose` and the command line that knows the model."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tpjb_ident.model_guard import check_model

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import CompareSettings, Comparison, Variant, compare_campaign
    from tpjb_ident.compare.predictions import ModelSettings, PointPrediction, predict_points, prediction_frame
    from tpjb_ident.compare.summary import deviations, summary_sentences
    from tpjb_ident.compare.tables import comparison_frame

check_model()  # before any file of this package imports the model

_HOMES = {
    "CompareSettings": "comparison",
    "Comparison": "comparison",
    "ModelSettings": "predictions",
    "PointPrediction": "predictions",
    "Variant": "comparison",
    "compare_campaign": "comparison",
    "comparison_frame": "tables",
    "deviations": "summary",
    "predict_points": "predictions",
    "prediction_frame": "predictions",
    "summary_sentences": "summary",
}

__all__ = [
    "CompareSettings",
    "Comparison",
    "ModelSettings",
    "PointPrediction",
    "Variant",
    "compare_campaign",
    "comparison_frame",
    "deviations",
    "predict_points",
    "prediction_frame",
    "summary_sentences",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tpjb_ident.compare' has no attribute {name!r}")
    return getattr(importlib.import_module(f"tpjb_ident.compare.{_HOMES[name]}"), name)

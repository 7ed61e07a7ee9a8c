"""Where the shaft stands: predicted and measured locus on one scale."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tpjb_ident.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison, Variant


def measured_locus(comparison: Comparison) -> FloatArray:
    """Measured positions (n, 2) [m], from the bearing centre if the campaign has a clearance run."""
    if comparison.locus is None:
        return np.zeros((0, 2))
    return np.array([p.position for p in comparison.locus.points]).reshape(-1, 2)


def predicted_locus(comparison: Comparison, variant: Variant) -> FloatArray:
    """Predicted positions (n, 2) [m] in the order and about the origin of the measured ones.

    Without a clearance run the probes' zero stands anywhere: then the prediction is shifted by the mean difference,
    and only the shape of the two can be compared.
    """
    places = np.array([p.prediction.position for p in variant.locus]).reshape(-1, 2)
    if comparison.clearance is None and len(places):
        places = places + np.nanmean(measured_locus(comparison) - places, axis=0)
    return places


def locus_distance(comparison: Comparison, variant: Variant) -> float:
    """Root mean square distance between the two loci [m]; NaN without locus runs."""
    off = predicted_locus(comparison, variant) - measured_locus(comparison)
    distance = np.hypot(off[:, 0], off[:, 1])
    distance = distance[np.isfinite(distance)]
    return float(np.sqrt(np.mean(distance**2))) if len(distance) else math.nan


def locus_frame(comparison: Comparison) -> pd.DataFrame:
    """Build locus_comparison.csv: measured and predicted position per load direction and pivot model."""
    import pandas as pd

    if comparison.locus is None:
        return pd.DataFrame(columns=["pivots", "static_load_direction_deg", "x_m", "y_m"])
    frames = []
    for variant in comparison.variants:
        frame = comparison.locus.to_frame()
        places = predicted_locus(comparison, variant)
        frame.insert(0, "pivots", variant.name)
        frame["x_m_predicted"], frame["y_m_predicted"] = places[:, 0], places[:, 1]
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)

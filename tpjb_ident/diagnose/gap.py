"""Gap: the root mean square of (measured - predicted) / sigma, over everything and by observable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.diagnose.observe import Observations

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def gap(observations: Observations, prediction: FloatArray, chosen: BoolArray | None = None) -> float:
    """Root mean square of (measured - predicted) / sigma; NaN where nothing is chosen."""
    z = (observations.value - prediction) / observations.total_sigma
    z = z if chosen is None else z[chosen]
    return float(np.sqrt(np.mean(z**2))) if len(z) else float("nan")


def noise_floor(observations: Observations, chosen: BoolArray | None = None) -> float:
    """Gap that measurement noise alone would leave under a perfect model."""
    share = np.diag(observations.covariance) / observations.total_sigma**2
    share = share if chosen is None else share[chosen]
    return float(np.sqrt(np.mean(share)))


def gap_by_observable(
    observations: Observations, before: FloatArray, after: FloatArray, chosen: BoolArray
) -> dict[str, dict[str, float]]:
    """Held-out gap before and after, per observable; observables without held-out points use all of theirs."""
    out: dict[str, dict[str, float]] = {}
    names = np.array([e.observable for e in observations.elements])
    for name in dict.fromkeys(names):
        mine = names == name
        part = mine & chosen
        key = "heldout" if part.any() else "fitted"
        part = part if part.any() else mine
        out[str(name)] = {
            f"{key}_before": gap(observations, before, part),
            f"{key}_after": gap(observations, after, part),
        }
    return out

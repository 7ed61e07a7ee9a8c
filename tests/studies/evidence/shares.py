"""Shares with exact binomial bounds (Clopper and Pearson, Biometrika 26 (1934) 404)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def upper_bound(events: int, trials: int) -> float:
    """Upper one-sided 95 % bound of a share."""
    from scipy.stats import beta

    return 1.0 if events >= trials else float(beta.ppf(0.95, events + 1, trials - events))


def share_interval(events: int, trials: int) -> tuple[float, float, float]:
    """Share with its two-sided 95 % interval; NaN where nothing was tried."""
    from scipy.stats import beta

    if not trials:
        return math.nan, math.nan, math.nan
    low = 0.0 if events == 0 else float(beta.ppf(0.025, events, trials - events + 1))
    high = 1.0 if events == trials else float(beta.ppf(0.975, events + 1, trials - events))
    return events / trials, low, high


def quantiles(values: Sequence[object], shares: Sequence[float] = (0.05, 0.25, 0.5, 0.75, 0.95)) -> list[float]:
    """Quantiles of the finite ones among values that may be None; NaN where there are none."""
    known = [float(v) for v in values if isinstance(v, (int, float)) and math.isfinite(v)]
    return [float(q) for q in np.quantile(known, shares)] if known else [math.nan] * len(shares)

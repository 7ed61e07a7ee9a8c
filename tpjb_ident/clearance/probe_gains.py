"""Unequal gains of the two probes, seen in the clearance polygon: they shear its sides.

A probe that reads (1 + g) times the truth stretches the measured plane along its axis. What it does to sizes cannot be
told from another clearance or another stiffness; what it does to directions can, since the pads' directions are known:
with b and c the dual pair of that probe (position = .. + b (c . position)), the normal n_k of side k turns by

    -g (b . n_k) (n_k x c)

which no common turn of the frame imitates. A gain that both probes share leaves all directions as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray


@dataclass(frozen=True)
class GainRatio:
    """How much more the first probe reads than the second, as the sides of a polygon tell.

    Attributes
    ----------
    value : float
        Gain of the first over that of the second, minus 1.
    se : float
        Its standard error; widened by what the sides scatter about the model.
    turn : float
        Common turn of all sides [rad].
    """

    value: float
    se: float
    turn: float


def gain_ratio(angles: FloatArray, tilt: FloatArray, tilt_se: FloatArray, axes: tuple[float, float]) -> GainRatio:
    """Fit a common turn and unequal gains to the turns of the sides.

    Parameters
    ----------
    angles : (n,) ndarray
        Pad directions [rad].
    tilt, tilt_se : (n,) ndarray
        Turn of every side [rad]; NaN where it was not reached.
    axes : (float, float)
        Of the two probes [rad].

    Returns
    -------
    GainRatio
        NaN where fewer than four sides, or probes along one line, tell nothing.
    """
    known = np.isfinite(tilt) & np.isfinite(tilt_se) & (tilt_se > 0)
    rows = np.array([[np.cos(a), np.sin(a)] for a in axes])
    if known.sum() < 4 or abs(np.linalg.det(rows)) < 0.05:
        return GainRatio(np.nan, np.nan, np.nan)
    n = np.column_stack([np.cos(angles), np.sin(angles)])[known]
    own, dual = rows[0], np.linalg.inv(rows)[:, 0]
    shear = -(n @ dual) * (n[:, 0] * own[1] - n[:, 1] * own[0])
    design = np.column_stack([np.ones(len(n)), shear]) / tilt_se[known, None]
    target = tilt[known] / tilt_se[known]
    covariance = np.linalg.inv(design.T @ design)
    turn, value = covariance @ design.T @ target
    chi_square = float(np.sum((target - design @ np.array([turn, value])) ** 2)) / (len(target) - 2)
    return GainRatio(float(value), float(np.sqrt(covariance[1, 1] * max(chi_square, 1.0))), float(turn))

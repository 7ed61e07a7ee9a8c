"""Load cells that were not tared: a constant in their mean that no set point explains.

The mean force of the runs is regressed on the set points, with an intercept: F_mean = g W + z, both complex (X + i Y).
Without the intercept a zero that is off looks like a load that misses its set point by more the smaller it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Condition

#: Set points must differ by this share for a zero to be told from a gain.
_MIN_RANGE = 0.15
#: Standard errors beyond which an intercept is one,
_CLEAR = 5.0
#: and share of the smallest load that it must have.
_NOTABLE = 0.004
_MIN_RUNS = 4


@dataclass(frozen=True)
class CellZero:
    """What the cells read at no load."""

    force: complex = 0.0
    error: float = 0.0

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of it at the points."""
        if not self.force:
            return ()
        size, angle = abs(self.force), np.degrees(np.angle(self.force))
        return (
            Condition(
                "cells-not-tared",
                f"over the loads of the campaign the cells' mean holds a constant of {size:.0f} N at {angle:.0f} deg "
                f"(standard error {self.error:.0f} N); it was taken off",
            ),
        )


def cell_zero(means: ComplexArray, set_points: ComplexArray, stated: float = 0.0) -> CellZero:
    """Zero of the cells from all runs; `means` (n,), `set_points` (n,) [N]."""
    good = np.isfinite(means) & (np.abs(set_points) > 0)
    y, x = means[good], set_points[good]
    if len(y) < _MIN_RUNS or (np.ptp(np.abs(x)) < _MIN_RANGE * np.abs(x).max() and _one_direction(x)):
        return CellZero()
    size = np.abs(x)
    design = np.stack([x, np.ones_like(x)], axis=1) / size[:, None]
    answer, weight = y / size, np.ones(len(y))
    for _ in range(10):
        root = np.sqrt(weight)[:, None]
        coefficients = np.linalg.lstsq(design * root, answer * root[:, 0], rcond=None)[0]
        residual = np.abs(answer - design @ coefficients)
        scale = 1.4826 * float(np.median(residual)) + 1e-9
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(residual, 1e-300))
    spread = float(np.sum(weight * residual**2) / max(float(weight.sum()) - 2.0, 1.0))
    covariance = np.linalg.inv((design * weight[:, None]).conj().T @ design).real * spread
    zero, error = complex(coefficients[1]), float(np.sqrt(covariance[1, 1]))
    there = abs(zero) > _CLEAR * error and abs(zero) > _NOTABLE * size.min()
    allowed = stated == 0.0 or abs(zero) < 3 * stated + 3 * error
    return CellZero(zero, error) if there and allowed else CellZero()


def _one_direction(set_points: ComplexArray) -> bool:
    return bool(np.abs(set_points / np.abs(set_points) - set_points[0] / abs(set_points[0])).max() < _MIN_RANGE)


def cell_zero_uncertainty(campaign: Campaign) -> float:
    """Standard uncertainty of the cells' zero by the manifest [N]; 0 where it says nothing."""
    cells = [c for c in campaign.channels.values() if c.quantity == "force"]
    return float(max((getattr(c, "zero_uncertainty", 0.0) for c in cells), default=0.0))

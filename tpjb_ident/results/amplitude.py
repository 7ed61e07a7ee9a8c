"""Whether the dynamic stiffness depends on how hard the bearing was shaken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.runs.point_data import PointData

#: Runs of one direction must differ in amplitude by this factor to tell anything.
MIN_RATIO = 1.3
#: A slope is pointed out beyond this probability and this size (relative change per doubling).
SIGNIFICANCE = 0.01
NOTABLE = 0.01


@dataclass(frozen=True)
class AmplitudeSlope:
    """Relative change of the dynamic stiffness when the amplitude doubles."""

    stiffening: float
    standard_error: float
    runs: int

    def condition(self) -> tuple[Condition, ...]:
        """What to say about it in the point's quality, where it is more than noise."""
        limit = -float(stdtrit(max(self.runs - 2, 1), SIGNIFICANCE / 2)) * self.standard_error
        if abs(self.stiffening) <= max(limit, NOTABLE):
            return ()
        change, error = 100 * self.stiffening, 100 * self.standard_error
        text = f"h changes by {change:+.1f} % when the amplitude doubles (standard error {error:.1f} %)"
        return (Condition("nonlinear-amplitude", text),)


def amplitude_slope(data: PointData, h: ComplexArray, weights: FloatArray) -> AmplitudeSlope | None:
    """Slope of h over the logarithm of the amplitude, from directions run at several amplitudes."""
    groups: dict[float, list[tuple[float, float]]] = {}
    for i, run in enumerate(data.runs):
        selected = (data.run_index == i) & (weights > 0) & np.isfinite(data.D).all(axis=1)
        if run.direction is None or not selected.any() or not np.isfinite(h).all():
            continue
        D = np.average(data.D[selected], axis=0, weights=weights[selected])
        F = np.average(data.F[selected], axis=0, weights=weights[selected])
        fitted = h @ D
        excess = float((fitted.conj() @ (F - fitted)).real / np.linalg.norm(fitted) ** 2)
        angle = round(float(np.degrees(run.direction)) % 180.0, 1)
        groups.setdefault(angle, []).append((np.log2(float(np.linalg.norm(D))), excess))
    comparable = [np.array(g) for g in groups.values() if len(g) > 1]
    comparable = [g for g in comparable if np.ptp(g[:, 0]) > np.log2(MIN_RATIO)]
    runs = sum(len(g) for g in comparable)
    if runs - len(comparable) < 2:
        return None
    # Differences within a direction only: what a direction as a whole is off by is no amplitude effect.
    x = np.concatenate([g[:, 0] - g[:, 0].mean() for g in comparable])
    y = np.concatenate([g[:, 1] - g[:, 1].mean() for g in comparable])
    slope = float(x @ y / (x @ x))
    spare = max(runs - len(comparable) - 1, 1)
    error = float(np.sqrt(np.sum((y - slope * x) ** 2) / spare / (x @ x)))
    return AmplitudeSlope(slope, error, runs)

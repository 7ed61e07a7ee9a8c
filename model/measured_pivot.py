"""A measured pivot: the monotone curve of a dry test as a law."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from model.errors import ModelError
from model.interpolation import monotone_cubics
from rigdata.arrays import FloatArray


class _PivotCurveError(ModelError):
    """A measured load-deflection curve that no pivot has."""


#: Least part of a measured give that a pivot keeps when a housing is taken off it.
_LEAST_SHARE = 0.02


@dataclass(frozen=True, eq=False)  # arrays have no single truth value: a curve equals itself only
class MeasuredPivot:
    """A measured monotone curve, interpolated with a continuous tangent (PCHIP in load).

    Beyond the last point the curve goes on with its last tangent; `extrapolated` says when that is so.
    """

    load: FloatArray  #: (n,) [N], and (n,) [m]: strictly increasing, from (0, 0).
    deflection_points: FloatArray
    valid_from: float = 0.0
    valid_to: float = math.inf
    name: str = "measured"
    includes_housing: bool = True
    _coefficients: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        load, points = np.asarray(self.load, float), np.asarray(self.deflection_points, float)
        if load.ndim != 1 or load.shape != points.shape or len(load) < 2:
            raise _PivotCurveError(f"load and deflection must be 1-D and alike, got {load.shape} and {points.shape}")
        if not (np.all(np.isfinite(load)) and np.all(np.isfinite(points))):
            raise _PivotCurveError("a pivot curve must be finite")
        if np.any(np.diff(load) <= 0) or np.any(np.diff(points) <= 0):
            raise _PivotCurveError("a pivot curve must rise strictly in load and deflection")
        with np.errstate(over="ignore"):  # an infinite slope is refused in the next line
            slopes = np.diff(points) / np.diff(load)
        if not np.all((slopes > 1e-100) & (slopes < 1e100)):
            raise _PivotCurveError("a pivot curve must have slopes that are numbers")
        if load[0] != 0.0 or points[0] != 0.0:
            load, points = np.concatenate([[0.0], load]), np.concatenate([[0.0], points])
            if load[1] <= 0 or points[1] <= 0:
                raise _PivotCurveError("a pivot curve must start at or above zero load and deflection")
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "deflection_points", points)
        object.__setattr__(self, "_coefficients", monotone_cubics(load, points))

    @property
    def coefficients(self) -> FloatArray:
        """Of the cubics between the points, highest power first, (4, n - 1)."""
        return self._coefficients

    def _piece(self, load: float) -> tuple[int, float]:
        i = int(np.searchsorted(self.load, load, side="right")) - 1
        i = min(max(i, 0), len(self.load) - 2)
        return i, load - self.load[i]

    def deflection(self, load: float) -> float:
        """delta(W) [m]."""
        if load <= 0:
            return 0.0
        end = self.load[-1]
        i, s = self._piece(min(load, end))
        c = self._coefficients[:, i]
        value = float(((c[0] * s + c[1]) * s + c[2]) * s + c[3])
        return value if load <= end else value + (load - end) * self._compliance(end)

    def _compliance(self, load: float) -> float:
        i, s = self._piece(min(max(load, 0.0), self.load[-1]))
        c = self._coefficients[:, i]
        return max(float((3 * c[0] * s + 2 * c[1]) * s + c[2]), 1e-15)

    def stiffness(self, load: float) -> float:
        """Tangent dW/ddelta [N/m]."""
        return 1.0 / self._compliance(load)

    vibration_stiffness = stiffness

    def extrapolated(self, load: float) -> bool:
        """Whether `load` lies beyond what was measured."""
        return not self.valid_from <= load <= self.valid_to

    def without_housing(self, compliance: float) -> MeasuredPivot:
        """Return the pivot alone, where a housing of this compliance [m/N] is modelled apart from it.

        What is left keeps at least `_LEAST_SHARE` of the measured give: a housing softer than the curve it is part of
        cannot be taken off it. A curve that holds no housing is returned as it is; of one that does, more than one
        part of the structure may be taken off.
        """
        if not self.includes_housing:
            return self
        deflections = np.diff(self.deflection_points)
        alone = np.maximum(deflections - compliance * np.diff(self.load), _LEAST_SHARE * deflections)
        points = np.concatenate([[0.0], np.cumsum(alone)])
        return replace(self, deflection_points=points)

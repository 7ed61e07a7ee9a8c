"""Pivot laws as rows of `model.pad.pivot`: the printed formulas, and the monotone curve of a dry test."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from model.errors import ModelError
from model.interpolation import rising_cubics
from model.pad.pivot import MEASURED, compliance, deflection
from rigdata.arrays import FloatArray


class _PivotCurveError(ModelError):
    """A measured load-deflection curve that no pivot has."""


#: Least part of a measured give that a pivot keeps when a housing is taken off it.
_LEAST_SHARE = 0.02


class _Law:
    """A law that is a row of numbers, and of a measured one its curve."""

    numbers: Any
    curve: FloatArray = np.zeros((5, 1))
    secant_vibrations: bool = False

    def deflection(self, load: float) -> float:
        """delta(W) [m]."""
        return float(deflection(self.numbers, self.curve, load))

    def stiffness(self, load: float) -> float:
        """Tangent dW/ddelta [N/m]; infinite for a rigid pivot."""
        flexibility = float(compliance(self.numbers, self.curve, load))
        return 1.0 / flexibility if flexibility else math.inf

    def secant(self, load: float) -> float:
        """K as printed [N/m]."""
        return max(load, 1e-9) / self.deflection(max(load, 1e-9))

    def vibration_stiffness(self, load: float) -> float:
        """Tangent, or the printed secant [N/m]."""
        return self.secant(load) if self.secant_vibrations else self.stiffness(load)


@dataclass(frozen=True)
class FormulaPivot(_Law):
    """A formula of `model.pad.pivot`: `numbers` are which it is, two constants, a factor on the stiffness."""

    numbers: tuple[int, float, float, float]
    name: str
    secant_vibrations: bool = False


@dataclass(frozen=True, eq=False)  # arrays have no single truth value: a curve equals itself only
class MeasuredPivot(_Law):
    """A measured monotone curve, interpolated with a continuous tangent (PCHIP in load).

    Beyond the last point the curve goes on with its last tangent.
    """

    load: FloatArray  #: (n,) [N], and (n,) [m]: strictly increasing, from (0, 0).
    deflection_points: FloatArray
    name: str = "measured"
    includes_housing: bool = True
    #: Largest load of its dry test [N].
    valid_to: float = math.inf
    #: (5, n): Loads, and from each on the cubic's coefficients, highest power first.
    curve: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        load = np.asarray(self.load, float)
        points = np.asarray(self.deflection_points, float)
        if load.ndim != 1 or load.shape != points.shape or len(load) < 2:
            raise _PivotCurveError(f"load and deflection must be 1-D and alike, got {load.shape} and {points.shape}")
        if load[0] != 0.0 or points[0] != 0.0:
            load, points = np.append(0.0, load), np.append(0.0, points)
        for name, values in (("load", load), ("deflection", points)):
            for before, after in itertools.pairwise(values):
                if not after > before:
                    fault = f"{name} goes from {before:g} to {after:g}"
                    raise _PivotCurveError(f"a pivot curve must rise strictly from zero: {fault}")
        with np.errstate(over="ignore"):  # an infinite slope is refused in the next line
            slopes = np.diff(points) / np.diff(load)
        if not np.all((slopes > 1e-100) & (slopes < 1e100)):
            raise _PivotCurveError("a pivot curve must have slopes that are numbers")
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "deflection_points", points)
        cubics = np.append(rising_cubics(load, points), np.zeros((4, 1)), axis=1)
        object.__setattr__(self, "curve", np.vstack([load, cubics]))

    @property
    def numbers(self) -> Any:
        """Row of `model.pad.pivot`."""
        return MEASURED, len(self.load), 0.0, 1.0

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
        return replace(self, deflection_points=np.append(0.0, np.cumsum(alone)))

"""Gains and axes of two probes, as the sides of a clearance polygon tell them: these stand across the pads.

Positions come out as D^-1 R p, with D of the stated axes, R of the true ones and their gains; a side's normal turns as
its inverse transpose does. A gain that both share leaves all directions as they are.
"""

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions, wrapped
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.clearance.polygon import TILT_SPREAD

#: By how much pads stand elsewhere than stated [rad]; what is plausible of gains and turns, one deviation; steps to
#: their most probable values, and standard errors from which one is off.
_PADS, _PLAUSIBLE, _STEPS, _CLEAR = 0.01, 0.3, 8, 4.0
#: Pads from which the sides tell gains and axes.
MIN_PADS = 4


def probe_errors(polygon: ClearancePolygon, axes: Sequence[float]) -> ComplexArray:
    """Logarithm of the gain + i turn [rad] of each of two probes on `axes` [rad], (2,); zero where they are as stated.

    Which of two gains is off the sides do not tell: each may be by all of it.
    """
    fitted = polygon.as_read[1] if polygon.as_read else polygon.fitted_angle
    told = np.isfinite(fitted)
    # without the sides' prior, which takes machined ones for granted
    precision = np.maximum(polygon.fitted_angle_se[told] ** -2 - TILT_SPREAD**-2, 1e-3 * TILT_SPREAD**-2)
    angles = polygon.angles[told]
    tilt = (fitted[told] - angles) * (1 + TILT_SPREAD**-2 / precision)
    weight, normals, stated = 1 / np.hypot(precision**-0.5, _PADS), directions(angles), np.asarray(axes)

    def left(numbers: FloatArray) -> FloatArray:
        true = directions(stated + numbers[1:]) * [[1 + numbers[0]], [1.0]]
        turned = normals @ np.linalg.inv(np.linalg.solve(directions(stated), true))
        off = wrapped(angles + tilt - np.arctan2(turned[:, 1], turned[:, 0]))
        return np.append(weight * off, numbers / _PLAUSIBLE)

    numbers = np.zeros(3)
    for _ in range(_STEPS):
        slopes = np.stack([(left(numbers + step) - left(numbers - step)) / 2e-6 for step in 1e-6 * np.eye(3)], axis=1)
        numbers = np.clip(numbers - np.linalg.lstsq(slopes, left(numbers), rcond=None)[0], -0.7, 0.7)
    numbers *= np.abs(numbers) > _CLEAR * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    gain = float(np.log1p(numbers[0]))
    return np.array([gain, -gain]) + 1j * numbers[1:]


def beside_the_usual(errors: ComplexArray) -> ComplexArray:
    """Errors of sensors (m,) less what most are off by, where a witness that is not off counts as one."""
    return errors - complex(np.median([*errors.real, 0.0]), np.median([*errors.imag, 0.0]))

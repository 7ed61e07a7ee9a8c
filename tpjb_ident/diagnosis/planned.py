"""Planned: the observation vector of tests that have not been run, from the model and an assumed noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from model.setup import Setup
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.observations.constants import Tolerance
from tpjb_ident.diagnosis.observations.gap import direct_scale
from tpjb_ident.diagnosis.observations.observe import (
    DryTest,
    DynamicTest,
    Layout,
    LocusTest,
    Observations,
    all_elements,
)

#: Standard errors that a well-run test reaches (the sample campaigns' own): share of the mean direct coefficient,
#: position [m], temperature [K], share of a dry compliance, angle of a polygon side [rad].
_STIFFNESS, _POSITION, _TEMPERATURE, _DRY, _ANGLE = 0.001, 0.1e-6, 0.05, 0.008, 3e-4


def planned_observations(setup: Setup, layout: Layout) -> Observations:
    """What the baseline predicts for a layout, with the covariance one may expect."""
    tolerance = Tolerance()
    elements = all_elements(layout, [pad.pivot_angle for pad in setup.bearing.pads])
    value = Forward(setup, layout, elements)()
    scale = direct_scale(elements, value)
    table: dict[str, tuple[np.ndarray | float, np.ndarray | float]] = {
        "h": (_STIFFNESS * scale, tolerance.stiffness * scale),
        "temperature": (_TEMPERATURE, tolerance.temperature),
        "locus": (_POSITION, tolerance.position),
        "load": (tolerance.load_miss, tolerance.load),
        "dry": (_DRY, tolerance.dry),
        "clearance": (_POSITION, tolerance.position),
        "side": (_ANGLE, tolerance.angle),
    }
    columns = np.zeros((2, len(value)))
    for i, e in enumerate(elements):
        row = table["side" if e.observable == "side_angle" else e.family]
        columns[:, i] = [float(np.broadcast_to(v, value.shape)[i]) for v in row]
    return Observations(layout, value, np.diag(columns[0] ** 2), columns[1], elements)


def dynamic(
    loads: Sequence[float], lines: Sequence[float], speed: float, direction: float, pads: int
) -> tuple[DynamicTest, ...]:
    """Dynamic tests at several loads, all lines at each; `pads` with a temperature sensor (0: none)."""
    sensors = tuple(range(1, pads + 1))
    return tuple(DynamicTest(float(w), direction, speed, tuple(map(float, lines)), sensors) for w in loads)


def around(load: float, count: int, speed: float) -> tuple[LocusTest, ...]:
    """Return a locus of evenly spread load directions."""
    return tuple(LocusTest(load, -math.pi / 2 + 2 * math.pi * k / count, speed) for k in range(count))


def dry(pads: Sequence[int], loads: Sequence[float] = (1000.0, 2750.0, 4700.0)) -> tuple[DryTest, ...]:
    """Dry tests on pads."""
    return tuple(DryTest(pad, tuple(loads)) for pad in pads)

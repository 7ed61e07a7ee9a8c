"""Planned: the observation vector of tests that have not been run, from the model and an assumed noise."""

import math
from collections.abc import Sequence

import numpy as np

from model.setup import Setup
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.observations.constants import TRUSTED, Deciding
from tpjb_ident.diagnosis.observations.observe import (
    DryTest,
    DynamicTest,
    Layout,
    LocusTest,
    Observations,
    all_elements,
    by_family,
    stated_sigma,
)

#: Standard errors that a well-run test reaches (the sample campaigns' own): share of the mean direct coefficient,
#: temperature [K], positions [m], share of a dry compliance, angle of a polygon side [rad].
_NOISE = {"h": 0.001, "temperature": 0.05, "locus": 0.1e-6, "clearance": 0.1e-6, "dry": 0.008, "side_angle": 3e-4}


def planned_observations(setup: Setup, layout: Layout) -> Observations:
    """What the baseline predicts for a layout, with the covariance one may expect."""
    elements = all_elements(layout, setup.bearing.pivot_angles)
    value = Forward(setup, layout, elements)()
    noise = by_family(elements, value, {**_NOISE, "load": Deciding.missed[0]})
    return Observations(layout, value, np.diag(noise**2), stated_sigma(elements, value, TRUSTED["h"]), elements)


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

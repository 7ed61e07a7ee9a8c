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
    ENTRY_NAMES,
    DryTest,
    DynamicTest,
    Element,
    Layout,
    LocusTest,
    Observations,
)

#: Standard errors that a well-run test reaches (the sample campaigns' own): share of the mean direct coefficient,
#: position [m], temperature [K], share of a dry compliance, angle of a polygon side [rad].
_STIFFNESS, _POSITION, _TEMPERATURE, _DRY, _ANGLE = 0.001, 0.1e-6, 0.05, 0.008, 3e-4


def planned_observations(setup: Setup, layout: Layout) -> Observations:
    """What the baseline predicts for a layout, with the covariance one may expect."""
    tolerance = Tolerance()
    elements = _elements(layout, [pad.pivot_angle for pad in setup.bearing.pads])
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


def _elements(layout: Layout, angles: Sequence[float]) -> tuple[Element, ...]:
    out: list[Element] = []
    for test in layout.dynamic:
        base = (("load", test.load), ("direction", test.direction), ("speed", test.speed))
        for omega in test.excitation:
            place = (*base, ("excitation", omega))
            out += [Element("h", f"{part}{entry}", place) for part in "kc" for entry in ENTRY_NAMES]
        out += [Element("temperature", "pad_temperature", (*base, ("pad", float(k)))) for k in test.pads]
    for locus_test in layout.locus:
        where3 = (("load", locus_test.load), ("direction", locus_test.direction), ("speed", locus_test.speed))
        out += [Element("locus", f"locus_{a}", where3) for a in "xy"]
        out += [Element("load", f"load_{a}", where3) for a in ("ratio", "turn")]
    for dry in layout.dry:
        out += [Element("dry", "dry_compliance", (("pad", float(dry.pad)), ("load", load))) for load in dry.load]
    if layout.push_load is not None:
        places = [(("pad", k + 1.0), ("angle", angle)) for k, angle in enumerate(angles)]
        out += [Element("clearance", name, p) for name in ("clearance_pushed", "side_angle") for p in places]
    return tuple(out)


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

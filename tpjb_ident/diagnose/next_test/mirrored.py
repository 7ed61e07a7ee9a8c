"""Mirrored: the other sense of rotation, as the model knows only one.

A bearing whose shaft turns clockwise is, seen in a mirror, one whose shaft turns counter-clockwise. The mirror stands
along the y axis: x becomes -x, angles become pi minus themselves, cross terms change their sign, and what was the
leading edge of a pad is the trailing one.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from model.arrays import ComplexArray
from model.instruments import Instruments, SensorMap
from model.setup import Setup
from tpjb_ident.diagnose.observations.layout import DynamicTest, Layout

_MIRROR = np.diag([-1.0, 1.0])
#: How far from the middle of its pad a pivot may sit for the shaft to turn either way [share of the arc].
CENTRAL = 0.05


def reversible(setup: Setup) -> bool:
    """Whether every pad would carry with the shaft turning the other way.

    Parameters
    ----------
    setup : Setup
        Bearing, oil, pivots, structure and instruments of the model.
    """
    return all(abs(pad.pivot_offset - 0.5) <= CENTRAL for pad in setup.bearing.pads)


def mirrored(setup: Setup) -> Setup:
    """The set-up as a mirror shows it: its answers at a mirrored layout are those of the other sense of rotation.

    Parameters
    ----------
    setup : Setup
        Bearing, oil, pivots, structure and instruments of the model.
    """
    angle, towards = setup.misalignment
    turned = setup.change_pads(
        lambda k, pad: replace(pad, pivot_angle=math.pi - pad.pivot_angle, pivot_offset=1.0 - pad.pivot_offset)
    )
    return turned.change(misalignment=(angle, math.pi - towards), instruments=_instruments(setup.instruments))


def mirrored_layout(layout: Layout) -> Layout:
    """Dynamic tests as a mirror shows them, thermometers where they sit.

    Parameters
    ----------
    layout : Layout
        Tests, with their operating points.
    """
    tests = tuple(DynamicTest(t.load, math.pi - t.direction, t.speed, t.excitation, t.pads) for t in layout.dynamic)
    return Layout(tests, temperature_position=tuple(1.0 - place for place in layout.temperature_position))


def _instruments(read: Instruments) -> Instruments:
    return replace(read, displacement=tuple(map(_map, read.displacement)), force=tuple(map(_map, read.force)))


def _map(one: SensorMap) -> SensorMap:
    def seen(omega: float) -> ComplexArray:
        return np.asarray(_MIRROR @ one(omega) @ _MIRROR)

    return seen

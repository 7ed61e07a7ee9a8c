"""Sensors of a campaign as the equation knows them, and what its housing stands on."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.campaign import Campaign
from tpjb_ident.estimate.blocks import QUANTITIES, Blocks, Rig, Sensor, vector

#: Distance of a / (w^2 d) from what it is of a floating housing, on both axes, within which the housing floats.
_FLOATS = 0.3
#: Motion of a floating housing's shaft over that of the housing, at most.
_SHAFT = 0.4
#: Cells over set points between which the cells carry the static load.
_CARRIED = (0.5, 2.0)
#: A sensor whose phasors are below this share of its quantity's is dead.
_NOTHING = 1e-6
#: Gain uncertainty of a sensor of more than two for which the manifest states none, as `[tolerances] probe_gain` has
#: it: what such sensors tell of one another needs one.
_USUAL_GAIN = 0.005
#: Low corners that are plausible where none is stated, by quantity, one deviation [Hz]: see `terms.corner`.
CORNERS = {"force": 0.5, "acceleration": 1.0}


def sensors_of(campaign: Campaign) -> tuple[Sensor, ...]:
    """Probes, cells and accelerometers of a campaign's dynamic runs."""
    channels = dict(campaign.channels)
    for run in campaign.of_kind("dynamic"):
        channels = dict(run.channels) | channels
    sensors: list[Sensor] = []
    for quantity in QUANTITIES:
        alike = [channel for channel in channels.values() if channel.quantity == quantity and channel.axis is not None]
        unstated = _USUAL_GAIN if len(alike) > 2 else None
        sensors += [
            Sensor(
                channel.name,
                quantity,
                unstated if channel.uncertainty is None else channel.uncertainty,
                channel.axis_uncertainty,
                channel.delay_uncertainty,
                channel.clock,
                channel.plane,
                channel.temperature_coefficient_uncertainty,
                0.0 if _has_low_corner(channel) else CORNERS.get(quantity, 0.0),
                axis=float(channel.axis or 0.0),
            )
            for channel in alike
        ]
    return tuple(sensors)


def _has_low_corner(channel: Channel) -> bool:
    """Whether a filter that is stated ends at a low corner, or the response was measured."""
    return any(getattr(filtered, "side", "high") == "high" for filtered in channel.response.filters)


def alive(sensors: Sequence[Sensor], size: FloatArray, least: float = _NOTHING) -> BoolArray:
    """Which sensors show something of what the largest of their quantity does, (m,); `size` (m,) of their phasors."""
    largest: dict[str, float] = {}
    for sensor, amplitude in zip(sensors, size.tolist()):
        largest[sensor.quantity] = max(amplitude, largest.get(sensor.quantity, 0.0))
    return np.array(
        [amplitude > least * largest[sensor.quantity] for sensor, amplitude in zip(sensors, size)], dtype=bool
    )


def axes_of(channels: Sequence[Channel | None]) -> FloatArray:
    """Unit vectors of the axes (m, 2); zero where a run has no such channel."""
    rows = [(0.0, 0.0) if c is None else (np.cos(c.axis or 0.0), np.sin(c.axis or 0.0)) for c in channels]
    return np.array(rows)


def campaign_rig(campaign: Campaign, sensors: tuple[Sensor, ...], blocks: Blocks, ratio: complex, **known: Any) -> Rig:
    """The rig of a campaign's dynamic runs; `ratio`: cells over set points of all runs, zero where they show none.

    `known`: what else is of the rig, by name.
    """
    mount = found_mount(sensors, blocks, getattr(campaign, "mount", None), ratio)
    return Rig(sensors, campaign.housing_mass, campaign.mass_uncertainty, mount, static=ratio != 0, **known)


def found_mount(sensors: Sequence[Sensor], blocks: Blocks, stated_mount: str | None, ratio: complex) -> str:
    """Whether the housing stands on its cells or floats: as stated, else by a over w^2 d.

    That is -c h of a housing on springs, 1 + g h of one that floats, c and g the compliance of what gives way. Without
    accelerometers cells tell that carry the static load (`ratio`: cells over set points of all runs): the housing
    stands on them. Cells of a floating stator show none; then it is "unknown".
    """
    if stated_mount:
        return stated_mount
    rig = Rig(tuple(sensors), 1.0)
    carried = "cells" if _CARRIED[0] < abs(ratio) < _CARRIED[1] else "unknown"
    if len(rig.of("acceleration")) < 2:
        return carried
    a = vector(rig, blocks, "acceleration")
    d = vector(rig, blocks, "displacement")
    force = vector(rig, blocks, "force")
    usable = np.isfinite(a).all(axis=1) & np.isfinite(d).all(axis=1) & np.isfinite(force).all(axis=1)
    if not usable.any():
        return carried
    square = (blocks.omega[usable] ** 2)[:, None]
    d, force, a = square * d[usable], square * force[usable], a[usable]
    power = np.maximum(np.sum(np.abs(d) ** 2, axis=0), 1e-300)
    quotient, h = np.sum(d.conj() * a, axis=0) / power, np.sum(d.conj() * force, axis=0) / power
    standing, floating = _remainder(-quotient, h, np.inf), _remainder(quotient - 1, h, _SHAFT)
    return "floating" if floating.max() < _FLOATS and floating.sum() < standing.sum() else "cells"


def _remainder(share: ComplexArray, h: ComplexArray, most: float) -> FloatArray:
    """What a compliance times h (2,), nought to `most`, leaves of a share of the motion (2,)."""
    along = h / np.maximum(np.abs(h), 1e-300)
    return np.abs(share - np.clip((share * along.conj()).real, 0.0, most) * along)

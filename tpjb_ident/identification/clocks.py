"""Clocks of further devices, found as a solve of the records goes on: whether there are any, and how fast they run.

Cells on a clock that is off by e turn against the probes by 2 pi f e per second, alike in all runs and at all lines in
proportion to their frequency. A beat or a wander of one device does neither. So a clock is supposed only where one
rate explains the slopes of all runs; where the manifest states clocks, they are as stated. Over a band its responses
turn as the windows of sines do.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Sensor
from tpjb_ident.terms.clock import START, Clock

if TYPE_CHECKING:
    from tpjb_ident.identification.band_solution import BandSolution
    from tpjb_ident.identification.campaign_solution import CampaignSolution

#: Standard errors beyond which a rate is one, and phase [rad] over a record from which it matters.
_CLEAR, _NOTABLE = 6.0, 2e-3
#: Probability below which one rate does not explain the runs' slopes.
_ONE_RATE = 1e-3
#: Share of the runs that tell it, those nearest to their median.
_USUAL = 0.8
#: Passes over the records in which the clocks' rates are found, at most, and phase [rad] over a record that the solve
#: puts right by itself.
_CLOCK_PASSES, _TURNED = 2, 1e-2


#: Of sines, or over bands.
Answer = TypeVar("Answer", "CampaignSolution", "BandSolution")


def solved_with_clocks(
    sensors: tuple[Sensor, ...], rate: float, solve: Callable[[tuple[Sensor, ...], Mapping[str, float]], Answer]
) -> Answer:
    """Solve, find the devices, and solve again with the rates of their clocks put right in the records.

    `solve` takes sensors and the rates found by device; `rate` [Hz] of the records. Devices that the manifest states
    are taken at their times; one that was found started within a sample of the first.
    """
    answer = solve(sensors, {})
    sensors, rates = with_found_devices(sensors, answer.solution.blocks, START / rate)
    if rates:
        answer = solve(sensors, rates)
    for _ in range(_CLOCK_PASSES if len({sensor.device for sensor in sensors}) > 1 else 0):
        solution, blocks = answer.solution, answer.solution.blocks
        more = Clock(solution.rig, blocks).rates(solution.fitted[Clock.name].value)
        turn = max(map(abs, more.values())) * float((2 * blocks.time * blocks.omega).max())
        if turn < _TURNED:
            break
        rates = {device: rates.get(device, 0.0) + change for device, change in more.items()}
        answer = solve(sensors, rates)
    return answer


def with_found_devices(
    sensors: tuple[Sensor, ...], blocks: Blocks, start: float
) -> tuple[tuple[Sensor, ...], dict[str, float]]:
    """The sensors, cells and accelerometers with devices of their own where their phases show them, and their rates.

    They started within `start` [s] of the first, one deviation.
    """
    force = None if any(sensor.device for sensor in sensors) else _rate(sensors, blocks, "force")
    if force is None or not force.clear:
        return sensors, {}
    acceleration = _rate(sensors, blocks, "acceleration")
    # too weak to tell: as a rule accelerometers are recorded with the cells
    devices, rates = {"force": "cells", "acceleration": "cells"}, {"cells": force.rate}
    if acceleration is not None and abs(acceleration.rate - force.rate) > _CLEAR * np.hypot(
        acceleration.error, force.error
    ):
        devices["acceleration"] = "accelerometers" if acceleration.clear else ""
        rates |= {"accelerometers": acceleration.rate} if acceleration.clear else {}
    separate = [replace(s, device=devices.get(s.quantity, "")) for s in sensors]
    return tuple(replace(s, delay_uncertainty=s.delay_uncertainty or start) if s.device else s for s in separate), rates


class _Rate(NamedTuple):
    rate: float
    error: float  #: standard error
    clear: bool  #: whether it is a rate of its own


def _rate(sensors: Sequence[Sensor], blocks: Blocks, quantity: str) -> _Rate | None:
    """Rate of a quantity's clock against the probes'; None where no one rate explains the runs."""
    rows = [j for j, sensor in enumerate(sensors) if sensor.quantity == quantity]
    probes = [j for j, sensor in enumerate(sensors) if sensor.quantity == "displacement"]
    usable = (blocks.windows > 3) & blocks.present[:, rows + probes].all(axis=1)
    if not rows or usable.sum() < 2:
        return None
    turn, turn_error = _turning(blocks, rows)
    probe, probe_error = _turning(blocks, probes)
    rate, error = ((probe - turn) / blocks.omega)[usable], (np.hypot(turn_error, probe_error) / blocks.omega)[usable]
    # a run that slipped tells nothing of a rate
    near = np.argsort(np.abs(rate - np.median(rate)) / error)[: max(2, int(_USUAL * len(rate)))]
    weight = 1 / np.hypot(error, np.median(error)) ** 2
    middle, doubt = float(np.average(rate[near], weights=weight[near])), float(1 / np.sqrt(np.sum(weight)))
    alike = float(chdtrc(len(near), np.sum(((rate - middle)[near] / error[near]) ** 2))) > _ONE_RATE
    turned = float(np.median(np.abs(rate) * 2 * (blocks.omega * blocks.time)[usable]))
    return _Rate(middle, doubt, abs(middle) > _CLEAR * doubt and turned > _NOTABLE) if alike else None


def _turning(blocks: Blocks, rows: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Rate at which the phase of some sensors turns (n,) [rad/s], and its standard error (n,)."""
    z: ComplexArray = blocks.z[:, rows]
    power = np.maximum(np.sum(np.abs(z) ** 2, axis=1), 1e-300)
    turning = np.sum(z.conj() * blocks.slope[:, rows], axis=1).imag / power
    noise = blocks.slope_noise[:, rows][:, :, rows]
    variance = np.einsum("ni,nij,nj->n", z.conj(), noise, z).real / 2 / power**2
    return turning, np.sqrt(np.maximum(variance, 0.0))

"""Whether quantities were recorded by devices of their own, where the manifest states no clock.

Cells on a clock that is off by e turn against the probes by 2 pi f e per second, alike in all runs and at all lines in
proportion to their frequency. A beat or a wander of one device does neither. So a clock is supposed only where one
rate explains the slopes of all runs; where the manifest states clocks, they are as stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Sensor

#: Standard errors beyond which a rate is one, and phase [rad] over a record from which it matters.
_CLEAR, _NOTABLE = 6.0, 2e-3
#: Probability below which one rate does not explain the runs' slopes.
_ONE_RATE = 1e-3
#: Rounds of the robust mean over the runs.
_ROUNDS = 10


def with_found_devices(sensors: Sequence[Sensor], blocks: Blocks) -> tuple[Sensor, ...]:
    """The sensors, cells and accelerometers with devices of their own where their phases show them."""
    if any(sensor.device for sensor in sensors):
        return tuple(sensors)
    force = _rate(sensors, blocks, "force")
    if force is None or not force.clear:
        return tuple(sensors)
    acceleration = _rate(sensors, blocks, "acceleration")
    # too weak to tell: as a rule accelerometers are recorded with the cells
    device = "cells"
    if acceleration is not None and abs(acceleration.rate - force.rate) > _CLEAR * np.hypot(
        acceleration.error, force.error
    ):
        device = "accelerometers" if acceleration.clear else ""
    names = {"force": "cells", "acceleration": device}
    return tuple(replace(sensor, device=names.get(sensor.quantity, "")) for sensor in sensors)


@dataclass(frozen=True)
class _Rate:
    rate: float
    error: float  #: standard error
    clear: bool  #: whether it is a rate of its own


def _rate(sensors: Sequence[Sensor], blocks: Blocks, quantity: str) -> _Rate | None:
    """Rate of a quantity's clock against the probes'; None where no one rate explains the runs."""
    rows = [j for j, sensor in enumerate(sensors) if sensor.quantity == quantity]
    probes = [j for j, sensor in enumerate(sensors) if sensor.quantity == "displacement"]
    told = (blocks.windows > 3) & blocks.present[:, rows + probes].all(axis=1)
    if not rows or told.sum() < 2:
        return None
    own, own_error = _turning(blocks, rows)
    probe, probe_error = _turning(blocks, probes)
    rate = (probe - own)[told] / blocks.omega[told]
    error = np.hypot(own_error, probe_error)[told] / blocks.omega[told]
    weight = 1 / np.hypot(error, np.median(error)) ** 2
    middle = float(np.median(rate))
    for _ in range(_ROUNDS):
        distance = np.abs(rate - middle)
        scale = max(1.4826 * float(np.median(distance)), float(np.median(error)))
        robust = weight * np.minimum(1.0, 1.5 * scale / np.maximum(distance, 1e-300))
        middle = float(np.sum(robust * rate) / np.sum(robust))
    doubt = float(1 / np.sqrt(np.sum(weight)))
    half = np.argsort(distance / error)[: max(2, int(0.8 * len(rate)))]
    chi_square = float(np.sum((rate[half] - middle) ** 2 / error[half] ** 2))
    alike = float(chdtrc(len(half), chi_square)) > _ONE_RATE
    turned = float(np.median(np.abs(rate) * blocks.omega[told] * 2 * blocks.time[told]))
    return _Rate(middle, doubt, abs(middle) > _CLEAR * doubt and turned > _NOTABLE) if alike else None


def _turning(blocks: Blocks, rows: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Rate at which the phase of some sensors turns (n,) [rad/s], and its standard error (n,)."""
    z: ComplexArray = blocks.z[:, rows]
    power = np.maximum(np.sum(np.abs(z) ** 2, axis=1), 1e-300)
    turning = np.sum(z.conj() * blocks.slope[:, rows], axis=1).imag / power
    noise = blocks.slope_noise[:, rows][:, :, rows]
    variance = np.einsum("ni,nij,nj->n", z.conj(), noise, z).real / 2 / power**2
    return turning, np.sqrt(np.maximum(variance, 0.0))

"""From motion to readings: axes, gains, delays, runout, noise, glitches, zero, then the converter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.virtual_rig.instruments import Instruments, Sensor
from rigdata.virtual_rig.motion import RunPhysics
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.noise_signals import channel_noise


@dataclass(frozen=True)
class Glitch:
    """One burst: a channel stands off by `size` (SI) over some samples."""

    channel: str
    first: int
    count: int
    size: float


@dataclass(frozen=True)
class Readings:
    """What the recorder gets: one array (n,) per channel in the channel's own unit, and the times (n,) [s]."""

    time: FloatArray = field(repr=False)
    columns: dict[str, FloatArray] = field(repr=False)
    rate: float


def analogue_readings(
    physics: RunPhysics, instruments: Instruments, noise: Noise, seed: int, run: str
) -> dict[str, FloatArray]:
    """Readings of all sensors before the converter, each (n,) in its own unit.

    Parameters
    ----------
    physics : RunPhysics
    instruments : Instruments
    noise : Noise
    seed : int
        Of the random numbers.
    run : str
        Run id.
    """
    time = physics.time
    disturbance = channel_noise(instruments.sensors, noise, time, seed, run)
    vectors: dict[tuple[str, float], FloatArray] = {}
    columns = {}
    for sensor, added in zip(instruments.sensors, disturbance):
        key = (sensor.quantity, sensor.error.delay)
        if sensor.axis is not None and key not in vectors:
            # sampled at the delayed time instead of shifted: exact for any fraction of a sample
            vectors[key] = physics.motion.at(sensor.quantity, time - sensor.error.delay)
        value = sensed(sensor, instruments, physics, vectors.get(key))
        error = sensor.error
        columns[sensor.name] = (
            sensor.polarity * sensor.scale * (error.gain * value + error.offset + added) + sensor.zero
        )
    return columns


def sensed(sensor: Sensor, instruments: Instruments, physics: RunPhysics, vector: FloatArray | None) -> FloatArray:
    """Quantity (n,) [SI, degC for temperatures] that a sensor feels, from the vector (n, 2) at its delayed time.

    Parameters
    ----------
    sensor : Sensor
    instruments : Instruments
    physics : RunPhysics
    vector : (n, 2) ndarray or None
        X and Y of the quantity at the delayed time; None for one without a direction.
    """
    n = len(physics.time)
    if sensor.quantity == "temperature":
        return np.full(n, physics.motion.temperature[(sensor.pad or 1) - 1])
    if sensor.quantity == "speed" or vector is None or sensor.axis is None:
        return np.full(n, physics.motion.speed)
    value = vector @ felt_direction(sensor, instruments)
    if sensor.quantity == "displacement":
        late = physics.time - sensor.error.delay
        value = value + physics.motion.runout(sensor.axis + sensor.error.angle, late)
    return value


def felt_direction(sensor: Sensor, instruments: Instruments) -> FloatArray:
    """Vector (2,) whose product with the quantity gives what the sensor feels: its axis, and cross-talk.

    Parameters
    ----------
    sensor : Sensor
    instruments : Instruments
    """
    direction = sensor.direction
    if sensor.error.cross:
        direction = direction + sensor.error.cross * instruments.partner(sensor).direction
    return direction


def draw_glitches(instruments: Instruments, noise: Noise, samples: int, seed: int, run: str) -> tuple[Glitch, ...]:
    """Draw the glitches of a run.

    Parameters
    ----------
    instruments : Instruments
    noise : Noise
    samples : int
        Of the run.
    seed : int
        Of the random numbers.
    run : str
        Run id.
    """
    rules = noise.glitches
    channels = [s for s in instruments.sensors if s.quantity in ("displacement", "force")]
    rng = stream(seed, run, "glitches")
    found: list[Glitch] = []
    while channels and len(found) < 4 and rng.uniform() < rules.share:
        sensor = channels[rng.integers(len(channels))]
        largest = rules.displacement if sensor.quantity == "displacement" else rules.force
        count = min(int(rng.integers(rules.shortest, rules.longest, endpoint=True)), samples)
        size = float(rng.uniform(0.4, 1.0) * largest * rng.choice([-1.0, 1.0]))
        found.append(Glitch(sensor.name, int(rng.integers(0, samples - count + 1)), count, size))
    return tuple(found)


def add_glitches(columns: dict[str, FloatArray], instruments: Instruments, glitches: Iterable[Glitch]) -> None:
    """Put bursts into the readings, in place.

    Parameters
    ----------
    columns : dict of str to (n,) ndarray
        Readings by channel, changed in place.
    instruments : Instruments
    glitches : iterable of Glitch
    """
    for glitch in glitches:
        sensor = instruments.named(glitch.channel)
        burst = slice(glitch.first, glitch.first + glitch.count)
        columns[glitch.channel][burst] += sensor.polarity * sensor.scale * glitch.size


def converted(reading: FloatArray, sensor: Sensor, bits: int | None) -> FloatArray:
    """Reading after the converter: limited to its span and rounded to its steps.

    Parameters
    ----------
    reading : (n,) ndarray
        In the sensor's own unit.
    sensor : Sensor
    bits : int or None
        Of the converter; None for none.
    """
    if bits is None:
        return reading
    step = converter_step(sensor, bits)
    codes = np.clip(np.rint(reading / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return codes * step


def converter_step(sensor: Sensor, bits: int) -> float:
    """One step of the converter, in the reading's unit.

    Parameters
    ----------
    sensor : Sensor
    bits : int or None
        Of the converter; None for none.
    """
    return 2 * sensor.span / 2**bits

"""A test rig in closed form: every channel is a function of time, sampled on a clock of its own.

The shaft turns, the actuators push along a direction, the housing stands on its load cells (springs), and every
channel adds what channels add: noise, drift, mains, its device's clock, lag and filter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.rigs.closed_form_bearing import Bearing

#: Channels of the rig: quantity and axis [deg].
CHANNELS = {
    "D1": ("displacement", 45.0),
    "D2": ("displacement", 135.0),
    "F1": ("force", 0.0),
    "F2": ("force", 90.0),
    "A1": ("acceleration", 0.0),
    "A2": ("acceleration", 90.0),
}
NOISE = {"displacement": 0.04e-6, "force": 3.0, "acceleration": 0.02}
Response = Callable[[float], complex]
Reading = Callable[[np.ndarray, str, np.random.Generator], np.ndarray]


@dataclass(frozen=True)
class Device:
    """What a channel's device does: clock `rate_error`, recorded late by `lag` [s], `response` over frequency [Hz].

    `slow` is the rate [Hz] at which it samples before its values are interpolated to the export's rate; `hold`
    repeats values in place of interpolating. `gain` and `turn` [rad] are what the manifest does not know; `reading`
    makes any other fault of the values as read.
    """

    rate_error: float = 0.0
    lag: float = 0.0
    response: Response | None = None
    slow: float = 0.0
    hold: bool = False
    gain: float = 1.0
    turn: float = 0.0
    zero: float = 0.0
    source: str = ""
    reading: Reading | None = None


@dataclass(frozen=True)
class Rig:
    """Everything about a rig that is the same in all of its runs."""

    bearing: Bearing = field(default_factory=Bearing)
    channels: tuple[str, ...] = tuple(CHANNELS)
    devices: Mapping[str, Device] = field(default_factory=dict)
    housing_mass: float = 60.0
    cell_stiffness: tuple[float, float] = (4e8, 6e8)
    cell_loss: float = 0.0
    rate: float = 2000.0
    seconds: float = 3.0
    shaft: float = 22.0
    speed_drift: float = 0.0
    runout: tuple[float, ...] = (3e-6, 1e-6)
    unbalance: float = 20.0
    locked: bool = False
    keyphasor: bool = False
    mains: float = 50.0
    pickup: Mapping[str, float] = field(default_factory=lambda: {"displacement": 0.03e-6, "force": 1.0})
    amplitude: float = 0.1
    amplitudes: tuple[float, ...] = (1.0,)
    drive_harmonic: float = 0.01
    real_frequency: float = 0.0
    miss: tuple[float, float] = (0.003, 0.0035)
    gain_by_run: float = 0.0
    static: bool = True
    noise: float = 1.0
    elliptic: float = 0.1
    baseline: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Plan:
    """One run: set points and where the excitation goes [deg]; `dry` without oil and rotation."""

    id: str
    load: float
    frequency: float
    direction: float
    scale: float = 1.0
    dry: bool = False


@dataclass(frozen=True)
class Tone:
    """One line: frequency [Hz] and X, Y phasors of the three quantities."""

    frequency: float
    phasors: Mapping[str, np.ndarray]


def record(rig: Rig, plan: Plan, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """All channels of one run, SI."""
    load = plan.load * (1 + rig.miss[0] * rng.standard_normal())
    aside = rig.miss[1] * rng.standard_normal()
    tones = _tones(rig, plan, load, aside, rng)
    push = np.array([np.sin(aside), -np.cos(aside)]) * load
    mean = {
        "displacement": push / 2.4e8 + np.array([30e-6, -50e-6]),
        "force": push if rig.static else np.zeros(2),
        "acceleration": np.zeros(2),
    }
    shaft = _Shaft(rig, rng)
    gain = {q: 1 + rig.gain_by_run * rng.standard_normal() for q in ("displacement", "force", "acceleration")}
    angle = {q: rng.uniform(0, 2 * np.pi) for q in NOISE}
    n = round(rig.rate * rig.seconds)
    found = {}
    for name in rig.channels:
        device = rig.devices.get(name, Device())
        quantity, axis = CHANNELS[device.source or name]

        def at(t: np.ndarray, quantity: str = quantity, axis: float = axis, device: Device = device) -> np.ndarray:
            u = np.array([np.cos(np.radians(axis) + device.turn), np.sin(np.radians(axis) + device.turn)])
            value = np.full_like(t, mean[quantity] @ u)
            for tone in tones:
                response = 1.0 if device.response is None else device.response(tone.frequency)
                value += np.real(response * (tone.phasors[quantity] @ u) * np.exp(2j * np.pi * tone.frequency * t))
            value += 0.0 if plan.dry else shaft.seen(quantity, u, t)
            pickup = rig.pickup.get(quantity, 0.0)
            value += pickup * np.cos(2 * np.pi * rig.mains * t + angle[quantity] + axis)
            value *= device.gain * gain[quantity]
            value += rig.noise * NOISE[quantity] * rng.standard_normal(len(t))
            return value + device.zero

        values = _sampled(at, device, n, rig.rate, rng)
        found[name] = values if device.reading is None else device.reading(values, plan.id, rng)
    if rig.keyphasor:
        turn = shaft.angle(np.arange(n) / rig.rate) / (2 * np.pi) % 1.0
        found["KEY"] = 5.0 * np.clip(20 * (0.05 - np.abs(turn - 0.3)), 0, 1) + 0.05 * rng.standard_normal(n)
    return found


class _Shaft:
    """Runout, unbalance: lines that turn with the shaft, whose speed may drift over the run."""

    def __init__(self, rig: Rig, rng: np.random.Generator) -> None:
        self.rig, self.phase = rig, 0.7 if rig.locked else rng.uniform(0, 2 * np.pi)
        self.start = rig.shaft - 0.5 * rig.speed_drift

    def angle(self, t: np.ndarray) -> np.ndarray:
        """Of the shaft [rad]."""
        slope = self.rig.speed_drift / self.rig.seconds
        return 2 * np.pi * (self.start * t + 0.5 * slope * t**2) + self.phase

    def seen(self, quantity: str, u: np.ndarray, t: np.ndarray) -> np.ndarray:
        angle = self.angle(t)
        turned = np.arctan2(u[1], u[0])
        if quantity == "displacement":
            return np.sum([a * np.cos(k * (angle - turned)) for k, a in enumerate(self.rig.runout, 1)], axis=0)
        if quantity == "force":
            return self.rig.unbalance * np.cos(angle - turned + 0.3)
        return np.zeros_like(t)


def _sampled(at: Callable, device: Device, n: int, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Values of a channel on its own clock, as the export shows them on the common one."""
    t = np.arange(n) / rate
    if not device.slow:
        return np.asarray(at(t * (1 + device.rate_error) - device.lag))
    own = np.arange(-2, int(n / rate * device.slow) + 4) / device.slow + rng.uniform(0, 1) / device.slow * (
        device.slow * round(rate / device.slow) != rate
    )
    values = at(own * (1 + device.rate_error) - device.lag)
    if device.hold:
        return np.asarray(values[np.searchsorted(own, t, side="right") - 1])
    return np.interp(t, own, values)


def _tones(rig: Rig, plan: Plan, load: float, aside: float, rng: np.random.Generator) -> list[Tone]:
    f = rig.real_frequency or plan.frequency
    size = rig.amplitude * plan.load * plan.scale
    angle = np.radians(plan.direction)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    start = 0.0 if rig.locked else rng.uniform(0, 2 * np.pi)
    force = size * (along + 1j * rig.elliptic * across) * np.exp(1j * start)
    omega = 2 * np.pi * f
    if plan.dry:
        return [_tone(rig, f, np.zeros(2, complex), force / np.array(rig.baseline))]
    h = rig.bearing.h(omega, load, aside)
    d = np.linalg.solve(h, force)
    share = float(np.linalg.norm(d)) / rig.bearing.clearance
    stiffer = 1 + 0.75 * rig.bearing.third * share**2
    d = d / stiffer
    share /= stiffer
    tones = [_tone(rig, f, force, d)]
    second = rig.drive_harmonic * size * along * np.exp(2j * start + 0.5j)
    h2 = rig.bearing.h(2 * omega, load, aside)
    stiff = 0.5 * rig.bearing.second / rig.bearing.clearance * np.abs(np.diag(h))
    film2 = stiff * np.array([0.5 * d[0] ** 2 + 1.2 * d[0] * d[1], d[1] ** 2 + 0.4 * d[0] ** 2])
    tones.append(_tone(rig, 2 * f, second, np.linalg.solve(h2, second - film2)))
    if rig.bearing.third:
        h3 = rig.bearing.h(3 * omega, load, aside)
        film3 = 0.25 * rig.bearing.third * share**2 * float(np.linalg.norm(h @ d)) * along * np.exp(3j * start)
        tones.append(_tone(rig, 3 * f, np.zeros(2, complex), np.linalg.solve(h3, -film3)))
    return tones


def _tone(rig: Rig, f: float, force: np.ndarray, d: np.ndarray) -> Tone:
    """Cells and accelerometers from the oil force: F_oil = F_cell + m a on springs."""
    omega = 2 * np.pi * f
    springs = np.array(rig.cell_stiffness) * (1 + 1j * rig.cell_loss)
    total = force + np.array(rig.baseline) * d
    cell = total * springs / (springs - rig.housing_mass * omega**2)
    return Tone(f, {"displacement": d, "force": cell, "acceleration": -(omega**2) * cell / springs})

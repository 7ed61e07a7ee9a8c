"""The instruments: what the manifest says of them, and what they really do.

Every sensor carries both: its stated calibration (in the manifest) and its `SensorError` (in the readings alone).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np

from rigdata.vector import directions
from rigdata.virtual_rig.truth import VirtualRigError, hz

_STANDARD_GRAVITY = 9.80665
#: Full scales that cells are sold with [N].
_CELL_SIZES = (20e3, 50e3, 100e3, 200e3, 500e3)
#: Quantity and entry of `SensorError` of every effect that acts on readings.
_EFFECTS = {
    "probe_gain": ("displacement", "gain"),
    "probe_rotation": ("displacement", "angle"),
    "channel_delay": ("displacement", "delay"),
    "loadcell_gain": ("force", "gain"),
    "loadcell_crosstalk": ("force", "cross"),
}


@dataclass(frozen=True)
class SensorError:
    """How a sensor departs from its stated calibration."""

    gain: float = 1.0
    angle: float = 0.0
    cross: float = 0.0
    delay: float = 0.0
    offset: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """One channel."""

    name: str
    quantity: str
    unit: str
    scale: float
    axis: float | None = None
    polarity: int = 1
    zero: float = 0.0
    span: float = 10.0
    calibration: Mapping[str, str] = field(default_factory=dict)
    uncertainty: float = 0.0
    pad: int | None = None
    position: float | None = None
    error: SensorError = SensorError()

    @classmethod
    def probe(cls, name: str, axis: float, gap_voltage: float = 8.0) -> Sensor:
        """Eddy-current probe of 7.78 mV/um: the reading falls as the shaft comes nearer."""
        stated = {"sensitivity": "7.78 mV/um"}
        return cls(name, "displacement", "V", 7.78e3, axis, -1, gap_voltage, calibration=stated, uncertainty=0.005)

    @classmethod
    def load_cell(cls, name: str, axis: float, load: float = 0.0) -> Sensor:
        """Strain-gauge cell in a bridge: 2 mV/V at full scale, supplied with 5 V; 20 kN, or more for a `load` [N]."""
        full_scale = next((size for size in _CELL_SIZES if size >= 1.5 * load), 1.5 * load)
        stated = {"sensitivity": "2.0 mV/V", "full_scale": f"{full_scale / 1e3:g} kN", "excitation": "5 V"}
        return cls(name, "force", "mV", 10.0 / full_scale, axis, calibration=stated, uncertainty=0.002)

    @classmethod
    def accelerometer(cls, name: str, axis: float) -> Sensor:
        """Accelerometer of 10 mV/g on a converter of 0.05 V."""
        scale = 10.0 * 1e-3 / _STANDARD_GRAVITY
        return cls(name, "acceleration", "V", scale, axis, span=0.05, calibration={"sensitivity": "10 mV/g"})

    @classmethod
    def thermometer(cls, name: str, pad: int) -> Sensor:
        """Pt100 with its amplifier, at three quarters of a pad's arc."""
        stated = {"sensitivity": "15 K/V", "zero": "0 degC"}
        return cls(name, "temperature", "V", 1 / 15.0, calibration=stated, pad=pad, position=0.75)

    @classmethod
    def tachometer(cls, name: str) -> Sensor:
        """Speed as a voltage."""
        return cls(name, "speed", "V", 0.1 / hz(1.0), calibration={"sensitivity": "100 mV/Hz"})

    def with_error(self, **changes: float) -> Sensor:
        """Return the sensor with these errors on top of its own: a gain multiplies, all else adds."""
        error = self.error
        for name, value in changes.items():
            total = error.gain * value if name == "gain" else getattr(error, name) + value
            error = replace(error, **{name: total})
        return replace(self, error=error)

    def direction(self, stated: bool = False) -> np.ndarray:
        """Unit vector (2,) along which it really reads, or is stated to read."""
        if self.axis is None:
            raise VirtualRigError(f"channel {self.name} has no axis")
        return directions(self.axis + (0.0 if stated else self.error.angle))


@dataclass(frozen=True)
class Instruments:
    """All sensors, and the housing between film and cells."""

    sensors: tuple[Sensor, ...] = field(repr=False)
    housing_mass: float = 30.0
    housing_mass_error: float = 0.0
    cell_stiffness: tuple[float, float] = (4e8, 6e8)

    def __post_init__(self) -> None:
        names = [sensor.name for sensor in self.sensors]
        if len(set(names)) < len(names):
            raise VirtualRigError(f"channel names must differ, got {names}")
        for quantity in ("displacement", "force", "acceleration"):
            if len(self.of(quantity)) % 2:
                raise VirtualRigError(f"{quantity} sensors must come in pairs")
        if self.true_mass < 0 or min(self.cell_stiffness) <= 0:
            raise VirtualRigError("the housing's true mass and cell_stiffness must not be negative")

    @classmethod
    def like_paper(cls, n_pads: int = 5, seed: int | None = None, load: float = 0.0) -> Instruments:
        """Two probes at 45 and 135 deg, cells (for a `load` [N]) and accelerometers at 0 and 90 deg, Pt100s, a tacho.

        With a `seed`, gap voltages and the zeros of accelerometers and Pt100s are random; without, the probes
        are at 8 V and everything else is at zero.
        """
        rng, share = np.random.default_rng([seed or 0, 0]), 0.0 if seed is None else 1.0
        gaps = (8.0 + share * rng.normal(0.0, 0.2, 2)).tolist()
        gravity, pt100 = ((share * rng.normal(0.0, size, n) + 0.0).tolist() for size, n in ((1.5, 2), (0.2, n_pads)))
        quarter = radians(90.0)
        thermometers = [Sensor.thermometer(f"T{i + 1}", i + 1).with_error(offset=zero) for i, zero in enumerate(pt100)]
        return cls(
            (
                Sensor.probe("X1A", radians(45.0), gaps[0]),
                Sensor.probe("X1B", radians(135.0), gaps[1]),
                Sensor.load_cell("L1H", 0.0, load),
                Sensor.load_cell("L1V", quarter, load),
                Sensor.accelerometer("A1H", 0.0).with_error(offset=gravity[0]),
                Sensor.accelerometer("A1V", quarter).with_error(offset=gravity[1]),
                *thermometers,
                Sensor.tachometer("K1"),
            )
        )

    @property
    def true_mass(self) -> float:
        """Housing mass as it really is [kg]."""
        return self.housing_mass + self.housing_mass_error

    def of(self, quantity: str) -> tuple[Sensor, ...]:
        """All sensors of a quantity."""
        return tuple(sensor for sensor in self.sensors if sensor.quantity == quantity)

    def named(self, name: str) -> Sensor:
        """Look up one sensor by its channel name."""
        for sensor in self.sensors:
            if sensor.name == name:
                return sensor
        raise VirtualRigError(f"no channel {name!r}; there are {[s.name for s in self.sensors]}")

    def gap_voltages(self) -> dict[str, float]:
        """Reading of every probe with the shaft in the bearing centre."""
        return {s.name: s.zero + s.polarity * s.scale * s.error.offset for s in self.of("displacement")}

    def with_errors(self, mass_error: float = 0.0, **effects: float) -> Instruments:
        """Add measurement effects by their canonical names and meanings (physics.md)."""
        errors: dict[str, dict[str, float]] = {}
        for name, value in effects.items():
            quantity, entry = _EFFECTS[name]
            errors.setdefault(quantity, {})[entry] = value
        return replace(
            self,
            sensors=tuple(s.with_error(**errors.get(s.quantity, {})) for s in self.sensors),
            housing_mass_error=self.housing_mass_error + mass_error,
        )

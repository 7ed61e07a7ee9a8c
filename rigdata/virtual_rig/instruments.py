"""The instruments, what the manifest says of them and what they really do; and all that is in a record besides.

Every sensor carries both: its stated calibration (in the manifest) and its `SensorError` (in the readings alone). The
amounts of `Noise.like_samples` were measured on the sample campaigns, in SI units of the quantity, so that they do not
change with a sensor's sensitivity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace
from math import radians
from typing import Any
from zlib import crc32

import numpy as np

from rigdata.vector import directions
from rigdata.virtual_rig.truth import PAPER_RIG

#: Full scales that cells are sold with [N].
_CELL_SIZES = (20e3, 50e3, 100e3, 200e3, 500e3)


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
    def of_type(cls, kind: str, name: str, **entries: Any) -> Sensor:
        """A sensor of the paper's rig, with entries of its own."""
        return cls(name, **PAPER_RIG["sensors"][kind] | entries)

    def with_error(self, **changes: float) -> Sensor:
        """Return the sensor with these errors on top of its own: a gain multiplies, all else adds."""
        error = self.error
        for name, value in changes.items():
            total = error.gain * value if name == "gain" else getattr(error, name) + value
            error = replace(error, **{name: total})
        return replace(self, error=error)

    def direction(self) -> np.ndarray:
        """Unit vector (2,) along which it really reads."""
        return directions((self.axis or 0.0) + self.error.angle)


@dataclass(frozen=True)
class Instruments:
    """All sensors, and the housing between film and cells."""

    sensors: tuple[Sensor, ...]
    housing_mass: float = 30.0
    housing_mass_error: float = 0.0
    cell_stiffness: tuple[float, float] = (4e8, 6e8)

    @classmethod
    def like_paper(cls, n_pads: int = 5, seed: int | None = None, load: float = 0.0) -> Instruments:
        """Two probes at 45 and 135 deg, cells (for a `load` [N]) and accelerometers at 0 and 90 deg, Pt100s, a tacho.

        With a `seed`, gap voltages and the zeros of accelerometers and Pt100s are random; without, the probes
        are at 8 V and everything else is at zero.
        """
        rig = PAPER_RIG["rig"]
        sensors = [Sensor.of_type(kind, name, axis=radians(degrees)) for kind, name, degrees in rig["sensors"]]
        sensors += [Sensor.of_type("thermometer", f"T{number}", pad=number) for number in range(1, n_pads + 1)]
        rng = np.random.default_rng([seed or 0, 0])
        full_scale = next((size for size in _CELL_SIZES if size >= 1.5 * load), 1.5 * load)
        calibration = {"sensitivity": "2.0 mV/V", "full_scale": f"{full_scale / 1e3:g} kN", "excitation": "5 V"}
        for place, sensor in enumerate(sensors):
            if sensor.quantity == "force":
                sensors[place] = replace(sensor, scale=10.0 / full_scale, calibration=calibration)
                continue
            zero = 0.0 if seed is None else rng.normal(0.0, rig["scatter"][sensor.quantity])
            if sensor.quantity == "displacement":
                sensors[place] = replace(sensor, zero=sensor.zero + zero)
            else:
                sensors[place] = sensor.with_error(offset=zero)
        return cls((*sensors, Sensor.of_type("tachometer", "K1")))

    @property
    def true_mass(self) -> float:
        """Housing mass as it really is [kg]."""
        return self.housing_mass + self.housing_mass_error

    def of(self, quantity: str) -> tuple[Sensor, ...]:
        """All sensors of a quantity."""
        return tuple(sensor for sensor in self.sensors if sensor.quantity == quantity)

    def named(self, name: str) -> Sensor:
        """Look up one sensor by its channel name."""
        return next(sensor for sensor in self.sensors if sensor.name == name)

    def gap_voltages(self) -> dict[str, float]:
        """Reading of every probe with the shaft in the bearing centre."""
        return {s.name: s.zero + s.polarity * s.scale * s.error.offset for s in self.of("displacement")}

    def with_errors(self, number: int | None = None, housing_mass: float = 0.0, **effects: float) -> Instruments:
        """Add measurement effects by their canonical names and meanings (physics.md), to one sensor of a quantity."""
        sensors = list(self.sensors)
        for name, value in effects.items():
            quantity, entry = PAPER_RIG["effects"][name]
            places = [place for place, sensor in enumerate(sensors) if sensor.quantity == quantity]
            for place in places if number is None else places[number - 1 : number]:
                sensors[place] = sensors[place].with_error(**{entry: value})
        return replace(self, sensors=tuple(sensors), housing_mass_error=self.housing_mass_error + housing_mass)


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one quantity, in its SI unit (K for temperatures)."""

    white: float = 0.0
    flicker: float = 0.0
    mains: float = 0.0
    drift: float = 0.0

    def scaled(self, factor: float) -> ChannelNoise:
        """Return the same noise, `factor` times as strong."""
        return ChannelNoise(*(amount * factor for amount in astuple(self)))


@dataclass(frozen=True)
class Glitches:
    """Bursts in which a displacement or force channel is off by a constant."""

    share: float = 0.0
    shortest: int = 3
    longest: int = 50
    displacement: float = 65e-6
    force: float = 4000.0


@dataclass(frozen=True)
class DryImperfections:
    """What goes wrong in dry tests."""

    direction: tuple[float, float] = (0.0, 0.0)
    side: tuple[float, float] = (0.0, 0.0)
    side_start: float = 0.0
    friction: float = 0.0
    contact_gap: tuple[float, float] = (0.0, 0.0)
    contact_load: float = 500.0
    push_scatter: float = 0.0


@dataclass(frozen=True)
class Noise:
    """All disturbances of a campaign."""

    displacement: ChannelNoise = ChannelNoise()
    force: ChannelNoise = ChannelNoise()
    acceleration: ChannelNoise = ChannelNoise()
    temperature: ChannelNoise = ChannelNoise()
    speed: ChannelNoise = ChannelNoise()
    mains_frequency: float = 50.0
    mains_scatter: float = 0.0
    mains_harmonics: tuple[float, ...] = ()
    runout: tuple[float, ...] = ()  #: of the shaft, 1X, 2X, ... [m]
    unbalance: float = 0.0  #: kg m
    actuator_harmonics: tuple[float, ...] = ()  #: shares of the excitation
    actuator_scatter: float = 0.0
    cross_talk: float = 0.0  #: of the actuators
    load_miss: float = 0.0  #: by how much a run misses its set point, standard deviations: share, rad, share
    direction_miss: float = 0.0
    speed_miss: float = 0.0
    glitches: Glitches = Glitches()
    dry: DryImperfections = DryImperfections()
    bits: int | None = None

    @classmethod
    def none(cls) -> Noise:
        """No disturbance at all: the records are the physics."""
        return cls()

    @classmethod
    def like_samples(cls) -> Noise:
        """As strong as in the sample campaigns, of every kind that they have."""
        entries = dict(PAPER_RIG["noise"])
        for name, amounts in entries.pop("channels").items():
            entries[name] = ChannelNoise(**amounts)
        entries |= {"glitches": Glitches(**entries["glitches"]), "dry": DryImperfections(**entries["dry"])}
        return cls(**entries)

    def scaled(self, factor: float) -> Noise:
        """Return it with the channels' noise `factor` times as strong; shaft, actuators, dry tests as they are."""
        return replace(self, **{name: getattr(self, name).scaled(factor) for name in PAPER_RIG["noise"]["channels"]})


#: What random streams are for; a change in one leaves all others as they were.
_PURPOSES = ("physics", "noise", "mains", "glitches", "dry", "faults", "campaign")


def stream(seed: int, run: str, purpose: str) -> np.random.Generator:
    """Generator for one run (by its id) and purpose; the same for the same arguments, on every machine."""
    return np.random.default_rng([seed, crc32(run.encode()), _PURPOSES.index(purpose)])

"""Faults on request: one named defect in chosen runs and channels, for testing whoever reads the campaign.

Four places can be at fault: a sensor (its reading is wrong from the start), a record (readings are spoilt
after the converter), a run (the test was done or noted wrongly) and a file.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.near_names import nearest_name
from rigdata.virtual_rig.instruments import Instruments, Sensor
from rigdata.virtual_rig.sensing import Readings
from rigdata.virtual_rig.truth import VirtualRigError

Place = Literal["sensor", "record", "run", "file"]

KINDS: dict[str, tuple[Place, str]] = {
    "scaled": ("sensor", "readings are `value` times the truth"),
    "delayed": ("sensor", "recorded `value` seconds late"),
    "rotated": ("sensor", "the sensor is `value` rad off its stated axis"),
    "offset": ("sensor", "`value` (SI) is added"),
    "crosstalk": ("sensor", "also reads this fraction `value` of the other axis"),
    "dead": ("record", "reads `value` (default 0) all the time"),
    "stuck": ("record", "from `start` on, for `length`, the reading does not change"),
    "clipped": ("record", "saturates at `value` (default 0.6) of its excursion about the middle"),
    "swapped": ("record", "exchanged with the channel `other`"),
    "inverted": ("record", "wired the wrong way round: the reading has the wrong sign"),
    "nan_gap": ("record", "no value from `start` for `length`"),
    "glitch": ("record", "is off by `value` (SI) from `start` for `length`"),
    "time_gap": ("record", "rows from `start` for `length` are missing in all channels"),
    "time_jitter": ("record", "time stamps scatter by `value` (default 0.2) of a sample"),
    "missing_excitation": ("run", "the actuators were off"),
    "duplicate_run": ("run", "the record is that of the run `other`"),
    "wrong_pad": ("run", "the manifest names pad `value`"),
    "wrong_direction": ("run", "the manifest's direction is off by `value` rad"),
    "wrong_frequency": ("run", "the manifest's excitation frequency is off by `value` Hz"),
    "wrong_load": ("run", "the manifest's static load is `value` times the truth"),
    "missing_channel": ("file", "the file lacks the channel"),
    "duplicate_column": ("file", "CSV: the column is there twice"),
    "truncated_line": ("file", "CSV: the last line ends in the middle"),
    "short_channel": ("file", "HDF5: the dataset is shorter than the others"),
    "missing_file": ("file", "the run's file or group is not there"),
    "empty_file": ("file", "the run's file holds no samples"),
}

_NEEDS_CHANNEL = {k for k, (place, _) in KINDS.items() if place in ("sensor", "record")} - {
    "time_gap",
    "time_jitter",
} | {"missing_channel", "duplicate_column", "short_channel"}
_NEEDS_VALUE = {
    "scaled", "delayed", "rotated", "offset", "crosstalk", "glitch",
    "wrong_pad", "wrong_direction", "wrong_frequency", "wrong_load",
}  # fmt: skip
_NEEDS_OTHER = {"swapped", "duplicate_run"}
CSV_ONLY = {"duplicate_column", "truncated_line"}
HDF5_ONLY = {"short_channel"}
NEEDS_TIME = {"time_jitter"}


@dataclass(frozen=True)
class Fault:
    """One defect."""

    kind: str
    run: str = "*"
    channel: str | None = None
    value: float | None = None
    start: float = 0.0
    length: float = float("inf")
    other: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            near = nearest_name(self.kind, KINDS)
            hint = f"; did you mean {near!r}?" if near else f"; there are {', '.join(KINDS)}"
            raise VirtualRigError(f"no fault {self.kind!r}{hint}")
        for needed, kinds in (
            ("channel", _NEEDS_CHANNEL), ("value", _NEEDS_VALUE), ("other", _NEEDS_OTHER),
        ):  # fmt: skip
            if self.kind in kinds and getattr(self, needed) is None:
                raise VirtualRigError(f"fault {self.kind!r} needs {needed}: {KINDS[self.kind][1]}")

    @property
    def place(self) -> Place:
        """Where it sits."""
        return KINDS[self.kind][0]

    def affects(self, run: str) -> bool:
        """Whether it concerns a run."""
        return fnmatchcase(run, self.run)

    def is_in(self, channel: str) -> bool:
        """Whether it concerns a channel of its runs."""
        return self.channel is None or fnmatchcase(channel, self.channel)


def check_faults(faults: Iterable[Fault], runs: Iterable[str], channels: Iterable[str]) -> None:
    """Refuse faults that would strike nothing: a campaign must hold what was asked for."""
    runs, channels = list(runs), list(channels)
    for fault in faults:
        if not any(fnmatchcase(run, fault.run) for run in runs):
            raise VirtualRigError(f"fault {fault.kind!r}: no run matches {fault.run!r}")
        if fault.channel is not None and not any(fnmatchcase(c, fault.channel) for c in channels):
            raise VirtualRigError(f"fault {fault.kind!r}: no channel matches {fault.channel!r}; there are {channels}")
        candidates = channels if fault.kind == "swapped" else runs
        if fault.other is not None and fault.other not in candidates:
            raise VirtualRigError(f"fault {fault.kind!r}: there is no {fault.other!r} among {candidates}")


def faulty_instruments(instruments: Instruments, faults: Iterable[Fault]) -> Instruments:
    """Instruments of one run, with the faults of its sensors; `faults` are those of the run."""
    sensors = list(instruments.sensors)
    for fault in faults:
        for i, sensor in enumerate(sensors):
            if fault.place == "sensor" and fault.is_in(sensor.name) and fault.value is not None:
                sensors[i] = _faulty_sensor(sensor, fault.kind, fault.value)
    return replace(instruments, sensors=tuple(sensors))


def _faulty_sensor(sensor: Sensor, kind: str, value: float) -> Sensor:
    if kind == "scaled":
        return sensor.with_error(gain=sensor.error.gain * value)
    name = {"delayed": "delay", "rotated": "angle", "offset": "offset", "crosstalk": "cross"}[kind]
    return sensor.with_error(**{name: getattr(sensor.error, name) + value})


def spoil_record(
    readings: Readings,
    instruments: Instruments,
    faults: Iterable[Fault],
    rng: np.random.Generator,
) -> Readings:
    """Readings with the record faults of their run; the given ones stay as they are."""
    columns = dict(readings.columns)
    time = readings.time
    for fault in faults:
        if fault.place != "record":
            continue
        if fault.kind == "time_gap":
            recorded = ~_window(fault, time)
            time, columns = time[recorded], {name: v[recorded] for name, v in columns.items()}
        elif fault.kind == "time_jitter":
            spread = 0.2 if fault.value is None else fault.value
            time = time + np.clip(spread * rng.standard_normal(len(time)), -0.45, 0.45) / readings.rate
        elif fault.kind == "swapped" and fault.channel is not None and fault.other is not None:
            columns[fault.channel], columns[fault.other] = columns[fault.other], columns[fault.channel]
        else:
            for name in columns:
                if fault.is_in(name):
                    columns[name] = _spoilt(columns[name], fault, instruments.named(name), time)
    return Readings(time, columns, readings.rate)


def _window(fault: Fault, time: FloatArray) -> np.ndarray:
    return (time >= fault.start) & (time < fault.start + fault.length)


def _spoilt(v: FloatArray, fault: Fault, sensor: Sensor, time: FloatArray) -> FloatArray:
    """Readings (n,) of one channel with a fault of its record."""
    inside = _window(fault, time)
    if fault.kind == "dead":
        return np.full_like(v, fault.value or 0.0)
    if fault.kind == "stuck":
        return np.where(inside, v[np.argmax(inside)], v)
    if fault.kind == "clipped":
        low, high = float(v.min()), float(v.max())
        middle = 0.5 * (low + high)
        reach = 0.5 * (high - low) * (0.6 if fault.value is None else fault.value)
        return np.clip(v, middle - reach, middle + reach)
    if fault.kind == "inverted":
        # a probe wired the wrong way round still has its gap voltage: only what moves changes sign
        return 2 * sensor.zero - v
    if fault.kind == "nan_gap":
        return np.where(inside, np.nan, v)
    return v + sensor.polarity * sensor.scale * (fault.value or 0.0) * inside  # a glitch

"""A virtual rig: truth, plan, instruments, noise and faults put together; runs are simulated one by one.

From motion to readings: axes, gains, delays, runout, noise, glitches, zero, the converter, faults of the record.
"""

from collections.abc import Iterable
from dataclasses import asdict, astuple, dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cache, cached_property
from math import inf
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len

from rigdata.arrays import BoolArray, FloatArray
from rigdata.near_names import unknown_name
from rigdata.virtual_rig.instruments import Instruments, Noise, Sensor, stream
from rigdata.virtual_rig.motion import Motion, clearance_motion, dry_motion, either_sign, running_motion
from rigdata.virtual_rig.truth import PAPER_RIG, DryTest, PlannedRun, RigPlan, RigTruth, VirtualRigError

#: Where each kind of fault sits ("sensor", "record", "run" or "file"), what it needs (fields, a layout, times in the
#: files), and what it does.
KINDS: dict[str, dict[str, Any]] = PAPER_RIG["faults"]


@dataclass(frozen=True)
class Fault:
    """One named defect in chosen runs and channels, for testing whoever reads the campaign.

    A sensor is wrong from the start, a record is spoilt after the converter, a run was done or noted wrongly, or a file
    is damaged.
    """

    kind: str
    run: str = "*"
    channel: str | None = None
    value: float | None = None
    start: float = 0.0
    length: float = inf
    other: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise VirtualRigError(unknown_name("fault", self.kind, KINDS))
        for name in self.rule["needs"]:
            if getattr(self, name, self) is None:
                raise VirtualRigError(f"fault {self.kind!r} needs {name}: {self.rule['does']}")

    @property
    def rule(self) -> dict[str, Any]:
        """What `KINDS` says of its kind."""
        return KINDS[self.kind]

    def stated(self) -> dict[str, object]:
        """Its entries that say something; an open end is not a JSON number."""
        return {key: value for key, value in asdict(self).items() if value not in (None, inf)}

    def size(self, usual: float) -> float:
        """Its value, or the usual one."""
        return usual if self.value is None else self.value

    def affects(self, run: str) -> bool:
        """Whether it concerns a run."""
        return fnmatchcase(run, self.run)

    def is_in(self, channel: str) -> bool:
        """Whether it concerns a channel of its runs."""
        return self.channel is None or fnmatchcase(channel, self.channel)


@dataclass(frozen=True)
class Glitch:
    """One burst: a channel is off by `size` (SI) over some samples."""

    channel: str
    first: int
    count: int
    size: float


@dataclass(frozen=True)
class Readings:
    """What the recorder gets: one array (n,) per channel in the channel's own unit, and the times (n,) [s]."""

    time: FloatArray
    columns: dict[str, FloatArray]
    rate: float


def analogue_readings(
    motion: Motion, instruments: Instruments, noise: Noise, seed: int, run: str
) -> dict[str, FloatArray]:
    """Readings of all sensors before the converter, each (n,) in its own unit."""
    time = motion.time
    disturbance = channel_noise(instruments.sensors, noise, time, seed, run)

    @cache
    def vectors(quantity: str, delay: float) -> FloatArray:
        # sampled at the delayed time instead of shifted: exact for any fraction of a sample
        return motion.at(quantity, time - delay)

    columns = {}
    for sensor, added in zip(instruments.sensors, disturbance):
        error = sensor.error
        value: FloatArray | float = abs(motion.speed)
        if sensor.quantity == "temperature":
            value = motion.temperature[(sensor.pad or 1) - 1]
        elif sensor.axis is not None:
            value = vectors(sensor.quantity, error.delay) @ felt_direction(sensor, instruments)
            if sensor.quantity == "displacement":
                value = value + motion.runout(sensor.axis + error.angle, time - error.delay)
        reading = error.gain * value + error.offset + added
        columns[sensor.name] = sensor.polarity * sensor.scale * reading + sensor.zero
    return columns


def felt_direction(sensor: Sensor, instruments: Instruments) -> FloatArray:
    """Vector (2,) whose product with the quantity gives what the sensor feels: its axis, and cross-talk."""
    direction = sensor.direction()
    if sensor.error.cross:
        pairs = instruments.of(sensor.quantity)
        partner = pairs[pairs.index(sensor) ^ 1]
        direction = direction + sensor.error.cross * partner.direction()
    return direction


def draw_glitches(instruments: Instruments, noise: Noise, samples: int, seed: int, run: str) -> tuple[Glitch, ...]:
    """Draw the glitches of a run."""
    rules = noise.glitches
    channels = [s for s in instruments.sensors if s.quantity in ("displacement", "force")]
    rng = stream(seed, run, "glitches")
    glitches: list[Glitch] = []
    while channels and len(glitches) < 4 and rng.uniform() < rules.share:
        sensor = channels[rng.integers(len(channels))]
        count = min(int(rng.integers(rules.shortest, rules.longest, endpoint=True)), samples)
        size = getattr(rules, sensor.quantity) * either_sign(rng, (0.4, 1.0))
        glitches.append(Glitch(sensor.name, int(rng.integers(0, samples - count + 1)), count, size))
    return tuple(glitches)


def converted(reading: FloatArray, sensor: Sensor, bits: int | None) -> FloatArray:
    """Reading after the converter: limited to its span and rounded to its steps."""
    if bits is None:
        return reading
    step = converter_step(sensor, bits)
    return np.clip(np.rint(reading / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * step


def converter_step(sensor: Sensor, bits: int) -> float:
    """One step of the converter, in the reading's unit."""
    return 2 * sensor.span / 2**bits


def channel_noise(sensors: tuple[Sensor, ...], noise: Noise, time: FloatArray, seed: int, run: str) -> FloatArray:
    """Noise of each sensor over `time` (n,) [s] -> (n_sensors, n), in the SI unit of its quantity."""
    kinds = [getattr(noise, sensor.quantity) for sensor in sensors]
    white, pink, mains, drift = np.array([astuple(kind) for kind in kinds]).T[..., None]
    n = len(time)
    rate = (n - 1) / (time[-1] - time[0]) if n > 1 else 1.0
    rng = stream(seed, run, "noise")
    out = white * rng.standard_normal((len(sensors), n))
    out += pink * flicker(rng, len(sensors), n, rate)
    out += drift * slow_drift(rng, len(sensors), time)
    if np.any(mains):
        out += mains * _pick_up(noise, [s.name for s in sensors], time, seed, run)
    return out


def flicker(rng: np.random.Generator, rows: int, n: int, rate: float) -> FloatArray:
    """1/f noise (rows, n) of amplitude density 1 per sqrt(Hz) at 1 Hz.

    Shaped in the frequency domain over twice the length and cut, because one period of a periodic series would
    end where it began, which drift does not.
    """
    length = next_fast_len(2 * n, real=True)
    frequency = np.arange(1, length // 2 + 1) * rate / length
    # one-sided density S(f) = 1/f; a line of the rfft has E|Z|^2 = S rate length / 2
    size = np.sqrt(rate * length / frequency) / 2
    spectrum = np.zeros((rows, length // 2 + 1), dtype=complex)
    spectrum[:, 1:] = size * (rng.standard_normal((rows, len(size), 2)) @ np.array([1.0, 1j]))
    return irfft(spectrum, n=length)[:, :n]


def slow_drift(rng: np.random.Generator, rows: int, time: FloatArray) -> FloatArray:
    """Slow monotone drift (rows, n), zero in the mean, with a standard deviation of 1 from start to end."""
    share = np.linspace(-0.5, 0.5, len(time))
    size = rng.standard_normal((rows, 1))
    return size * (share + rng.uniform(-1.0, 1.0, (rows, 1)) * (share**2 - np.mean(share**2)))


def _pick_up(noise: Noise, names: list[str], time: FloatArray, seed: int, run: str) -> FloatArray:
    """Mains pick-up (n_sensors, n) of amplitude about 1.

    How the channels pick it up belongs to the cabling, the same in the whole campaign; the phase of the mains
    at the start of a record is chance.
    """
    rng = stream(seed, run, "mains")
    frequency = noise.mains_frequency + noise.mains_scatter * rng.standard_normal()
    start = rng.uniform(0, 2 * np.pi)
    out = np.zeros((len(names), len(time)))
    for row, name in enumerate(names):
        cabling = stream(seed, name, "mains")
        strength = cabling.uniform(0.9, 1.1)
        for order, share in enumerate((1.0, *noise.mains_harmonics), 1):
            phase = order * start + cabling.uniform(0, 2 * np.pi)
            out[row] += strength * share * np.cos(2 * np.pi * order * frequency * time + phase)
    return out


def spoil_record(
    readings: Readings, instruments: Instruments, faults: Iterable[Fault], rng: np.random.Generator
) -> Readings:
    """Readings with the record faults of their run; the given ones stay as they are."""
    columns, time = dict(readings.columns), readings.time
    for fault in faults:
        if fault.rule["place"] != "record":
            continue
        inside = (time >= fault.start) & (time < fault.start + fault.length)
        if fault.kind == "time_gap":
            time, columns = time[~inside], {name: v[~inside] for name, v in columns.items()}
        elif fault.kind == "time_jitter":
            shift = np.clip(fault.size(0.2) * rng.standard_normal(len(time)), -0.45, 0.45)
            time = time + shift / readings.rate
        elif fault.kind == "swapped":
            first, second = str(fault.channel), str(fault.other)
            columns[first], columns[second] = columns[second], columns[first]
        else:
            for sensor in instruments.sensors:
                if fault.is_in(sensor.name):
                    columns[sensor.name] = _spoilt(columns[sensor.name], fault, sensor, inside)
    return Readings(time, columns, readings.rate)


def _spoilt(v: FloatArray, fault: Fault, sensor: Sensor, inside: BoolArray) -> FloatArray:
    """Readings (n,) of one channel with a fault of its record, which a few have `inside` a stretch only."""
    if fault.kind == "dead":
        return np.full_like(v, fault.size(0.0))
    if fault.kind == "inverted":
        # a probe wired the wrong way round still has its gap voltage: only what moves changes sign
        return 2 * sensor.zero - v
    if fault.kind == "clipped":
        low, high = v.min(), v.max()
        middle, reach = 0.5 * (low + high), 0.5 * (high - low) * fault.size(0.6)
        return np.clip(v, middle - reach, middle + reach)
    if fault.kind == "glitch":
        return v + sensor.polarity * sensor.scale * fault.size(0.0) * inside
    return np.where(inside, np.nan if fault.kind == "nan_gap" else v[np.argmax(inside)], v)  # or stuck


@dataclass(frozen=True)
class SimulatedRun:
    """One record, and what is in it."""

    run: PlannedRun
    readings: Readings
    motion: Motion
    glitches: tuple[Glitch, ...] = ()
    source: str = ""


@dataclass(frozen=True)
class VirtualRig:
    """Everything that determines a campaign, to the last bit."""

    truth: RigTruth
    plan: RigPlan = field(default_factory=RigPlan.like_paper)
    instruments: Instruments = field(default_factory=Instruments.like_paper)
    noise: Noise = field(default_factory=Noise.like_samples)
    faults: tuple[Fault, ...] = ()
    seed: int = 0
    campaign: str = "virtual"
    description: str = "computed data from a virtual rig"

    def __post_init__(self) -> None:
        """Refuse faults that would strike nothing: a campaign must hold what was asked for."""
        channels = [sensor.name for sensor in self.instruments.sensors]
        for fault in self.faults:
            runs = [run.id for run in self.runs]
            for name, pattern, names in (("run", fault.run, runs), ("channel", fault.channel or "*", channels)):
                if not any(fnmatchcase(candidate, pattern) for candidate in names):
                    listed = ", ".join(names[:20])
                    raise VirtualRigError(f"fault {fault.kind!r}: no {name} matches {pattern!r}; there are {listed}")
            candidates = channels if fault.kind == "swapped" else runs
            if fault.other is not None and fault.other not in candidates:
                raise VirtualRigError(f"fault {fault.kind!r}: there is no {fault.other!r} among {candidates}")

    @cached_property
    def runs(self) -> tuple[PlannedRun, ...]:
        """All runs, in the order of the test."""
        return self.plan.runs(self.truth.pivot_angles)

    def simulate(self, run_id: str) -> SimulatedRun:
        """Make the record of one run (or the one that it shares, or that was copied in its place)."""
        runs = {run.id: run for run in self.runs}
        run = runs[runs[run_id].record]
        copied = [fault.other for fault in self.faults_of(run.id) if fault.kind == "duplicate_run"]
        return replace(self._simulated(runs[copied[0] or ""] if copied else run), run=run)

    def faults_of(self, record: str) -> tuple[Fault, ...]:
        """Faults that strike one of the runs of a record."""
        if not self.faults:
            return ()
        members = [run.id for run in self.runs if run.record == record]
        return tuple(fault for fault in self.faults if any(map(fault.affects, members)))

    def fault_kinds(self, record: str, channel: str | None = None) -> set[str]:
        """Kinds of the faults of a record, or of those in one of its channels."""
        return {fault.kind for fault in self.faults_of(record) if channel is None or fault.is_in(channel)}

    def _simulated(self, run: PlannedRun) -> SimulatedRun:
        faults, noise, seed = self.faults_of(run.record), self.noise, self.seed
        if "missing_excitation" in self.fault_kinds(run.record):
            run = replace(run, lines=())
        sensors = self.instruments.sensors
        for fault in faults:
            if fault.rule["place"] == "sensor":
                change = {fault.rule["error"]: fault.size(0.0)}
                sensors = tuple(s.with_error(**change) if fault.is_in(s.name) else s for s in sensors)
        instruments = replace(self.instruments, sensors=sensors)
        glitches: tuple[Glitch, ...] = ()
        if isinstance(run.test, DryTest):
            motion = dry_motion(run, run.test, self.truth, noise, seed)
        elif run.test is not None:
            motion = clearance_motion(run, run.test, self.truth, noise, seed)
        else:
            motion = running_motion(run, self.truth, instruments, noise, seed)
            glitches = draw_glitches(instruments, noise, len(motion.time), seed, run.id)
        columns = analogue_readings(motion, instruments, noise, seed, run.id)
        if not np.isfinite(list(columns.values())).all():
            raise VirtualRigError(f"run {run.id}: the truth gives no finite motion at {run.point}")
        for glitch in glitches:
            sensor = instruments.named(glitch.channel)
            burst = slice(glitch.first, glitch.first + glitch.count)
            columns[glitch.channel][burst] += sensor.polarity * sensor.scale * glitch.size
        columns = {s.name: converted(columns[s.name], s, noise.bits) for s in sensors}
        readings = Readings(motion.time, columns, run.rate)
        readings = spoil_record(readings, instruments, faults, stream(seed, run.id, "faults"))
        return SimulatedRun(run, readings, motion, glitches, run.id)

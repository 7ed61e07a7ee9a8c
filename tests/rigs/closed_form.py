"""Rigs in closed form: H(w) = K - w^2 M + i w C between an actuator and a housing, nothing of the toolkit in it.

The housing stands on its load cells or floats on stingers; shafts have inertia and compliance. The actuator makes lines
or a course in time (late, switched, wandering, noise, sweep, multi-sine, blows), both taken through transfer functions
in closed form. The truth of a point is H of the film at the set load. `write_rig` makes a campaign of one in one call.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tests.rigs.acquisition import (
    EXACT,
    Acquisition,
    Array,
    Campaign,
    Channel,
    Run,
    Signal,
    bearing_file,
    unit_vector,
    write_campaign,
)

Matrix = tuple[tuple[float, float], tuple[float, float]]
NONE: Matrix = ((0.0, 0.0), (0.0, 0.0))
#: Samples of a course per second, and how long it runs before and after the record [s].
FINE, BEFORE, AFTER = 8000.0, 1.0, 0.25
LOSS = 0.01


@dataclass(frozen=True)
class Film:
    """K, C, M at the reference load [SI]; K grows with the load to the power 0.6, C to 0.2.

    `square` and `cube` are its next terms: force = k x (1 + square x/c + cube (x/c)^2), along the motion.
    """

    k: Matrix
    c: Matrix
    m: Matrix = NONE
    load: float = 5000.0
    square: float = 0.0
    cube: float = 0.0
    exponents = (0.6, 0.2)

    def h(self, frequency: Array | float, load: float) -> Array:
        """Dynamic stiffness (..., 2, 2) [N/m]."""
        w = 2 * np.pi * np.asarray(frequency, dtype=float)[..., None, None]
        ratio = load / self.load if load > 0 and self.load > 0 else 1.0
        k, c, m = np.array(self.k), np.array(self.c), np.array(self.m)
        return np.asarray(k * ratio ** self.exponents[0] - w**2 * m + 1j * w * c * ratio ** self.exponents[1])


USUAL = Film(((9.2e7, 5e6), (-7e6, 1.75e8)), ((3.6e5, 1.2e4), (-6e3, 4.5e5)))
SMALL = Film(((6.1e6, 4e5), (-3e5, 1.1e7)), ((9e3, 3e2), (-2e2, 1.2e4)), load=300.0)
LARGE = Film(((1.3e9, 6e7), (-9e7, 2.4e9)), ((1.1e7, 4e5), (-3e5, 1.6e7)), load=1.5e5)
PLAIN = Film(((2.4e7, 6.5e7), (-6.1e7, 2.8e7)), ((3.1e5, 1e4), (1e4, 3.3e5)), load=0.0)
NEGATIVE = Film(((-1.6e7, 5.5e7), (-2.9e7, 6.2e7)), ((2.6e5, -3e4), (-3e4, 3.4e5)), load=2000.0)
HEAVY = Film(((2.2e7, 3e6), (-3e6, 3.1e7)), ((1.1e5, 2e4), (-2e4, 1.3e5)), ((260.0, 12.0), (-12.0, 300.0)), 3000.0)


@dataclass(frozen=True)
class Rig:
    """A rig and its plan; amplitudes are shares of the clearance or of the drive's force."""

    film: Film = USUAL
    diameter: float = 0.1
    clearance: float = 80e-6
    speed: float = 22.0  #: [Hz]
    loads: tuple[float, ...] = (5000.0,)
    load_direction: float = -90.0
    frequencies: tuple[float, ...] = (25.0, 45.0)
    directions: tuple[float, ...] = (0.0, 45.0, 90.0, 135.0)
    repeats: int = 1
    mount: str = "cells"
    mass: float = 30.0
    stated_mass: float = 0.0  #: where it is another one
    springs: tuple[float, float] = (4e8, 6e8)
    foundation: tuple[float, float] = (0.0, np.inf)  #: mass [kg], springs [N/m] under cells or a shaft's bearings
    beside: tuple[float, float] = (0.0, 0.0)  #: springs beside the film, which dry runs of the plan tell [N/m]
    shaft_mass: float = 0.0
    shaft_compliance: float = 0.0  #: of a floating stator's shaft [m/N]
    static: bool = True  #: cells show the static load
    excitation: str = "sine"
    band: tuple[float, float] = (6.0, 90.0)
    notch: tuple[float, float] = (0.0, 0.0)  #: part of the band without power [Hz]
    tones: str = "every"  #: lines of a multi-sine: every one, odd ones, odd ones but every fifth
    amplitude: float = 0.015  #: of the displacement: of a sine the amplitude, of a band the deviation
    sizes: tuple[float, ...] = (1.0,)  #: of the runs' amplitudes, in turn
    harmonic: float = 0.0  #: of the drive's force, at twice its frequency
    locked: bool = False  #: the drive turns with the shaft: every run begins at the same angle
    keyphasor: bool = False
    share: tuple[float, float] = (0.0, 1.0)  #: of the record with drive
    wander: float = 0.0  #: of the drive's frequency [Hz]
    senses: tuple[float, ...] = (1.0, -1.0)  #: of blows
    detune: float = 0.0  #: real less stated frequency [Hz]
    lines: tuple[tuple[float, float], ...] = ()  #: further forces on the film: [Hz], share of the drive
    unbalance: float = 0.2
    runout: float = 0.003
    load_scatter: float = 0.003
    stiffness_scatter: float = 0.0  #: of the film from run to run
    temperatures: tuple[float, float] = (40.0, 40.0)  #: of the first and the last run
    tilt: float = 0.0
    switch: float = 1.0  #: the drive's level after half of the record, at another phase
    seconds: float = 4.0
    with_clearance: bool = False
    head: tuple[str, ...] = ()  #: further lines of [housing]


@dataclass(frozen=True)
class Test:
    """One dynamic run of a plan."""

    load: float
    frequency: float
    direction: float
    size: float = 1.0  #: of the amplitude
    dry: bool = False  #: without film and rotation


def response(rig: Rig, frequency: Array, load: float, scale: float = 1.0) -> dict[str, Array]:
    """Motion and cell force per actuator force, by quantity (..., 2, 2); signs of the contract."""
    h = rig.film.h(frequency, load) * scale + np.diag(rig.beside)
    w2, unit = (2 * np.pi * frequency[..., None, None]) ** 2, np.eye(2)
    mass, springs = rig.foundation
    below = 1 / (springs * (1 + 4j * LOSS) - mass * w2) if np.isfinite(springs) else 0.0
    if rig.mount == "floating":
        moved = unit + (rig.shaft_compliance + below) * h  # housing against shaft, per displacement
        d = np.linalg.inv(rig.mass * w2 * moved - h)
        acceleration = w2 * moved @ d
    else:
        support = 1 / (1 / (np.array(rig.springs)[:, None] * (1 + 1j * LOSS)) + below)
        compliance = unit / (support - rig.mass * w2)
        d = np.linalg.inv(h - w2 * rig.shaft_mass * (unit + compliance @ h))
        acceleration = -w2 * compliance @ h @ d
    return {"displacement": d, "acceleration": acceleration, "force": h @ d - rig.mass * acceleration}


def sine_course(rig: Rig, test: Test, t: Array, rng: np.random.Generator) -> Array:
    """A sine that may wander by half a period over the record, and go on at another level and phase (n,)."""
    swing = 2 * rig.wander * rig.seconds * np.sin(np.pi * t / rig.seconds)
    later = (rig.switch != 1.0) * (t > rig.seconds / 2)
    phase = 2 * np.pi * (test.frequency + rig.detune) * t + swing + rng.uniform(0, 6.28) + 1.7 * later
    return np.asarray(np.sin(phase) * np.where(later, rig.switch, 1.0) * np.clip((t + BEFORE) / 0.3, 0, 1))


def band_course(rig: Rig, t: Array, rng: np.random.Generator) -> Array:
    """Noise, a sweep, a multi-sine of 1 s or blows of 6 ms (n,)."""
    low, high = rig.band
    if rig.excitation == "random":
        f = np.fft.rfftfreq(len(t), 1 / FINE)
        power = (f >= low) & (f <= high) & ~((f > rig.notch[0]) & (f < rig.notch[1]))
        return np.fft.irfft(np.fft.rfft(rng.standard_normal(len(t))) * power, len(t))
    if rig.excitation == "multisine":
        tones = tones_of(rig)
        one = t[: round(FINE)] if (tones % 1 == 0).all() else t  # whole hertz: the first second comes again and again
        waves = np.cos(2 * np.pi * np.outer(one, tones) + rng.uniform(0, 6.28, len(tones)))
        return np.resize(waves.sum(axis=1), len(t))
    if rig.excitation == "sweep":
        begin, end = rig.share[0] * rig.seconds, rig.share[1] * rig.seconds
        part = np.clip((t - begin) / (end - begin), 0, 1)
        return np.asarray(np.sin(2 * np.pi * (low * part + (high - low) * part**2 / 2) * (end - begin)))
    total = np.zeros_like(t)
    for i, blow in enumerate(np.arange(0.1, rig.seconds - 0.35, 0.45) + rng.uniform(0, 0.05)):
        shape = np.cos(np.pi * (t - blow) / 6e-3) ** 2 * (abs(t - blow) < 3e-3)
        total += rig.senses[i % len(rig.senses)] * shape
    return total


def tones_of(rig: Rig) -> Array:
    """Lines of a multi-sine [Hz]."""
    tones = np.arange(rig.band[0], rig.band[1] + 0.5)
    odd = {"every": tones > 0, "odd": tones % 2 == 1, "some odd": (tones % 2 == 1) & (tones % 10 != 5)}
    return np.asarray(tones[odd[rig.tones]])


def course_signals(rig: Rig, test: Test, rng: np.random.Generator, film: tuple[float, float]) -> dict[str, CubicSpline]:
    """Signals of a course, by quantity functions of time to (n, 2); `film` is the run's load and scale of H."""
    t = np.arange(round((BEFORE + rig.seconds + AFTER) * FINE)) / FINE - BEFORE
    drive = sine_course(rig, test, t, rng) if rig.excitation == "sine" else band_course(rig, t, rng)
    start = -np.inf if rig.share[0] == 0 else rig.share[0] * rig.seconds
    end = np.inf if rig.share[1] == 1 else rig.share[1] * rig.seconds
    drive = drive * np.clip((t - start) / 0.02, 0, 1) * np.clip((end - t) / 0.02, 0, 1)
    n = len(t)
    spectrum = np.fft.rfft(drive, 2 * n)[:, None] * unit_vector(test.direction)
    matrices = response(rig, np.fft.rfftfreq(2 * n, 1 / FINE), *film)
    matrices["command"] = np.broadcast_to(np.eye(2), matrices["force"].shape)
    signals = {q: np.fft.irfft((m @ spectrum[..., None])[..., 0], axis=0)[:n] for q, m in matrices.items()}
    motion = signals["displacement"][(t >= 0) & (t < rig.seconds)]
    largest = np.abs(motion).max() if rig.excitation in ("impact", "sine") else 0.0
    size = largest or np.sqrt(np.mean(np.sum(motion**2, axis=1)))
    return {q: CubicSpline(t, rig.amplitude * rig.clearance / size * values) for q, values in signals.items()}


def lines_of(
    rig: Rig, test: Test, rng: np.random.Generator, film: tuple[float, float], shaft: float
) -> list[tuple[float, Any]]:
    """Every steady line: frequency and phasors by quantity (2,); the drive's first. `shaft`: its angle at 0 s [rad]."""
    f, circle = np.array(test.frequency + rig.detune), np.array([1.0, -1.0j])
    phase, aside = (0.7, 1.6) if rig.locked else rng.uniform(0, 6.28, 2)
    amplitude = rig.amplitude * test.size
    stiffer = film[0], film[1] * (1 + 0.75 * rig.film.cube * amplitude**2)
    matrices = response(rig, f, *stiffer)
    push = unit_vector(test.direction) + 0.04 * unit_vector(test.direction + 90) * np.exp(1j * aside)
    push = push * np.exp(1j * phase)
    push = push * amplitude * rig.clearance / np.linalg.norm(matrices["displacement"] @ push)
    motion = matrices["displacement"] @ push
    lines = [(float(f), {q: m @ push for q, m in matrices.items()})]
    if test.dry:
        return lines
    lines += overtones(rig, f, motion, film)
    if rig.harmonic:
        again = rig.harmonic * push * np.exp(1j * (phase + 0.5))
        lines.append((2 * float(f), {q: m @ again for q, m in response(rig, 2 * f, *film).items()}))
    for frequency, share in ((rig.speed, rig.unbalance), *rig.lines):
        angle = shaft + 0.3 if frequency == rig.speed else rng.uniform(0, 6.28)
        on_film = share * usual_force(rig, test.frequency, test.load) * circle * np.exp(1j * angle)
        matrices = response(rig, np.array(frequency), *film)
        d = np.linalg.solve(rig.film.h(frequency, film[0]) * film[1], on_film)
        push = np.linalg.solve(matrices["displacement"], d)
        lines.append((frequency, {q: m @ push for q, m in matrices.items()}))
    for order in (1, 2, 3):
        # waves of the shaft's surface, as probes at 45 and 135 deg see them
        waves = sum(unit_vector(at) * np.exp(1j * order * (shaft - np.radians(at))) for at in (45.0, 135.0))
        lines.append((order * rig.speed, {"displacement": rig.runout / order * rig.clearance * waves}))
    return lines


def usual_force(rig: Rig, frequency: float, load: float) -> float:
    """What a drive of the usual amplitude pushes the film with [N], whatever its direction."""
    return rig.amplitude * rig.clearance * float(np.abs(np.diag(rig.film.h(frequency, load))).mean())


def overtones(rig: Rig, f: Array, d: Array, film: tuple[float, float]) -> list[tuple[float, Any]]:
    """Motion (2,) at two and three times the drive's frequency by which a curved film makes up for its own force."""
    lines, direct = [], np.abs(np.diag(rig.film.h(f, film[0]))) * film[1]
    if rig.film.square:
        product = np.array([0.5 * d[0] ** 2 + 1.2 * d[0] * d[1], d[1] ** 2 + 0.4 * d[0] ** 2])
        on_film = 0.5 * rig.film.square / rig.clearance * direct * product
        lines.append((2, on_film))
    if rig.film.cube:
        share = np.linalg.norm(d) / rig.clearance
        lines.append((3, 0.25 * rig.film.cube * share**2 * direct * d * np.exp(2j * np.angle(d))))
    return [
        (order * float(f), {"displacement": -np.linalg.solve(rig.film.h(order * f, film[0]) * film[1], on_film)})
        for order, on_film in lines
    ]


def signal(rig: Rig, test: Test, rng: np.random.Generator) -> Signal:
    """Everything that a run's sensors could see."""
    load = test.load * (1 + rig.load_scatter * rng.standard_normal())
    pull = unit_vector(rig.load_direction + np.degrees(rig.load_scatter * rng.standard_normal()))
    film = (load, (1 + rig.stiffness_scatter * rng.standard_normal()) * (not test.dry))
    shaft = 0.0 if rig.locked else rng.uniform(0, 6.28)
    steady = lines_of(rig, test, rng, film, shaft)
    courses: dict[str, CubicSpline] = {}
    if (rig.excitation, rig.share, rig.wander, rig.switch) != ("sine", (0.0, 1.0), 0.0, 1.0):
        steady, courses = steady[1:], course_signals(rig, test, rng, film)
    means = {"displacement": 0.5 * rig.clearance * pull * (test.load > 0), "force": load * pull * rig.static}

    def values(quantity: str, times: Array) -> Array:
        if quantity == "keyphasor":  # a pulse at three tenths of a turn
            away = np.abs((rig.speed * times + shaft / (2 * np.pi)) % 1.0 - 0.3)
            return np.array([5.0 * np.clip(20 * (0.05 - away), 0, 1), 0 * times])
        total = np.zeros((2, len(times))) + means.get(quantity, np.zeros(2))[:, None]
        for frequency, phasors in steady:
            if quantity in phasors:
                total += np.real(phasors[quantity][:, None] * np.exp(2j * np.pi * frequency * times))
        return total + courses[quantity](times).T if quantity in courses else total

    return values


def clearance_sweep(rig: Rig) -> Signal:
    """A small load goes round once; the shaft lies against five stiff pads at the clearance."""
    normals = np.array([unit_vector(-90 + 72 * i) for i in range(5)])
    load = 0.05 * max(rig.film.load, 100.0)
    stiffness = load / (0.004 * rig.clearance)

    def values(quantity: str, times: Array) -> Array:
        angle = 2 * np.pi * times / times[-1]
        push = load * np.array([np.cos(angle), np.sin(angle)])
        if quantity != "displacement":
            return push * (quantity == "force")
        place = rig.clearance * push / load
        for _ in range(60):  # Newton on springs that only push
            over = np.maximum(normals @ place - rig.clearance, 0.0)
            missing = push - stiffness * normals.T @ over - 1e-4 * stiffness * place
            k = np.einsum("pn,pi,pj->nij", (over > 0) * stiffness, normals, normals) + 1e-4 * stiffness * np.eye(2)
            place = place + np.linalg.solve(k, missing.T[..., None])[..., 0].T
        return np.asarray(place)

    return values


def channels_of(rig: Rig, probes: tuple[float, ...] = (45.0, 135.0), stage: float = 0.0) -> tuple[Channel, ...]:
    """The usual sensors: probes at their angles, cells and accelerometers at `stage` and 90 deg more [deg]."""
    channels = [Channel(f"X1{'ABCDEF'[i]}", "displacement", axis) for i, axis in enumerate(probes)]
    for letter, quantity in (("L", "force"), ("A", "acceleration")):
        channels += [Channel(letter + "1H", quantity, stage), Channel(letter + "1V", quantity, stage + 90)]
    if rig.excitation != "sine":
        channels += [Channel("CMDX", "command", 0.0), Channel("CMDY", "command", 90.0)]
    if rig.keyphasor:
        channels.append(Channel("KEY", "keyphasor", 0.0))
    return tuple(channels)


def noise_of(rig: Rig) -> dict[str, float]:
    """Usual noise of a sample, by quantity."""
    force = usual_force(rig, rig.frequencies[0], rig.film.load)
    return {"displacement": 3e-4 * rig.clearance, "force": 0.01 * force, "acceleration": 4e-3, "command": 2e-3 * force,
            "keyphasor": 0.05}  # fmt: skip


def tests_of(rig: Rig) -> list[Test]:
    """The plan."""
    frequencies = rig.frequencies if rig.excitation == "sine" else (sum(rig.band) / 2,)
    points = [(load, f) for load in rig.loads for f in frequencies]
    runs = [(direction, size) for direction in rig.directions * rig.repeats for size in rig.sizes]
    dry = [Test(0.0, f, direction, dry=True) for f in frequencies * any(rig.beside) for direction in rig.directions]
    return [Test(*point, *run) for point in points for run in runs] + dry


def campaign(rig: Rig, channels: tuple[Channel, ...], seed: list[int]) -> Campaign:
    """All runs of a rig."""
    rng = np.random.default_rng(seed)
    return campaign_of(rig, [signal(rig, test, rng) for test in tests_of(rig)], channels)


def campaign_of(rig: Rig, signals: list[Signal], channels: tuple[Channel, ...]) -> Campaign:
    """Signals of all runs with what the manifest says of them."""
    runs = []
    for i, (test, values) in enumerate(zip(tests_of(rig), signals)):
        lines = [f'kind = "dynamic"\nshaft_speed = "{rig.speed:g} Hz"\nstatic_load = "{test.load:g} N"']
        lines += [f'static_load_direction = "{rig.load_direction:g} deg"']
        lines = ['kind = "baseline"\nshaft_speed = "0 Hz"'] if test.dry else lines
        lines += [f'excitation_direction = "{test.direction:g} deg"']
        if rig.excitation == "sine":
            lines += [f'excitation_frequency = "{test.frequency:g} Hz"']
        else:
            lines += [f'excitation = "{rig.excitation}"\nexcitation_band = "{rig.band[0]:g}..{rig.band[1]:g} Hz"']
        part, (cold, warm) = i / max(len(signals) - 1, 1), rig.temperatures
        warmth = cold + (warm - cold) * part
        lines += [f'temperature = "{warmth:g} degC"'] if warm != cold else []
        name = f"d-{i:02d}-{test.load:g}-{test.frequency:g}-{test.direction:g}"
        runs.append(Run(name, tuple(lines), values, rig.seconds, warmth, rig.tilt))
    if rig.with_clearance:
        runs.append(Run("c-1", ('kind = "clearance"',), clearance_sweep(rig), 8.0))
    head = ("[housing]", f'mass = "{rig.stated_mass or rig.mass:g} kg"', *rig.head)
    off = rig.detune if rig.excitation == "sine" else 0.0
    bearing = bearing_file(rig.diameter, rig.clearance)
    return Campaign(head, bearing, channels, tuple(runs), lambda w, f: rig.film.h(f + off, w), lambda f: f + off)


def with_entries(channels: tuple[Channel, ...], names: str, **entries: Any) -> tuple[Channel, ...]:
    """The same channels, those whose name begins with one of the words of `names` with other entries."""
    starts = tuple(names.split())
    return tuple(replace(c, **entries) if c.name.startswith(starts) else c for c in channels)


def write_rig(
    folder: Path, rig: Rig, channels: tuple[Channel, ...] = (), setup: Acquisition | None = None, seed: int = 1
) -> Path:
    """Write a campaign of a rig, with its usual sensors unless others are given, exact but for noise; its path."""
    setup = replace(setup or Acquisition(uncertainty=EXACT), noise=noise_of(rig))
    folder.mkdir(parents=True, exist_ok=True)
    return write_campaign(folder, campaign(rig, channels or channels_of(rig), [seed]), setup, [seed, 1])


def vector(h: Array) -> Array:
    """Real and imaginary entries of a dynamic stiffness (8,), as estimates list them."""
    return np.concatenate([h.real.ravel(), h.imag.ravel()])

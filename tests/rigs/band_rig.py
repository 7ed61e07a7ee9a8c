"""A test rig shaken over a band, in closed form: every spectral line of a long record obeys F = h D exactly.

The force is a trigonometric polynomial over a record several times as long as the one that is kept, so that what is
kept begins and ends in motion; periodic excitation repeats within it. Film, housing on its cells, accelerometers,
runout, unbalance, mains and noise of every channel are those of `rig`; neither `model` nor the virtual rig takes part.
"""

from dataclasses import dataclass

import numpy as np

from tests.rigs.closed_form import Film

#: The long record over the one that is kept.
LONGER = 3
#: Channels of the rig: quantity and axis [deg]; noise of a sample by quantity, SI.
CHANNELS = {
    "D1": ("displacement", 45.0),
    "D2": ("displacement", 135.0),
    "F1": ("force", 0.0),
    "F2": ("force", 90.0),
    "A1": ("acceleration", 0.0),
    "A2": ("acceleration", 90.0),
}
NOISE = {"displacement": 0.04e-6, "force": 3.0, "acceleration": 0.02}
FILM = Film(((1.6e8, 1.5e7), (-1.2e7, 2.4e8)), ((4.2e5, -2e4), (-2.5e4, 5.5e5)), ((12.0, 1.0), (-1.0, 16.0)))


@dataclass(frozen=True)
class BandRig:
    """A rig and how it is shaken.

    `kind` is multisine, periodic random, random, sweep or impact; `period` [s] of the periodic ones; `command` how many
    command channels there are (0, 1: along the excitation, 2: both actuators at once); `noise` by quantity, times
    that of `NOISE`; `run_gain` scatter of the runs' cells; `generator` by how much the generator's clock is fast,
    `cells` by how much that of cells and accelerometers.
    """

    kind: str = "random"
    bearing: Film = FILM
    band: tuple[float, float] = (10.0, 110.0)
    rate: float = 1000.0
    seconds: float = 16.0
    period: float = 1.0
    shaft: float = 22.3
    mains: float = 50.0
    housing_mass: float = 60.0
    cell_stiffness: tuple[float, float] = (4e8, 6e8)
    force: float = 300.0
    noise: tuple[float, float, float] = (5.0, 5.0, 1.0)
    command: int = 1
    miss: tuple[float, float] = (0.0, 0.0)
    run_gain: float = 0.0
    runout: float = 3e-6
    generator: float = 0.0
    cells: float = 0.0


@dataclass(frozen=True)
class BandPlan:
    """One run: load [N] and direction of the excitation [deg]."""

    id: str
    load: float
    direction: float


def band_plans(loads: tuple[float, ...] = (5000.0,), directions: tuple[float, ...] = (30.0, 120.0)) -> list[BandPlan]:
    """Every load in some directions."""
    return [BandPlan(f"b-{load:.0f}-{i}", load, angle) for load in loads for i, angle in enumerate(directions)]


def excitation(rig: BandRig, n: int, rng: np.random.Generator) -> np.ndarray:
    """Command of one actuator over n samples, circular, of unit root mean square where it acts."""
    t = np.arange(n) / rig.rate
    kept = round(rig.seconds * rig.rate)
    start = (n - kept) // 2
    if rig.kind in ("multisine", "periodic random"):
        m = round(rig.period * rig.rate)
        one = _noise(m, rig, rng, flat=rig.kind == "multisine")
        return np.tile(one, n // m + 1)[:n]
    if rig.kind == "random":
        return _noise(n, rig, rng, flat=False)
    local = t - start / rig.rate
    if rig.kind == "sweep":
        low, high = 0.8 * rig.band[0], 1.15 * rig.band[1]
        inside = (local >= 0.02 * rig.seconds) & (local <= 0.98 * rig.seconds)
        u = np.clip((local / rig.seconds - 0.02) / 0.96, 0, 1) * 0.96 * rig.seconds
        phase = 2 * np.pi * (low * u + 0.5 * (high - low) / (0.96 * rig.seconds) * u**2) + rng.uniform(0, 2 * np.pi)
        fade = np.clip(np.minimum(u, 0.96 * rig.seconds - u) / 0.5, 0, 1)
        return np.sqrt(2) * np.sin(phase) * np.sin(0.5 * np.pi * fade) ** 2 * inside
    hits = np.arange(0.5, rig.seconds - 0.5, 1.0) + rng.uniform(-0.1, 0.1, len(np.arange(0.5, rig.seconds - 0.5, 1.0)))
    width = 0.5 / rig.band[1]
    out = np.zeros(n)
    for hit in hits:
        x = (local - hit) / width
        out += rng.uniform(8, 14) * np.where(np.abs(x) < 0.5, np.cos(np.pi * np.clip(x, -0.5, 0.5)) ** 2, 0.0)
    return out


def _noise(n: int, rig: BandRig, rng: np.random.Generator, flat: bool) -> np.ndarray:
    f = np.fft.rfftfreq(n, 1 / rig.rate)
    inside = (f >= 0.9 * rig.band[0]) & (f <= 1.1 * rig.band[1])
    phases = np.exp(2j * np.pi * rng.uniform(size=len(f)))
    size = np.ones(len(f)) if flat else np.sqrt(rng.exponential(size=len(f)))
    values = np.fft.irfft(np.where(inside, size * phases, 0.0), n)
    return values / values.std()


def stiffness(bearing: Film, omega: np.ndarray, load: float, aside: float = 0.0) -> np.ndarray:
    """Dynamic stiffness (n, 2, 2) [N/m] at many frequencies, turned by `aside` [rad]."""
    turn = np.array([[np.cos(aside), -np.sin(aside)], [np.sin(aside), np.cos(aside)]])
    return turn @ bearing.h(omega / (2 * np.pi), load) @ turn.T


def record(rig: BandRig, plan: BandPlan, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """All channels of one run, SI."""
    n = round(rig.seconds * rig.rate)
    if rig.kind in ("multisine", "periodic random"):
        m = round(rig.period * rig.rate)
        long = LONGER * m * (n // m + 1)
    else:
        long = LONGER * n
    load = plan.load * (1 + rig.miss[0] * rng.standard_normal())
    aside = rig.miss[1] * rng.standard_normal()
    angle = np.radians(plan.direction)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    drives = [excitation(rig, long, rng)] + ([excitation(rig, long, rng)] if rig.command == 2 else [])
    spectra = [np.fft.rfft(u) for u in drives]
    force = np.multiply.outer(spectra[0], along + 0.1j * across * (rig.command != 2))
    if rig.command == 2:
        force += np.multiply.outer(spectra[1], across)
    force *= rig.force
    seen = 1 + rig.run_gain * rng.standard_normal()
    omega = 2 * np.pi * np.fft.rfftfreq(long, 1 / rig.rate) * (1 + rig.generator)
    h = stiffness(rig.bearing, omega, load, aside)
    d = np.linalg.solve(h, force[:, :, None])[:, :, 0]
    springs = np.array(rig.cell_stiffness)
    cell = force * springs / (springs - rig.housing_mass * omega[:, None] ** 2)
    moved = {"displacement": d, "force": cell * seen, "acceleration": -(omega[:, None] ** 2) * cell / springs}
    start = (long - n) // 2
    waves = {q: _sampled(z, long, start, n, rig.generator, rig.cells * (q != "displacement")) for q, z in moved.items()}
    push = np.array([np.sin(aside), -np.cos(aside)]) * load
    found = {name: _channel(rig, name, waves, push, rng) for name in CHANNELS}
    for k in range(rig.command):
        found[f"C{k + 1}"] = _sampled(spectra[k][:, None], long, start, n, rig.generator)[:, 0]
    return found


def _sampled(spectrum: np.ndarray, long: int, start: int, n: int, fast: float, own: float = 0.0) -> np.ndarray:
    """Samples start .. start + n - 1 of a circular record, on a clock that is slower than its own by `fast`.

    `own` is by how much the channel's clock differs from the others, from the start of what is kept.
    """
    if not (fast or own):
        return np.fft.irfft(spectrum, long, axis=0)[start : start + n]
    at = (start + np.arange(n) * (1 + own)) * (1 + fast)
    used = np.flatnonzero(np.abs(spectrum).max(axis=1) > 1e-12 * np.abs(spectrum).max())
    out = np.zeros((n, spectrum.shape[1]))
    for part in np.array_split(used, max(1, len(used) // 64)):
        waves = np.exp(2j * np.pi * np.outer(at, part) / long)
        out += (waves @ spectrum[part]).real * (2 / long)
    return out


def _channel(
    rig: BandRig, name: str, waves: dict[str, np.ndarray], push: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    quantity, axis = CHANNELS[name]
    u = np.array([np.cos(np.radians(axis)), np.sin(np.radians(axis))])
    value = waves[quantity] @ u
    t = np.arange(len(value)) / rig.rate
    turn = 2 * np.pi * rig.shaft * t - np.radians(axis)
    if quantity == "displacement":
        value += rig.runout * np.cos(turn + 0.7) + rig.runout / 3 * np.cos(2 * turn + 1.0) + 30e-6
        value += 0.03e-6 * np.cos(2 * np.pi * rig.mains * t + axis)
    if quantity == "force":
        value += push @ u + 20.0 * np.cos(turn + 1.0) + np.cos(2 * np.pi * rig.mains * t)
    size = rig.noise[list(NOISE).index(quantity)] * NOISE[quantity]
    return value + size * rng.standard_normal(len(value))

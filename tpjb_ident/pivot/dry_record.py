"""A dry-pivot run made ready: glitches out, holds found, averaged, projected on its pad."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, ndimage

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import Problem, RigDataError
from tpjb_ident.pivot.blocks import Blocks, PivotSettings, Samples, cut_blocks
from tpjb_ident.pivot.steps import Hold, find_holds
from tpjb_ident.slow_records.bad_samples import slow_samples
from tpjb_ident.slow_records.noise import NoiseModel, NoiseSeries, estimate_noise

if TYPE_CHECKING:
    from rigdata.calibration import Channel
    from rigdata.campaign import Run


@dataclass(frozen=True)
class PadDirection:
    """A direction fitted to vectors."""

    angle: float
    se: float

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):+.2f} deg (se {math.degrees(self.se):.2f} deg) from the pad"


@dataclass(frozen=True)
class Projection:
    """Blocks on the axes of a pad: along (outward positive) and across (counter-clockwise positive)."""

    load: FloatArray
    across_load: FloatArray
    deflection: FloatArray
    across: FloatArray


def pad_axes(angle: float) -> FloatArray:
    """Rows: unit vectors along and across a pad direction [rad], (2, 2)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def project(blocks: Blocks, angle: float) -> Projection:
    """Project loads and displacements on a pad direction."""
    axes = pad_axes(angle)
    load = blocks.load @ axes.T
    displacement = blocks.displacement @ axes.T
    return Projection(load[:, 0], load[:, 1], displacement[:, 0], displacement[:, 1])


def load_direction(projection: Projection, blocks: Blocks) -> PadDirection:
    """PadDirection in which the load grows, relative to the pad."""
    vectors = np.column_stack([projection.load, projection.across_load])
    size = np.hypot(*vectors.T)
    # neighbouring blocks share one hold: their scatter about the line is counted hold by hold
    holds = max(len(np.unique(blocks.hold[blocks.hold >= 0])), 3)
    return _growth(vectors, size, np.eye(len(size)), len(size) / holds)


def displacement_direction(projection: Projection, blocks: Blocks, noise: NoiseModel) -> PadDirection:
    """PadDirection in which the shaft moves as the load grows, relative to the pad.

    Both components carry the same noise, correlated and drifting as `noise` says.
    """
    vectors = np.column_stack([projection.deflection, projection.across])
    size = np.hypot(projection.load, projection.across_load)
    return _growth(vectors, size, noise.covariance(blocks.time, blocks.duration), 1.0)


def _growth(vectors: FloatArray, size: FloatArray, covariance: FloatArray, dependence: float) -> PadDirection:
    """PadDirection of the slope of vectors (m, 2) over a load size (m,), by generalised least squares."""
    design = np.column_stack([np.ones_like(size), (size - size.mean()) / max(float(np.ptp(size)), 1e-300)])
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    x, y = whitener @ design, whitener @ vectors
    inverse = np.linalg.pinv(x.T @ x)
    along, across = (inverse @ (x.T @ y))[1]
    length = math.hypot(along, across)
    if length == 0.0:
        return PadDirection(0.0, math.inf)
    # the slope is an average over a curved path; what counts is the scatter across the direction itself
    normal = np.array([-across, along]) / length
    off = y @ normal
    misfit = float(np.sum((off - x @ (inverse @ (x.T @ off))) ** 2)) / max(len(size) - 2, 1)
    spread = math.sqrt(inverse[1, 1] * misfit * dependence)
    return PadDirection(math.atan2(across, along), spread / length)


AROUND = 0.35  # [Hz] in which the mains is looked for
SMOOTH = 0.1  # [s]: whole periods of either, so that taking off the running mean leaves the pick-up whole
NOISE_FROM, NOISE_TO = 1.0, 4.0  # [Hz] off the mains, where noise is measured
SHORTEST = 3.0  # [s] of record
MATCHES = 30.0  # chi-square below which two runs show one signature (6 degrees of freedom; by chance above: 4e-5)
CLEARER = 25.0  # by which a mistake undone must lower it


@dataclass(frozen=True)
class PickupSignature:
    """Mains line in every channel of a run."""

    channels: tuple[str, ...]
    size: ComplexArray
    noise: FloatArray


@dataclass(frozen=True)
class Mistake:
    """What a signature says of a run."""

    what: str
    agree: int


def measure_pickup(values: Mapping[str, FloatArray], good: BoolArray, rate: float) -> PickupSignature | None:
    """Mains line in the channels of one run."""
    n = len(good)
    if n < SHORTEST * rate or rate < 2.2 * max(MAINS_FREQUENCIES) or good.sum() < 0.5 * n:
        return None
    index = np.arange(n)
    window = np.hanning(n) * good
    width = max(int(SMOOTH * rate + 0.5), 3)
    rows = []
    for column in values.values():
        whole = column if good.all() else np.interp(index, index[good], column[good])
        rows.append((whole - ndimage.uniform_filter1d(whole, width, mode="nearest")) * window)
    length = fft.next_fast_len(3 * n, real=True)
    spectra = fft.rfft(np.array(rows), n=length, axis=1) * (2.0 / window.sum())
    frequency = np.arange(spectra.shape[1]) * rate / length
    best: PickupSignature | None = None
    strength = 0.0
    for mains in MAINS_FREQUENCIES:
        off = np.abs(frequency - mains)
        noise = np.sqrt(np.mean(np.abs(spectra[:, (off > NOISE_FROM) & (off < NOISE_TO)]) ** 2, axis=1))
        power = np.sum(np.abs(spectra / np.maximum(noise, 1e-300)[:, None]) ** 2, axis=0)
        peak = int(np.argmax(np.where(off < AROUND, power, 0.0)))
        if power[peak] > strength:
            strength = float(power[peak])
            best = PickupSignature(tuple(values), spectra[:, peak], noise)
    return best


def mistakes(pickups: Sequence[PickupSignature | None], pairs: Sequence[tuple[str, str]]) -> list[Mistake | None]:
    """What the signatures say of every run: nothing, or a mistake that most other runs confirm."""
    out: list[Mistake | None] = []
    for number, mine in enumerate(pickups):
        others = [p for k, p in enumerate(pickups) if k != number and p is not None]
        out.append(None if mine is None else _mistake(mine, others, pairs))
    return out


def _mistake(
    mine: PickupSignature, others: Sequence[PickupSignature], pairs: Sequence[tuple[str, str]]
) -> Mistake | None:
    others = [other for other in others if other.channels == mine.channels]
    stated = [(other, _mismatch(mine, other)) for other in others]
    strange = [(other, size) for other, size in stated if size > MATCHES]
    needed = max(2, math.ceil(len(others) / 2))
    if len(strange) < needed:
        return None
    found = [
        Mistake(what, sum(_mismatch(undone, other) < min(MATCHES, size - CLEARER) for other, size in strange))
        for what, undone in _undone(mine, pairs)
    ]
    best = max(found, key=lambda m: m.agree)
    return best if best.agree >= needed else None


def _undone(mine: PickupSignature, pairs: Sequence[tuple[str, str]]) -> list[tuple[str, PickupSignature]]:
    """A run's signature with every simple mistake undone."""
    out = []
    for first, second in pairs:
        i, j = mine.channels.index(first), mine.channels.index(second)
        order = np.arange(len(mine.channels))
        order[[i, j]] = j, i
        out.append(
            (f"{first} and {second} are exchanged", PickupSignature(mine.channels, mine.size[order], mine.noise[order]))
        )
    for i, name in enumerate(mine.channels):
        turned = np.ones(len(mine.channels))
        turned[i] = -1.0
        out.append((f"{name} is reversed", PickupSignature(mine.channels, mine.size * turned, mine.noise)))
    return out


def _mismatch(a: PickupSignature, b: PickupSignature) -> float:
    """Chi-square of one signature being the other's, times one complex factor."""
    factor = complex(np.vdot(b.size / b.noise, a.size / b.noise) / np.vdot(b.size / b.noise, b.size / b.noise))
    for _ in range(2):
        variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
        factor = complex(np.vdot(b.size / variance, a.size) / np.vdot(b.size / variance, b.size))
    variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
    return 2.0 * float(np.sum(np.abs(a.size - factor * b.size) ** 2 / variance))


FEWEST_SAMPLES = 50
MOST_LOST = 0.5  # share of samples lost to gaps and glitches above which a record is refused
FEWEST_BLOCKS = 8
UNDITHERED = 0.3  # share of samples that differ from the one before, below which noise does not reach a step


@dataclass(frozen=True)
class DryRecord:
    """One dry run of one pad."""

    run: Run
    pad: int
    angle: float
    holds: tuple[Hold, ...]
    blocks: Blocks
    projection: Projection
    lost: float
    quantisation: float
    pickup: PickupSignature | None = None


def read_dry_run(run: Run, pad_angles: FloatArray, settings: PivotSettings) -> DryRecord:
    """Read one dry run."""
    if run.pad is None or not 1 <= run.pad <= len(pad_angles):
        raise refusal(
            run, "pad", f"names pad {run.pad}, the bearing has pads 1 to {len(pad_angles)}", "Correct the manifest"
        )
    angle = float(pad_angles[run.pad - 1])
    samples, pickup = _samples(run, angle, settings)
    load_range = float(np.ptp(samples.along))
    if load_range <= 0.0 or np.ptp(samples.displacement, axis=0).max() <= 0.0:
        what = "does not move: a dead or disconnected channel"
        raise refusal(run, "force or displacement", what, "Check the channels of this run")
    holds = find_holds(samples.time, samples.along)
    blocks = cut_blocks(samples, holds, settings.block)
    if len(blocks) < FEWEST_BLOCKS:
        what = f"gives only {len(blocks)} usable averages of {settings.block:g} s"
        raise refusal(run, "record", what, "Record for longer, or set a shorter block")
    on_pad, steps = project(blocks, angle), _quantisation(samples)
    return DryRecord(run, run.pad, angle, holds, blocks, on_pad, samples.lost, steps, pickup)


def _samples(run: Run, angle: float, settings: PivotSettings) -> tuple[Samples, PickupSignature | None]:
    """Both vectors on one time base, glitches left out; the mains line of the channels behind them."""
    time, load, position, good = slow_samples(run, settings.longest_glitch)
    good &= np.isfinite(time)
    n = len(good)
    lost = 1.0 - float(np.mean(good)) if n else 1.0
    if n < FEWEST_SAMPLES or lost > MOST_LOST:
        what = f"has {n} samples, of which {100 * lost:.0f} % are missing or glitches"
        raise refusal(run, "record", what, "Repeat the test")
    pickup = _pickup(run, {"force": load, "displacement": position}, good)
    time, load, position = time[good], load[good], position[good]
    if np.any(np.diff(time) <= 0.0):
        # a logger that repeats or shuffles time stamps: order is what averages need
        order = np.argsort(time, kind="stable")
        time, load, position = time[order], load[order], position[order]
    return Samples(time, load, position, np.asarray(load @ pad_axes(angle)[0]), lost), pickup


def _pickup(run: Run, vectors: Mapping[str, FloatArray], good: BoolArray) -> PickupSignature | None:
    """Mains line per channel. Two channels per vector: only then the vector holds each of them as it was."""
    channels = axial_channels(run)
    if any(sum(c.quantity == quantity for c in channels.values()) != 2 for quantity in vectors):
        return None
    values = {name: vectors[c.quantity] @ pad_axes(c.axis or 0.0)[0] for name, c in channels.items()}
    return measure_pickup(values, good, run.sample_rate)


def axial_channels(run: Run) -> dict[str, Channel]:
    """Probes and cells of a run, by name."""
    return {n: c for n, c in run.channels.items() if c.quantity in ("force", "displacement") and c.axis is not None}


def _quantisation(samples: Samples) -> float:
    """Error of a level [m] that stands between two steps of the converter, where no noise dithers it."""
    worst = 0.0
    for column in samples.displacement.T:
        moves = np.abs(np.diff(column))
        # two channels turned into X and Y leave rounding residues: those are no steps
        real = moves > 1e-6 * np.ptp(column)
        if real.any() and real.mean() < UNDITHERED:
            worst = max(worst, float(np.min(moves[real])) / math.sqrt(6.0))
    return worst


def refusal(run: Run, place: str, what: str, cure: str) -> RigDataError:
    """Error that names the run, the place, the trouble and the cure."""
    return RigDataError(Problem("error", run.file, place, f"run {run.id} {what}", cure, run=run.id))


def noise_within_holds(records: Sequence[DryRecord], drift_rate: float) -> NoiseModel:
    """Noise from what happens within holds alone: every hold's level is free, so a bad step does no harm."""
    series: list[NoiseSeries] = []
    for record in _with_holds(records):
        used = record.blocks.hold >= 0
        if not used.any():
            series += _smooth_series(record, np.ones(len(record.blocks), dtype=bool))
            continue
        blocks = record.blocks.take(used)
        levels = np.unique(blocks.hold)
        mean = (blocks.hold[:, None] == levels[None, :]).astype(float)
        for values in (record.projection.deflection, record.projection.across):
            series.append(NoiseSeries(blocks.time, blocks.duration, values[used], mean))
    return estimate_noise(series, drift_rate, learn_drift=_any_hold(records))


def _any_hold(records: Sequence[DryRecord]) -> bool:
    return any(record.holds for record in records)


def _with_holds(records: Sequence[DryRecord]) -> Sequence[DryRecord]:
    """The records that have holds, since only they tell drift from deflection; all, where none has."""
    return [record for record in records if record.holds] or records


def noise_about_curve(records: Sequence[DryRecord], good: Sequence[BoolArray], drift_rate: float) -> NoiseModel:
    """Noise about any smooth load-deflection curve: sees the slow part of 1/f noise as well."""
    series = []
    for record, mask in zip(records, good, strict=True):
        if _any_hold(records) and not record.holds:
            continue
        held = record.blocks.hold >= 0
        series += _smooth_series(record, mask & held if (mask & held).sum() > 20 else mask)
    return estimate_noise(series, drift_rate, learn_drift=_any_hold(records))


def _smooth_series(record: DryRecord, used: BoolArray) -> list[NoiseSeries]:
    blocks = record.blocks.take(used)
    mean = _smooth_columns(record.projection.load[used], blocks)
    return [
        NoiseSeries(blocks.time, blocks.duration, values[used], mean)
        for values in (record.projection.deflection, record.projection.across)
    ]


def _smooth_columns(load: FloatArray, blocks: Blocks) -> FloatArray:
    """Columns (m, p) that span every law of `laws.py` well within the noise, and a soft toe."""
    u = np.maximum(load / np.max(load), 1e-3)
    columns = [np.ones_like(u), u, u * np.log(u), np.exp(-u / 0.06), np.exp(-u / 0.15)]
    if np.all(blocks.hold < 0):
        columns.append(np.cbrt(u) ** 2)  # a ramp has points enough for a sphere's law as it is
    if len(np.unique(blocks.branch)) > 1:
        down = (blocks.branch < 0).astype(float)
        columns += [down, down * u]
    return np.column_stack(columns)

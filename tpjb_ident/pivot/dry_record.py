"""A dry-pivot run made ready: glitches out, holds found, averaged on its pad's axes; its directions, noise and pick-up.

The rig never pushes exactly at a pad, and the shaft does not move exactly where it is pushed. What counts for the pivot
is the component of both along the pad's direction; the component across tells whether the record is what it claims.

Every channel picks up the mains with a strength and phase of its own, which belong to its cable and amplifier and are
the same in every run; only the mains' own phase changes. So the pattern of complex amplitudes over the channels, free
of one common factor, is a signature, and an exchange or a reversal at the recorder changes it in a known way. A probe
exchanged together with its cable and amplifier keeps its signature: that cannot be seen here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, ndimage

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import RigDataError, refuse
from tpjb_ident.phasors.slow_noise import NoiseModel, NoiseSeries, estimate_noise
from tpjb_ident.phasors.slow_samples import converter_step, live_run, slow_samples, spare_slopes
from tpjb_ident.pivot.blocks import Blocks, Hold, PivotSettings, Samples, cut_blocks, find_holds, pad_axes

if TYPE_CHECKING:
    from rigdata.calibration import Channel
    from rigdata.campaign import Run

_FEWEST_SAMPLES = 50
_MOST_LOST = 0.5  # share of samples lost to gaps and glitches above which a record is refused
_FEWEST_BLOCKS = 8
_UNDITHERED = 0.3  # share of samples that differ from the one before, below which noise does not reach a step
_AROUND = 0.35  # [Hz] in which the mains is looked for
_SMOOTH = 0.1  # [s]: whole periods of either, so that taking off the running mean leaves the pick-up whole
_NOISE_FROM, _NOISE_TO = 1.0, 4.0  # [Hz] off the mains, where noise is measured
_SHORTEST = 3.0  # [s] of record
_FREE = 10.0  # times the compliance of the upper loads: no contact gives so much at a hundredth of the load
_NOTABLE_WAY = 0.1  # of the deflection at the largest load: a shorter free way is left to the contact loss of the laws
_NEAR = 0.05  # of the largest load, within which a free way ends


@dataclass(frozen=True)
class PadDirection:
    """A direction [rad] relative to the pad, with its standard error."""

    angle: float = 0.0
    se: float = math.inf

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):+.2f} deg (se {math.degrees(self.se):.2f} deg) from the pad"


@dataclass(frozen=True)
class PickupSignature:
    """Mains line in every channel of a run."""

    channels: tuple[str, ...]
    size: ComplexArray  #: (n,) amplitude, in the channel's unit
    noise: FloatArray  #: (n,) standard deviation of the amplitude


@dataclass(frozen=True)
class DryRecord:
    """One dry run of one pad."""

    run: Run
    pad: int
    angle: float
    holds: tuple[Hold, ...]
    blocks: Blocks
    good: BoolArray  #: (m,) blocks that belong to the curve
    lost: float  #: share of samples lost
    quantisation: float  #: [m]
    pickup: PickupSignature | None = None
    load_direction: PadDirection = field(default_factory=PadDirection)
    displacement_direction: PadDirection = field(default_factory=PadDirection)
    slopes: Mapping[str, FloatArray] = field(default_factory=dict)  #: of readings, where more than two tell a vector
    creep: float = 0.0  #: share of the deflection that crept and was taken off
    free_load: float = 0.0  #: N: load up to which the shaft had not reached its pad


def read_dry_run(run: Run, angle: float | None, settings: PivotSettings) -> DryRecord:
    """Read one dry run of a pad at an angle [rad]; where none is known it is that toward which the load rises."""
    run = live_run(run)
    time, load, displacement, good, rate = slow_samples(run, settings.longest_glitch)
    good &= np.isfinite(time)
    lost = 1.0 - float(np.mean(good)) if len(good) else 1.0
    if len(good) < _FEWEST_SAMPLES or lost > _MOST_LOST:
        what = f"has {len(good)} samples, of which {100 * lost:.0f} % are missing or glitches"
        raise _refusal(run, "record", what, "Repeat the test")
    pickup = _pickup(run, {"force": load, "displacement": displacement}, good, rate)
    order = np.flatnonzero(good)
    if np.any(np.diff(time[order]) <= 0.0):
        # a logger that repeats or shuffles time stamps: order is what averages need
        order = order[np.argsort(time[order], kind="stable")]
    push = _push(load[order])
    if push is None:
        raise _refusal(run, "force", "has a load that does not rise", "Check the cells; repeat the run")
    if angle is None:
        angle = math.atan2(push[1], push[0])
    samples = Samples(time[order], load[order], displacement[order], angle)
    if np.ptp(samples.displacement, axis=0).max() <= 0.0:
        what = "does not move: a dead or disconnected channel"
        raise _refusal(run, "displacement", what, "Check the channels of this run")
    holds = find_holds(samples.time, samples.along)
    blocks = cut_blocks(samples, holds, settings.block)
    loose = before_contact(blocks)
    free_load = float(np.max(blocks.load[loose], initial=0.0))
    blocks = blocks.take(~loose)
    holds = holds if (blocks.hold >= 0).any() else ()
    if len(blocks) < _FEWEST_BLOCKS:
        what = f"gives only {len(blocks)} usable averages of {settings.block:g} s"
        raise _refusal(run, "record", what, "Record for longer, or set a shorter block")
    good = np.ones(len(blocks), dtype=bool)
    step = _quantisation(samples.displacement)
    direction, slopes = load_direction(blocks), spare_slopes(run, pad_axes(angle)[:1], settings.longest_glitch)
    return DryRecord(
        run, run.pad or 0, angle, holds, blocks, good, lost, step, pickup, direction, slopes=slopes, free_load=free_load
    )


def before_contact(blocks: Blocks) -> BoolArray:
    """Blocks (m,) in which the shaft still travels freely to its pad: small loads move it by far more than any pivot.

    A way that closes over some tenths of the load is left to the law's contact loss.
    """
    largest = float(np.max(blocks.load, initial=0.0))
    upper = blocks.load >= 0.3 * largest
    if np.unique(blocks.load[upper]).size < 3 or not largest > 0.0:
        return np.zeros(len(blocks), dtype=bool)
    compliance = abs(float(np.polyfit(blocks.load[upper], blocks.deflection[upper], 1)[0]))
    more = blocks.load[None, :] - blocks.load[:, None]
    way = blocks.deflection[None, :] - blocks.deflection[:, None]
    near = (more >= 0.0) & (more < _NEAR * largest)
    loose = np.asarray((near & (way > compliance * (_FREE * more + _NOTABLE_WAY * largest))).any(axis=1))
    beside = np.convolve(loose, np.ones(3), "same") > 0  # the average in which the way ends holds some of it
    return np.asarray(beside & (blocks.load < _NEAR * largest))


def _push(load: FloatArray) -> FloatArray | None:
    """From the least to the greatest of some loads (n, 2), (2,) [N]; None where the load hardly changes."""
    size = np.linalg.norm(load, axis=1)
    few = max(3, len(load) // 20)
    order = np.argsort(size)
    push = np.median(load[order[-few:]], axis=0) - np.median(load[order[:few]], axis=0)
    noise = float(np.median(np.abs(np.diff(size))))
    return push if float(np.hypot(*push)) > max(10 * noise, 1e-9) else None


def _refusal(run: Run, place: str, what: str, cure: str) -> RigDataError:
    """Error that names the run, the place, the trouble and the cure."""
    return refuse(run.file, place, f"run {run.id} {what}", cure, run.id)


def _quantisation(displacement: FloatArray) -> float:
    """Error of a level [m] that stands between two steps of the converter, where no noise dithers it."""
    steps = [step for step, share in map(converter_step, displacement.T) if share < _UNDITHERED]
    return max(steps, default=0.0) / math.sqrt(6.0)


def axial_channels(run: Run) -> dict[str, Channel]:
    """Probes and cells of a run, by name."""
    return {n: c for n, c in run.channels.items() if c.quantity in ("force", "displacement") and c.axis is not None}


def relative_calibration(channels: Iterable[Channel], angle: float) -> float:
    """Relative standard uncertainty along a pad's angle [rad] from the certificates of channels."""
    # two channels at right angles share a direction as the squares of their cosines
    shares = [math.cos((c.axis or 0.0) - angle) ** 2 * (c.uncertainty or 0.0) for c in channels]
    return math.sqrt(sum(share**2 for share in shares))


def _pickup(run: Run, vectors: Mapping[str, FloatArray], good: BoolArray, rate: float) -> PickupSignature | None:
    """Mains line per channel. Two channels per vector: only then the vector holds each of them as it was."""
    channels = axial_channels(run)
    if any(sum(c.quantity == quantity for c in channels.values()) != 2 for quantity in vectors):
        return None
    values = {name: vectors[c.quantity] @ pad_axes(c.axis or 0.0)[0] for name, c in channels.items()}
    return measure_pickup(values, good, rate)


def measure_pickup(values: Mapping[str, FloatArray], good: BoolArray, rate: float) -> PickupSignature | None:
    """Mains line in the channels (n,) of one run at `rate` [Hz]; only samples that are `good` (n,) take part."""
    n = len(good)
    if n < _SHORTEST * rate or rate < 2.2 * max(MAINS_FREQUENCIES) or good.sum() < 0.5 * n:
        return None
    index = np.arange(n)
    window = np.hanning(n) * good
    width = max(int(_SMOOTH * rate + 0.5), 3)
    rows = []
    for column in values.values():
        whole = column if good.all() else np.interp(index, index[good], column[good])
        rows.append((whole - ndimage.uniform_filter1d(whole, width, mode="nearest")) * window)
    length = fft.next_fast_len(3 * n, real=True)
    spectra = fft.rfft(np.array(rows), n=length, axis=1) * (2.0 / window.sum())
    frequency = np.arange(spectra.shape[1]) * rate / length
    strongest: PickupSignature | None = None
    strength = 0.0
    for mains in MAINS_FREQUENCIES:
        distance = np.abs(frequency - mains)
        beside = (distance > _NOISE_FROM) & (distance < _NOISE_TO)
        noise = np.sqrt(np.mean(np.abs(spectra[:, beside]) ** 2, axis=1))
        power = np.sum(np.abs(spectra / np.maximum(noise, 1e-300)[:, None]) ** 2, axis=0)
        peak = int(np.argmax(np.where(distance < _AROUND, power, 0.0)))
        if power[peak] > strength:
            strength = float(power[peak])
            strongest = PickupSignature(tuple(values), spectra[:, peak], noise)
    return strongest


def load_direction(blocks: Blocks) -> PadDirection:
    """Direction in which the load grows, relative to the pad."""
    vectors = np.column_stack([blocks.load, blocks.across_load])
    size = np.hypot(*vectors.T)
    # neighbouring blocks share one hold: their scatter about the line is counted hold by hold
    holds = max(len(np.unique(blocks.hold[blocks.hold >= 0])), 3)
    return _growth(vectors, size, np.eye(len(size)), len(size) / holds)


def displacement_direction(blocks: Blocks, noise: NoiseModel, quantisation: float = 0.0) -> PadDirection:
    """Direction in which the shaft moves as the load grows, relative to the pad; both components carry one noise."""
    vectors = np.column_stack([blocks.deflection, blocks.across])
    size = np.hypot(blocks.load, blocks.across_load)
    covariance = noise.covariance(blocks.time, blocks.duration) + quantisation**2 * np.eye(len(size))
    return _growth(vectors, size, covariance, 1.0)


def _growth(vectors: FloatArray, size: FloatArray, covariance: FloatArray, dependence: float) -> PadDirection:
    """Direction of the slope of vectors (m, 2) over a load size (m,), by generalised least squares."""
    design = np.column_stack([np.ones_like(size), (size - size.mean()) / max(float(np.ptp(size)), 1e-300)])
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    x, y = whitener @ design, whitener @ vectors
    inverse = np.linalg.pinv(x.T @ x)
    along, across = (inverse @ (x.T @ y))[1]
    length = math.hypot(along, across)
    if length == 0.0:
        return PadDirection()
    # the slope is an average over a curved path; what counts is the scatter across the direction itself
    normal = np.array([-across, along]) / length
    distance = y @ normal
    misfit = float(np.sum((distance - x @ (inverse @ (x.T @ distance))) ** 2)) / max(len(size) - 2, 1)
    spread = math.sqrt(inverse[1, 1] * misfit * dependence)
    return PadDirection(math.atan2(across, along), spread / length)


def noise_within_holds(records: Sequence[DryRecord], drift_rate: float) -> NoiseModel:
    """Noise from what happens within holds alone: every hold's level is free, so a bad step does no harm."""
    with_holds = [record for record in records if record.holds]
    series: list[NoiseSeries] = []
    for record in with_holds or records:  # only holds tell drift from deflection
        used = record.blocks.hold >= 0
        if not used.any():
            series += _smooth_series(record.blocks)
            continue
        blocks = record.blocks.take(used)
        levels = np.unique(blocks.hold)
        mean = (blocks.hold[:, None] == levels[None, :]).astype(float)
        series += _both_components(blocks, mean)
    return estimate_noise(series, drift_rate, learn_drift=bool(with_holds))


def noise_about_curve(records: Sequence[DryRecord], drift_rate: float) -> NoiseModel:
    """Noise of the good blocks about any smooth curve: sees the slow part of 1/f noise as well."""
    any_hold = any(record.holds for record in records)
    series = []
    for record in records:
        if any_hold and not record.holds:
            continue
        held = record.good & (record.blocks.hold >= 0)
        series += _smooth_series(record.blocks.take(held if held.sum() > 20 else record.good))
    return estimate_noise(series, drift_rate, learn_drift=any_hold)


def _both_components(blocks: Blocks, mean: FloatArray) -> list[NoiseSeries]:
    """Displacements along and across the pad about the columns of `mean` (m, p)."""
    return [NoiseSeries(blocks.time, blocks.duration, values, mean) for values in (blocks.deflection, blocks.across)]


def _smooth_series(blocks: Blocks) -> list[NoiseSeries]:
    """Displacements about columns that span every law of `laws.py` well within the noise, and a soft toe."""
    u = np.maximum(blocks.load / np.max(blocks.load), 1e-3)
    columns = [np.ones_like(u), u, u * np.log(u), np.exp(-u / 0.06), np.exp(-u / 0.15)]
    if np.all(blocks.hold < 0):
        columns.append(np.cbrt(u) ** 2)  # a ramp has points enough for a sphere's law as it is
    if len(np.unique(blocks.branch)) > 1:
        down = (blocks.branch < 0).astype(float)
        columns += [down, down * u]
    return _both_components(blocks, np.column_stack(columns))

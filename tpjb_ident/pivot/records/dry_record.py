"""A dry-pivot run made ready: glitches out, holds found, averaged, projected on its pad."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigdata.problem import Problem, RigDataError
from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.pivot.records.blocks import Blocks, Samples, cut_blocks
from tpjb_ident.pivot.records.pickup import PickupSignature, measure_pickup
from tpjb_ident.pivot.records.projection import Projection, pad_axes, project
from tpjb_ident.pivot.records.settings import PivotSettings
from tpjb_ident.pivot.records.steps import Hold, find_holds
from tpjb_ident.slow_records.bad_samples import slow_samples
from tpjb_ident.slow_records.noise import NoiseModel, NoiseSeries, estimate_noise

if TYPE_CHECKING:
    from rigdata.calibration import Channel
    from rigdata.campaign import Run

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

"""Noise of a campaign's displacement channels, as its dry records show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.pivot.records.blocks import Blocks
from tpjb_ident.pivot.records.dry_record import DryRecord
from tpjb_ident.slow_records.noise import NoiseModel, NoiseSeries, estimate_noise


def noise_within_holds(records: Sequence[DryRecord], drift_rate: float) -> NoiseModel:
    """Noise from what happens within holds alone: every hold's level is free, so a bad step does no harm.

    Parameters
    ----------
    records : sequence of DryRecord
    drift_rate : float
        Centre of the prior of the drift rate [m/s].
    """
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
    """Noise about any smooth load-deflection curve: sees the slow part of 1/f noise as well.

    Parameters
    ----------
    records : sequence of DryRecord
        One campaign.
    good : sequence of (m,) ndarray of bool
        Blocks to use of each record.
    drift_rate : float
        Centre of the prior [m/s].

    Returns
    -------
    NoiseModel
    """
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

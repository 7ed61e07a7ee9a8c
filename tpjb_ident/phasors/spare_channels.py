"""Channels of a plane beyond the two that tell it: dead ones are left out, the others must agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from rigdata.arrays import FloatArray
from rigdata.channel_statistics import ChannelStatistics
from rigdata.vector import directions

if TYPE_CHECKING:
    from rigdata.calibration import Channel
    from rigdata.campaign import Run

REMEDY = "Check sensitivities and axes against the certificates and the drawing; set the wrong one to ignore"
#: Two directions whose smallest singular value is below this tell no plane.
_PLANE = 0.1
#: Gain uncertainty of a channel where nothing is stated; what a curved path leaves of a slope; chance of a false alarm.
_GAIN, _CURVED, _BY_CHANCE = 0.005, 1e-3, 1e-4


def is_spare(channel: Channel, alive: Sequence[Channel]) -> bool:
    """Whether the others of a channel's quantity that are alive tell the plane without it."""
    axes = [c.axis for c in alive if c.quantity == channel.quantity and c.name != channel.name and c.axis is not None]
    return len(axes) > 1 and bool(np.linalg.svd(directions(axes), compute_uv=False)[-1] > _PLANE)


def without_dead_spares(run: Run, statistics: Mapping[str, ChannelStatistics]) -> Run:
    """The run without channels that read one value throughout, where others tell the plane without them."""
    alive = [c for name, c in run.channels.items() if name not in statistics or not statistics[name].constant]
    channels = {name: c for name, c in run.channels.items() if c in alive or not is_spare(c, alive)}
    return run if len(channels) == len(run.channels) else replace(run, channels=channels)


def contradictions(
    channels: Mapping[str, Channel], slopes: Sequence[Mapping[str, FloatArray]], noise: Mapping[str, Sequence[float]]
) -> list[str]:
    """Names of channels of one plane that do not agree, each set of them in one text.

    `slopes`: of every run, by how much each reading changes with some directions (k,); `noise`: by quantity, standard
    error of the slopes of every run.
    """
    groups: dict[tuple[str, float], list[str]] = {}
    for name in slopes[0] if slopes else ():
        if all(name in run_slopes for run_slopes in slopes):
            groups.setdefault((str(channels[name].quantity), channels[name].plane), []).append(name)
    contradicting = []
    for (quantity, _), names in groups.items():
        rows = np.vstack([np.column_stack([run_slopes[name] for name in names]) for run_slopes in slopes])
        spread = np.repeat(np.clip(noise[quantity], _CURVED, 1.0), len(rows) // len(slopes))
        if len(names) > 2 and _chance([channels[name] for name in names], rows, spread) < _BY_CHANCE:
            listed = ", ".join(names)
            contradicting.append(f"{listed} contradict one another: no movement makes all of them read what they do")
    return contradicting


def _chance(channels: Sequence[Channel], rows: FloatArray, noise: FloatArray) -> float:
    """Chance of channels (m) that are as stated to leave as much as these do.

    The changes s (m,) of readings along axes A (m, 2) with null space N leave N s, which gains and angles of the
    channels, common to all rows (r, m), and each row's own noise (r,) must explain.
    """
    axes = directions([channel.axis or 0.0 for channel in channels])
    null = np.linalg.svd(axes)[0][:, 2:].T
    gain = np.array([_GAIN if channel.uncertainty is None else channel.uncertainty for channel in channels])
    angle = np.array([channel.axis_uncertainty for channel in channels])
    moved = np.linalg.lstsq(axes, rows.T, rcond=None)[0]
    turned = (axes @ np.array([moved[1], -moved[0]])).T
    effects = [np.hstack([null * (s * gain), null * (t * angle)]) for s, t in zip(rows, turned)]
    design, residual = np.vstack(effects), (rows @ null.T).ravel()
    covariance = design @ design.T + np.diag(np.repeat(noise**2, len(null)))
    return float(special.chdtrc(len(residual), residual @ np.linalg.solve(covariance, residual)))

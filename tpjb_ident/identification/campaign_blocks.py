"""Rig and blocks of a campaign from the means of its points."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.estimate.blocks import QUANTITIES, Blocks, stacked
from tpjb_ident.estimate.noise import unbiased_noise
from tpjb_ident.estimate.sensors import axes_of, sensors_of
from tpjb_ident.identification.point_means import PointMeans
from tpjb_ident.runs.point_data import PointData
from tpjb_ident.runs.static_load import missed_load

#: Degrees of freedom below which the noise of a point is taken together with the other points'.
_FREEDOM = 60.0
#: Error of a run's mean load where its windows do not tell, relative.
_LOAD_ERROR = 2e-4


def unstated(campaign: Campaign) -> tuple[Condition, ...]:
    """Say which probes and cells have no uncertainty in the manifest."""
    names = [s.name for s in sensors_of(campaign) if s.quantity in QUANTITIES[:2] and s.uncertainty is None]
    text = f"no uncertainty in the manifest for {', '.join(names)}: their systematic part is left out"
    return holding((names, "calibration-uncertainty-unstated", text))


def run_temperatures(campaign: Campaign, measured: Iterable[tuple[str, Mapping[int, float]]]) -> dict[str, float]:
    """Temperature at the probes by run [K]: as stated, else the mean of its thermometers."""
    means = {run: float(np.mean(list(temperatures.values()))) for run, temperatures in measured if temperatures}
    noted = {run.id: run.temperature for run in campaign.of_kind("dynamic") if run.temperature is not None}
    return means | noted


def campaign_blocks(
    points: Sequence[PointData],
    means: Sequence[PointMeans],
    misses: Sequence[ComplexArray],
    bent: FloatArray,
    temperatures: Mapping[str, float],
) -> Blocks:
    """Stack the runs of all points; `bent` (P,), `temperatures` [K] by run."""
    noises, freedoms = _pooled_noise(means, [data.runs[0].length for data in points])
    names: list[str] = []
    calibrations: list[list[Hashable]] = []
    rows: list[dict[str, Any]] = []
    for p, (data, point, miss) in enumerate(zip(points, means, misses)):
        w = point.means
        for g, (run, line) in enumerate(zip(data.runs, data.lines)):
            if w is None or not w.count[g] > 0:
                continue
            channels = point.channels[g]
            calibrations = calibrations or [[] for _ in channels]
            load, loads = data.point.static_load, run.cell_force.mean
            loads = loads[np.isfinite(loads).all(axis=1)]
            # standard error of the size of the run's mean cell force
            error = float(np.linalg.norm(loads.std(axis=0, ddof=1)) / np.sqrt(len(loads))) if len(loads) > 1 else 0.0
            row = channel_columns(channels, calibrations)
            row |= {
                "point": p,
                "run": len(names),
                "omega": 2 * np.pi * run.lines.driven[line],
                "z": w.mean[g] * row["present"],
                "noise": noises[p] / w.count[g],
                "dof": freedoms[p],
                "slope": w.slope[g],
                "slope_noise": (noises[p] + w.motion) / max(float(w.spread[g]), 1e-12),
                "windows": w.count[g],
                "time": w.time[g],
                "temperature": temperatures.get(run.run, np.nan),
                "miss": missed_load(miss, [g]),
                "miss_error": error / load if load > 0 else _LOAD_ERROR,
                "shaft": point.shaft[g],
            }
            names.append(run.run)
            rows.append(row)
    return stacked([data.point for data in points], names, len(means[0].channels[0]), rows, bent)


def channel_columns(channels: Sequence[Channel | None], tables: list[list[Hashable]]) -> dict[str, Any]:
    """What a block's channels (m,) are; `tables` holds the calibrations of each sensor, new ones join it."""
    numbers = []
    for channel, calibrations in zip(channels, tables):
        if channel is not None and channel.calibration not in calibrations:
            calibrations.append(channel.calibration)
        numbers.append(0 if channel is None else calibrations.index(channel.calibration))
    present = np.array([channel is not None for channel in channels])
    return {"present": present, "along": axes_of(channels), "calibration": numbers}


def _pooled_noise(means: Sequence[PointMeans], lengths: Sequence[float]) -> tuple[list[ComplexArray], FloatArray]:
    """Noise of a window at every point with its degrees of freedom; with few, the campaign's own noise joins in.

    What points share is the noise's density: that of a window goes with one over its length [s].
    """
    densities = [(p.means.spare, length * p.means.noise) for p, length in zip(means, lengths) if p.means is not None]
    if sum(spare for spare, _ in densities) < _FREEDOM:
        # too few windows in all the campaign: what the lines leave of the records tells the noise
        densities += [(spare, noise) for noise, spare in (p.residual for p in means)]
    total = sum(spare for spare, _ in densities)
    density = np.asarray(sum(spare * noise for spare, noise in densities) / max(total, 1.0), complex)
    noises: list[ComplexArray] = []
    freedoms: list[float] = []
    for p, length in zip(means, lengths):
        spare, single = (0.0, density) if p.means is None else (p.means.spare, length * p.means.noise)
        more = min(max(_FREEDOM - spare, 0.0), total - spare)
        freedom = max(spare + more, 1.0)
        noise = np.asarray((spare * single + more * density) / freedom / length, complex)
        noises.append(unbiased_noise(noise, freedom))
        freedoms.append(freedom)
    return noises, np.array(freedoms)

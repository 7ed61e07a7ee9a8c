"""Shaft positions over load direction, from the bearing centre (paper, Fig. 14)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.vector import directions, zero_uncertainty
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.conditions import Condition, sentences
from tpjb_ident.phasors.slow_noise import NoiseModel, NoiseSeries, estimate_noise
from tpjb_ident.phasors.slow_samples import live_run, refused_runs, slow_samples
from tpjb_ident.phasors.windows import line_design
from tpjb_ident.presentation import Presented

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.campaign import Campaign, Run


_DRIFT_RATE = 1.0e-8  # [m/s], centre of the prior
_BLOCK = 0.1  # [s], for learning the noise
_NOISE_RUNS = 8  # that noise is learnt from, spread over the test
_SAME_DIRECTION = math.radians(1.0)
_LOAD_MISS = 0.05  # relative, between set point and measured load
_DIRECTION_MISS = math.radians(5.0)


@dataclass(frozen=True)
class LocusPoint:
    """Mean shaft position under one static load.

    Attributes
    ----------
    run : str
        Where it came from.
    point : OperatingPoint
        Set points.
    load, load_direction : float
        As the cells measured it [N], [rad].
    position : (2,) ndarray
        From the bearing centre [m]; from the probes' own zero where no centre is known.
    covariance : (2, 2) ndarray
        [m^2], the centre's own included.
    """

    run: str
    point: OperatingPoint
    load: float
    load_direction: float
    position: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, repr=False)
class Locus(Presented):
    """Positions of the shaft centre over load direction.

    Attributes
    ----------
    points : tuple of LocusPoint
        In order of load and direction.
    centre : (2,) ndarray
        Reading of the bearing centre that was taken off [m]; zero where none is known.
    drift : (2,) ndarray
        Drift taken off, per run in the order of testing [m]; NaN where no direction was repeated.
    status : tuple of Condition
        Named conditions.
    """

    points: tuple[LocusPoint, ...]
    centre: FloatArray
    drift: FloatArray
    status: tuple[Condition, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Table of `locus.csv` (outputs.md)."""
        import pandas as pd

        se = np.sqrt(np.array([np.diag(p.covariance) for p in self.points]))
        place = np.array([p.position for p in self.points])
        return pd.DataFrame(
            {
                "static_load_N": [p.point.static_load for p in self.points],
                "static_load_direction_deg": [p.point.static_load_direction_deg for p in self.points],
                "shaft_speed_Hz": [p.point.shaft_speed_hz for p in self.points],
                "rotation": [p.point.rotation for p in self.points],
                "static_load_measured_N": [p.load for p in self.points],
                "static_load_direction_measured_deg": [math.degrees(p.load_direction) for p in self.points],
                "x_m": place[:, 0],
                "y_m": place[:, 1],
                "x_m_se": se[:, 0],
                "y_m_se": se[:, 1],
                "run": [p.run for p in self.points],
            }
        )

    def plot(self, **options: Any) -> Any:
        """Draw the positions; see `tpjb_ident.report.plots.clearance_and_locus`.

        Parameters
        ----------
        **options
            ``polygons``, ``predicted``, ``drawing``, ``title``.
        """
        from tpjb_ident.report.plots import clearance_and_locus

        return clearance_and_locus(locus=self, **options)

    def __str__(self) -> str:
        radii = [1e6 * float(np.hypot(*p.position)) for p in self.points]
        origin = "probes' zero" if "no-centre" in self.status else "centre"
        text = f"{len(self.points)} positions, {min(radii):.1f} to {max(radii):.1f} µm from the {origin}"
        return text + (f"; {', '.join(sentences(self.status))}" if self.status else "")


def measure_locus(campaign: Campaign, polygon: ClearancePolygon | None = None) -> Locus:
    """Measure the mean position of every locus run.

    Parameters
    ----------
    campaign : Campaign
        With runs of kind ``locus``.
    polygon : ClearancePolygon, optional
        Gives the bearing centre, and a wall that no position may lie behind.

    Returns
    -------
    Locus

    Raises
    ------
    RigDataError
        When the campaign has no locus runs, or half of them or more cannot be used. Fewer are left out, and the status
        names them.

    Examples
    --------
    >>> locus = ti.measure_locus(ti.load_campaign(demo))
    >>> print(locus.points[0].position.shape, locus.status[0])
    (2,) no-centre
    """
    runs = campaign.of_kind("locus")
    if not runs:
        raise refuse("campaign.toml", "runs", "has no runs of kind locus", "Record the shaft locus")
    records, refused = _usable(runs)
    noise = _noise(list(records.values()))
    centre = np.zeros(2) if polygon is None else polygon.centre
    drift, drift_variance = _drift(records, noise, centre)
    correction = np.nan_to_num(drift)
    # with the bearing's centre from the same probes their zero falls out
    zero = np.diag(zero_uncertainty(campaign.channels.values(), "displacement") ** 2)
    centre_covariance = zero if polygon is None else polygon.centre_covariance
    points = []
    for order, record in records.items():
        run = runs[order]
        position = record.position - correction * order - centre
        variance = (noise.mean_variance(record.span) + order**2 * drift_variance) * np.eye(2)
        points.append(
            LocusPoint(run.id, run.point, record.load, record.direction, position, variance + centre_covariance)
        )
    points.sort(key=lambda p: (p.point.static_load, p.point.spin, _from_down(p.point.static_load_direction)))
    return Locus(tuple(points), np.asarray(centre), drift, (*_status(points, polygon, drift), *refused))


def _usable(runs: Sequence[Run]) -> tuple[dict[int, _Record], tuple[Condition, ...]]:
    """Runs that can be used, by their number in the order of testing, and a condition that names the others."""
    records: dict[int, _Record] = {}
    problems: list[Problem] = []
    for order, run in enumerate(runs):
        try:
            records[order] = _read(run)
        except RigDataError as error:
            problems += error.problems
    if 2 * len(records) <= len(runs):
        raise RigDataError(problems)
    return records, refused_runs(problems)


@dataclass(frozen=True)
class _Record:
    """One locus run: mean position and load, and block averages for the noise."""

    point: OperatingPoint
    position: FloatArray  #: (2,) [m]
    load: float  #: [N]
    direction: float  #: [rad]
    span: float  #: [s]
    block_time: FloatArray  #: (m,) [s]
    blocks: FloatArray  #: (m, 2) [m]


def _from_down(direction: float) -> float:
    """Angle from straight down, 0 to 2 pi: the order in which a locus is swept."""
    return (direction + math.pi / 2 + 1e-9) % (2 * math.pi)


def _read(run: Run) -> _Record:
    time, force, place, good, _ = slow_samples(live_run(run))
    if good.sum() < 50 or good.mean() < 0.5:
        what = f"locus run {run.id} has only {int(good.sum())} usable samples of {len(good)}"
        raise refuse(run.file, "record", what, "Repeat this direction", run.id)
    time, place = time[good], place[good]
    # what turns with the shaft (runout, unbalance) averages out only over whole turns: take it off
    speed = run.point.shaft_speed_hz
    turning = [speed, 2 * speed] if speed * (time[-1] - time[0]) > 2.0 else []
    design = line_design(time, np.array(turning), drift_order=0)
    mean = np.linalg.lstsq(design, np.hstack([place, force[good]]), rcond=None)[0]
    steady = place - design[:, :-1] @ mean[:-1, :2]
    label = np.floor((time - time[0]) / _BLOCK).astype(int)
    count = np.bincount(label)
    usual = np.median(count[count > 0])
    parts = [label == k for k in np.flatnonzero(count > 0.5 * usual)]
    load = mean[-1, 2:]
    return _Record(
        point=run.point,
        position=np.asarray(mean[-1, :2], dtype=float),
        load=float(np.hypot(*load)),
        direction=float(np.arctan2(load[1], load[0])),
        span=float(time[-1] - time[0]),
        block_time=np.array([time[part].mean() for part in parts]),
        blocks=np.array([steady[part].mean(axis=0) for part in parts]),
    )


def _noise(records: list[_Record]) -> NoiseModel:
    """Noise of the probes, pooled over all runs."""
    series = []
    for record in records[:: max(1, len(records) // _NOISE_RUNS)]:
        time, m = record.block_time, len(record.block_time)
        series += [NoiseSeries(time, np.full(m, _BLOCK), values, np.ones((m, 1))) for values in record.blocks.T]
    if max(len(s.time) for s in series) <= 3:
        # records of a few tenths of a second show no noise over seconds: take the scatter within each run
        scatter = float(np.mean([np.var(s.values) for s in series])) + 1e-18
        return NoiseModel(scatter * _BLOCK, scatter, _DRIFT_RATE)
    return estimate_noise(series, _DRIFT_RATE)


def _drift(records: dict[int, _Record], noise: NoiseModel, centre: FloatArray) -> tuple[FloatArray, float]:
    """Drift per run (2,) [m] from repeats of one set point, NaN without any, and the variance [m^2] of a component.

    Runs are evenly spaced in time as far as anyone knows: the drift is taken as proportional to the run's number. A
    repeat meets its set point otherwise than the first time: by as much, times its distance from the centre, the shaft
    may stand elsewhere without any drift.
    """
    runs_between, shifts, variances = [], [], []
    for (i, first), (j, repeat) in itertools.combinations(records.items(), 2):
        if not _same_set_point(first.point, repeat.point):
            continue
        load_miss = repeat.load / max(first.load, 1e-300) - 1.0
        miss = math.hypot(load_miss, math.remainder(repeat.direction - first.direction, 2 * math.pi))
        elsewhere = miss * float(np.hypot(*(first.position - centre)))
        runs_between.append(float(j - i))
        shifts.append(repeat.position - first.position)
        variances.append(noise.mean_variance(first.span) + noise.mean_variance(repeat.span) + elsewhere**2)
    if not shifts:
        return np.full(2, np.nan), 0.0
    intervals = np.array(runs_between)
    weight = intervals / (intervals @ intervals)
    return weight @ np.array(shifts), float(weight**2 @ np.array(variances))


def _same_set_point(first: OperatingPoint, second: OperatingPoint) -> bool:
    turn = abs(math.remainder(first.static_load_direction - second.static_load_direction, 2 * math.pi))
    same = first.static_load == second.static_load and first.spin == second.spin
    return same and turn < _SAME_DIRECTION


def _status(points: list[LocusPoint], polygon: ClearancePolygon | None, drift: FloatArray) -> tuple[Condition, ...]:
    status = []
    if polygon is None:
        status.append(Condition("no-centre", "positions from the probes' zero, no clearance polygon given"))
    if np.isnan(drift).any():
        status.append(Condition("drift-unknown", "no load direction was repeated"))
    missed = []
    for p in points:
        load_miss = abs(p.load - p.point.static_load) / max(p.point.static_load, 1.0)
        turn = abs(math.remainder(p.load_direction - p.point.static_load_direction, 2 * math.pi))
        if load_miss > _LOAD_MISS or turn > _DIRECTION_MISS:
            missed.append(p.run)
    if missed:
        status.append(Condition("load-off-set-point", ", ".join(missed)))
    if polygon is not None:
        behind = [p.run for p in points if _behind(p, polygon)]
        if behind:
            status.append(Condition("outside-polygon", ", ".join(behind)))
    return tuple(status)


def _behind(point: LocusPoint, polygon: ClearancePolygon) -> bool:
    """True where the shaft lies behind a pad's unloaded face by more than any pivot deflects."""
    return bool(np.nanmax(directions(polygon.angles) @ point.position - 1.5 * polygon.clearance) > 0.0)

"""Shaft positions over load direction, from the bearing centre (paper, Fig. 14)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage, special

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError, refuse
from rigdata.vector import directions, wrapped, zero_uncertainty
from tpjb_ident.clearance.measure import ClearancePolygon, probe_gains
from tpjb_ident.columns import amount
from tpjb_ident.conditions import Conditions, holding, sentences
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.phasors.lines import line_design
from tpjb_ident.phasors.slow_noise import DRIFT_RATE, NoiseModel, NoiseSeries, estimate_noise
from tpjb_ident.phasors.slow_samples import live_run, refused_runs, slow_samples
from tpjb_ident.pivot.blocks import time_bins
from tpjb_ident.pivot.dry_record import refusal
from tpjb_ident.pivot.refusals import usable_runs
from tpjb_ident.pivot.sweep_witness import as_witnessed
from tpjb_ident.presentation import Presented
from tpjb_ident.rounding import listed
from tpjb_ident.schema import STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.calibration import Channels
    from rigdata.campaign import Campaign, Run


#: Columns of `locus.csv` behind the set point.
_MEASURED = (
    "static_load_measured_N", "static_load_direction_measured_deg", "x_m", "y_m", "x_m_se", "y_m_se", "run",
)  # fmt: skip
_BLOCK = 0.1  # [s], for learning the noise
_NOISE_RUNS = 8  # that noise is learnt from, spread over the test
_SAME_DIRECTION = math.radians(1.0)
_LOAD_MISS = 0.05  # relative, between set point and measured load
_DIRECTION_MISS = math.radians(5.0)
_STEADY = 3.0  # standard deviations of what a shaft that stands changes within a record, and at least
_LEAST_MOVE = 0.5e-6  # [m]: a smaller change is of no consequence
_UNLIKE = 0.5  # share by which a bearing may answer a turned or larger load otherwise than a round one does
_OFF_CENTRE = 5.0e-6  # [m] beyond what the pads' clearances differ by: one soft pivot moves the middle by some 2 um
_AROUND = math.radians(100.0)  # largest gap between directions of a locus that goes around


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
        [m^2], the centre's own included, and where repeats tell it how well the shaft comes back.
    doubt : (2, 2) ndarray or float
        Beside that, of the probes' gains and of other centres that fit a sweep as well [m^2]: what all positions share.
    """

    run: str
    point: OperatingPoint
    load: float
    load_direction: float
    position: FloatArray
    covariance: FloatArray
    doubt: FloatArray | float = 0.0


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
        Drift taken off, per run in the order of testing, of a jump the mean [m]; NaN where no direction was repeated.
    status : tuple of Condition
        Named conditions.
    """

    points: tuple[LocusPoint, ...]
    centre: FloatArray
    drift: FloatArray
    status: Conditions = ()

    def to_frame(self) -> pd.DataFrame:
        """Table of `locus.csv` (outputs.md)."""
        import pandas as pd

        rows = []
        for p in self.points:
            measured = p.load, math.degrees(p.load_direction)
            rows.append((*p.point.static_key, *measured, *p.position, *np.sqrt(np.diag(p.covariance + p.doubt)), p.run))
        return pd.DataFrame(rows, columns=[*STATIC_KEY, *_MEASURED])

    def plot(self, **options: Any) -> Any:
        """Draw the positions; `tpjb_ident.report.plots.clearance_and_locus` takes the same options."""
        from tpjb_ident.report.plots import clearance_and_locus

        return clearance_and_locus(locus=self, **options)

    def __str__(self) -> str:
        radii = [float(np.hypot(*p.position)) for p in self.points]
        nearest, farthest = (amount(radius, "length", ".3g") for radius in (min(radii), max(radii)))
        origin = "probes' zero" if "no-centre" in self.status else "centre"
        text = f"{len(self.points)} positions, {nearest} to {farthest} from the {origin}"
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
    # with the bearing's centre from the same probes their zero falls out
    zero = np.diag(zero_uncertainty(campaign.channels.values(), "displacement") ** 2)
    centre, known, doubt = np.zeros(2), zero, np.zeros((2, 2))
    channels: Channels = {}
    if polygon is not None:
        centre, known = polygon.centre, polygon.centre_covariance
        doubt, channels = polygon.centre_doubt, polygon.sensors
    records, problems = usable_runs(runs, lambda run: _read(run, channels))
    if 2 * len(records) <= len(runs):
        raise RigDataError(problems)
    orders = np.array([runs.index(record.run) for record in records], dtype=float)
    noise = _noise(records)
    walk = _walk(records, orders, noise, centre)
    points, on_its_way = [], [walk.jump] if walk.jump else []
    for record, moved, walked in zip(records, walk.moved, walk.covariance, strict=True):
        if size := _moved(record, noise):
            on_its_way.append(f"halves of {record.run.id} stand {amount(size, 'length', '.2g')} apart")
        position = record.position - moved - centre
        # of a steady way the ends are as far from the mean as the halves from each other
        variance = noise.mean_variance(record.span) + size**2 / 4.0
        run, covariance = record.run, variance * np.eye(2) + known + walked
        shared = doubt + _gain_errors(as_witnessed(run, channels), position)
        points.append(LocusPoint(run.id, run.point, record.load, record.direction, position, covariance, shared))
    off = np.zeros(2) if polygon is None else _off_centre(points, polygon)
    # nothing tells whether the zero moved before the sweep, after it or within: the interval holds the way
    points = [replace(p, covariance=p.covariance + np.outer(off, off)) for p in points]
    points.sort(key=lambda p: _swept(p.point))
    if off.any():
        on_its_way.append(f"positions go around a place {amount(math.hypot(*off), 'length', '.2g')} from the centre")
    status = (*_status(points, polygon, walk.repeats, listed(on_its_way, 4)), *refused_runs(problems))
    return Locus(tuple(points), centre, walk.drift, status)


@dataclass(frozen=True)
class _Record:
    """One locus run: mean position and load, and block averages for the noise."""

    run: Run
    position: FloatArray  #: (2,) [m]
    load: float  #: [N]
    direction: float  #: [rad]
    span: float  #: [s]
    blocks: tuple[NoiseSeries, NoiseSeries]  #: of either component


@dataclass(frozen=True)
class _Walk:
    """What the probes' zero did over a locus of n runs, as far as directions tell that were repeated."""

    repeats: int  #: runs at a set point that was there before
    drift: FloatArray  #: (2,) per run [m]; NaN without any repeat
    moved: FloatArray  #: (n, 2) [m]
    covariance: FloatArray  #: (n, 2, 2) of that, and of how well the shaft comes back [m^2]
    jump: str = ""  #: in words


def _swept(point: OperatingPoint) -> tuple[float, ...]:
    """Load, speed, and angle from straight down, 0 to 2 pi: the order in which a locus is swept."""
    return point.static_load, point.spin, (point.static_load_direction + math.pi / 2 + 1e-9) % (2 * math.pi)


def _read(run: Run, channels: Channels) -> _Record:
    time, force, place, good, _ = slow_samples(live_run(as_witnessed(run, channels)))
    if good.sum() < 50 or good.mean() < 0.5:
        what = f"has only {good.sum()} usable samples of {len(good)}"
        raise refusal(run, "record", what, "Repeat this direction")
    time, place = time[good], place[good]
    span = time[-1] - time[0]
    # what turns with the shaft (runout, unbalance) averages out only over whole turns, as sampled: take it off
    lines, rate = run.point.shaft_speed_hz * np.array([1.0, 2.0]), (len(time) - 1) / span
    sampled = np.abs(lines - rate * np.round(lines / rate))
    design = line_design(time, lines[sampled * span > 2.0], drift_order=0)
    mean = np.linalg.lstsq(design, np.hstack([place, force[good]]), rcond=None)[0]
    load = mean[-1, 2:]
    steady = place - design[:, :-1] @ mean[:-1, :2]
    label, whole = time_bins(time, _BLOCK)
    moment, *means = (ndimage.mean(values, label, whole) for values in (time, *steady.T))
    duration, constant = np.full(len(whole), _BLOCK), np.ones((len(whole), 1))
    x, y = (NoiseSeries(moment, duration, mean, constant) for mean in means)
    return _Record(
        run=run,
        position=np.asarray(mean[-1, :2]),
        load=np.hypot(*load),
        direction=math.atan2(load[1], load[0]),
        span=span,
        blocks=(x, y),
    )


def _gain_errors(run: Run, position: FloatArray) -> FloatArray:
    """Covariance (2, 2) [m^2] of a position (2,) [m] by what the gains of its probes are known to."""
    axes, uncertainty = probe_gains(run)
    along = directions(axes)
    inverse = np.linalg.pinv(along)
    return inverse * (along @ position * uncertainty) ** 2 @ inverse.T


def _noise(records: Sequence[_Record]) -> NoiseModel:
    """Noise of the probes, pooled over all runs."""
    chosen = records[:: max(1, len(records) // _NOISE_RUNS)]
    series = list(itertools.chain.from_iterable(record.blocks for record in chosen))
    if max(len(s.time) for s in series) <= 3:
        # records of a few tenths of a second show no noise over seconds: take the scatter within each run
        scatter = np.mean([np.var(s.values) for s in series]) + 1e-18
        return NoiseModel(scatter * _BLOCK, scatter, DRIFT_RATE)
    return estimate_noise(series)


def _moved(record: _Record, noise: NoiseModel) -> float:
    """How far apart the means of both halves of a record are [m]; zero where the shaft stands."""
    time = record.blocks[0].time
    late = time > 0.5 * (time[0] + time[-1])
    if len(time) < 2:
        return 0.0
    contrast = late / late.sum() - ~late / (~late).sum()
    steady = replace(noise, drift=0.0).covariance(time, record.blocks[0].duration)
    size = math.hypot(*(contrast @ series.values for series in record.blocks))
    ordinary = _STEADY * math.sqrt(2.0 * (contrast @ steady @ contrast))
    return size if size > max(ordinary, _LEAST_MOVE) else 0.0


def _off_centre(points: Sequence[LocusPoint], polygon: ClearancePolygon) -> FloatArray:
    """Middle (2,) [m] of the positions under one load that goes around; zero where it may be the polygon's.

    Equal pads all around leave it at the centre, whatever film and pivots do; unequal ones move it by less than they
    differ.
    """
    alike = _under_one_load([p.point for p in points])
    largest = alike[np.argmax(alike.sum(axis=0))]
    turn = np.exp(1j * np.array([p.load_direction for p in points]))[largest]
    angles = np.sort(np.angle(turn))
    place = np.array([p.position for p in points])[largest] @ [1.0, 1j]
    middle = np.linalg.lstsq(np.column_stack([np.ones(len(turn)), turn]), place, rcond=None)[0][0]
    error = math.sqrt(np.median(np.array([np.trace(p.covariance) for p in points])[largest]))
    limit = _OFF_CENTRE + np.nanmax(polygon.clearance) - np.nanmin(polygon.clearance) + _STEADY * error
    goes_around = np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < _AROUND
    return _vectors(middle * (goes_around and abs(middle) > limit))


def _under_one_load(points: Sequence[OperatingPoint]) -> BoolArray:
    """Which points (n,) have load and speed in common, (n, n)."""
    loads = np.array([(point.static_load, point.spin) for point in points])
    return (loads[:, None] == loads).all(axis=2)


def _walk(records: Sequence[_Record], orders: FloatArray, noise: NoiseModel, centre: FloatArray) -> _Walk:
    """What repeats tell of the probes' zero, by least squares, with a place of its own for every set point.

    Runs are evenly spaced in time as far as anyone knows: the zero drifts in proportion to the run's number, or it
    jumps before one of them; `_likely` weighs these courses. A repeat meets its set point otherwise than the first
    time: the shaft follows the load around the centre, and by half of its change away from it, give or take a half of
    either. What two repeats or more leave beyond that and the noise is scatter; with few of them it is as much larger
    as Student's interval is wider than the normal one.
    """
    points = [record.run.point for record in records]
    aims, alike = np.array([point.static_load_direction for point in points]), _under_one_load(points)
    same = alike & (np.abs(wrapped(aims[:, None] - aims)) < _SAME_DIRECTION)
    firsts, number = same.argmax(axis=1), len(records)
    within, count = np.eye(number) - same / same.sum(axis=0), int(np.sum(firsts < np.arange(number)))
    if count == 0:
        return _Walk(0, np.full(2, np.nan), np.zeros((number, 2)), np.zeros((number, 2, 2)))
    pull = np.array([r.load * np.exp(1j * r.direction) for r in records])
    met = pull / (pull[firsts] + 1e-300)
    place = np.array([r.position for r in records]) @ [1.0, 1j]
    along = place[firsts] - centre @ [1.0, 1j]
    change = np.abs(met) - 1.0 + 1j * np.angle(met)
    variance = np.array([noise.mean_variance(r.span) for r in records]) + (_UNLIKE * np.abs(change * along)) ** 2
    courses = np.column_stack([orders, (orders[:, None] >= orders[1:]) * np.ptp(orders)])
    courses = courses[:, np.any(np.abs(within @ courses) > 1e-6, axis=0)]
    since = within @ courses
    weight = since / np.sum(since**2, axis=0)
    apart = within @ (place - (change - 0.5 * change.real) * along)
    drifts = apart @ weight
    left = np.sum(np.abs(apart[:, None] - since * drifts) ** 2, axis=0) * student_widening(max(2 * count - 2, 1)) ** 2
    noisy = variance @ (np.diag(within)[:, None] - since * weight)
    scatter = np.maximum(0.5 * left - noisy, 0.0) / max(count - 1, 1)  # one repeat leaves none
    moved = courses * drifts
    shares = _likely(alike, pull, place[:, None] - moved, np.sum(variance))
    mean, best = moved @ shares, shares.argmax()
    spread = _vectors(moved.T - mean)
    own = shares @ scatter + courses**2 @ (shares * np.sum((variance[:, None] + scatter) * weight**2, axis=0))
    covariance = np.einsum("kni,knj,k->nij", spread, spread, shares) + own[:, None, None] * np.eye(2)
    size, text = np.abs(drifts[best]) * np.ptp(orders), ""
    if shares[0] < 0.5 and size > _LEAST_MOVE:
        first = records[int(np.argmax(courses[:, best]))].run.id
        text = f"the probes' zero moved by {amount(size, 'length', '.2g')}, likely at one go before {first}"
    return _Walk(count, _vectors(drifts @ shares), _vectors(mean), covariance, text)


def _vectors(numbers: ComplexArray) -> FloatArray:
    """Complex numbers (..) as vectors (.., 2)."""
    return np.stack([numbers.real, numbers.imag], axis=-1)


def _likely(alike: BoolArray, pull: ComplexArray, places: ComplexArray, variance: float) -> FloatArray:
    """Shares (k,) of courses of the zero, by how smoothly each leaves places (n, k) [m] go around with a pull (n,) [N].

    Under one load (`alike` (n, n)) they lie on an ellipse; what else they do is of a size that nobody knows beforehand.
    """
    turn = np.exp(1j * np.angle(pull))[:, None]
    design = np.hstack([alike, alike * turn, alike / turn])
    values, _, rank, _ = np.linalg.lstsq(design, places, rcond=1e-9)
    square = np.sum(np.abs(places - design @ values) ** 2, axis=0) + 2.0 * variance
    prior = np.log(2 * len(square)) * (np.arange(len(square)) == 0)
    return special.softmax(prior - (len(pull) - rank) * np.log(square))


def _status(points: list[LocusPoint], polygon: ClearancePolygon | None, repeats: int, moved: str) -> Conditions:
    """Named conditions of a locus; `moved`: of shafts that do not stand, and a zero that did not."""
    missed, behind = [], []
    for p in points:
        load_miss = abs(p.load - p.point.static_load) / max(p.point.static_load, 1.0)
        turn = abs(math.remainder(p.load_direction - p.point.static_load_direction, 2 * math.pi))
        if load_miss > _LOAD_MISS or turn > _DIRECTION_MISS:
            missed.append(p.run)
        # behind a pad's unloaded face by more than any pivot deflects
        if polygon and np.nanmax(directions(polygon.angles) @ p.position - 1.5 * polygon.clearance) > 0.0:
            behind.append(p.run)
    not_held = "intervals do not hold how well the shaft comes back to a place"
    return holding(
        (polygon is None, "no-centre", "positions from the probes' zero, no clearance polygon given"),
        (repeats == 0, "drift-unknown", f"no load direction was repeated; {not_held}"),
        (repeats == 1, "scatter-unknown", f"one load direction was repeated; {not_held}"),
        (missed, "load-off-set-point", ", ".join(missed)),
        (behind, "outside-polygon", ", ".join(behind)),
        (moved, "misfit", moved),
    )

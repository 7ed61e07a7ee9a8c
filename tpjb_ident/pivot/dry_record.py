"""A dry-pivot run made ready: glitches out, holds found, averaged on its pad's axes; its directions and its noise.

The rig never pushes exactly at a pad, and the shaft does not move exactly where it is pushed. What counts for the pivot
is the component of both along the pad's direction; the component across tells whether the record is what it claims.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import Channel
from rigdata.campaign import Run
from rigdata.problem import RigDataError, refuse
from rigdata.vector import directions, zero_uncertainty
from tpjb_ident.columns import amount
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.phasors.slow_noise import NoiseModel, NoiseSeries, estimate_noise
from tpjb_ident.phasors.slow_samples import good_samples, level_error, live_run, slow_samples, spare_slopes
from tpjb_ident.pivot.blocks import BLOCK, Blocks, Hold, LoadCourse, cut_blocks, find_holds, load_course

#: Share of the load that friction holds back, where the load never comes back to show it.
FRICTION_SHARE, FRICTION_SE = 0.003, 0.003
LOAD_LIMIT = math.radians(8.0)  # off the pad
_STRAIGHT = 1e-4  # [rad] that a line along which a load grows is straight at best
_CLEAR, _NOTABLE = 5.0, 0.004  # standard errors of a zero that nobody stated, and share of the load
_UNSURE = 2.0  # standard errors of the zero
_FEWEST_SAMPLES = 50
_MOST_LOST = 0.5  # share of samples lost to gaps and glitches above which a record is refused
_FEWEST_BLOCKS = 8
_COURSE = 0.01, 3000  # [s], averages of the load's course: turns are sharp
_FREE = 10.0  # times the compliance of the upper loads: no contact gives so much at a hundredth of the load
_NOTABLE_WAY = 0.1  # of the deflection at the largest load: a shorter free way is left to the contact loss of the laws
_STICKS_WITHIN = 0.08  # of the load at a reversal: twice the friction of a poor pivot
_NEAR = 0.05  # of the largest load, within which a free way ends


@dataclass(frozen=True)
class PadDirection:
    """A direction [rad] relative to the pad, with its standard error."""

    angle: float = 0.0
    se: float = math.inf

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):+.2f} deg (se {math.degrees(self.se):.2f} deg) from the pad"


@dataclass(frozen=True)
class DryRecord:
    """One dry run of one pad."""

    run: Run
    pad: int
    angle: float
    holds: tuple[Hold, ...]
    blocks: Blocks
    course: LoadCourse
    good: BoolArray  #: (m,) blocks that belong to the curve
    lost: float  #: share of samples lost
    quantisation: float  #: [m]
    load_direction: PadDirection = PadDirection()
    displacement_direction: PadDirection = PadDirection()
    slopes: Mapping[str, FloatArray] = field(default_factory=dict)  #: of readings, where more than two tell a vector
    friction: tuple[float, float] = FRICTION_SHARE, FRICTION_SE  #: share held back, standard deviation: prior
    creep: float = 0.0  #: share of the deflection that crept and was taken off
    free_load: float = 0.0  #: N: load up to which the shaft had not reached its pad
    load_error: float = 0.0  #: N: standard error of the zero of the load along the pad
    elsewhere: float = 0.0  #: share of the clearance by which it begins elsewhere than a sweep has the pad
    untared: str = ""  #: what the cells read at no load, where it was taken off

    @property
    def used(self) -> Blocks:
        """The good blocks."""
        return self.blocks.take(self.good)


def read_dry_run(run: Run, angle: float | None) -> DryRecord:
    """Read one dry run of a pad at an angle [rad]; where none is known it is that toward which the load rises."""
    run = live_run(run)
    time, load, place, good, rate = slow_samples(run)
    good &= np.isfinite(time)
    lost = 1.0 - float(np.mean(good)) if len(good) else 1.0
    if len(good) < _FEWEST_SAMPLES or lost > _MOST_LOST:
        what = f"has {len(good)} samples, of which {100 * lost:.0f} % are missing or glitches: fewer than it takes"
        cure = "Export every sample, not one a step; state the sample_rate of a slower device; else repeat the test"
        raise refusal(run, "record", what, cure)
    order = np.argsort(time, kind="stable")  # a logger may repeat or shuffle time stamps
    time, load, place = time[order], load[order], place[order]
    good = good[order]
    # an overshoot of the load, which friction remembers, is no glitch for being short
    turns = good_samples(load, max(round(_COURSE[0] * rate), 3)) & np.isfinite(time)
    course = time[turns], load[turns]
    time, load, place = time[good], load[good], place[good]
    order = np.argsort(np.linalg.norm(load, axis=1))
    few = max(3, len(load) // 20)
    push = np.median(load[order[-few:]], axis=0) - np.median(load[order[:few]], axis=0)
    if angle is None:
        angle = math.atan2(push[1], push[0])
    if math.hypot(*push) <= max(10.0 * np.median(np.abs(np.diff(np.hypot(*load.T)))), 1e-9):
        raise refusal(run, "force", "has a load that does not rise", "Check the cells; repeat the run")
    axes = pad_axes(angle)
    vectors = np.hstack([load @ axes.T, place @ axes.T])
    holds = find_holds(time, vectors[:, 0])
    blocks = cut_blocks(time, vectors, holds)
    loose = before_contact(blocks)
    free_load = float(np.max(blocks.load[loose], initial=0.0))
    # where a record begins with unloading, nobody knows yet whether its pivot slides
    sticks = (blocks.branch < 0) & (blocks.load > (1.0 - _STICKS_WITHIN) * blocks.load[0])
    blocks = blocks.take(~loose & ~np.logical_and.accumulate(sticks))
    if len(blocks) < _FEWEST_BLOCKS:
        what = f"gives only {len(blocks)} usable averages of {BLOCK:g} s"
        raise refusal(run, "record", what, "Record for longer")
    return DryRecord(
        run,
        run.pad or 0,
        angle,
        holds=holds if (blocks.hold >= 0).any() else (),
        blocks=blocks,
        course=load_course(course[0], course[1] @ axes[0], *_COURSE),
        good=np.ones(len(blocks), dtype=bool),
        lost=lost,
        quantisation=level_error(place),
        load_direction=load_direction(blocks),
        slopes=spare_slopes(run, axes[:1]),
        free_load=free_load,
    )


def pad_axes(angle: float) -> FloatArray:
    """Rows: unit vectors along and across a pad direction [rad], (2, 2)."""
    return directions([angle, angle + 0.5 * math.pi])


def before_contact(blocks: Blocks) -> BoolArray:
    """Blocks (m,) in which the shaft still travels freely to its pad: small loads move it by far more than any pivot.

    A way that closes over some tenths of the load is left to the law's contact loss.
    """
    load, deflection = blocks.load - np.min(blocks.load, initial=np.inf), blocks.deflection
    largest = np.max(load, initial=0.0)
    upper = load >= 0.3 * largest
    if np.unique(load[upper]).size < 3 or not largest > 0.0:
        return np.zeros(len(blocks), dtype=bool)
    compliance = abs(np.polyfit(load[upper], deflection[upper], 1)[0])
    more, way = load - load[:, None], deflection - deflection[:, None]
    near = (more >= 0.0) & (more < _NEAR * largest)
    loose = (near & (way > compliance * (_FREE * more + _NOTABLE_WAY * largest))).any(axis=1)
    return loose & (load < _NEAR * largest)


def refusal(run: Run, place: str, what: str, cure: str) -> RigDataError:
    """Error that names the run, the place, the trouble and the cure."""
    return refuse(run.file, place, f"{run.kind.replace('_', ' ')} run {run.id} {what}", cure, run.id)


def with_load_zero(records: Sequence[DryRecord]) -> list[DryRecord]:
    """Records whose loads count from the zero of their cells.

    The load grows along a line toward each pad, and all lines meet in what the cells read at no load, wherever each of
    them points and begins. Where the manifest states no uncertainty of the zero it counts if it is clear alone.
    """
    stated = zero_uncertainty(axial_channels(records[0].run).values(), "force")
    lines = []
    for record in records:
        blocks, towards = record.blocks, record.load_direction
        if abs(towards.angle) < LOAD_LIMIT:
            lines.append((record.angle, towards.angle, towards.se, blocks.load.mean(), blocks.across_load.mean()))
    angle, turn, deviation, load, across = np.reshape(lines, (-1, 5)).T
    error = np.maximum(deviation, _STRAIGHT) * load
    design = directions(turn + (angle + 0.5 * math.pi))
    freedom = len(lines) - 2
    zero, covariance, text = np.zeros(2), np.diag(stated**2), ""
    if freedom > 0 and np.linalg.matrix_rank(design, 0.1) == 2:
        x, y = design / error[:, None], (across * np.cos(turn) - load * np.sin(turn)) / error
        scatter = np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2) / freedom
        variance = max(scatter, 1.0) * student_widening(freedom) ** 2
        spread = np.linalg.inv(x.T @ x / variance + np.diag(1.0 / stated**2 if stated.all() else np.zeros(2)))
        middle, se = spread @ (x.T @ y) / variance, math.sqrt(np.trace(spread))
        if (size := np.hypot(*middle)) > max(_CLEAR * se, _NOTABLE * np.max(load)):
            place, error = amount(float(size), "force", ".0f"), amount(se, "force", ".0f")
            text = f"the lines along which all pads' loads grow meet at {place} (se {error}); it was taken off"
        if text or stated.all():
            zero, covariance = middle, spread
    return [_less_zero(record, zero, covariance, text) for record in records]


def _less_zero(record: DryRecord, zero: FloatArray, covariance: FloatArray, untared: str) -> DryRecord:
    """A record whose loads count from a zero (2,) [N] that is known with a covariance (2, 2)."""
    axes, blocks, course = pad_axes(record.angle), record.blocks, record.course
    along, across = axes @ zero
    error = math.sqrt(axes[0] @ covariance @ axes[0])
    blocks = replace(blocks, load=blocks.load - along, across_load=blocks.across_load - across)
    # whether the pad carries anything at all is not known there
    unsure = (blocks.load < _UNSURE * error) & (error > _NOTABLE * np.max(np.abs(blocks.load)))
    return replace(
        record,
        blocks=blocks.take(~unsure),
        good=record.good[~unsure],
        course=course._replace(load=course.load - along),
        free_load=max(record.free_load - along, 0.0) if record.free_load else 0.0,
        load_error=error,
        untared=untared,
    )


def probes_of(run: Run) -> frozenset[str]:
    """Names of a run's probes."""
    return frozenset(name for name, channel in axial_channels(run).items() if channel.quantity == "displacement")


def axial_channels(run: Run) -> dict[str, Channel]:
    """Probes and cells of a run, by name."""
    return {n: c for n, c in run.channels.items() if c.quantity in ("force", "displacement") and c.axis is not None}


def relative_calibration(channels: Iterable[Channel], angle: float) -> float:
    """Relative standard uncertainty along a pad's angle [rad] from the certificates of channels."""
    # two channels at right angles share a direction as the squares of their cosines
    return math.hypot(*(math.cos((c.axis or 0.0) - angle) ** 2 * (c.uncertainty or 0.0) for c in channels))


def load_direction(blocks: Blocks) -> PadDirection:
    """Direction in which the load grows, relative to the pad."""
    # neighbouring blocks share one hold: their scatter about the line is counted hold by hold
    holds = max(len(np.unique(blocks.hold[blocks.hold >= 0])), 3)
    return _growth(blocks, (blocks.load, blocks.across_load), np.eye(len(blocks)), len(blocks) / holds)


def displacement_direction(blocks: Blocks, noise: NoiseModel, quantisation: float = 0.0) -> PadDirection:
    """Direction in which the shaft moves as the load grows, relative to the pad; both components carry one noise."""
    return _growth(blocks, (blocks.deflection, blocks.across), blocks.covariance(noise, quantisation))


def _growth(
    blocks: Blocks, vector: tuple[FloatArray, FloatArray], covariance: FloatArray, dependence: float = 1.0
) -> PadDirection:
    """Direction of the slope of a vector, along and across (m,), over the load's size, by generalised least squares."""
    size = np.hypot(blocks.load, blocks.across_load)
    columns = np.column_stack([np.ones_like(size), (size - size.mean()) / max(np.ptp(size), 1e-300), *vector])
    whitened = np.linalg.inv(np.linalg.cholesky(covariance)) @ columns
    x, y = whitened[:, :2], whitened[:, 2:]
    inverse = np.linalg.pinv(x.T @ x)
    along, across = (inverse @ (x.T @ y))[1]
    length = math.hypot(along, across)
    if length == 0.0:
        return PadDirection()
    # the slope is an average over a curved path; what counts is the scatter across the direction itself
    distance = y @ [-across / length, along / length]
    residual = distance - x @ (inverse @ (x.T @ distance))
    spread = math.sqrt(inverse[1, 1] * (residual @ residual) / max(len(size) - 2, 1) * dependence)
    return PadDirection(math.atan2(across, along), spread / length)


def pooled_noise(records: Sequence[DryRecord], about_curve: bool = False) -> NoiseModel:
    """Noise of the good blocks of all records, of those with holds alone where some have any.

    Within holds every hold's level is free, so a bad step does no harm; about any smooth curve the slow part of 1/f
    noise is seen as well.
    """
    with_holds = [record for record in records if record.holds]
    series = []
    for record in with_holds or records:  # only holds tell drift from deflection
        used = record.used
        blocks = used.take(used.hold >= 0)
        # a curve takes five columns, or seven, and noise shows in what is left of three blocks more
        needed = 8 + 2 * (len(np.unique(blocks.branch)) > 1)
        if (about_curve and len(blocks) < needed) or not record.holds:
            blocks = used
        levels = (blocks.hold[:, None] == np.unique(blocks.hold)).astype(float)
        mean = smooth_columns(blocks) if about_curve or not record.holds else levels
        series += [NoiseSeries(blocks.time, blocks.duration, x, mean) for x in (blocks.deflection, blocks.across)]
    return estimate_noise(series, learn_drift=bool(with_holds))


def smooth_columns(blocks: Blocks) -> FloatArray:
    """Columns (m, p) that span every law of `laws.py` well within the noise, and a soft toe."""
    u = np.maximum(blocks.load / np.max(blocks.load), 1e-3)
    columns = [np.ones_like(u), u, u * np.log(u), np.exp(-u / 0.06), np.exp(-u / 0.15)]
    if np.all(blocks.hold < 0):
        columns.append(np.cbrt(u) ** 2)  # a ramp has points enough for a sphere's law as it is
    if len(np.unique(blocks.branch)) > 1:
        down = (blocks.branch < 0).astype(float)
        columns += [down, down * u]
    return np.column_stack(columns)

"""What a clearance sweep of a shaft at rest tells of the cells and probes of its campaign.

*Cells.* The push keeps its size while it goes around, so that the readings of the cells lie on a circle about their
zero. An ellipse in its place shows by which share one reads more than the other, and by which angle their axes stand
otherwise than stated to each other. Which of two is wrong it does not show: half is taken off each, and counts as an
error of both.

*Probes.* Between two pads the shaft lies in the corner of both, and from corner to corner it goes along the pad in
between: across that pad's direction, wherever the pad stands. The readings of two probes are to each other as what both
must show of that way: linear equations for a gain and the turns of both. A gain that both share leaves all as it is.

*Runs.* A pad's dry test begins where the shaft touches that pad in the sweep: probes that read otherwise in one run
begin it elsewhere.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channels
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import directions, wrapped
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.statistics import huber_weight, reweighted
from tpjb_ident.phasors.line_fit import robust_deviation
from tpjb_ident.phasors.slow_samples import live_run, slow_samples
from tpjb_ident.pivot.dry_record import DryRecord, axial_channels, probes_of

#: What tells of cells and of probes, in words.
WITNESSES = {"force": "the push of the clearance sweep", "displacement": "the sides of the clearance polygon"}
#: Standard errors from which sensors are off, and gains or axes of cells (a push may be oval by less) and of probes.
_ERRORS, _OVAL, _UNEQUAL = 4.0, 0.03, 0.02
_INDEPENDENT = 10.0  # readings that a push which wanders is worth
#: Pads from which corners tell probes; around a corner's direction, of the way to the next; where pads stand, as usual
#: [rad], and how many pads that is worth.
MIN_PADS, _CORNER, _PADS, _USUAL = 4, 0.12, 0.004, 4.0
_EVIDENCE = {
    "force": ("the push goes around", "cells-differ", "cells-differ"),
    "displacement": ("the sides stand", "probe-gains-differ", "probe-turned"),
}  #: by quantity: what shows it, and conditions of gains and of axes
_EXCHANGED = 0.6  # [rad] from which it is no axis any more but another channel or sign: that is refused elsewhere
_TOUCHED = 0.99  # share of a sweep in which the shaft has not been farther out
_PUSHED = 0.9  # cosine of the angle within which a pad is pushed at
_PLAUSIBLE, _STAYS = 0.3, 0.1  # deviation of a sensor's error; of a run's weight: that the zero did not move
_LEAST_LENGTH = 1e-9  # [m]: a shorter one is none
_ELSEWHERE, _LEAST_MOVE, _SPREADS = 0.015, 1e-6, 5.0  # of the clearance, [m], robust deviations of the other runs


@dataclass(frozen=True)
class PushCircle:
    """The circle on which the push of a sweep lies, as the cells read it."""

    zero: FloatArray  #: (2,) what they read at no load [N]
    spread: FloatArray  #: (2, 2) inverse of the ellipse's form about it [N^2]
    scatter: float  #: of the push, as a share


def push_circle(load: FloatArray) -> PushCircle | None:
    """Ellipse through loads (n, 2) [N]; None where there is none."""
    middle, size = 0.5 * (load.max(axis=0) + load.min(axis=0)), max(np.ptp(load), 1e-300)
    points = (load - middle) / size
    x, y = points.T
    design = np.column_stack([x * x, 2.0 * x * y, y * y, x, y])
    a, b, c, *line = np.linalg.lstsq(design, np.ones(len(x)), rcond=None)[0]
    form = np.array([[a, b], [b, c]])
    if np.linalg.eigvalsh(form)[0] <= 0.0:
        return None
    zero = -0.5 * np.linalg.solve(form, line)
    form /= 1.0 + zero @ form @ zero
    radius = np.sqrt(np.sum((points - zero) @ form * (points - zero), axis=1))
    return PushCircle(middle + size * zero, size**2 * np.linalg.inv(form), float(np.std(radius)))


def cell_errors(circle: PushCircle, axes: FloatArray, uncertainty: FloatArray) -> ComplexArray:
    """Logarithm of the gain + i turn [rad] of each of two cells: all of what gains differ by, half of what axes do.

    On `axes` (2,) [rad], with gains known to `uncertainty` (2,).
    """
    spread = directions(axes) @ circle.spread @ directions(axes).T
    gain, apart = 0.5 * np.log(spread[0, 0] / spread[1, 1]), wrapped(axes[1] - axes[0])
    cosine = spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1])
    turn = np.sign(apart) * np.arccos(np.clip(cosine, -1.0, 1.0)) - apart
    error = np.linalg.norm([2.0 * circle.scatter / np.sqrt(_INDEPENDENT), *uncertainty])
    gain, turn = np.array([gain, turn]) * (np.abs([gain, turn]) > max(_OVAL, _ERRORS * error))
    return np.array([1.0, -1.0]) * complex(gain, -0.5 * turn)


def probe_errors(load: FloatArray, place: FloatArray, angles: FloatArray, axes: FloatArray) -> ComplexArray:
    """Logarithm of the gain + i turn [rad] of each of two probes on `axes` (2,) [rad]; zero where it is not clear.

    Of pads at `angles` (n,) [rad], load (m, 2) [N] from the cells' zero and place (m, 2) [m]. Which of two gains is off
    the corners do not tell: each may be by all of it. What both are turned by alike is the pads' or the frame's.
    """
    pads = np.sort(np.mod(angles, 2.0 * np.pi))
    gaps = np.diff(pads, append=pads[:1] + 2.0 * np.pi)[:, None]
    held = np.abs(wrapped(np.arctan2(load[:, 1], load[:, 0]) - pads[:, None] - 0.5 * gaps)) < _CORNER * gaps
    if len(pads) < MIN_PADS or gaps.max() >= np.pi or not held.any(axis=1).all():
        return np.zeros(2, complex)
    corners = np.array([np.median(place[at], axis=0) for at in held])
    way = corners - np.roll(corners, 1, axis=0)
    first, second = directions(axes) @ way.T / (np.linalg.norm(way, axis=1) * np.sin(axes[1] - axes[0]))
    aside = axes[:, None] - pads - 0.5 * np.pi
    (along, other_along), (across, other_across) = np.cos(aside), np.sin(aside)
    # gain of the first, taken off the second, and turns of either
    design = np.column_stack([second * along + first * other_along, -second * across, first * other_across])
    target = first * other_along - second * along
    # by what pads would show that stand where they are said to: where that is nothing, those that do not show no gain
    drawn = np.stack([2.0 * along * other_along, -other_along * across, along * other_across])
    inverse = np.linalg.inv(drawn @ design + (_PADS / _PLAUSIBLE) ** 2 * np.eye(3))
    gain, *turns = best = inverse @ (drawn @ target)
    variance = (_USUAL * _PADS**2 + np.sum((target - design @ best) ** 2)) / (_USUAL + len(pads) - 3)
    errors = np.log([1.0 + gain, 1.0 - gain] + 1j * np.array(turns))
    common = np.median([*errors.imag, 0.0])
    off = np.array([errors[0].real - errors[1].real, *(errors.imag - common)])
    slopes = np.diag([2.0, 1.0, 1.0])
    slopes[1:, 1:] -= errors.imag == common
    limit = np.maximum(_UNEQUAL, _ERRORS * np.sqrt(variance * np.abs(np.diag(slopes @ inverse @ slopes.T))))
    gain, *turns = off * (np.abs(off) > limit) * (np.max(np.abs(off[1:])) < _EXCHANGED)
    return np.array([gain, -gain]) + 1j * np.array(turns)


@dataclass(frozen=True)
class SweepWitness:
    """Sensors as a sweep shows them, and where the shaft was in it."""

    errors: Mapping[str, complex]  #: by channel: logarithm of the gain + i turn [rad]
    channels: Channels  #: those that are to be read otherwise than stated, by name
    conditions: Conditions
    place: FloatArray  #: (n, 2) of the shaft, as told [m]
    probes: Collection[str]

    def held_against(self, records: list[DryRecord]) -> list[DryRecord]:
        """Records with the share of the clearance by which each begins elsewhere than the sweep has its pad."""
        alike = [record for record in records if probes_of(record.run) == self.probes]
        if len(alike) < MIN_PADS:
            return records
        outward = directions([record.angle for record in alike])
        frame = np.column_stack([outward, np.ones(len(alike))])
        reach = np.quantile(self.place @ outward.T, _TOUCHED, axis=0)
        clearance = abs(np.linalg.lstsq(frame, reach, rcond=None)[0][2])
        # by its lowest load and, where contact is not complete there, by the way that its upper loads point back
        starts = np.array([_starts(record) for record in alike]).T
        first, back = (common_start(frame, start - reach)[1] for start in starts)
        away = np.where(np.abs(first) < np.abs(back), first, back)
        limit = max(_LEAST_MOVE, _ELSEWHERE * clearance, _SPREADS * robust_deviation(away))
        shares = {record.run.id: off / clearance for record, off in zip(alike, away) if abs(off) > limit}
        return [replace(record, elsewhere=shares.get(record.run.id, 0.0)) for record in records]


def _starts(record: DryRecord) -> tuple[float, float]:
    """Reading [m] at the lowest load, and at none by a straight line through the upper ones."""
    load, deflection = record.blocks.load, record.blocks.deflection
    upper = load >= 0.3 * np.max(load)
    return deflection[np.argmin(load)], np.polyfit(load[upper], deflection[upper], 1)[1]


def as_witnessed(run: Run, channels: Channels) -> Run:
    """A run whose channels are read as a sweep shows them."""
    mended = {name: channels.get(name, stated) for name, stated in run.channels.items()}
    return replace(run, channels=mended) if channels else run


def common_start(frame: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Zero and distance (3,) that most lengths (m,) along a frame (m, 3) share, and what they leave of each.

    By least absolute values: most runs are alike. Of four any one may be elsewhere: then the zero is least.
    """
    design, target = np.vstack([frame, _STAYS * np.eye(3)[:2]]), np.r_[lengths, 0.0, 0.0]
    values, *_ = reweighted(design, target, lambda u: huber_weight(u, 1.0), _LEAST_LENGTH)
    return values, lengths - frame @ values


def sweep_witness(campaign: Campaign, angles: FloatArray) -> SweepWitness:
    """What the first sweep of a shaft at rest tells; nothing without any that can be read."""
    for run in campaign.of_kind("clearance"):
        if run.point.shaft_speed == 0.0:
            try:
                return witness_of(live_run(run), angles)
            except RigDataError:  # said where sweeps are measured
                continue
    return SweepWitness({}, {}, (), np.zeros((0, 2)), ())


def witness_of(run: Run, angles: FloatArray) -> SweepWitness:
    """What a live sweep past pads at `angles` (n,) [rad] tells."""
    load, place = _good_vectors(run)
    circle = push_circle(load) if len(load) > len(angles) else None
    errors = {}
    channels, conditions = {}, []
    for quantity, (evidence, of_gain, of_axis) in _EVIDENCE.items():
        pair = [channel for channel in axial_channels(run).values() if channel.quantity == quantity]
        if circle is None or len(pair) != 2:
            continue
        axes, uncertainty = np.array([(channel.axis or 0.0, channel.uncertainty or 0.0) for channel in pair]).T
        if quantity == "force":
            off = cell_errors(circle, axes, uncertainty)
            doubt = np.linalg.norm([uncertainty, 0.5 * off.real, off.imag], axis=0)
        else:
            off = probe_errors(load - circle.zero, place, angles, axes)
            doubt = np.linalg.norm([uncertainty, 0.5 * off.real], axis=0)
        gains = [channel.gain for channel in pair] * np.exp(-0.5 * off.real)
        for channel, error, *numbers in zip(pair, off, gains, axes + off.imag, doubt):
            errors[channel.name] = error
            if off.any():
                gain, axis, unsure = map(float, numbers)
                channels[channel.name] = replace(channel, gain=gain, axis=axis, uncertainty=unsure)
            if error.imag:
                text = f"{evidence} as if {channel.name} stood {np.degrees(error.imag):+.1f} deg off its stated axis"
                conditions.append(Condition(of_axis, text))
        if share := 100.0 * np.expm1(off[0].real):
            more = f"read {abs(share):.1f} % {'more' if share > 0.0 else 'less'} than"
            text = f"{evidence} as if {pair[0].name} {more} {pair[1].name}; half of it is taken off each"
            conditions.append(Condition(of_gain, text))
    _, place = _good_vectors(as_witnessed(run, channels))
    # a pad that was not pushed at is elsewhere by as much as nobody knows
    pushed = np.cos(np.arctan2(load[:, 1], load[:, 0])[:, None] - angles).max(axis=0)
    probes = probes_of(run) if np.all(pushed > _PUSHED) else ()
    return SweepWitness(errors, channels, tuple(conditions), place, probes)


def _good_vectors(run: Run) -> tuple[FloatArray, FloatArray]:
    """Load and place (n, 2) of the good samples."""
    _, load, place, good, _ = slow_samples(run)
    return load[good], place[good]

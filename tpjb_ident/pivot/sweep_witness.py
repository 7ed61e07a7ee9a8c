"""What a clearance sweep of a shaft at rest tells of the cells and probes of its campaign.

*Cells.* The push keeps its size while it goes around, so that the readings of the cells lie on a circle about their
zero. An ellipse in its place shows by which share one reads more than the other, and by which angle their axes stand
otherwise than stated to each other. Which of two is wrong it does not show: half is taken off each, and counts as an
error of both.

*Probes.* Between two pads the shaft lies in the corner of both, and from corner to corner it goes along the pad in
between: across that pad's direction, wherever the pad stands. With t_k the way along pad k as read, and B the map from
readings to places, n_k . B t_k = 0 for every pad: linear equations for B but for its size, whose rows along the probes'
axes are gains and true axes. A gain that both share leaves all directions as they are.

*Runs.* A pad's dry test begins where the shaft touches that pad in the sweep: probes that read otherwise in one run
begin it elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channels
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import directions, wrapped
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.phasors.line_fit import robust_deviation
from tpjb_ident.phasors.slow_samples import live_run, slow_samples
from tpjb_ident.pivot.dry_record import DryRecord, probes_of

SIDES = "the sides of the clearance polygon"  # what tells of probes, in words
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
_PLAUSIBLE = 0.3  # of a sensor's error, one standard deviation
_TOUCHED = 0.99  # share of a sweep in which the shaft has not been farther out
_STAYS = 0.1  # of a run's weight: that the zero did not move
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
    (tx, ty), (nx, ny) = (way / np.linalg.norm(way, axis=1, keepdims=True)).T, directions(pads).T
    # B = 1 + [[p, q], [r, -p]]
    design, target = np.column_stack([nx * tx - ny * ty, nx * ty, ny * tx]), -(nx * tx + ny * ty)
    inverse = np.linalg.inv(design.T @ design + (_PADS / _PLAUSIBLE) ** 2 * np.eye(3))
    best = inverse @ (design.T @ target)
    variance = (_USUAL * _PADS**2 + np.sum((target - design @ best) ** 2)) / (_USUAL + len(pads) - 3)

    def numbers(map_: FloatArray) -> FloatArray:
        p, q, r = map_
        rows = directions(axes) @ np.linalg.inv([[1.0 + p, q], [r, 1.0 - p]]) @ [1.0, 1j] * np.exp(-1j * axes)
        turns = np.angle(rows)
        return np.r_[np.log(abs(rows[0] / rows[1])), turns - np.median([*turns, 0.0])]

    slopes = np.array([numbers(best + step) - numbers(best) for step in 1e-6 * np.eye(3)]) / 1e-6
    errors = np.sqrt(variance * np.diag(slopes.T @ inverse @ slopes))
    off = numbers(best)
    gain, *turns = off * (np.abs(off) > np.maximum(_UNEQUAL, _ERRORS * errors)) * (np.max(np.abs(off[1:])) < _EXCHANGED)
    return np.array([gain, -gain]) + 1j * np.array(turns)


@dataclass(frozen=True)
class SweepWitness:
    """Sensors as a sweep shows them, and where the shaft was in it."""

    errors: Mapping[str, complex]  #: by channel: logarithm of the gain + i turn [rad]
    channels: Channels  #: those that are to be read otherwise than stated, by name
    conditions: Conditions
    place: FloatArray  #: (n, 2) of the shaft, as told [m]
    probes: frozenset[str]

    def held_against(self, records: Sequence[DryRecord]) -> list[DryRecord]:
        """Records with the share of the clearance by which each begins elsewhere than the sweep has its pad."""
        alike = [record for record in records if probes_of(record.run) == self.probes]
        if len(alike) < MIN_PADS:
            return list(records)
        outward = directions([record.angle for record in alike])
        frame = np.column_stack([outward, np.ones(len(alike))])
        reach = np.quantile(self.place @ outward.T, _TOUCHED, axis=0)
        clearance = abs(np.linalg.lstsq(frame, reach, rcond=None)[0][2])
        # by its lowest load and, where contact is not complete there, by the way that its upper loads point back
        first, back = (_left(frame, starts - reach) for starts in np.array([_starts(record) for record in alike]).T)
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
    known = {name: channels.get(name, stated) for name, stated in run.channels.items()}
    return replace(run, channels=known) if channels else run


def _left(frame: FloatArray, lengths: FloatArray) -> FloatArray:
    """What a moved zero and another load leave of lengths (n,) by least absolute values: most runs are as the sweep.

    Of four runs any one may be elsewhere: then the zero has moved least.
    """
    design, target = np.vstack([frame, _STAYS * np.eye(3)[:2]]), np.r_[lengths, 0.0, 0.0]
    left, weights = target, np.ones(len(target))
    for _ in range(50):
        root = np.sqrt(weights)
        left = target - design @ np.linalg.lstsq(design * root[:, None], target * root, rcond=None)[0]
        weights = 1.0 / np.maximum(np.abs(left), 1e-9)
    return left[:-2]


def sweep_witness(campaign: Campaign, angles: FloatArray) -> SweepWitness | None:
    """What the first sweep of a shaft at rest tells; None without any that can be read."""
    for run in campaign.of_kind("clearance"):
        if run.point.shaft_speed == 0.0:
            try:
                return witness_of(live_run(run), angles)
            except RigDataError:  # said where sweeps are measured
                continue
    return None


def witness_of(run: Run, angles: FloatArray) -> SweepWitness:
    """What a live sweep past pads at `angles` (n,) [rad] tells."""
    _, load, place, good, _ = slow_samples(run)
    circle = push_circle(load[good]) if good.sum() > len(angles) else None
    errors: dict[str, complex] = {}
    channels, conditions = {}, []
    for quantity, (evidence, of_gain, of_axis) in _EVIDENCE.items():
        pair = [channel for channel in run.of(quantity) if channel.axis is not None]
        if circle is None or len(pair) != 2:
            continue
        axes, uncertainty = np.array([(c.axis or 0.0, c.uncertainty or 0.0) for c in pair]).T
        cells = quantity == "force"
        off = (
            cell_errors(circle, axes, uncertainty)
            if cells
            else probe_errors(load[good] - circle.zero, place[good], angles, axes)
        )
        for channel, error in zip(pair, off):
            errors[channel.name] = complex(error)
            doubt = np.linalg.norm([channel.uncertainty or 0.0, 0.5 * error.real, error.imag * cells])
            gain, axis = channel.gain * float(np.exp(-0.5 * error.real)), (channel.axis or 0.0) + float(error.imag)
            if off.any():
                channels[channel.name] = replace(channel, gain=gain, axis=axis, uncertainty=float(doubt))
            if error.imag:
                text = f"{evidence} as if {channel.name} stood {np.degrees(error.imag):+.1f} deg off its stated axis"
                conditions.append(Condition(of_axis, text))
        if off[0].real:
            share = 100.0 * np.expm1(off[0].real)
            more = f"read {abs(share):.1f} % {'more' if share > 0.0 else 'less'} than"
            text = f"{evidence} as if {pair[0].name} {more} {pair[1].name}; half of it is taken off each"
            conditions.append(Condition(of_gain, text))
    place = slow_samples(as_witnessed(run, channels))[2] if channels else place
    return SweepWitness(errors, channels, tuple(conditions), place[good], probes_of(run))

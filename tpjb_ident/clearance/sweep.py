"""A clearance sweep, read: averages of the shaft's position with the load that each touched pad carries.

A small load turns once around. Between the directions of two neighbouring pads the shaft lies in the corner
between them and both carry; just past a pad's direction it slides along that pad's side to the next corner.
So the force vector says how much each pad carries, and the position says which pads are touched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import binary_dilation, uniform_filter1d

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.campaign import Run
from rigdata.vector import directions, wrapped
from tpjb_ident.phasors.line_fit import robust_deviation, white_noise
from tpjb_ident.phasors.slow_samples import REMEDY, contradictions, level_error, piece_means, slow_samples, spare_slopes
from tpjb_ident.pivot.dry_record import pad_axes, refusal
from tpjb_ident.pivot.sweep_witness import push_circle

_BLOCK = 0.1  # [s]; five mains periods
_CONTACT_DEPTH = 1.0e-6  # [m]: a pad counts as touched within this of its farthest position, plus its deflection
_SHORTEST = 5  # samples in a piece, where a whole one has as many
_MOVING = 2.0  # robust standard deviations of the speed in corners above which the shaft is still on its way
_ASIDE = 5.0  # robust deviations of the places in a corner
LARGEST_DEFLECTION = 6.0e-6  # [m], of a pivot under the push load where no curve says it
_LARGEST_LAG = np.radians(25.0)  # of the shaft: friction of a quarter, or oil that lets it slide hardly in time
_UNTARED = 0.1  # of the push: a smaller zero of the cells may be a push that is not the same all around
_RELEASED = 0.1  # of the push: below it the load has no direction
_LARGEST_GAP = np.radians(60.0)  # between directions of the load: half of it from a pad's own, both corners are beyond


@dataclass(frozen=True)
class ContactIntervals:
    """Averages during which a pad was touched: m pieces, (m,) each, of one pad each."""

    time: FloatArray  #: [s]
    duration: FloatArray  #: [s]
    pad: IntArray  #: from 0
    along: FloatArray  #: place of the shaft in the pad's direction [m]
    across: FloatArray  #: [m]
    load: FloatArray  #: that the pad carries [N]
    force: FloatArray  #: (m, 2) on the shaft [N]
    touched: BoolArray  #: (m, n) pads that the shaft touched
    push: float  #: of the sweep [N]
    level_error: float  #: of a place where the shaft lies still between two steps of a converter [m]

    def take(self, chosen: BoolArray) -> ContactIntervals:
        """The averages where `chosen` (m,) is true."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)[:-2]})

    def lag(self, angles: FloatArray) -> float:
        """Usual angle [rad] by which the load is past a corner's last pad when the shaft leaves it."""
        load = np.angle(self.force @ [1.0, 1j])
        past = np.where(self.touched, wrapped(load[:, None] - angles), np.nan)
        first, last = np.nanmin(past, axis=1), np.nanmax(past, axis=1)
        outside = np.where(first > 0.0, first, np.minimum(last, 0.0))
        corner = self.touched @ (1 << np.arange(len(angles))) * (self.touched.sum(axis=1) == 2)
        ends = []
        for k in np.unique(corner[corner > 0]):
            at_corner = outside[corner == k]
            ends.append(at_corner[np.argmax(np.abs(at_corner))])
        return np.median(ends) if ends else 0.0

    def lagging(self, angles: FloatArray, lag: float) -> ContactIntervals:
        """The averages of a shaft that follows its load by an angle `lag` [rad]: angles (n,) [rad] of the pads.

        Where it rubs on all pads that it touches, their forces are those of a load turned back by the angle of
        friction; where oil is squeezed out, those of a load some time ago.
        """
        carried = _carried(self.force @ pad_axes(lag).T, angles, self.touched)
        return replace(self, load=carried[np.arange(len(self.pad)), self.pad])


def sweep_samples(run: Run) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Good samples of a sweep, which goes around and takes the shaft along: time (n,), load, position (n, 2)."""
    time, load, position, good, _ = slow_samples(run)
    if good.sum() < 200:
        raise refusal(run, "record", f"has only {good.sum()} usable samples", "Repeat the sweep")
    slopes = spare_slopes(run, np.eye(2))
    for what in contradictions(run.channels, [slopes], {"force": [0.0], "displacement": [0.0]}):
        raise refusal(run, "channels", f"cannot be used: {what}", REMEDY)
    load, position = load[good], position[good]
    circle = push_circle(load)
    if circle is not None and np.hypot(*circle.zero) > _UNTARED * math.sqrt(0.5 * np.trace(circle.spread)):
        load = load - circle.zero
    _check_turn(run, load, position)
    return time[good], load, position


def read_sweep(run: Run, angles: FloatArray, deflection: float) -> ContactIntervals:
    """Average a live run of kind ``clearance`` per pad over pieces in which the same pads are touched.

    Angles (n,) [rad] of the pads, largest deflection of a pivot [m].
    """
    time, load, position = sweep_samples(run)
    # whole turns of a shaft that turns: its runout averages out
    turn = 2.0 * np.pi / run.point.shaft_speed if run.point.shaft_speed > 0.0 else _BLOCK
    length = turn * max(round(_BLOCK / turn), 1)
    # the shaft touches a pad within some micrometres of where it was farthest out
    period = (time[-1] - time[0]) / (len(time) - 1)
    samples = max(round(length / period), 1)
    noisy = (max(map(white_noise, position.T)) / (0.5 * _CONTACT_DEPTH)) ** 2
    outward = uniform_filter1d(position, int(np.clip(noisy, 1, samples)), axis=0) @ directions(angles).T
    touched = outward > np.quantile(outward, 0.995, axis=0) - _CONTACT_DEPTH - deflection
    state = touched @ (1 << np.arange(len(angles)))
    piece = np.floor((time - time[0]) / length).astype(int)
    cuts = np.flatnonzero((np.diff(state) != 0) | (np.diff(piece) != 0)) + 1
    starts, stops = np.r_[0, cuts], np.r_[cuts, len(time)]
    long = (stops - starts) >= min(_SHORTEST, samples)
    starts, stops = starts[long], stops[long]
    means = piece_means(np.column_stack([time, position, load]), starts, stops)
    moment, place, force, pads_touched = means[:, 0], means[:, 1:3], means[:, 3:], touched[starts]
    carried = _carried(force, angles, pads_touched)
    row, pad = np.nonzero(np.isfinite(carried) & _settled(moment, place, pads_touched)[:, None])
    tangent = directions(angles + 0.5 * np.pi)
    return ContactIntervals(
        time=moment[row],
        duration=(stops - starts)[row] * period,
        pad=pad,
        along=np.sum(place[row] * directions(angles)[pad], axis=1),
        across=np.sum(place[row] * tangent[pad], axis=1),
        load=carried[row, pad],
        force=force[row],
        touched=pads_touched[row],
        push=float(np.median(np.hypot(*load.T))),
        level_error=level_error(position),
    )


def _check_turn(run: Run, load: FloatArray, position: FloatArray) -> None:
    """Refuse a load that does not go around, and a shaft that goes elsewhere than the load."""
    step = max(1, len(load) // 400)
    whole = len(load) // step * step
    pushed, place = (part[:whole].reshape(-1, step, 2).mean(axis=1) @ [1.0, 1j] for part in (load, position))
    angle = np.angle(pushed)
    covered = np.sort(angle[np.abs(pushed) > _RELEASED * np.median(np.abs(pushed))])
    gap = np.diff(covered, append=covered[0] + 2.0 * np.pi).max()
    if gap > _LARGEST_GAP:
        what = f"turns its load through {360.0 - np.degrees(gap):.0f} deg only"
        raise refusal(run, "record", what, "Sweep the load once around, 360 deg")
    place = place - 0.5 * (place.real.max() + place.real.min() + 1j * (place.imag.max() + place.imag.min()))
    in_load_frame = np.mean(place * np.exp(-1j * angle))
    lag, coherence = np.angle(in_load_frame), abs(in_load_frame) / max(np.abs(place).mean(), 1e-300)
    if abs(lag) > _LARGEST_LAG or coherence < 0.7:
        what = f"has a shaft that does not follow its load ({np.degrees(lag):+.0f} deg away, coherence {coherence:.2f})"
        cure = "Check order, axes and polarity of the displacement and force channels; sweep without oil"
        raise refusal(run, "record", what, cure)


def _carried(load: FloatArray, angles: FloatArray, touched: BoolArray) -> FloatArray:
    """Load on every touched pad (n_samples, n) [N]; NaN where the touched pads cannot balance the force."""
    n = directions(angles)
    carried = np.full(touched.shape, np.nan)
    count = touched.sum(axis=1)
    single = np.flatnonzero(count == 1)
    pad = np.argmax(touched[single], axis=1)
    carried[single, pad] = np.sum(load[single] * n[pad], axis=1)
    for first in range(len(angles)):
        pads = np.array([first, (first + 1) % len(angles)])
        pair = np.flatnonzero((count == 2) & touched[:, pads].all(axis=1))
        share = np.linalg.solve(n[pads].T, load[pair].T).T
        # past a pad's own direction its neighbour would have to pull: the pad carries all, friction holds the shaft
        carried[np.ix_(pair, pads)] = np.where(share[:, ::-1] < 0.0, load[pair] @ n[pads].T, np.maximum(share, 0.0))
    return carried


def _settled(time: FloatArray, place: FloatArray, touched: BoolArray) -> BoolArray:
    """True for pieces (m,) in which the shaft lies in a corner, or slides along one pad.

    A shaft that comes to a corner slowly is near the second pad before it touches it: only when it moves no faster
    than the pivots deflect does the corner hold it.
    """
    corner = touched.sum(axis=1) == 2
    if corner.sum() < 8:
        return np.ones(len(time), dtype=bool)
    step = np.hypot(*np.diff(place, axis=0).T) / np.maximum(np.diff(time), 1e-9)
    speed = np.maximum(np.r_[step, 0.0], np.r_[0.0, step])
    ordinary = np.median(speed[corner])
    spread = robust_deviation(speed[corner] - ordinary)
    moving = corner & (speed > ordinary + _MOVING * spread)
    state = touched @ (1 << np.arange(touched.shape[1]))
    for number in np.unique(state[corner]):  # one that stopped on its way is elsewhere
        members = state == number
        away = np.hypot(*(place[members] - np.median(place[members], axis=0)).T)
        moving[members] |= away > _ASIDE * max(robust_deviation(away), 1e-8)
    # the piece beside a moving one hides a remainder of the way below the noise, and would do so at every corner
    return ~corner | ~binary_dilation(moving)

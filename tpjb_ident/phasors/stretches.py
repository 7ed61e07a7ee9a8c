"""Stretches of one excitation: where the drive starts late, stops, or is switched over, windows are no repeats.

Windows of another excitation, of none, or across the change say nothing of the phasor that the run's longest stretch
has. A change of the drive shows in forces and displacements alike; what shows in one of them is a fault of channels.
"""

from dataclasses import replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.phasors.run_data import RunPhasors, complex_median, phasor_noise

#: Windows of a stretch, at least.
_LEAST = 3
#: Change of the phasors over the larger of two levels, in forces and in displacements,
_CHANGE = 0.25
#: that leaves at most this share of the windows' scatter about their mean.
_LEFT = 0.1
#: A window whose line is below this many deviations of its noise, or this share of the run's, has no drive.
_DEVIATIONS, _QUIET = 3.0, 0.1
#: A window so far from its stretch's level lies across a change.
_ACROSS = 0.05


def longest_stretch(result: RunPhasors, rate: float) -> RunPhasors:
    """The run with the windows of its longest stretch alone; those of others give no phasor."""
    driven = len(result.lines.excitation)
    noise = phasor_noise(result, rate)
    quantity = np.array([c.quantity for c in result.channels])
    live = np.isfinite(noise) & (quantity != "acceleration")
    z, quantity = result.z[:, :driven, live] / noise[live], quantity[live]
    good = np.flatnonzero(np.isfinite(z).all(axis=(1, 2)))
    if len(good) < _LEAST or len(set(quantity)) < 2:
        return result
    windows = z[good]
    groups = [windows[:, :, quantity == q].reshape(len(good), -1) for q in ("displacement", "force")]
    cuts = sorted(_cuts(groups, 0, len(good)))
    level = np.sqrt(np.mean(np.abs(windows) ** 2, axis=(1, 2)))
    idle = (level < _DEVIATIONS) | (level < _QUIET * np.quantile(level, 0.9))
    is_steady = not cuts and not (idle.any() and np.median(level) > _DEVIATIONS)
    if is_steady or idle.all():
        return result
    inside = _longest(windows.reshape(len(good), -1), np.array([0, *cuts, len(good)]), idle)
    repeats = good[inside]
    z = np.full_like(result.z, np.nan)
    z[repeats] = result.z[repeats]
    first, last = result.start[repeats[[0, -1]]].tolist()
    return replace(result, z=z, span=(first, last + result.length))


def _cuts(groups: list[ComplexArray], first: int, stop: int) -> list[int]:
    """Windows at which the level of both groups changes between first and stop: halves, and halves of these."""
    if stop - first < 2 * _LEAST:
        return []
    parts = [group[first:stop] for group in groups]
    joined = np.concatenate(parts, axis=1)
    places = range(_LEAST, stop - first - _LEAST + 1)
    remainders = [_scatter(joined[:k]) + _scatter(joined[k:]) for k in places]
    best = places[int(np.argmin(remainders))]
    if min(remainders) > _LEFT * _scatter(joined):
        return []
    for part in parts:
        before, after = part[:best].mean(axis=0), part[best:].mean(axis=0)
        if np.linalg.norm(after - before) < _CHANGE * max(np.linalg.norm(before), np.linalg.norm(after)):
            return []
    cut = first + best
    return [*_cuts(groups, first, cut), cut, *_cuts(groups, cut, stop)]


def _scatter(windows: ComplexArray) -> float:
    """Sum of squares about the median of some windows (n, m), one of them, the farthest, left out."""
    squares = np.sum(np.abs(windows - complex_median(windows)) ** 2, axis=1)
    return float(squares.sum() - squares.max())


def _longest(windows: ComplexArray, edges: IntArray, idle: BoolArray) -> BoolArray:
    """Windows (n,) of the longest driven stretch that do not lie across a change; `windows` (n, m)."""
    stretch = np.repeat(np.arange(len(edges) - 1), np.diff(edges))
    inside = ~idle & (stretch == np.bincount(stretch[~idle]).argmax())
    places = np.flatnonzero(inside)
    middle = complex_median(windows[places])
    distance: FloatArray = np.linalg.norm(windows - middle, axis=1)
    for end, inner in ((places[0], places[1:4]), (places[-1], places[-4:-1])):
        if distance[end] > max(_ACROSS * np.linalg.norm(middle), 3 * np.max(distance[inner], initial=0.0)):
            inside[end] = False
    return inside

"""Whether a point stands apart from the other frequencies of its load: a gain or a delay that all of its runs share.

Runs of one point that are wrong alike agree with one another; other frequencies tell, where the film is near K-C-M. A
point stands apart where its own H, left free, makes far more of what K-C-M leaves go than one more power of frequency
in every entry does, which has as many numbers: H of a film runs smoothly. Where pads bend it, little is told this way.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.point_result import PointResult, by_static_point

#: Frequencies from which K-C-M leaves something over when one of them is free.
_FREQUENCIES = 4
#: Powers of frequency in the real and the imaginary entries: of K-C-M, and one more.
_K_C_M, _POWERS = ((0, 2), (1,)), ((0, 2, 4), (1, 3))
#: Share of H by which a point stands apart, at least: pads and pivots bend H over frequency by less.
_NOTABLE = 0.03
#: Distance from the nearest frequency up to which the others tell of a point, over their span.
_REACH = 0.6
#: Times as much as another power of frequency that the point's own H must make go, and as any other point's does.
_CLEARLY, _ALONE = 25.0, 5.0


def with_frequency_outliers(points: Sequence[PointResult]) -> tuple[PointResult, ...]:
    """The points, with a condition on each that stands apart from the other frequencies of its load."""
    result = list(points)
    for places in by_static_point(points):
        outlier = frequency_outlier([points[i].stiffness for i in places])
        if outlier is not None:
            point, share = points[places[outlier[0]]], outlier[1]
            others = f"the other {len(places) - 1} frequencies of this load"
            doubt = Condition("frequency-outlier", f"h is {100 * share:.0f} % from what {others} let expect")
            result[places[outlier[0]]] = replace(point, quality=merged(point.quality, (doubt,)))
    return tuple(result)


def frequency_outlier(estimates: Sequence[DynamicStiffness]) -> tuple[int, float] | None:
    """Place of the estimate that stands apart, and by which share of its H; None where none does."""
    omega = np.array([e.omega for e in estimates])
    if len(np.unique(omega)) < _FREQUENCIES:
        return None
    size = np.array([np.linalg.norm(e.h) for e in estimates])
    y = np.array([e.vector for e in estimates]) / size[:, None]
    noise = sum(float(np.trace(e.covariance)) / s**2 for e, s in zip(estimates, size))
    w = omega / np.exp(np.log(omega).mean())
    everyone = np.ones(len(w), dtype=bool)
    smooth = float(np.sum(_remainder(w, size, y, everyone, _POWERS) ** 2)) + noise
    distance, rest = np.zeros(len(w)), np.full(len(w), np.inf)
    for k in range(len(w)):
        others = np.arange(len(w)) != k
        if np.abs(w[others] - w[k]).min() > _REACH * np.ptp(w[others]):
            continue  # the others are too far off to tell
        left = _remainder(w, size, y, others, _K_C_M)
        distance[k], rest[k] = np.linalg.norm(left[k]), np.sum(left[others] ** 2) + noise
    place, second = np.argsort(rest)[:2].tolist()
    is_apart = distance[place] > _NOTABLE and _CLEARLY * rest[place] < smooth and _ALONE * rest[place] < rest[second]
    return (place, float(distance[place])) if is_apart else None


def _remainder(
    w: FloatArray, size: FloatArray, y: FloatArray, used: BoolArray, powers: tuple[tuple[int, ...], ...]
) -> FloatArray:
    """What powers of frequency w (n,), fitted to some estimates, leave of all of them, (n, 8) in shares of their H."""
    parts = []
    for numbers, exponents in zip(np.split(y, 2, axis=1), powers):
        columns = w[:, None] ** np.array(exponents) / size[:, None]
        parts.append(numbers - columns @ np.linalg.lstsq(columns[used], numbers[used], rcond=None)[0])
    return np.concatenate(parts, axis=1)

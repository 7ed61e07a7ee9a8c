"""Whether a point stands apart from the other frequencies of its load: a gain or a delay that all of its runs share.

Runs of one point that are wrong alike agree with one another; other frequencies tell, where the film is near K-C-M. A
point stands apart where its own H, left free, makes far more of what K-C-M leaves go than one more power of frequency
in every entry does, which has as many numbers: H of a film runs smoothly. Where pads bend it, little is told this way.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.shape import MODELS, power_columns, remainder
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.point_result import PointResult, by_static_point

#: Frequencies from which K-C-M leaves something over when one of them is free.
_FREQUENCIES = 4
#: Powers of frequency with one more than K-C-M in the real entries and in the imaginary ones.
_SMOOTH = 5
#: Share of H by which a point stands apart, at least: pads and pivots bend H over frequency by less.
_NOTABLE = 0.03
#: Distance from the nearest frequency up to which the others tell of a point, over their span.
_REACH = 0.6
#: Times as much as another power of frequency that the point's own H must make go, and as any other point's does.
_CLEARLY, _ALONE = 25.0, 5.0


def with_frequency_outliers(points: Sequence[PointResult]) -> tuple[PointResult, ...]:
    """The points, each that stands apart from the other frequencies of its load with a condition and a wider interval.

    Which of them is right nothing tells: a gain or a range that is off, or a film that does so.
    """
    result = list(points)
    for places in by_static_point(points):
        outlier = frequency_outlier([points[i].stiffness for i in places])
        if outlier is not None:
            k, distance = outlier
            share = float(np.linalg.norm(distance) / np.linalg.norm(points[places[k]].stiffness.h))
            others = f"the other {len(places) - 1} frequencies of this load"
            doubt = Condition("frequency-outlier", f"h is {100 * share:.0f} % from what {others} let expect")
            result[places[k]] = _widened(points[places[k]], CHANGE_AS_DEVIATION * distance, doubt)
    return tuple(result)


def _widened(point: PointResult, deviation: FloatArray, doubt: Condition) -> PointResult:
    """The point, h by every method uncertain by a further source of one deviation (8,) [N/m]."""
    covariance = np.outer(deviation, deviation)
    by_method = dict(point.by_method)
    for name, estimate in point.by_method.items():
        by_method[name] = replace(estimate, systematic=estimate.systematic + covariance)
    default = next(name for name, estimate in point.by_method.items() if estimate is point.stiffness)
    quality, budget = merged(point.quality, (doubt,)), {**point.budget, "other frequencies": covariance}
    return replace(point, stiffness=by_method[default], by_method=by_method, quality=quality, budget=budget)


def frequency_outlier(estimates: Sequence[DynamicStiffness]) -> tuple[int, FloatArray] | None:
    """Place of the estimate that stands apart, and its distance (8,) from the others' curve; None where none does."""
    omega = np.array([e.omega for e in estimates])
    if len(np.unique(omega)) < _FREQUENCIES:
        return None
    size = np.array([np.linalg.norm(e.h) for e in estimates])
    y, root = np.array([e.vector for e in estimates])[:, :, None], np.eye(NUMBERS) / size[:, None, None]
    noise = sum(float(np.trace(e.covariance)) / s**2 for e, s in zip(estimates, size))
    w = omega / np.exp(np.log(omega).mean())
    smooth = float(np.sum(remainder(power_columns(w, _SMOOTH), y, root, slice(None)) ** 2)) + noise
    distance, rest = np.zeros((len(w), NUMBERS)), np.full(len(w), np.inf)
    for k in range(len(w)):
        others = np.arange(len(w)) != k
        if np.abs(w[others] - w[k]).min() > _REACH * np.ptp(w[others]):
            continue  # the others are too far off to tell
        left = remainder(power_columns(w, MODELS["K-C-M"]), y, root, others)[:, :, 0]
        distance[k], rest[k] = left[k], np.sum(left[others] ** 2) + noise
    place, second = np.argsort(rest)[:2].tolist()
    is_clear = _CLEARLY * rest[place] < smooth and _ALONE * rest[place] < rest[second]
    is_apart = np.linalg.norm(distance[place]) > _NOTABLE and is_clear
    return (place, distance[place] * size[place]) if is_apart else None

"""Probes that read no lengths in this bearing, by its clearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.results.point_result import PointResult

#: Readings below which a sweep says nothing of a probe.
_FEWEST = 100
#: Half of a probe's travel in a sweep over the clearance, least and most: a polygon reaches up to twice its clearance.
_TRAVEL = (0.5, 2.5)
#: Distance between two mean positions over the clearance, at most.
_APART = 3.0
#: Clearance times stiffness over load, at least: pivots that give let the shaft move by more than the clearance.
_LEAST_STIFF = 0.5


@dataclass(frozen=True)
class SweptProbe:
    """One probe in one clearance sweep."""

    run: str
    name: str
    half_travel: float


def swept_probes(campaign: Campaign) -> tuple[SweptProbe, ...]:
    """Every probe in every clearance sweep that can be read."""
    return tuple(probe for run in campaign.of_kind("clearance") for probe in _of_sweep(run))


def _of_sweep(run: Run) -> list[SweptProbe]:
    swept = []
    for name in (n for n, c in run.channels.items() if c.quantity == "displacement"):
        values = _values(run, name)
        if values is None:
            continue
        finite_values = values[np.isfinite(values)]
        low, high = np.quantile(finite_values, [0.01, 0.99]) if len(finite_values) >= _FEWEST else (np.nan, np.nan)
        swept.append(SweptProbe(run.id, name, 0.5 * float(high - low)))
    return swept


def _values(run: Run, name: str) -> FloatArray | None:
    try:
        return run.record(name).values
    except RigDataError:  # a damaged sweep is no matter of the dynamic runs
        return None


def with_probe_doubts(
    sweeps: Sequence[SweptProbe], points: Sequence[PointResult], clearance: float | None
) -> tuple[PointResult, ...]:
    """The points, each with the doubt that the probes' readings are no lengths in this bearing, where there is one.

    Coefficients alone never show a wrong scale of the probes: stiffness and damping shrink alike. The drawing's
    clearance is a length that they can be held against, in three ways:

    - in a clearance sweep a probe travels once through the clearance, and little more;
    - the shaft does not leave the clearance between one operating point and another;
    - a film stiffens as it is loaded, so that the load W moved the shaft by more than W / K, which the clearance must
      hold.
    """
    if clearance is None or not clearance > 0:
        return tuple(points)
    sentences = [*_sweeps(sweeps, clearance), *_positions(points, clearance), *_stiffness(points, clearance)]
    if not sentences:
        return tuple(points)
    cure = "is the probes' sensitivity right in the manifest?"
    doubt = Condition(
        "probes-contradict-clearance", f"{'; '.join(sentences)} (clearance {1e6 * clearance:.0f} um): {cure}"
    )
    return tuple(replace(point, quality=merged(point.quality, (doubt,))) for point in points)


def _sweeps(sweeps: Sequence[SweptProbe], clearance: float) -> list[str]:
    table: dict[str, str] = {}
    for probe in sweeps:
        if probe.half_travel <= _TRAVEL[0] * clearance or probe.half_travel >= _TRAVEL[1] * clearance:
            um = 1e6 * probe.half_travel
            table[probe.name] = f"{probe.name} travels {um:.3g} um to either side in the sweep {probe.run}"
    return list(table.values())


def _positions(points: Sequence[PointResult], clearance: float) -> list[str]:
    places = np.array([p.position for p in points if np.isfinite(p.position).all()]).reshape(-1, 2)
    if len(places) < 2:
        return []
    distance = float(np.hypot(*np.ptp(places, axis=0)))
    return [f"the shaft's mean positions lie {1e6 * distance:.3g} um apart"] if distance > _APART * clearance else []


def _stiffness(points: Sequence[PointResult], clearance: float) -> list[str]:
    soft_points = []
    for load, direction, stiffness in _static_stiffness(points):
        along = np.array([np.cos(direction), np.sin(direction)])
        value = float(along @ stiffness @ along)
        if load > 0 and 0 < value < _LEAST_STIFF * load / clearance:
            soft_points.append((value * clearance / load, load, value))
    if not soft_points:
        return []
    _, load, value = min(soft_points)
    return [
        f"{load / 1e3:g} kN on a stiffness of {value / 1e6:.3g} MN/m would move the shaft by more than "
        f"{1e6 * load / value:.3g} um"
    ]


def _static_stiffness(points: Sequence[PointResult]) -> list[tuple[float, float, FloatArray]]:
    """Load, direction and stiffness (2, 2) at rest: Re h = K - omega^2 M, extrapolated over the frequencies of a load.

    With a single frequency Re h itself stands in.
    """
    groups: dict[tuple[object, ...], list[PointResult]] = {}
    for p in points:
        if np.isfinite(p.stiffness.h).all():
            groups.setdefault(p.point.static_key, []).append(p)
    result = []
    for members in groups.values():
        load, direction = members[0].point.static_load, members[0].point.static_load_direction
        square = np.array([p.stiffness.omega**2 for p in members])
        k = np.array([p.stiffness.k.ravel() for p in members])
        several = len(members) > 1 and np.ptp(square) > 0
        at_rest = np.polynomial.polynomial.polyfit(square, k, 1)[0] if several else k[0]
        result.append((load, direction, at_rest.reshape(2, 2)))
    return result

"""Whether the probes' readings can be lengths in this bearing: a sensitivity ten times off is told, no few per cent.

Coefficients alone never show a wrong scale of the probes: stiffness and damping shrink alike. The drawing's clearance
is a length that they can be held against, in three ways:

- in a clearance sweep a probe travels once through the clearance, and little more;
- the shaft does not leave the clearance between one operating point and another;
- a film stiffens as it is loaded, so that the load W moved the shaft by more than W / K, which the clearance must hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.results.swept_probes import SweptProbe

#: Half of a probe's travel in a sweep over the clearance, least and most: a polygon reaches up to twice its clearance.
TRAVEL = (0.5, 2.5)
#: Distance between two mean positions over the clearance, at most.
APART = 3.0
#: Clearance times stiffness over load, at least: pivots that give let the shaft move by more than the clearance.
LEAST_STIFF = 0.5


def with_probe_doubts(
    sweeps: Sequence[SweptProbe], points: Sequence[PointResult], clearance: float | None
) -> tuple[PointResult, ...]:
    """The points, each with the doubt that the probes' readings are no lengths in this bearing, where there is one.

    Parameters
    ----------
    sweeps : sequence of SweptProbe
        The campaign's probes in its clearance sweeps.
    points : sequence of PointResult
    clearance : float or None
        Assembled clearance of the drawing [m]; None says nothing.
    """
    if clearance is None or not clearance > 0:
        return tuple(points)
    said = [*_sweeps(sweeps, clearance), *_positions(points, clearance), *_stiffness(points, clearance)]
    if not said:
        return tuple(points)
    cure = "is the probes' sensitivity right in the manifest?"
    doubt = Condition("probes-contradict-clearance", f"{'; '.join(said)} (clearance {1e6 * clearance:.0f} um): {cure}")
    return tuple(replace(point, quality=merged(point.quality, (doubt,))) for point in points)


def _sweeps(sweeps: Sequence[SweptProbe], clearance: float) -> list[str]:
    said: dict[str, str] = {}
    for probe in sweeps:
        if probe.half_travel <= TRAVEL[0] * clearance or probe.half_travel >= TRAVEL[1] * clearance:
            um = 1e6 * probe.half_travel
            said[probe.name] = f"{probe.name} travels {um:.3g} um to either side in the sweep {probe.run}"
    return list(said.values())


def _positions(points: Sequence[PointResult], clearance: float) -> list[str]:
    places = np.array([p.position for p in points if np.isfinite(p.position).all()]).reshape(-1, 2)
    if len(places) < 2:
        return []
    apart = float(np.hypot(*np.ptp(places, axis=0)))
    return [f"the shaft's mean positions lie {1e6 * apart:.3g} um apart"] if apart > APART * clearance else []


def _stiffness(points: Sequence[PointResult], clearance: float) -> list[str]:
    found = []
    for p in points:
        load, direction = p.point.static_load, p.point.static_load_direction
        along = np.array([np.cos(direction), np.sin(direction)])
        stiffness = float(along @ p.stiffness.k @ along)
        if load > 0 and 0 < stiffness < LEAST_STIFF * load / clearance:
            found.append((stiffness * clearance / load, load, stiffness))
    if not found:
        return []
    _, load, stiffness = min(found)
    return [
        f"{load / 1e3:g} kN on a stiffness of {stiffness / 1e6:.3g} MN/m would move the shaft by more than "
        f"{1e6 * load / stiffness:.3g} um"
    ]

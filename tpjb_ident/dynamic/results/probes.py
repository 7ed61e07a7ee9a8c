"""What sweeps and positions say of the probes that the dynamic runs are measured with; every sweep is read once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import inverse_directions
from tpjb_ident.arrays import FloatArray
from tpjb_ident.check.run_gains import swept_centre
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.results.point_result import PointResult

#: Readings below which a sweep says nothing of a probe.
FEWEST = 100
#: Half of a probe's travel in a sweep over the clearance, least and most: a polygon reaches up to twice its clearance.
TRAVEL = (0.5, 2.5)
#: Distance between two mean positions over the clearance, at most.
APART = 3.0
#: Clearance times stiffness over load, at least: pivots that give let the shaft move by more than the clearance.
LEAST_STIFF = 0.5


@dataclass(frozen=True)
class SweptProbe:
    """One probe in one clearance sweep.

    Attributes
    ----------
    run, name : str
    half_travel : float
        Half of the way between its 1 and 99 % quantiles [m]; NaN where it has too few readings.
    centre : float or None
        What it reads at the bearing's centre [m]; None where the load does not go around.
    """

    run: str
    name: str
    half_travel: float
    centre: float | None


def swept_probes(campaign: Campaign) -> tuple[SweptProbe, ...]:
    """Every probe in every clearance sweep that can be read.

    Parameters
    ----------
    campaign : Campaign
    """
    return tuple(probe for run in campaign.of_kind("clearance") for probe in _of_sweep(run))


def _of_sweep(run: Run) -> list[SweptProbe]:
    probes = [n for n, c in run.channels.items() if c.quantity == "displacement"]
    cells = [n for n, c in run.channels.items() if c.quantity == "force"]
    readings = {name: values for name in (*probes, *cells) if (values := _values(run, name)) is not None}
    load = _load(run, [readings[n] for n in cells if n in readings])
    found = []
    for name in probes:
        if name not in readings:
            continue
        values = readings[name]
        known = values[np.isfinite(values)]
        low, high = np.quantile(known, [0.01, 0.99]) if len(known) >= FEWEST else (np.nan, np.nan)
        centre = swept_centre(load, values) if load is not None and len(load) == len(values) else None
        found.append(SweptProbe(run.id, name, 0.5 * float(high - low), centre))
    return found


def _values(run: Run, name: str) -> FloatArray | None:
    try:
        return run.record(name).values
    except RigDataError:  # a damaged sweep is no matter of the dynamic runs
        return None


def _load(run: Run, readings: list[FloatArray]) -> FloatArray | None:
    """X and Y of the load (n, 2); None unless two cells in different directions give it."""
    cells = [c for c in run.channels.values() if c.quantity == "force"]
    if len(cells) != 2 or len(readings) != 2 or len(readings[0]) != len(readings[1]):
        return None
    plane = inverse_directions(tuple(float(c.axis or 0.0) for c in cells))
    return np.stack(readings, axis=1) @ plane.T if np.isfinite(plane).all() else None


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

"""Gains that are not the manifest's: probes that read no lengths here, one channel of a run off the other runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import inverse_directions
from tpjb_ident.check.gain_evidence import PointReadings
from tpjb_ident.check.one_gain import wrong_gains
from tpjb_ident.check.run_gains import gain_in_words, swept_centre
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median

#: Readings below which a sweep says nothing of a probe.
_FEWEST = 100
#: Half of a probe's travel in a sweep over the clearance, least and most: a polygon reaches up to twice its clearance.
_TRAVEL = (0.5, 2.5)
#: Distance between two mean positions over the clearance, at most.
_APART = 3.0
#: Clearance times stiffness over load, at least: pivots that give let the shaft move by more than the clearance.
_LEAST_STIFF = 0.5
#: Name of the condition.
_RUN_GAIN_OFF = "run-gain-off"


@dataclass(frozen=True)
class Pairs:
    """The two probes and the two cells of a rig."""

    names: tuple[str, ...]
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from two readings to X and Y
    cell_plane: FloatArray
    centre: tuple[float | None, float | None]


@dataclass(frozen=True)
class SweptProbe:
    """One probe in one clearance sweep."""

    run: str
    name: str
    half_travel: float
    centre: float | None


def swept_probes(campaign: Campaign) -> tuple[SweptProbe, ...]:
    """Every probe in every clearance sweep that can be read."""
    return tuple(probe for run in campaign.of_kind("clearance") for probe in _of_sweep(run))


def _of_sweep(run: Run) -> list[SweptProbe]:
    probes = [n for n, c in run.channels.items() if c.quantity == "displacement"]
    cells = [n for n, c in run.channels.items() if c.quantity == "force"]
    readings = {name: values for name in (*probes, *cells) if (values := _values(run, name)) is not None}
    load = _load(run, [readings[n] for n in cells if n in readings])
    swept = []
    for name in probes:
        if name not in readings:
            continue
        values = readings[name]
        finite_values = values[np.isfinite(values)]
        low, high = np.quantile(finite_values, [0.01, 0.99]) if len(finite_values) >= _FEWEST else (np.nan, np.nan)
        centre = swept_centre(load, values) if load is not None and len(load) == len(values) else None
        swept.append(SweptProbe(run.id, name, 0.5 * float(high - low), centre))
    return swept


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
    groups: dict[tuple[float, ...], list[PointResult]] = {}
    for p in points:
        if np.isfinite(p.stiffness.h).all():
            key = (p.point.static_load, p.point.static_load_direction, p.point.shaft_speed_hz)
            groups.setdefault(key, []).append(p)
    result = []
    for (load, direction, _), members in groups.items():
        square = np.array([p.stiffness.omega**2 for p in members])
        k = np.array([p.stiffness.k.ravel() for p in members])
        several = len(members) > 1 and np.ptp(square) > 0
        at_rest = np.polynomial.polynomial.polyfit(square, k, 1)[0] if several else k[0]
        result.append((load, direction, at_rest.reshape(2, 2)))
    return result


def channel_pairs(campaign: Campaign, sweeps: Sequence[SweptProbe] = ()) -> Pairs | None:
    """Probes and cells of a campaign; None where it has not two of each in different directions."""
    of = {q: [c for c in campaign.channels.values() if c.quantity == q] for q in ("displacement", "force")}
    if any(len(channels) != 2 for channels in of.values()):
        return None
    probe_plane, cell_plane = (
        inverse_directions(tuple(float(c.axis or 0.0) for c in channels)) for channels in of.values()
    )
    if not np.isfinite(probe_plane).all() or not np.isfinite(cell_plane).all():
        return None
    names = tuple(c.name for channels in of.values() for c in channels)
    first, second = (_centre(sweeps, name) for name in names[:2])
    return Pairs(names, probe_plane, cell_plane, (first, second))


def _centre(sweeps: Sequence[SweptProbe], probe: str) -> float | None:
    centres = [sweep.centre for sweep in sweeps if sweep.name == probe and sweep.centre is not None]
    return float(np.median(centres)) if centres else None


def gain_doubts(data: PointData, pairs: Pairs | None) -> tuple[Condition, ...]:
    """A condition that names the runs of a point in which one channel has a gain of its own; none where there is none.

    The search is that of `tpjb check`, `tpjb_ident.check.one_gain`; here it works on the phasors of all windows.
    """
    if pairs is None:
        return ()
    medians = [_medians(data, k) for k in range(len(data.runs))]
    complete = [k for k, values in enumerate(medians) if all(np.isfinite(v).all() for v in values)]
    if not complete:
        return ()
    gains = wrong_gains(_readings(data, [medians[k] for k in complete], complete, pairs))
    doubts = []
    for gain in sorted(gains, key=lambda f: f.run):
        names = [pairs.names[i] for i in gain.channels]
        doubts.append(f"{data.runs[complete[gain.run]].run}: {names[0]} {gain_in_words(gain, names)}")
    return (Condition(_RUN_GAIN_OFF, "; ".join(doubts)),) if doubts else ()


def _medians(data: PointData, k: int) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Displacement, cell force and oil force of one run, X and Y, medians over its windows; NaN where it has none."""
    selected = data.run_index == k
    run, line = data.runs[k], data.lines[k]
    blocks = (data.D[selected], run.cell_force.phasors[:, line], data.F[selected])
    good = np.logical_and.reduce([np.isfinite(block).all(axis=1) for block in blocks])
    if not good.any():
        nothing = np.full(2, np.nan + 0j)
        return nothing, nothing, nothing
    first, second, third = (complex_median(b[good]) for b in blocks)
    return first, second, third


def _readings(
    data: PointData,
    medians: Sequence[tuple[ComplexArray, ComplexArray, ComplexArray]],
    kept: Sequence[int],
    pairs: Pairs,
) -> PointReadings:
    displacement, cells, force = (np.stack([values[i] for values in medians]) for i in range(3))
    to_probes, to_cells = np.linalg.inv(pairs.probe_plane).T, np.linalg.inv(pairs.cell_plane).T
    return PointReadings(
        probes=displacement @ to_probes,
        cells=cells @ to_cells,
        inertia=force - cells,
        probe_means=data.mean_positions[list(kept)] @ to_probes,
        cell_means=data.mean_loads[list(kept)] @ to_cells,
        probe_plane=pairs.probe_plane,
        cell_plane=pairs.cell_plane,
        centre=pairs.centre,
    )

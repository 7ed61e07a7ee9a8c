"""Gains and axes of single sensors, by vectors whose directions are known: static loads, and the pads in a sweep.

A cell that reads (1 + g) times the truth along an axis turned by t shows W (1 + g) cos(phi - axis - t) of a load W
towards phi: loads in two directions tell both numbers. Two probes are told by the sides of the clearance polygon, which
stand across the pads, two cells by the push around it. Where all but one agree, that one is off; set points and pads
have a say too.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.arguments import carried_bearing
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import set_point
from tpjb_ident.clearance.measure import coldest_first
from tpjb_ident.estimate.statistics import huber_weight, reweighted
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.sweep_witness import WITNESSES, witness_of

#: Condition of the loads' directions up to which they tell cells apart, and runs.
_TELLING, _MIN_RUNS = 30.0, 4
#: Directions that are one, and share of a load by which a run is another than its set point.
_ALIKE, _UNUSUAL = 0.01, 0.05
#: Deviations from which a run loses weight, and standard errors from which a sensor is off.
_BEND, _CLEAR = 1.5, 4.0


def check_cells(observations: Sequence[Observation]) -> None:
    """Cells against the static loads of dynamic and locus runs."""
    groups = defaultdict(list)
    for observation in observations:
        if observation.run.kind in {"dynamic", "locus"} and observation.run.point.static_load > 0:
            groups[tuple(observation.names("force"))].append(observation)
    for names, group in groups.items():
        axes = np.array([channel.axis or 0.0 for channel in group[0].of("force")])
        readings = np.array([observation.lines.mean[observation.pick("force")] for observation in group])
        set_points = np.array([set_point(observation.run.point) for observation in group])
        loads = np.column_stack([set_points.real, set_points.imag])
        shown = np.isfinite(readings).all(axis=1)
        loads, readings = loads[shown], readings[shown]
        usual = _is_usual(loads, readings)
        if len(names) > 1 and usual.sum() >= _MIN_RUNS:
            _ask(group, names, _logarithms(loads[usual], readings[usual], axes), "the static loads in all directions")


def _is_usual(loads: FloatArray, readings: FloatArray) -> BoolArray:
    """Which runs show of their loads what the others in their direction do, (n,)."""
    size = np.linalg.norm(loads, axis=1, keepdims=True)
    shares, usual = readings / size, np.ones(len(loads), dtype=bool)
    for direction in np.unique(np.round(loads / size, 3), axis=0):
        alike = np.linalg.norm(loads / size - direction, axis=1) < _ALIKE
        off = np.linalg.norm(shares - np.median(shares[alike], axis=0), axis=1)
        usual &= ~(alike & (off > _UNUSUAL))
    return usual


def _logarithms(loads: FloatArray, readings: FloatArray, axes: FloatArray) -> ComplexArray:
    """Logarithm of the gain + i turn [rad] of every sensor (m,), NaN where loads (n, 2) tell it no better than a few %.

    With a zero besides: loads in two directions of one size do not tell that.
    """
    size = np.linalg.norm(loads, axis=1, keepdims=True)
    design = np.column_stack([loads, np.full(len(loads), float(size.mean()))]) / size
    if np.linalg.cond(design) > _TELLING:
        return np.full(len(axes), np.nan + 0j)
    off = np.zeros(len(axes), complex)
    for j, reading in enumerate((readings / size).T):
        values, weights, _, _ = reweighted(design, reading, lambda u: huber_weight(u, _BEND))
        scatter = np.sum(weights * (reading - design @ values) ** 2) / max(weights.sum() - 3, 1.0)
        covariance = scatter * np.linalg.inv((design * weights[:, None]).T @ design)
        ratio = complex(values[0], values[1]) * np.exp(-1j * axes[j])
        if abs(np.log(ratio)) > _CLEAR * np.sqrt(covariance[0, 0] + covariance[1, 1]):
            off[j] = np.log(ratio)
    return off


def check_sweep(campaign: Campaign, sweeps: Sequence[Observation], dry: Sequence[Observation]) -> None:
    """Two cells against a round push, two probes against the pads of dry runs, else of the bearing file."""
    usable = {observation.run.id: observation for observation in sweeps if not observation.report.cells_doubted}
    for run in coldest_first([observation.run for observation in usable.values()])[:1]:
        angles = _pad_directions(dry) or getattr(carried_bearing(campaign, lambda text: None), "pivot_angles", [])
        try:
            errors = witness_of(live_run(run), np.array(angles)).errors
        except RigDataError:  # said by its own check
            return
        observation = usable[run.id]
        for quantity, witness in WITNESSES.items():
            names = sorted(errors.keys() & observation.names(quantity))
            _ask([observation], names, np.array([errors[name] for name in names]), witness)


def _pad_directions(runs: Sequence[Observation]) -> list[float]:
    """Directions [rad] of all pads as dry runs state them; none where a pad lacks."""
    stated = {}
    for observation in runs:
        run = observation.run
        if run.pad and "static_load_direction" in run.stated:
            stated[run.pad] = run.point.static_load_direction
    angles = [stated[pad] for pad in sorted(stated)]
    gaps = np.diff(np.sort(np.mod(angles, 2 * np.pi)))
    is_whole = max(stated, default=0) == len(stated) and np.all(gaps * len(stated) > np.pi)
    return angles if is_whole else []


def _ask(observations: Sequence[Observation], names: Sequence[str], logarithms: ComplexArray, witness: str) -> None:
    """Report sensors (m,) that are off against the others and the witness, each of which counts as one."""
    if not np.isfinite(logarithms).all():
        return
    errors = logarithms - complex(np.median([*logarithms.real, 0.0]), np.median([*logarithms.imag, 0.0]))
    for name, gain, angle in zip(names, errors.real, np.degrees(errors.imag)):
        for observation in observations:
            report = observation.report
            report.ask("sensor gain", abs(gain), name, share=float(np.expm1(gain)), witness=witness)
            report.ask("sensor axis", abs(angle), name, angle=angle, witness=witness)

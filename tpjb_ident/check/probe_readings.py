"""What a probe reads in one run beside the other runs: its mean, and what turns with the shaft.

A probe that was touched stands elsewhere, and one that another gain was given shows run-out of another size; run-out is
the same at all loads. One that shows no mean in any run hangs on an input that passes none.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from operator import attrgetter

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.check.findings import far
from tpjb_ident.check.observation import NO_NOISE, Observation

#: Logarithm by which what turns with the shaft differs in one run, and run-out between loads (they move the shaft along
#: by little), over the median scatter of runs, and runs beyond one a load that tell it.
_SAME_LINE, _SAME_RUNOUT, _MANY_LINES, _MIN_SPARE = 0.06, 0.02, 6.0, 4
#: Sizes below this many times what noise makes of a line tell nothing.
_CLEAR = 8.0
#: Logarithm between loads that is no gain: the shaft's speed is wrong at one, and its line stands elsewhere.
_LOST = math.log(10.0)
#: How much softer a film may be than along its excitation; deviation of a gain over its change: a 95 % interval holds
#: the change of two probes alike.
_SOFTER, _AS_DEVIATION = 2.0, 0.8
#: Distance from the median of an operating point, over the runs' median one, and the least [m]: a probe that drifts by
#: 1.5 % of a gap of 1 mm was touched, or its amplifier was.
_STEP, _LEAST_STEP, _MIN_STEPS = 9.0, 15e-6, 4
#: Mean over the range of readings below which a probe shows no place: one that is set to zero wanders by more.
_NO_PLACE = 0.005


def _by_probe(runs: Sequence[Observation], alike: str) -> Iterator[tuple[str, list[tuple[Observation, int]]]]:
    """Probes with all runs of what is `alike`, and the probe's place in each."""
    groups: dict[tuple[object, ...], list[tuple[Observation, int]]] = defaultdict(list)
    for run in runs:
        for k in run.pick("displacement"):
            if np.isfinite(run.spread[1, k]):
                # a probe that was put elsewhere is another one
                groups[run.channels[k].name, run.channels[k].axis, attrgetter(alike)(run)].append((run, k))
    for (name, *_), members in groups.items():
        yield str(name), members


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) of dynamic runs, run against run; none in any is no place."""
    for name, members in _by_probe(runs, "run.kind"):
        mean, size = np.transpose(
            [(run.lines.mean[k] - run.channels[k].zero, np.ptp(run.spread[:, k])) for run, k in members]
        )
        is_known = any(run.channels[k].response for run, k in members)
        if len(members) >= _MIN_STEPS and not is_known and np.all(np.abs(mean) < _NO_PLACE * size):
            for run, _ in members:
                run.report.ask("no place", 1.0, name)
    for name, members in _by_probe(runs, "run.point"):
        off = np.array([run.spread[1, k] for run, k in members])
        off -= np.median(off)
        for j in np.flatnonzero(far(np.abs(off), _LEAST_STEP, _STEP, _MIN_STEPS)):
            members[j][0].report.ask("step", 1.0, name, off=1e6 * off[j])


def check_shaft_lines(runs: Sequence[Observation]) -> None:
    """What turns with the shaft, run against run: run-out is the same at all loads, whatever the excitation.

    Whole operating points are told so in which a channel has another gain: their runs have no fellow without it.
    """
    for order, speed in enumerate(("", "twice ", "three times ")):
        # what computed records without noise show beside their lines is rounding
        shown = [run for run in runs if NO_NOISE not in run.report.keys and _motion(run, order) >= 0]
        for name, alike in _by_probe(shown, "run.point.spin"):
            members, rows = [], []
            for run, k in alike:
                size = run.shaft_lines[order, k]
                if size > _CLEAR * run.lines.floor[k]:
                    members.append((run, k))
                    rows.append((size, _motion(run, order)))
            sizes, motion = np.reshape(rows, (-1, 2)).T
            static = [run.run.point.static_key for run, _ in members]
            for (run, _), change in zip(members, _size_changes(np.log(sizes), motion / sizes, static).tolist()):
                if change:
                    run.report.ask("shaft line", math.exp(change), name, speed=speed)
                    run.report.off[name] = max(run.report.off.get(name, 0.0), _AS_DEVIATION * abs(change))


def _motion(run: Observation, order: int) -> float:
    """How far the film lets the shaft move at a line of it under the force there, at most [m]; NaN where untold."""
    if not len(run.shaft_lines):
        return math.nan
    force, inertia = (np.linalg.norm(run.shaft_lines[order, run.pick(q)]) for q in ("force", "acceleration"))
    compliance = np.linalg.norm(run.line("displacement")) / np.linalg.norm(run.film_force)
    return float((force + run.run.housing_mass * inertia) * compliance)


def _size_changes(sizes: FloatArray, motion: FloatArray, static: Sequence[object]) -> FloatArray:
    """By how much a line's sizes (n,), logarithms, differ from most others; zero where scatter or motion explains it.

    Where no half of them agree, as where a gain drifts, any may be the right one: from the farthest point. `motion`
    (n,): share of it that may be motion, which another film answers otherwise; `static`: point of every run.
    """
    codes = np.array([static.index(key) for key in static])
    usual = np.array([np.median(sizes[codes == code]) for code in codes])
    spare = len(sizes) - len(set(static))
    if spare < _MIN_SPARE or np.ptp(usual) > _LOST:
        return np.zeros(len(sizes))
    # the middle of two groups as large would halve what they differ by
    alone, change = sizes - usual, sizes - np.quantile(sizes, 0.5, method="lower")
    spread, step = np.median(np.abs(alone)), np.median(np.abs(np.diff(alone)))
    many = _MANY_LINES * math.sqrt(len(sizes) / spare)
    # a drift is no scatter: from run to run it is little
    differs = np.abs(change) > max(_SAME_RUNOUT, many * min(spread, step)) + _SOFTER * (motion + np.median(motion))
    if differs.mean() >= 0.5 or (2 * step < spread and differs.any()):
        above, below = sizes - usual.min(), sizes - usual.max()
        return np.where(above > -below, above, below)
    return np.where(differs, change, np.where(np.abs(alone) > max(_SAME_LINE, many * spread), alone, 0.0))

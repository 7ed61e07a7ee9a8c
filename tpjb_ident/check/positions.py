"""Mean positions of the shaft, run against run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter

import numpy as np

from tpjb_ident.check.observation import Observation
from tpjb_ident.check.questions import far

#: Distance from the median of all runs in ranges of the middle 80 % of them, and the least: a smaller one is no jump
#: [m], dry runs press the shaft against pads on all sides; runs that tell it.
_FAR, _MIN_JUMP, _MIN_PLACES = 3.0, {("dynamic", "locus"): 100e-6, ("dry_pivot", "clearance"): 300e-6}, 5
#: Distance from the median of an operating point, over the runs' median one, and the least [m]: a probe that drifts by
#: 1.5 % of a gap of 1 mm was touched, or its amplifier was.
_STEP, _LEAST_STEP, _MIN_STEPS = 9.0, 15e-6, 4


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run."""
    for kinds, least in _MIN_JUMP.items():
        alike = [run for run in runs if run.run.kind in kinds]
        for key, values in by_probe(alike, type, _middle).items():
            low, high = np.quantile([value for _, value in values], [0.1, 0.9])
            for name, observation, off in outlying({key: values}, max(_FAR * (high - low), least), 0.0, _MIN_PLACES):
                observation.report.ask("position", 1.0, name, off=1e6 * off)
                observation.report.doubts.add("displacement")
    dynamic = [run for run in runs if run.run.kind == "dynamic" and "displacement" not in run.report.doubts]
    points = by_probe(dynamic, attrgetter("run.point"), _middle)
    for name, observation, off in outlying(points, _LEAST_STEP, _STEP, _MIN_STEPS):
        observation.report.ask("step", 1.0, name, off=1e6 * off)


def _middle(observation: Observation, place: int) -> float:
    return float(observation.spread[1, place])


def by_probe(
    runs: Sequence[Observation], key: Callable[[Observation], object], value: Callable[[Observation, int], float]
) -> dict[tuple[str, object], list[tuple[Observation, float]]]:
    """Every probe's values by its name and by what is alike of their runs."""
    groups: dict[tuple[str, object], list[tuple[Observation, float]]] = {}
    for observation in runs:
        for index in observation.pick("displacement"):
            shown = value(observation, index)
            if np.isfinite(shown):
                groups.setdefault((observation.channels[index].name, key(observation)), []).append((observation, shown))
    return groups


def outlying(
    groups: dict[tuple[str, object], list[tuple[Observation, float]]], least: float, many: float, count: int
) -> Iterator[tuple[str, Observation, float]]:
    """Probe, run and distance from its group's median of values that lie `far` off."""
    for (name, _), values in groups.items():
        off = np.array([value for _, value in values])
        off -= np.median(off)
        for k in np.flatnonzero(far(np.abs(off), least, many, count)):
            yield name, values[k][0], float(off[k])

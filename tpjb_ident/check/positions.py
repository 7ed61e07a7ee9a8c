"""Mean positions of the shaft, run against run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter

import numpy as np

from tpjb_ident.check.observation import Observation
from tpjb_ident.check.questions import far

#: Distance from the median of all runs over their median one, and the least: a smaller one is no jump [m], dry runs
#: press the shaft against pads on all sides; runs that tell it.
_FAR, _MIN_JUMP, _MIN_PLACES = 8.0, {("dynamic", "locus"): 100e-6, ("dry_pivot", "clearance"): 300e-6}, 5
#: The same within an operating point: a probe that drifts by 1.5 % of a gap of 1 mm was touched, or its amplifier was.
_STEP, _LEAST_STEP, _MIN_STEPS = 9.0, 15e-6, 4


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run, and their travel."""
    for observation in runs:
        for index in observation.pick("displacement"):
            low, _, high = observation.spread[:, index]
            observation.report.ask("travel", high - low, observation.channels[index].name)
    for kinds, least in _MIN_JUMP.items():
        alike = [run for run in runs if run.run.kind in kinds]
        for name, observation, off in outlying(by_probe(alike, type, _middle), least, _FAR, _MIN_PLACES):
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

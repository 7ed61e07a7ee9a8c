"""Mean positions of the shaft, run against run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from tpjb_ident.check.observation import Observation
from tpjb_ident.check.questions import far

#: Runs needed before one can be told apart, and distance from their median in ranges of the middle 80 % of them.
_MIN_PLACES, _FAR = 5, 3.0
#: A smaller distance is no jump: dry runs press the shaft against pads on all sides [m].
_MIN_JUMP = {"running": 100e-6, "dry": 300e-6}
#: Distance from the median of an operating point, over the runs' median one, and the least [m]: a probe that drifts by
#: 1.5 % of a gap of 1 mm within an operating point was touched, or its amplifier was.
_STEP, _LEAST_STEP = 9.0, 15e-6
#: Logarithm by which what turns with the shaft differs in one run, at one load and at others, and over the median one.
_SAME_LINE, _LIKE_LINE, _MANY_LINES = 0.06, 0.5, 6.0


class _Mean(NamedTuple):
    """What a probe shows in a run: its mean [m], or the logarithm of a size."""

    observation: Observation
    value: float


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run, and their travel."""
    for observation in runs:
        for index in observation.pick("displacement"):
            low, _, high = observation.spread[:, index]
            observation.report.ask("travel", high - low, observation.channels[index].name)
    for state, kinds in (("running", {"dynamic", "locus"}), ("dry", {"dry_pivot", "clearance"})):
        alike = [observation for observation in runs if observation.run.kind in kinds]
        for name, means in _groups(alike, type, _middle):
            low, middle, high = 1e6 * np.quantile([mean.value for mean in means], [0.1, 0.5, 0.9])
            allowed = max(1e-6 * _FAR * (high - low), _MIN_JUMP[state])
            for mean in _outlying(means, allowed, 0.0, _MIN_PLACES):
                mean.observation.report.ask("position", 1.0, name, mean=1e6 * mean.value, low=low, high=high)
                mean.observation.report.doubts.add("displacement")
    dynamic = [observation for observation in runs if observation.run.kind == "dynamic"]
    for name, means in _groups(dynamic, attrgetter("run.point"), _middle):
        middle = float(np.median([mean.value for mean in means]))
        for mean in _outlying(means, _LEAST_STEP, _STEP, 4):
            if "displacement" not in mean.observation.report.doubts:
                mean.observation.report.ask("step", 1.0, name, off=1e6 * (mean.value - middle))


def check_shaft_lines(runs: Sequence[Observation]) -> None:
    """What turns with the shaft, run against run: nearly the same at all loads, the same whatever the excitation."""
    shown = [observation for observation in runs if len(observation.shaft_line)]
    for alike, least in (("run.point.static_key", _SAME_LINE), ("run.point.spin", _LIKE_LINE)):
        for name, sizes in _groups(shown, attrgetter(alike), _shaft_size):
            middle = float(np.median([size.value for size in sizes]))
            for size in _outlying(sizes, least, _MANY_LINES, _MIN_PLACES):
                if f"shaft line {name}" not in size.observation.report.keys:
                    size.observation.report.ask("shaft line", math.exp(size.value - middle), name)


def _middle(observation: Observation, place: int) -> float:
    return float(observation.spread[1, place])


def _shaft_size(observation: Observation, place: int) -> float:
    return math.log(max(float(np.nan_to_num(observation.shaft_line[place])), 1e-300))


def _groups(
    runs: Sequence[Observation], key: Callable[[Observation], object], value: Callable[[Observation, int], float]
) -> Iterator[tuple[str, list[_Mean]]]:
    """Every probe's values by name and by what is alike of their runs."""
    groups: dict[tuple[str, object], list[_Mean]] = {}
    for observation in runs:
        for index in observation.pick("displacement"):
            mean = _Mean(observation, value(observation, index))
            if np.isfinite(mean.value):
                groups.setdefault((observation.channels[index].name, key(observation)), []).append(mean)
    for (name, _), means in groups.items():
        yield name, means


def _outlying(means: Sequence[_Mean], least: float, many: float, count: int) -> list[_Mean]:
    values = np.array([mean.value for mean in means])
    outlying = far(np.abs(values - np.median(values)), least, many, count)
    return [mean for mean, is_apart in zip(means, outlying) if is_apart]

"""Mean positions of the shaft, run against run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.questions import far

#: Runs needed before one can be told apart, and distance from their median in ranges of the middle 80 % of them.
_MIN_PLACES, _FAR = 5, 3.0
#: A smaller distance is no jump: dry runs press the shaft against pads on all sides [m].
_MIN_JUMP = {"running": 100e-6, "dry": 300e-6}
#: Distance from the median of an operating point, over the runs' median one, and the least [m]: a probe that drifts by
#: 1.5 % of a gap of 1 mm within an operating point was touched, or its amplifier was.
_STEP, _LEAST_STEP = 9.0, 15e-6


class _Mean(NamedTuple):
    """What a probe reads on average in a run [m]."""

    observation: Observation
    value: float


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run, and their travel."""
    places: dict[tuple[str, str], list[_Mean]] = {}
    points: dict[tuple[str, OperatingPoint], list[_Mean]] = {}
    for observation in runs:
        for index in observation.pick("displacement"):
            name, (low, middle, high) = observation.channels[index].name, observation.spread[:, index]
            observation.report.ask("travel", high - low, name)
            if np.isfinite(middle):
                mean = _Mean(observation, float(middle))
                state = "running" if observation.run.kind in {"dynamic", "locus"} else "dry"
                places.setdefault((name, state), []).append(mean)
                if observation.run.kind == "dynamic":
                    points.setdefault((name, observation.run.point), []).append(mean)
    for (name, state), means in places.items():
        values = np.array([mean.value for mean in means])
        low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
        allowed = max(_FAR * (high - low), _MIN_JUMP[state])
        for mean in _outlying(means, allowed, 0.0, _MIN_PLACES):
            mean.observation.report.ask("position", 1.0, name, mean=1e6 * mean.value, low=1e6 * low, high=1e6 * high)
            mean.observation.report.doubts.add("displacement")
    for (name, _), means in points.items():
        middle = float(np.median([mean.value for mean in means]))
        for mean in _outlying(means, _LEAST_STEP, _STEP, 4):
            if "displacement" not in mean.observation.report.doubts:
                mean.observation.report.ask("step", 1.0, name, off=1e6 * (mean.value - middle))


def _outlying(means: Sequence[_Mean], least: float, many: float, count: int) -> list[_Mean]:
    values = np.array([mean.value for mean in means])
    outlying = far(np.abs(values - np.median(values)), least, many, count)
    return [mean for mean, is_apart in zip(means, outlying) if is_apart]

"""Mean positions of the shaft, run against run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.check.observation import Observation
from tpjb_ident.phasors.bad_samples import robust_deviation

#: No film bearing lets its shaft travel further [m].
_MAX_TRAVEL = 1e-3
#: Runs needed before one can be told apart.
_MIN_PLACES = 5
#: Distance from the median of like runs, in units of the range of the middle 80 % of them.
_FAR = 3.0
#: A smaller distance is no jump: dry runs press the shaft against pads on all sides [m].
_MIN_JUMP = {"running": 100e-6, "dry": 300e-6}
#: Runs of one operating point needed, distance from their median in robust standard deviations, and the least [m]: a
#: probe that drifts by 1.5 % of a gap of 1 mm within an operating point was touched, or its amplifier was.
_LIKE_RUNS, _STEP, _LEAST_STEP = 4, 6.0, 15e-6


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run, and their travel."""
    places: dict[tuple[str, str], list[tuple[Observation, float]]] = {}
    for observation in runs:
        for index in observation.pick("displacement"):
            name = observation.channels[index].name
            low, middle, high = observation.spread[:, index]
            if not np.isfinite(middle):
                continue
            state = "running" if observation.run.kind in {"dynamic", "locus"} else "dry"
            places.setdefault((name, state), []).append((observation, float(middle)))
            if high - low > _MAX_TRAVEL:
                text = f"the shaft travels {1e3 * (high - low):.2g} mm, more than a film bearing lets it"
                cure = "Check the sensitivity of the probe, and for loose cables"
                observation.report.say(f"travel {name}", "warning", f"channel {name}", text, cure)
    for (name, state), means in places.items():
        _check_jumps(name, means, _MIN_JUMP[state])
        points: dict[object, list[tuple[Observation, float]]] = {}
        for observation, middle in means:
            if observation.run.kind == "dynamic":
                points.setdefault(observation.run.point, []).append((observation, middle))
        for like in points.values():
            _check_steps(name, like)


def _check_steps(name: str, means: Sequence[tuple[Observation, float]]) -> None:
    """One probe's means in the runs of one operating point."""
    if len(means) < _LIKE_RUNS:
        return
    values = np.array([m for _, m in means])
    off = values - np.median(values)
    allowed = max(_STEP * robust_deviation(off), _LEAST_STEP)
    for (observation, _), distance in zip(means, off):
        if abs(distance) > allowed and "displacement" not in observation.report.doubts:
            text = f"reads {1e6 * distance:+.0f} um on average beside the other runs at this operating point"
            cure = "Check probe and amplifier: moved, or another gain in this run?"
            observation.report.say(f"step {name}", "warning", f"channel {name}", text, cure)


def _check_jumps(name: str, means: Sequence[tuple[Observation, float]], least: float) -> None:
    if len(means) < _MIN_PLACES:
        return
    values = np.array([m for _, m in means])
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    allowed = max(_FAR * (high - low), least)
    for observation, mean in means:
        if abs(mean - middle) > allowed:
            text = (
                f"reads {1e6 * mean:.0f} um on average, others of its kind {1e6 * low:.0f} to {1e6 * high:.0f} um; "
                "the gap voltage is constant within a campaign"
            )
            cure = "Check the probe: moved, wrong sign, wrong sensitivity in this run?"
            observation.report.say(f"position {name}", "error", f"channel {name}", text, cure)
            observation.report.doubts.add("displacement")

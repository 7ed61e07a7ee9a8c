"""Dry pivot tests: load steps toward one pad, no oil, no rotation."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.virtual_rig.motion import RunPhysics, SlowMotion
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.plan import DryTest, PlannedRun
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError

SETTLING = 0.1  # time constant of an overshoot [s]
UPPER = 0.3  # sine of a pivot's angle above which its pad counts as an upper one


def dry_physics(run: PlannedRun, truth: RigTruth, noise: Noise, seed: int) -> RunPhysics:
    """Physics of a dry pivot test: position along the pad = clearance + deflection under the load on the pivot.

    Parameters
    ----------
    run : PlannedRun
    truth : RigTruth
    noise : Noise
    seed : int
        Of the random numbers.
    """
    test = run.test
    if not isinstance(test, DryTest) or run.direction is None:
        raise VirtualRigError(f"run {run.id} is not a dry pivot test")
    rng = stream(seed, run.record, "dry")
    pad = test.pad - 1
    toward = np.array([np.cos(run.direction), np.sin(run.direction)])
    sideways = np.array([-toward[1], toward[0]])
    time, load = load_history(test, run.rate)
    flaws = noise.dry
    off = _either_sign(rng, flaws.direction)
    side = _either_sign(rng, flaws.side)
    side_start = flaws.side_start * rng.standard_normal()
    gap = rng.uniform(*flaws.contact_gap) if toward[1] > UPPER else 0.0
    on_pivot = held_back(load * np.cos(off), flaws.friction)
    deflection = truth.deflection(test.pad, on_pivot)
    missing = gap * np.exp(-load / flaws.contact_load)
    radial = truth.clearance[pad] + deflection - missing
    position = np.outer(radial, toward) + np.outer(side_start + side * (deflection - missing), sideways)
    direction = run.direction + off
    motion = SlowMotion(time, position, np.outer(load, [np.cos(direction), np.sin(direction)]), _cold(truth))
    facts = {
        "load_direction_error_deg": float(np.degrees(off)),
        "side_share": side,
        "side_start_m": side_start,
        "contact_gap_m": gap,
        "friction": flaws.friction,
    }
    return RunPhysics(time, motion, facts)


def load_history(test: DryTest, rate: float) -> tuple[FloatArray, FloatArray]:
    """Time (n,) [s] and load (n,) [N] of a dry test: ramps and holds.

    Parameters
    ----------
    test : DryTest
    rate : float
        [Hz]
    """
    knots, level, held = [0.0], [test.start], []
    rising = list(zip(test.levels, test.holds))
    order = {"up": rising, "down": rising[::-1], "cycle": rising + rising[-2::-1]}[test.branch]
    if test.branch == "down":
        level = [test.levels[-1]]
        knots = [0.0]
    for target, hold in order:
        arrival = knots[-1] + (test.ramp if target != level[-1] else 0.0)
        held.append((arrival, arrival + hold, target - level[-1], target))
        knots += [arrival, arrival + hold]
        level += [target, target]
    if test.branch != "up":
        knots.append(knots[-1] + test.ramp)
        level.append(test.start)
    time = np.arange(round(knots[-1] * rate)) / rate
    load = np.interp(time, knots, level)
    for start, stop, step, target in held:
        inside = (time >= start) & (time < stop)
        since = time[inside] - start
        load[inside] += test.overshoot * step * np.exp(-since / SETTLING)
        load[inside] += test.load_drift * target * since
    return time, load


def held_back(load: FloatArray, friction: float) -> FloatArray:
    """Load (n,) [N] that reaches the pivot past dry friction of a fraction of the force.

    The play operator: going up the pivot feels (1 - friction) of the load, going down (1 + friction), and on
    reversal it waits until the load has crossed that gap.

    Parameters
    ----------
    load : (n,) ndarray
        [N]
    friction : float
        Dry friction over force.
    """
    if friction == 0.0:
        return load
    felt = np.empty_like(load)
    low, high = (load * (1 - friction)).tolist(), (load * (1 + friction)).tolist()
    # a falling test begins at the top of a load that came from above
    now = high[0] if load[-1] < load[0] else low[0]
    for i, (least, most) in enumerate(zip(low, high)):
        now = min(max(now, least), most)
        felt[i] = now
    return felt


def _either_sign(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(rng.uniform(*limits) * rng.choice([-1.0, 1.0]))


def _cold(truth: RigTruth) -> FloatArray:
    return np.full(len(truth.pivot_angles), truth.cold_temperature)

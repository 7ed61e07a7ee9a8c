"""Tests without rotation: dry load steps toward one pad, and a small load swept once around the clearance polygon."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.virtual_rig.motion import RunPhysics, SlowMotion
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.plan import ClearanceSweep, DryTest, PlannedRun
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError

SETTLING = 0.1  # time constant of an overshoot [s]
UPPER = 0.3  # sine of a pivot's angle above which its pad counts as an upper one


def dry_physics(run: PlannedRun, truth: RigTruth, noise: Noise, seed: int) -> RunPhysics:
    """Physics of a dry pivot test: position along the pad = clearance + deflection under the load on the pivot."""
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
    """Time (n,) [s] and load (n,) [N] of a dry test: ramps and holds."""
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


def clearance_physics(run: PlannedRun, truth: RigTruth, noise: Noise, seed: int) -> RunPhysics:
    """Physics of a clearance sweep."""
    sweep = run.test
    if not isinstance(sweep, ClearanceSweep):
        raise VirtualRigError(f"run {run.id} is not a clearance sweep")
    rng = stream(seed, run.record, "dry")
    push = sweep.push * (1 + noise.dry.push_scatter * rng.standard_normal())
    time = np.arange(round(sweep.seconds * run.rate)) / run.rate
    direction = sweep.start + 2 * np.pi * time / sweep.seconds
    position = swept_position(truth, push, direction, sweep.slide_lag, sweep.slide_width)
    load = push * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    cold = np.full(len(truth.pivot_angles), truth.cold_temperature)
    return RunPhysics(time, SlowMotion(time, position, load, cold), {"push_N": push})


def swept_position(truth: RigTruth, push: float, direction: FloatArray, lag: float, width: float) -> FloatArray:
    """Shaft position (n, 2) [m] under a load `push` [N] toward `direction` (n,) [rad].

    The shaft rests in the corner between the two pads that the load points between; each pivot carries its share
    of the load and gives by its own law. It slides along a pad's side to the next corner when the load has
    passed that pad by `lag`, over about `width` (friction). On its way that pad alone carries, push times the cosine
    of the angle between them: there the side stands at clearance + deflection(that).
    """
    pads = _sides(truth)
    normals = np.array([[np.cos(truth.pivot_angles[k]), np.sin(truth.pivot_angles[k])] for k in pads])
    shares, places = [], []
    for i, pad in enumerate(pads):
        after = pads[(i + 1) % len(pads)]
        here, there = truth.pivot_angles[pad], truth.pivot_angles[after]
        gap = (there - here) % (2 * np.pi)
        beyond = (direction - here - lag + np.pi) % (2 * np.pi) - np.pi
        left = (there + lag - direction + np.pi) % (2 * np.pi) - np.pi
        share = 0.25 * (1 + np.tanh(beyond / width)) * (1 + np.tanh(left / width))
        turned = np.clip((direction - here + np.pi) % (2 * np.pi) - np.pi, 0.0, gap)
        forces = push * np.stack([np.sin(gap - turned), np.sin(turned)]) / np.sin(gap)
        reach = np.stack([truth.clearance[k] + truth.deflection(k + 1, f) for k, f in zip((pad, after), forces)])
        corner = np.linalg.solve(np.stack([normals[i], normals[(i + 1) % len(pads)]]), reach).T
        shares.append(share)
        places.append(corner)
    weight = np.array(shares) / np.sum(shares, axis=0)
    position = np.einsum("kn,knj->nj", weight, np.array(places))
    for i, pad in enumerate(pads):
        # between two corners a blend of both would share the load among three pads
        alone = 4.0 * weight[i - 1] * weight[i]
        off = np.cos(direction - truth.pivot_angles[pad])
        stands = truth.clearance[pad] + truth.deflection(pad + 1, push * np.maximum(off, 0.0))
        position += (alone * (stands - position @ normals[i]))[:, None] * normals[i]
    return np.asarray(position)


def corners(truth: RigTruth) -> FloatArray:
    """Corners (n_sides, 2) [m] of the cold polygon without load, counter-clockwise."""
    pads = _sides(truth)
    return np.array([_corner(truth, k, pads[(i + 1) % len(pads)]) for i, k in enumerate(pads)])


def _sides(truth: RigTruth) -> list[int]:
    """Pads in counter-clockwise order, less those that the shaft cannot touch between their neighbours."""
    pads = sorted(range(len(truth.pivot_angles)), key=lambda k: truth.pivot_angles[k] % (2 * np.pi))
    removed = True
    while removed and len(pads) > 3:
        removed = False
        for i, k in enumerate(pads):
            before, after = pads[i - 1], pads[(i + 1) % len(pads)]
            if (truth.pivot_angles[after] - truth.pivot_angles[before]) % (2 * np.pi) >= np.pi:
                continue
            reach = _corner(truth, before, after) @ _normal(truth, k)
            if reach <= truth.clearance[k]:
                pads.remove(k)
                removed = True
                break
    spans = [
        (truth.pivot_angles[pads[(i + 1) % len(pads)]] - truth.pivot_angles[k]) % (2 * np.pi)
        for i, k in enumerate(pads)
    ]
    if max(spans) >= np.pi - 1e-6:
        raise VirtualRigError("the pads leave half the circle open: the shaft would fall out of the bearing")
    return pads


def _corner(truth: RigTruth, first: int, second: int) -> FloatArray:
    normals = np.stack([_normal(truth, first), _normal(truth, second)])
    reach = np.array([truth.clearance[first], truth.clearance[second]])
    return np.asarray(np.linalg.solve(normals, reach), dtype=float)


def _normal(truth: RigTruth, pad: int) -> FloatArray:
    angle = truth.pivot_angles[pad]
    return np.array([np.cos(angle), np.sin(angle)])

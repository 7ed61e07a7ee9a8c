"""The clearance test: a small load swept once around moves the shaft along the sides of a polygon."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.virtual_rig.motion import RunPhysics, SlowMotion
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.plan import ClearanceSweep, PlannedRun
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError


def clearance_physics(run: PlannedRun, truth: RigTruth, noise: Noise, seed: int) -> RunPhysics:
    """Physics of a clearance sweep.

    Parameters
    ----------
    run : PlannedRun
    truth : RigTruth
    noise : Noise
    seed : int
        Of the random numbers.
    """
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

    Parameters
    ----------
    truth : RigTruth
    push : float
        [N]
    direction : (n,) ndarray
        Of the load [rad].
    lag : float
        By which the shaft follows late [rad].
    width : float
        Over which a corner is rounded [rad].
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
    """Corners (n_sides, 2) [m] of the cold polygon without load, counter-clockwise.

    Parameters
    ----------
    truth : RigTruth
    """
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

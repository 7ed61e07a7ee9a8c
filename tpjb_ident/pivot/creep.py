"""Creep of a dry test: a deflection that goes on for seconds after every step of the load, as liners and joints do.

Within a hold creep looks like drift, but drift goes on through all holds at one rate of either sign, while creep
follows the load, in all runs alike. Taken for drift it is taken off over the whole record, though it may begin anew
with every step, and the pivot comes out several per cent too stiff. Holds tell how it goes on within them; whether the
next one carries it on they do not: every step may add its own for ever (as in a linear solid), or the next step may
end it. Both are tried with several time constants, weighed by how well they fit; the mean is taken off, and its size
at the largest load counts as an error of all deflections alike.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.dry_record import DryRecord, pooled_noise, smooth_columns

# share of the deflection that liners and joints creep: what holds hardly show is not made large; the same of a joint
# that only one pad has
_PLAUSIBLE, _OF_ONE = 0.03, 0.2
_MOST = 0.8  # of the deflection: what more of it comes late is none
_TIMES = (0.3, 1.0, 3.0, 10.0)  # time constants over the usual length of a hold
# standard errors from which it is creep, by the noise, which takes creep for drift, and by how the runs differ; of one
# pad by the noise of the others, where another pad creeps, and where most do
_LEAST, _ALIKE, _ALONE, _BESIDE, _AMONG = 3.0, 5.0, 4.0, 3.3, 1.0
_ROUNDS = 4


def without_creep(
    records: Sequence[DryRecord], noise: NoiseModel
) -> tuple[list[DryRecord], NoiseModel, dict[int, Conditions]]:
    """Records less the creep that the holds of a pad show, else those of all alike; their noise, conditions by pad.

    Without creep they are given back as they are.
    """
    less = list(records)
    conditions: dict[int, Conditions] = {record.pad: () for record in records}
    for least, most in ((_ALONE, 0.0), (_BESIDE, 0.0), (_AMONG, 0.5)):
        if sum(map(bool, conditions.values())) < most * len(conditions):
            break
        for pad, condition in list(conditions.items()):
            if condition:
                continue
            own = [record for record in less if record.pad == pad]
            if _less_alike(own, noise, _OF_ONE, 0.5 * least)[2]:  # hardly any is none
                others = [record for record in less if record.pad != pad]  # whose noise no creep of this pad is part of
                own, _, conditions[pad] = _less_alike(own, pooled_noise(others) if others else noise, _OF_ONE, least)
                crept = iter(own)
                for place, record in enumerate(less):
                    if record.pad == pad:
                        less[place] = next(crept)
        if not any(conditions.values()):
            less, noise, shared = _less_alike(records, noise, _PLAUSIBLE, _LEAST)
            return less, noise, dict.fromkeys(conditions, shared)
    return less, pooled_noise(less), conditions


def _less_alike(
    records: Sequence[DryRecord], noise: NoiseModel, plausible: float, least: float
) -> tuple[list[DryRecord], NoiseModel, Conditions]:
    """Records less the creep that they share, their noise, and a condition."""
    held = [record for record in records if record.holds]
    if not held:
        return list(records), noise, ()
    durations = []
    for record in held:
        durations.extend([hold.duration for hold in record.holds])
    times = np.median(durations) * np.array(_TIMES)
    less = list(records)
    condition: Conditions = ()
    for _ in range(_ROUNDS):  # what noise there is shows when the creep is off: until then it takes much for drift
        holds = [_held_to_light(record, noise, times) for record in held]
        runs = np.array([hold.sum(axis=0) for hold in holds])
        total, pull = runs.sum(axis=0)
        total += plausible**-2
        share = pull / total
        scatter = _scatter(runs, share)
        # a jump within one hold is no creep: all show that
        apart = np.maximum(scatter, _scatter(np.vstack(holds), share))
        error = np.sqrt(np.maximum(apart, 1.0) / total)
        best = np.argmax(share / error)
        limit = max(least * error[best], _ALIKE * math.sqrt(scatter[best] / total[best]))
        if not limit <= share[best] < _MOST:
            break
        weight = special.softmax(0.5 * np.where(share > 0.0, (share / error) ** 2, 0.0))
        less = []
        for record in records:
            blocks, creep = record.blocks, _courses(record, times) @ (share * weight)
            largest = np.max(np.abs(creep)) / np.ptp(blocks.deflection)
            blocks = replace(blocks, deflection=blocks.deflection - creep)
            less.append(replace(record, blocks=blocks, creep=largest))
        noise = pooled_noise(less)
        percent = f"{100 * share[best]:.1f} % (se {100 * error[best]:.1f} %)"
        detail = f"{percent} of the deflection follow a step within some {times[best % len(times)]:.2g} s"
        condition = (Condition("deflection-creeps", detail),)
    return less, noise, condition


def _scatter(sums: FloatArray, share: FloatArray) -> FloatArray:
    """How parts (n,) differ from a share (k,), by information and pull (n, 2, k), over what they do by chance (k,)."""
    information = np.maximum(sums[:, 0], 1e-300)
    return np.sum((sums[:, 1] - information * share) ** 2 / information, axis=0) / max(len(sums) - 1, 1)


def _courses(record: DryRecord, times: FloatArray) -> FloatArray:
    """Creep of unit size at the blocks (m, 2 k): of every time constant (k,), lost at the next step, and carried on."""
    blocks = record.blocks
    smooth = smooth_columns(blocks)  # the readings themselves would find their own noise in their courses
    moved = smooth @ np.linalg.lstsq(smooth, blocks.deflection, rcond=None)[0]
    moved -= moved[np.argmin(blocks.load)]
    starts = np.array([hold.start for hold in record.holds] + [0.0])
    since = np.where(blocks.hold >= 0, blocks.time - starts[blocks.hold], 0.0)[:, None]
    anew = moved[:, None] * -np.expm1(-np.maximum(since, 0.0) / times)
    carried = np.full_like(anew, moved[0])
    follow = -np.expm1(-np.diff(blocks.time)[:, None] / times)
    for k in range(1, len(moved)):
        carried[k] = carried[k - 1] + (moved[k] - carried[k - 1]) * follow[k - 1]
    return np.hstack([anew, carried - carried[0]])


def _held_to_light(record: DryRecord, noise: NoiseModel, times: FloatArray) -> FloatArray:
    """What holds (h,), each at a level of its own, say of the size of courses (k,): information and pull (h, 2, k)."""
    used = record.blocks.hold >= 0
    blocks = record.blocks.take(used)
    member = (blocks.hold[:, None] == np.unique(blocks.hold)).astype(float)
    load = blocks.load - member @ (member.T @ blocks.load / member.sum(axis=0))  # one that wanders moves the pivot too
    level = np.column_stack([member, load / np.abs(load).max()]) if np.any(load) else member
    root = np.linalg.cholesky(blocks.covariance(noise, record.quantisation))
    columns = np.column_stack([_courses(record, times)[used], blocks.deflection])
    levels, columns = np.linalg.solve(root, level), np.linalg.solve(root, columns)
    basis, _ = np.linalg.qr(levels)
    free = columns - basis @ (basis.T @ columns)
    return np.stack([member.T @ free[:, :-1] ** 2, member.T @ (free[:, :-1] * free[:, -1:])], axis=1)

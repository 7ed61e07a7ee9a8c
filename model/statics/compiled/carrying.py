"""Which pads carry: what `model.statics.carrying` decides, on the arrays of a compiled search."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.compilation import inner
from model.film.mesh import FilmWork
from model.film.oil_state import Running
from model.statics.compiled.constants import CROWN, EDGE, MAX_LOAD_CHANGES, NEAR_EDGE
from model.statics.compiled.laws import compliance, deflection
from model.statics.compiled.stack import PadStack, PadState
from rigdata.arrays import FloatArray

#: Every so many rows of an attitude's table the pivot is asked; between them its give is as good as straight.
_EVERY = 4


class Case(NamedTuple):
    """The numbers of one search."""

    load: FloatArray  #: (2,), N
    running: Running
    hold: tuple[float, float]
    size: float
    accuracy: float
    isothermal: bool


@inner
def rigid_approach(pads: PadStack, state: PadState, m: int) -> float:
    """Approach of a film if its pivot were rigid [m]."""
    return pads.preload[m] + pads.frame[m, 0, 0] * state.position[0] + pads.frame[m, 0, 1] * state.position[1]


@inner
def along(pads: PadStack, state: PadState, m: int) -> float:
    """Journal's place across the pivot line [m]."""
    return pads.frame[m, 1, 0] * state.position[0] + pads.frame[m, 1, 1] * state.position[1]


@inner
def margin(pads: PadStack, state: PadState, m: int) -> float:
    """How far a pad is from where it stops carrying, as a share of its clearance; negative beyond."""
    return (reach(pads, state, m) - state.branch[m, 0, 0]) / pads.clearance[m]


@inner
def _bulge(pads: PadStack, state: PadState, m: int) -> float:
    """How far the face of a pad that bends stands inward at its pivot [m]."""
    if state.bent.size == 0:
        return 0.0
    before, share = int(pads.pivot[m, 0]), pads.pivot[m, 1]
    return -((1.0 - share) * state.bent[m, before, 0] + share * state.bent[m, before + 1, 0])


@inner
def reach(pads: PadStack, state: PadState, m: int) -> float:
    """How near the journal is to a pad on a rigid pivot [m], counting by how much a warm pad's face stands inward."""
    return rigid_approach(pads, state, m) + _bulge(pads, state, m)


@inner
def edge(pads: PadStack, state: PadState, m: int) -> float:
    """Share of the clearance by which the table of rigid pads may be wrong about where a pad stops carrying."""
    return EDGE + CROWN * abs(_bulge(pads, state, m)) / pads.clearance[m]


@inner
def find_branch(case: Case, pads: PadStack, works: FilmWork, state: PadState, m: int, hotter: float) -> None:
    """Loaded attitudes of a pad at its film's mean temperature, or `hotter` [K] than that."""
    count = pads.rows[m]
    if count < 2:
        state.branch[m] = 0.0
        state.branch[m, 0, :2] = math.inf
        state.length[m] = 2
        return
    warm = works.temperature[m]
    mean = 0.0
    for i in range(warm.shape[0]):
        for j in range(warm.shape[1]):
            mean += warm[i, j]
    mean = mean / warm.size + hotter
    speed, oil = case.running.speed, case.running.oil
    scale = oil[0] * math.exp(oil[1] * (40.0 - mean)) * speed * case.size
    table, clearance = pads.attitudes[m], pads.clearance[m]
    load = np.empty(count)
    for k in range(count):
        load[k] = scale * table[2, k] / (clearance / (1.0 + table[0, k])) ** 2
    # the pivot's give between the loads at which it is asked
    asked = _sorted(load)
    given = np.empty(len(asked))
    for k in range(len(asked)):
        given[k] = deflection(pads.laws[m], pads.curves[m], asked[k])
    rigid = np.empty(count)
    last_fall = -1
    for k in range(count):
        rigid[k] = clearance - clearance / (1.0 + table[0, k]) + interpolate(asked, given, len(asked), load[k])
        if k > 0 and rigid[k] - rigid[k - 1] <= 0.0:
            last_fall = k - 1
    rising = last_fall + 1
    for k in range(rising, count):
        room = clearance / (1.0 + table[0, k])
        state.branch[m, 0, k - rising] = rigid[k]
        state.branch[m, 1, k - rising] = clearance - room
        state.branch[m, 2, k - rising] = table[1, k] * room
        state.branch[m, 3, k - rising] = load[k]
    state.length[m] = count - rising


@inner
def _sorted(load: FloatArray) -> FloatArray:
    """Every so many loads, rising; they are nearly so as they come."""
    count = (len(load) + _EVERY - 1) // _EVERY
    out = np.empty(count)
    for k in range(count):
        value, place = load[k * _EVERY], k
        while place > 0 and out[place - 1] > value:
            out[place] = out[place - 1]
            place -= 1
        out[place] = value
    return out


@inner
def interpolate(x: FloatArray, y: FloatArray, count: int, at: float) -> float:
    """Straight between the first `count` points, constant beyond them."""
    if at <= x[0]:
        return y[0]
    if at >= x[count - 1]:
        return y[count - 1]
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x[middle] <= at:
            low = middle
        else:
            high = middle
    return y[low] + (y[high] - y[low]) / (x[high] - x[low]) * (at - x[low])


@inner
def _let_idle(state: PadState, m: int) -> None:
    """Let a pad carry nothing."""
    state.idle[m] = True
    state.deflection[m] = 0.0
    state.tilt[m] = 0.0


@inner
def set_loaded(pads: PadStack, works: FilmWork, state: PadState, m: int) -> None:
    """Put a pad on its loaded attitude, or let it idle."""
    _let_idle(state, m)
    state.idle[m] = margin(pads, state, m) <= 0.0
    works.ruptured[m] = False
    if not state.idle[m]:
        rigid, count = reach(pads, state, m), state.length[m]
        a = interpolate(state.branch[m, 0], state.branch[m, 1], count, rigid)
        b = interpolate(state.branch[m, 0], state.branch[m, 2], count, rigid)
        state.deflection[m] = rigid - a
        state.tilt[m] = (b - along(pads, state, m)) / pads.pivot_radius[m]


@inner
def hold_of(case: Case, state: PadState, m: int, load: float) -> tuple[float, float]:
    """What holds a tilt back: its slope by the tilt [N m/rad] and by the pad's load [m]."""
    stiffness = case.hold[0] + case.hold[1] * max(load, 0.0)
    return stiffness, case.hold[1] * state.tilt[m] if load > 0.0 else 0.0


@inner
def _is_stable(case: Case, pads: PadStack, state: PadState, m: int) -> bool:
    """Whether film and pivot push a pad back from a small change of tilt and deflection."""
    k, load, radius = state.stiffness[m], state.force[m, 0], pads.pivot_radius[m]
    give = compliance(pads.laws[m], pads.curves[m], max(load, 1e-6))
    stiffness, arm = hold_of(case, state, m, load)
    arm = arm / radius
    turning = k[1, 1] + arm * k[0, 1] + stiffness / radius**2
    return turning * (1.0 + give * k[0, 0]) > give * (k[1, 0] + arm * k[0, 0]) * k[0, 1]


@inner
def update_carrying(case: Case, pads: PadStack, works: FilmWork, state: PadState) -> bool:
    """Let pads take up or shed their load as the journal's position has it; True if any did."""
    changed = False
    for m in range(len(state.tilt)):
        if state.length[m] == 0 or abs(margin(pads, state, m)) < NEAR_EDGE:
            find_branch(case, pads, works, state, m, 0.0)
        inside = margin(pads, state, m)
        if state.idle[m] and inside > 0.0 and state.changes[m] < MAX_LOAD_CHANGES:
            set_loaded(pads, works, state, m)
        elif not state.idle[m] and case.hold[0] == 0.0 and not _keeps_its_load(case, pads, state, m, inside):
            _let_idle(state, m)
        else:
            continue
        state.changes[m] += 1
        changed = True
    return changed


@inner
def _keeps_its_load(case: Case, pads: PadStack, state: PadState, m: int, inside: float) -> bool:
    if inside > 0.0 or inside < -edge(pads, state, m) or not state.solved[m]:
        return inside > 0.0
    return _is_stable(case, pads, state, m)


@inner
def leave_unstable(case: Case, pads: PadStack, works: FilmWork, state: PadState) -> bool:
    """Move pads off attitudes that nothing holds, the falling part of the load near an edge; True if there were any."""
    found = False
    for m in range(len(state.tilt)):
        if not state.solved[m] or case.hold[0] > 0.0 or _is_stable(case, pads, state, m):
            continue
        found = True
        state.changes[m] += 1
        if margin(pads, state, m) > edge(pads, state, m) and state.changes[m] < MAX_LOAD_CHANGES:
            set_loaded(pads, works, state, m)
        else:
            _let_idle(state, m)
            state.changes[m] = MAX_LOAD_CHANGES
    return found

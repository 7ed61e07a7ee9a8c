"""Where a pad carries: putting it on its loaded attitude, letting it idle, and whether what holds it is stable."""

from __future__ import annotations

import math

from model.compilation import inner
from model.film.mesh import FilmWork
from model.interpolation import row_below
from model.pad.pivot import compliance
from model.statics.compiled.case import ALONE, COUPLED, Case, along, rigid_approach
from model.statics.compiled.stack import PadStack, PadState
from model.tilt_hold import held_moment
from rigdata.arrays import FloatArray

#: Share of the load below which a film that opens carries nothing that is told from none: from other starts some stand
#: at up to 7e-7 of it where the pad idles, and those that heat holds carry 0.07 and more.
_NOTHING = 1e-4
#: How often a search puts a pad back on its loaded attitude that has lost it on the way.
_RESCUES = 12


@inner
def let_idle(state: PadState, m: int) -> None:
    """Let a pad carry nothing."""
    state.idle[m] = True
    state.deflection[m] = 0.0
    state.tilt[m] = 0.0


@inner
def place(pads: PadStack, works: FilmWork, state: PadState, m: int) -> None:
    """Put a pad on its loaded attitude for the journal's position; at its fold where it has none there."""
    table, last = pads.attitudes[m], pads.rows[m] - 1
    at = max(rigid_approach(pads, state.position, m), table[0, 0])
    low = row_below(table[0], pads.rows[m], at)
    share = (min(at, table[0, last]) - table[0, low]) / (table[0, low + 1] - table[0, low])
    a = table[1, low] + share * (table[1, low + 1] - table[1, low])
    b = table[2, low] + share * (table[2, low + 1] - table[2, low])
    state.idle[m] = False
    state.deflection[m] = at - a
    state.tilt[m] = (b - along(pads, state.position, m)) / pads.pivot_radius[m]
    works.ruptured[m] = False


@inner
def rescue(pads: PadStack, works: FilmWork, state: PadState, m: int) -> bool:
    """Put a pad back on its loaded attitude, if it has one here and has not been put back too often."""
    if pads.rows[m] < 2 or state.rescues[m] >= _RESCUES or margin(pads, state, m) < 0.0:
        return False
    state.rescues[m] += 1
    place(pads, works, state, m)
    return True


@inner
def margin(pads: PadStack, state: PadState, m: int) -> float:
    """How far a pad is from the fold of its loaded attitudes, as a share of its clearance; negative beyond."""
    return (rigid_approach(pads, state.position, m) - pads.attitudes[m, 0, 0]) / pads.clearance[m]


@inner
def _warms(case: Case) -> bool:
    """Whether a film's temperature follows, and what that adds to its stiffness is known."""
    return case.thermal == ALONE or case.thermal == COUPLED


@inner
def is_doubtful(case: Case, pads: PadStack, state: PadState, m: int) -> bool:
    """Whether the frozen film leaves a pad's stability in doubt, or its wedge is flatter than that of its fold."""
    if case.hold.flexure > 0.0:
        return False
    flat = _warms(case) and state.wedge[m, 1] < pads.attitudes[m, 2, 0]
    return flat or not is_stable(case, pads, state, m, state.stiffness[m])


@inner
def is_stable(case: Case, pads: PadStack, state: PadState, m: int, k: FloatArray) -> bool:
    """Whether film and pivot push a pad back from a small change of tilt and deflection: `k` (2, 2) of the film [N/m].

    The determinant of the pad's own two equations is positive: kbb (1 + c kaa) > c kba kab, c the pivot's compliance,
    with what holds the tilt back added to the film's moment. What counts is the film whose heat follows: the branch
    that comes back from the fold is unstable by it, and near a fold the frozen one calls unstable what is not. An
    unloaded film leaves a load that is not told from none, and, where no heat carries it, a wedge that opens.
    """
    opens = state.wedge[m, 1] <= pads.flattest[m]
    none = (_NOTHING if opens else case.accuracy) * math.hypot(case.load[0], case.load[1])
    if case.hold.slip == 0.0 and (state.force[m, 0] <= none or (opens and not _warms(case))):
        return False
    load, radius = state.force[m, 0], pads.pivot_radius[m]
    give = compliance(pads.laws[m], pads.curves[m], max(load, 1e-6))
    _, stiffness, arm, _ = held_moment(case.hold, state.tilt[m], load)
    arm = arm / radius
    turning = k[1, 1] + arm * k[0, 1] + stiffness / radius**2
    return turning * (1.0 + give * k[0, 0]) > give * (k[1, 0] + arm * k[0, 0]) * k[0, 1]

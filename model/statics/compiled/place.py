"""Where a pad carries: putting it on its loaded attitude, letting it idle, and whether what holds it is stable."""

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmWork
from model.interpolation import row_below
from model.pad.pivot import compliance
from model.statics.compiled.case import ALONE, COUPLED, Case
from model.statics.compiled.stack import along, rigid_approach, work_of
from model.tilt_hold import held_moment
from rigdata.arrays import BoolArray, FloatArray

#: Share of the load below which a film that opens carries nothing that is told from none: from other starts some stand
#: at up to 7e-7 of it where the pad idles, and those that heat holds carry 0.07 and more.
_NOTHING = 1e-4
#: How often a search puts a pad back on its loaded attitude that has lost it on the way.
_RESCUES = 12
#: A film's temperature follows, and what that adds to its stiffness is known.
_WARM = (ALONE, COUPLED)


@inner
def let_idle(pad: np.record) -> None:
    """Let a pad carry nothing."""
    pad.idle = True
    pad.deflection = 0.0
    pad.tilt = 0.0


@inner
def place(pad: np.record, work: FilmWork, position: FloatArray) -> None:
    """Put a pad on its loaded attitude for the journal's position; at its fold where it has none there."""
    table, last = pad.attitudes, pad.rows - 1
    at = max(rigid_approach(pad, position), table[0, 0])
    low = row_below(table[0], pad.rows, at)
    share = (min(at, table[0, last]) - table[0, low]) / (table[0, low + 1] - table[0, low])
    a = table[1, low] + share * (table[1, low + 1] - table[1, low])
    b = table[2, low] + share * (table[2, low + 1] - table[2, low])
    pad.idle = False
    pad.deflection = at - a
    pad.tilt = (b - along(pad, position)) / pad.pivot_radius
    work.ruptured[:] = False


@compiled
def place_pads(pads: np.ndarray, works: FilmWork, loaded: BoolArray, position: FloatArray) -> None:
    """Put those pads that are loaded on their loaded attitudes."""
    for m in range(len(loaded)):
        if loaded[m]:
            place(pads[m], work_of(works, m), position)


@inner
def rescue(pad: np.record, work: FilmWork, position: FloatArray) -> bool:
    """Put a pad back on its loaded attitude, if it has one here and has not been put back too often."""
    if pad.rows < 2 or pad.rescues >= _RESCUES or rigid_approach(pad, position) < pad.attitudes[0, 0]:
        return False
    pad.rescues += 1
    place(pad, work, position)
    return True


@inner
def is_doubtful(case: Case, pad: np.record, curve: FloatArray) -> bool:
    """Whether the frozen film leaves a pad's stability in doubt, or its wedge is flatter than that of its fold."""
    if case.hold.flexure > 0.0:
        return False
    flat = case.thermal in _WARM and pad.wedge[1] < pad.attitudes[2, 0]
    return flat or not is_stable(case, pad, curve, pad.stiffness)


@inner
def is_stable(case: Case, pad: np.record, curve: FloatArray, k: FloatArray) -> bool:
    """Whether film and pivot push a pad back from a small change of tilt and deflection: `k` (2, 2) of the film [N/m].

    The determinant of the pad's own two equations is positive: kbb (1 + c kaa) > c kba kab, c the pivot's compliance,
    with what holds the tilt back added to the film's moment. What counts is the film whose heat follows: the branch
    that comes back from the fold is unstable by it, and near a fold the frozen one calls unstable what is not. An
    unloaded film leaves a load that is not told from none, and, where no heat carries it, a wedge that opens.
    """
    opens = pad.wedge[1] <= pad.flattest
    none = (_NOTHING if opens else case.accuracy) * math.hypot(case.load[0], case.load[1])
    if case.hold.slip == 0.0 and (pad.force[0] <= none or (opens and case.thermal not in _WARM)):
        return False
    load, radius = pad.force[0], pad.pivot_radius
    flexibility = compliance(pad.law, curve, max(load, 1e-6))
    _, stiffness, arm = held_moment(case.hold, pad.tilt, load)
    arm = arm / radius
    turning = k[1, 1] + arm * k[0, 1] + stiffness / radius**2
    return turning * (1.0 + flexibility * k[0, 0]) > flexibility * (k[1, 0] + arm * k[0, 0]) * k[0, 1]

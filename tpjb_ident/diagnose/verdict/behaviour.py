"""Behaviour: what lies beyond the library, in few numbers.

A spring in series, a parallel stiffness or damping; a pad whose clearance or whose pivot is further off than stated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import TERMS
from tpjb_ident.diagnose.search.fit import Fit
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search
from tpjb_ident.diagnose.search.worth import STAND_IN

#: A smaller principal value below this share of the larger one makes a term one of one direction.
ONE_WAY = 0.2
#: What a pad by itself may be off by: kind, effect and parameter that say it, unit.
PADS = {
    "clearance_scatter": ("clearance by pad", "pad_offset", "radial_offset", "m"),
    "pivot_stiffness_scatter": ("pivot law of a pad", "soft_pivot", "stiffness_factor", "1"),
}


@dataclass(frozen=True)
class Behaviour:
    """A term that describes what the library does not.

    Attributes
    ----------
    kind : str
        ``"series compliance"``, ``"parallel stiffness"``, ``"parallel damping"``, ``"clearance by pad"``,
        ``"pivot law of a pad"``.
    size : float
        Stiffness [N/m], damping [N s/m], change of a pad's clearance [m], share of its pivot's stiffness.
    unit : str
    direction_deg : float or None
        Of a term of one direction.
    spread : float
        Relative standard error of the size.
    words : str
    effect : str
        Name under which `predict --effects` reads it.
    parameters : dict of str to float
    """

    kind: str
    size: float
    unit: str
    direction_deg: float | None
    spread: float
    words: str
    effect: str
    parameters: dict[str, float]


def behaviours(problem: Problem, found: Search, beyond: bool = False) -> tuple[Behaviour, ...]:
    """Describe the generic terms of a search's model, and the pads that are further off than stated.

    Parameters
    ----------
    problem : Problem
    found : Search
    beyond : bool
        Whether what is left is more than noise and stated tolerances: only then a pad by itself tells something.
    """
    model = found.model
    out = []
    for candidate, amplitudes, at in zip(model.candidates, model.amplitudes, model.slices, strict=True):
        if candidate.name not in TERMS:
            continue
        values = candidate.values(amplitudes)
        matrix = np.array([[values["xx"], values["xy"]], [values.get("yx", values["xy"]), values["yy"]]])
        errors = model.errors[at]
        spread = float(np.max(errors) / max(np.max(np.abs(amplitudes)), 1e-300))
        out.append(_described(candidate.name, candidate.form, matrix, spread, values))
    return (*out, *(_pads(problem, found.effects) if beyond else ()))


def _pads(problem: Problem, fitted: Fit) -> list[Behaviour]:
    """Pads whose clearance or pivot is off by more than `STAND_IN` standard deviations of what is stated."""
    count = fitted.jacobian.shape[1]
    free = fitted.assessment.free[count:]
    variance = np.diag(fitted.assessment.covariance)[count:]
    out = []
    for one, m, v in zip(problem.nuisances, free, variance, strict=True):
        if one.name not in PADS or abs(m) < STAND_IN * math.sqrt(max(1.0 - v, 1e-12)):
            continue
        pad, change, spread = int(one.place.split()[-1]), float(m * one.sigma), float(math.sqrt(v) / abs(m))
        kind, effect, parameter, unit = PADS[one.name]
        if effect == "pad_offset":
            size, words = change, f"pad #{pad} stands {1e6 * change:+.1f} um from where the drawing has it"
        else:
            size = math.exp(change)
            words = f"the pivot of pad #{pad} has {100 * size:.0f} % of the stiffness that its law says"
        parameters = {"pad": float(pad), parameter: size}
        out.append(Behaviour(kind, size, unit, None, spread, words, effect, parameters))
    return out


def _described(name: str, form: str, matrix: FloatArray, spread: float, values: dict[str, float]) -> Behaviour:
    kind = name.replace("_", " ")
    unit = "N s/m" if name == "parallel_damping" else "N/m"
    direction: float | None = None
    if form == "cross-coupled":
        size, how = float(matrix[0, 1]), "cross-coupled"
    elif form == "isotropic":
        size, how = float(matrix[0, 0]), "equal in all directions"
    else:
        sizes, axes = np.linalg.eigh(0.5 * (matrix + matrix.T))
        first = int(np.argmax(np.abs(sizes)))
        size = float(sizes[first])
        angle = math.degrees(math.atan2(axes[1, first], axes[0, first]))
        direction = (angle + 90.0) % 180.0 - 90.0
        other = float(sizes[1 - first])
        how = f"in one direction, {direction:.0f} deg"
        if abs(other) > ONE_WAY * abs(size):
            how = f"unequal: {direction:.0f} deg and, {other / size:.2f} times as much, across"
    if name == "series_compliance":
        size = 1.0 / size if size else math.inf
    what = {"series_compliance": "a spring", "parallel_stiffness": "a stiffness", "parallel_damping": "a damping"}[name]
    where = "between bearing and probes" if name == "series_compliance" else "beside the bearing"
    words = f"{what} of {size:.3g} {unit} {how}, {where}"
    return Behaviour(kind, size, unit, direction, spread, words, name, values)

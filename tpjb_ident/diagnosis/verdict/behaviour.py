"""Behaviour: what lies beyond the library, in few numbers, and what of the library drifts.

A spring in series, a parallel stiffness or damping; a pad whose clearance or whose pivot is further off than stated; an
amplitude that is not the same at every load, speed and frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.diagnosis.search.assessment import Linear, assess
from tpjb_ident.diagnosis.search.effect_gain import STAND_IN
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.search import Search

#: A smaller principal value below this share of the larger one makes a term one of one direction.
_ONE_WAY = 0.2
#: What a pad by itself may be off by: kind, effect and parameter that say it, unit.
_PADS = {
    "clearance_scatter": ("clearance by pad", "pad_offset", "radial_offset", "m"),
    "pivot_stiffness_scatter": ("pivot law of a pad", "soft_pivot", "stiffness_factor", "1"),
}
#: What an amplitude could change over, with the number of levels it takes to tell.
OVER = (("static_load", "load", 3), ("shaft_speed", "speed", 2), ("excitation", "excitation", 4))
#: Rise of the log evidence from which a drift counts: odds of 150.
_NOTABLE = 5.0
#: Relative change over the range below which an amplitude is the same for all practical ends.
_SAME = 0.1


@dataclass(frozen=True)
class Behaviour:
    """A term that describes what the library does not."""

    kind: str
    size: float
    unit: str
    direction_deg: float | None
    spread: float
    words: str
    effect: str
    parameters: dict[str, float]


def behaviours(problem: Problem, result: Search, beyond: bool = False) -> tuple[Behaviour, ...]:
    """Describe the generic terms of a search's model, and the pads that are further off than stated."""
    model = result.model
    out = []
    for candidate, amplitudes, at in zip(model.candidates, model.amplitudes, model.slices, strict=True):
        if candidate.name not in TERMS:
            continue
        values = candidate.values(amplitudes)
        matrix = np.array([[values["xx"], values["xy"]], [values.get("yx", values["xy"]), values["yy"]]])
        errors = model.errors[at]
        spread = float(np.max(errors) / max(np.max(np.abs(amplitudes)), 1e-300))
        out.append(_described(candidate.name, candidate.form, matrix, spread, values))
    return (*out, *(_pads(problem, result.effects) if beyond else ()))


def _pads(problem: Problem, fitted: Fit) -> list[Behaviour]:
    """Pads whose clearance or pivot is off by more than `STAND_IN` standard deviations of what is stated."""
    count = fitted.jacobian.shape[1]
    free = fitted.assessment.free[count:]
    variance = np.diag(fitted.assessment.covariance)[count:]
    out = []
    for nuisance, m, v in zip(problem.nuisances, free, variance, strict=True):
        if nuisance.name not in _PADS or abs(m) < STAND_IN * math.sqrt(max(1.0 - v, 1e-12)):
            continue
        pad, change, spread = int(nuisance.place.split()[-1]), float(m * nuisance.sigma), float(math.sqrt(v) / abs(m))
        kind, effect, parameter, unit = _PADS[nuisance.name]
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
        second = float(sizes[1 - first])
        how = f"in one direction, {direction:.0f} deg"
        if abs(second) > _ONE_WAY * abs(size):
            how = f"unequal: {direction:.0f} deg and, {second / size:.2f} times as much, across"
    if name == "series_compliance":
        size = 1.0 / size if size else math.inf
    noun = {"series_compliance": "a spring", "parallel_stiffness": "a stiffness", "parallel_damping": "a damping"}[name]
    place = "between bearing and probes" if name == "series_compliance" else "beside the bearing"
    words = f"{noun} of {size:.3g} {unit} {how}, {place}"
    return Behaviour(kind, size, unit, direction, spread, words, name, values)


@dataclass(frozen=True)
class Drift:
    """How a parameter changes over the operating range."""

    effect: str
    parameter: str
    over: str
    start: float
    end: float
    words: str

    def to_dict(self) -> dict[str, object]:
        """Plain data, as in the contract."""
        return {"effect": self.effect, "parameter": self.parameter, "over": self.over, "from": self.start,
                "to": self.end, "words": self.words}  # fmt: skip


def drifts(problem: Problem, fitted: Fit) -> tuple[Drift, ...]:
    """Look for drifts of the first amplitude of every effect of a fit, the most telling per effect."""
    out = []
    for candidate, at in zip(fitted.candidates, fitted.slices, strict=True):
        if candidate.name in TERMS or candidate.basis:
            continue
        found = [_over(problem, fitted, candidate, at.start, row) for row in OVER]
        best = max((f for f in found if f is not None), key=lambda f: f[0], default=None)
        if best is not None and best[0] > _NOTABLE:
            out.append(best[1])
    return tuple(out)


def _over(problem, fitted: Fit, candidate, index: int, row) -> tuple[float, Drift] | None:  # type: ignore[no-untyped-def]
    name, coordinate, levels = row
    coordinates = np.array([abs(e.place(coordinate)) if e.family in {"h", "temperature"} else math.nan
                      for e in problem.observations.elements])  # fmt: skip
    finite_values = sorted(set(coordinates[np.isfinite(coordinates)]))
    if len(finite_values) < levels:
        return None
    middle = float(np.mean(finite_values))
    slope = np.nan_to_num(coordinates / middle - 1.0)
    linear = fitted.assessment.linear
    # per unit of relative growth; a prior of one: up to twice, down to nothing
    moved = float(
        np.concatenate(fitted.amplitudes)[index] - np.concatenate([c.origin for c in fitted.candidates])[index]
    )
    column = linear.columns[:, index] * slope * moved
    wider = Linear(linear.residual, np.column_stack([linear.columns, column]), np.append(linear.width, 1.0))
    assessment = assess(problem.basis, wider, fitted.assessment.scales)
    growth = float(assessment.free[-1])
    origin = float(candidate.origin[0])
    ends = [_value(candidate, origin, moved, growth, v / middle - 1.0) for v in (finite_values[0], finite_values[-1])]
    size = abs(ends[1] - ends[0]) / max(abs(ends[0]), abs(ends[1]), 1e-300)
    if size < _SAME:
        return None
    parameter = candidate.free[0]
    words = _words(ends, finite_values, name)
    return assessment.evidence - fitted.evidence, Drift(candidate.label, parameter.name, name, ends[0], ends[1], words)


def _value(candidate, origin: float, moved: float, growth: float, share: float) -> float:  # type: ignore[no-untyped-def]
    return float(candidate.free[0].from_linear(origin + moved * (1.0 + growth * share)))


def _words(ends: list[float], known: list[float], over: str) -> str:
    spoken = over.replace("_", " ")
    if min(ends) <= 0.0 < max(ends) or ends[0] == 0.0:
        return f"changes from {ends[0]:.3g} to {ends[1]:.3g} over the {spoken}"
    power = math.log(ends[1] / ends[0]) / math.log(known[-1] / known[0])
    if 0.8 < power < 1.2:
        return f"grows in proportion to the {spoken}"
    how = "grows" if abs(ends[1]) > abs(ends[0]) else "falls"
    return f"{how} over the {spoken}, about as its power {power:.1f}"

"""Remainder: which observable disagrees where, and whether that is more than noise and the stated tolerances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtr

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.diagnosis.observations.gap import residuals
from tpjb_ident.diagnosis.observations.observe import Observations
from tpjb_ident.diagnosis.search.assessment import assess
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.verdict.verdict import Disagreement

#: Share of its prior variance that the data take from something that may be off, before they say anything about it.
_TOLD = 0.05
#: Rows of the list of disagreements.
_MOST = 12


def localise(observations: Observations, prediction: FloatArray) -> tuple[Disagreement, ...]:
    """Split the squared gap by observable and region, largest share first; `prediction` (n,)."""
    z = residuals(observations, prediction)
    total = float(np.sum(z**2))
    rows: list[Disagreement] = []
    for name in dict.fromkeys(e.observable for e in observations.elements):
        mine = np.array([e.observable == name for e in observations.elements])
        for where, part in _regions(observations, mine):
            square = float(np.sum(z[part] ** 2))
            rows.append(Disagreement(name, where, math.sqrt(square / part.sum()), square / total if total else 0.0))
    rows.sort(key=lambda d: -d.share)
    return tuple(rows[:_MOST])


def _regions(observations: Observations, mine: BoolArray):  # type: ignore[no-untyped-def]
    """Halves of the range of the coordinate that varies most among the elements, or single pads."""
    elements = observations.elements
    for coordinate, unit, factor in (("pad", "", 1.0), ("load", "N", 1.0), ("direction", "deg", 180 / math.pi)):
        values = np.array([e.place(coordinate) for e in elements])
        levels = sorted(set(values[mine & np.isfinite(values)]))
        if len(levels) < 2:
            continue
        if coordinate == "pad":
            yield from ((f"pad {int(k)}", mine & (values == k)) for k in levels)
        else:
            half = len(levels) // 2
            for part in (levels[:half], levels[half:]):
                low, high = part[0] * factor, part[-1] * factor
                name = {"load": "static_load", "direction": "static_load_direction"}[coordinate]
                yield f"{name} {low:.0f}-{high:.0f} {unit}", mine & np.isin(values, part)
        return
    yield "everywhere", mine


@dataclass(frozen=True)
class Excess:
    """What a model leaves beyond its stated tolerances."""

    p: float
    where: str


def excess(problem: Problem, fitted: Fit) -> Excess:
    """Test every observable, every fold, and everything that may be off, against noise and stated tolerances.

    A posterior mean m of something with prior variance 1 and posterior variance v scatters with 1 - v.
    """
    # every kind of observable as wrong as stated, nothing beyond, no more scatter than stated
    tolerances = problem.basis.stated
    assessment = assess(problem.basis, fitted.assessment.linear, tolerances, fixed=True)
    total = problem.basis.covariance(tolerances) + fitted.assessment.linear.spread
    residual = assessment.linear.residual
    rows = _groups(problem)
    tests = []
    for name, at in rows:
        square = residual[at] @ np.linalg.solve(total[np.ix_(at, at)], residual[at])
        tests.append((float(chdtrc(len(at), square)), name))
    first = len(fitted.errors)
    remaining = 1.0 - np.diag(assessment.covariance)[first:]
    for nuisance, m, spread in zip(problem.nuisances, assessment.free[first:], remaining, strict=True):
        if spread > _TOLD:
            tests.append((2.0 * float(ndtr(-abs(m) / np.sqrt(spread))), f"{nuisance.name} {nuisance.place}".strip()))
    p, where = min(tests)
    return Excess(min(1.0, p * len(tests)), where)


def _groups(problem: Problem) -> list[tuple[str, IntArray]]:
    elements = problem.observations.elements
    names = np.array([e.observable for e in elements])
    pads = np.array([e.place("pad") for e in elements])
    out = []
    for name in dict.fromkeys(names):
        selected = names == name
        numbers = sorted(set(pads[selected & np.isfinite(pads)]))
        out += [(f"{name} of pad {k:.0f}", np.flatnonzero(selected & (pads == k))) for k in numbers]
        if not numbers:
            out.append((str(name), np.flatnonzero(selected)))
    return out + [(f.name, f.members) for f in problem.folds] + [("everything", np.arange(len(elements)))]

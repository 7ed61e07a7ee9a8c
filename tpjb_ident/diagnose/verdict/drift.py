"""Drift: is a fitted amplitude the same at every load, speed and frequency, or does it grow, and how."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tpjb_ident.diagnose.forward.candidates import TERMS
from tpjb_ident.diagnose.search.assessment import Linear, assess
from tpjb_ident.diagnose.search.fit import Fit
from tpjb_ident.diagnose.search.problem import Problem

#: What an amplitude could change over, with the number of levels it takes to tell.
OVER = (("static_load", "load", 3), ("shaft_speed", "speed", 2), ("excitation", "excitation", 4))
#: Rise of the log evidence from which a drift counts: odds of 150.
NOTABLE = 5.0
#: Relative change over the range below which an amplitude is the same for all practical ends.
SAME = 0.1


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
    """Look for drifts of the first amplitude of every effect of a fit, the most telling per effect.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
    """
    out = []
    for candidate, at in zip(fitted.candidates, fitted.slices, strict=True):
        if candidate.name in TERMS or candidate.basis:
            continue
        found = [_over(problem, fitted, candidate, at.start, row) for row in OVER]
        best = max((f for f in found if f is not None), key=lambda f: f[0], default=None)
        if best is not None and best[0] > NOTABLE:
            out.append(best[1])
    return tuple(out)


def _over(problem, fitted: Fit, candidate, index: int, row) -> tuple[float, Drift] | None:  # type: ignore[no-untyped-def]
    name, coordinate, levels = row
    where = np.array([e.place(coordinate) if e.family in {"h", "temperature"} else math.nan
                      for e in problem.observations.elements])  # fmt: skip
    known = sorted(set(where[np.isfinite(where)]))
    if len(known) < levels:
        return None
    middle = float(np.mean(known))
    slope = np.nan_to_num(where / middle - 1.0)
    linear = fitted.assessment.linear
    # per unit of relative growth; a prior of one: up to twice, down to nothing
    moved = float(
        np.concatenate(fitted.amplitudes)[index] - np.concatenate([c.origin for c in fitted.candidates])[index]
    )
    column = linear.columns[:, index] * slope * moved
    wider = Linear(linear.residual, np.column_stack([linear.columns, column]), np.append(linear.width, 1.0))
    found = assess(problem.basis, wider, fitted.assessment.scales)
    growth = float(found.free[-1])
    origin = float(candidate.origin[0])
    ends = [_value(candidate, origin, moved, growth, v / middle - 1.0) for v in (known[0], known[-1])]
    size = abs(ends[1] - ends[0]) / max(abs(ends[0]), abs(ends[1]), 1e-300)
    if size < SAME:
        return None
    parameter = candidate.free[0]
    words = _words(ends, known, name)
    return found.evidence - fitted.evidence, Drift(candidate.label, parameter.name, name, ends[0], ends[1], words)


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

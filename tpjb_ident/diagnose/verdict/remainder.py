"""Remainder: is what a model leaves more than noise and the stated tolerances, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtr

from tpjb_ident.arrays import FloatArray, IntArray
from tpjb_ident.diagnose.search.assessment import assess
from tpjb_ident.diagnose.search.fit import Fit
from tpjb_ident.diagnose.search.problem import Problem

#: Share of its prior variance that the data take from something that may be off, before they say anything about it.
TOLD = 0.05


@dataclass(frozen=True)
class Excess:
    """What a model leaves beyond its stated tolerances.

    Attributes
    ----------
    p : float
        Of the most telling group of elements, all groups considered.
    where : str
        That group, in words.
    """

    p: float
    where: str


def excess(problem: Problem, fitted: Fit) -> Excess:
    """Test every observable, every fold, and everything that may be off, against noise and stated tolerances.

    A posterior mean m of something with prior variance 1 and posterior variance v scatters with 1 - v.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
    """
    # every kind of observable as wrong as stated, nothing beyond, no more scatter than stated
    stated = problem.basis.stated
    told = assess(problem.basis, fitted.assessment.linear, stated, fixed=True)
    total = problem.basis.covariance(stated) + fitted.assessment.linear.spread
    residual = told.linear.residual
    rows = _groups(problem)
    tests = [(float(chdtrc(len(at), _square(total, residual, at))), name) for name, at in rows]
    first = len(fitted.errors)
    left = 1.0 - np.diag(told.covariance)[first:]
    for one, m, spread in zip(problem.nuisances, told.free[first:], left, strict=True):
        if spread > TOLD:
            tests.append((2.0 * float(ndtr(-abs(m) / np.sqrt(spread))), f"{one.name} {one.place}".strip()))
    p, where = min(tests)
    return Excess(min(1.0, p * len(tests)), where)


def _square(total: FloatArray, residual: FloatArray, at: IntArray) -> float:
    return float(residual[at] @ np.linalg.solve(total[np.ix_(at, at)], residual[at]))


def _groups(problem: Problem) -> list[tuple[str, IntArray]]:
    elements = problem.observations.elements
    names = np.array([e.observable for e in elements])
    pads = np.array([e.place("pad") for e in elements])
    out = []
    for name in dict.fromkeys(names):
        mine = names == name
        numbers = sorted(set(pads[mine & np.isfinite(pads)]))
        out += [(f"{name} of pad {k:.0f}", np.flatnonzero(mine & (pads == k))) for k in numbers]
        if not numbers:
            out.append((str(name), np.flatnonzero(mine)))
    return out + [(f.name, f.members) for f in problem.folds] + [("everything", np.arange(len(elements)))]

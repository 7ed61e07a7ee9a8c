"""Remainder: is what a model leaves more than noise and the stated tolerances, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray, IntArray
from tpjb_ident.diagnose.search.assessment import assess
from tpjb_ident.diagnose.search.fit import Fit
from tpjb_ident.diagnose.search.problem import Problem


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
    """Test every observable, and every fold, against noise, stated tolerances and all that is free.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
    """
    from scipy.stats import chi2

    # every kind of observable as wrong as stated, nothing beyond, no more scatter than stated
    stated = problem.basis.stated
    told = assess(problem.basis, fitted.assessment.linear, stated, fixed=True)
    total = problem.basis.covariance(stated) + fitted.assessment.linear.spread
    residual = told.linear.residual
    rows = _groups(problem)
    values = [float(chi2.sf(_square(total, residual, at), len(at))) for _, at in rows]
    least = int(np.argmin(values))
    return Excess(min(1.0, values[least] * len(values)), rows[least][0])


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

"""Examine: does a fitted model describe the campaign, on the points it was fitted to and on those held out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.search.directions import Direction
from tpjb_ident.diagnose.search.fit import Fit, Misfit
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.structure import Structure, patterns, residual_structure

#: Limits of the variance scale that a residual may choose: calibration errors never shrink, scatter may be larger
#: than stated.
SCALE = (1.0, 4.0)


@dataclass(frozen=True)
class Examination:
    """What a model leaves.

    Attributes
    ----------
    structure : Structure
        Of the training residual.
    held_p : float
        Of the misfit of held-out points, given the training points.
    """

    structure: Structure = field(repr=False)
    held_p: float

    @property
    def scale(self) -> float:
        """Variance of the rough part of the residual over what was stated."""
        return self.structure.scale


def examine(problem: Problem, fitted: Fit, columns: Mapping[Candidate, FloatArray]) -> Examination:
    """Test what a fit leaves.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
    columns : mapping of Candidate to (n,) ndarray
        Change of the prediction per unit of every candidate.
    """
    covariance = problem.tolerant(fitted)
    misfit = Misfit(problem.observations.value, covariance, problem.misfit.train)
    singles = [Direction(c.label, v[:, None]) for c, v in columns.items() if c not in fitted.candidates]
    spans = patterns(misfit.factor, misfit.train, problem.groups, singles, fitted.jacobian)
    residual = misfit.whiten(problem.observations.value - fitted.prediction)
    absorbed, _ = np.linalg.qr(misfit.whiten(fitted.jacobian))
    structure = residual_structure(spans, residual - absorbed @ (absorbed.T @ residual), SCALE)
    return Examination(structure, _held_out(problem, fitted, covariance, structure.scale))


def _held_out(problem: Problem, fitted: Fit, covariance: FloatArray, scale: float) -> float:
    """p-value of the held-out points, nuisances and amplitudes learnt from the training points."""
    from scipy.stats import chi2

    held = problem.held
    if not held.any():
        return 1.0
    total = covariance + fitted.jacobian @ fitted.covariance @ fitted.jacobian.T
    train = ~held
    cross = np.linalg.solve(total[np.ix_(train, train)], total[np.ix_(train, held)])
    residual = problem.observations.value - fitted.prediction
    left = residual[held] - cross.T @ residual[train]
    spread = total[np.ix_(held, held)] - cross.T @ total[np.ix_(train, held)]
    return float(chi2.sf(left @ np.linalg.solve(spread, left) / scale, held.sum()))

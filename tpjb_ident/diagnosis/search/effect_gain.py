"""Worth: what an effect is to unseen points, and beside everything that may be off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.search.assessment import assess
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.screen import without

#: Standard deviations from which something that is off is more than its tolerance: a chance of 1 in 370 each.
STAND_IN = 3.0


@dataclass(frozen=True)
class EffectGain:
    """What an effect is worth in a model."""

    unseen: float
    beside: float


def effect_gain(problem: Problem, model: Fit, less: Fit, candidate: Candidate) -> EffectGain:
    """What a candidate is worth in a model, beside the same model without it.

    Where the model without it needs something to be off by more than is stated, that stands in for the candidate, and
    predicts unseen points just as well: it is set aside, as are nuisances that are the candidate under another name.
    """
    at = [f.assessment.free[f.jacobian.shape[1] :] for f in (model, less)]
    stand_in = np.flatnonzero((np.abs(at[1]) > STAND_IN) & (np.abs(at[1]) > np.abs(at[0]) + 1.0))
    gone = sorted({*problem.aliases(candidate), *(int(i) for i in stand_in)})
    unseen = []
    for fit in (model, less):
        told = assess(problem.basis, without(fit, gone), fit.assessment.scales) if gone else fit.assessment
        unseen.append(float(np.sum(told.scores())))
    return EffectGain(unseen[0] - unseen[1], model.evidence - less.evidence)

"""Naive rules that a diagnosis must beat: largest score, training chi-square, BIC, a random name."""

from __future__ import annotations

import math

import numpy as np

from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search


def naive_names(problem: Problem, found: Search, rng: np.random.Generator) -> dict[str, str]:
    """What simple rules would have named on the same campaign; an empty name where a rule names nothing.

    Parameters
    ----------
    problem : Problem
    found : Search
        Screening and fits are shared with the real search.
    rng : Generator
        For the random name.
    """
    best = found.first_scores[0]
    count = int(problem.misfit.train.sum())
    fitted = min((f for f in found.singles if len(f.candidates) == 1), key=lambda f: f.chi_square, default=None)
    chi = fitted.candidates[0].name if fitted is not None else best.candidate.name
    drop = found.baseline.chi_square - fitted.chi_square if fitted is not None else best.gain
    return {
        "largest score": best.candidate.name,
        "training chi-square": chi,
        "BIC": chi if drop > math.log(count) else "",
        "random": problem.pool[int(rng.integers(len(problem.pool)))].name,
    }

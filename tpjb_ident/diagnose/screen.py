"""Screen: the score test of every candidate at the present model: one model run each, no fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.diagnose.candidates import Candidate
from tpjb_ident.diagnose.fit import Fit, Misfit, slope
from tpjb_ident.diagnose.forward import Forward
from tpjb_ident.diagnose.workers import Map

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """What one candidate could do to the residual, to first order.

    Attributes
    ----------
    candidate : Candidate
    gain : float
        Drop of chi-square it promises, other fitted amplitudes free to follow, inside its bounds.
    amplitude : float
        At which it promises that (nearly linear form).
    column : (n,) ndarray
        Change of the prediction per unit of amplitude.
    detectable : float
        Whitened size of its typical step: what this campaign sees of it.
    """

    candidate: Candidate
    gain: float
    amplitude: float
    column: FloatArray = field(repr=False)
    detectable: float


def screen(run: Map, misfit: Misfit, model: Fit, pool: Sequence[Candidate]) -> list[Score]:
    """Score every candidate of a pool against a fitted model, best first.

    Parameters
    ----------
    run : Map
        See `workers`.
    misfit : Misfit
    model : Fit
    pool : sequence of Candidate
    """
    residual = misfit.whiten(misfit.value - model.prediction)
    project = _projector(misfit.whiten(model.jacobian))
    scores = []
    columns = run(_column, [(model, candidate) for candidate in pool])
    for candidate, column in zip(pool, columns, strict=True):
        seen = project(misfit.whiten(column))
        scores.append(_score(candidate, column, seen, float(seen @ seen), residual))
    return sorted(scores, key=lambda s: -s.gain)


def _column(forward: Forward, model: Fit, candidate: Candidate) -> FloatArray:
    chosen = (*model.candidates, candidate)
    now = np.append(model.amplitudes, candidate.neutral)
    # a step of the size one would expect: some effects act late, or by their square
    return slope(forward, chosen, now, model.prediction, len(chosen) - 1, 0.5 * candidate.step)


def _score(candidate: Candidate, column: FloatArray, seen: FloatArray, power: float, residual: FloatArray) -> Score:
    if power <= 1e-12:
        return Score(candidate, 0.0, candidate.neutral, column, 0.0)
    low, high = candidate.bounds
    amplitude = float(seen @ residual) / power
    moved = min(max(candidate.neutral + amplitude, low), high) - candidate.neutral
    gain = float(2 * moved * (seen @ residual) - moved**2 * power)
    return Score(candidate, gain, candidate.neutral + moved, column, float(np.sqrt(power)) * candidate.step)


def _projector(basis: FloatArray):  # type: ignore[no-untyped-def]
    if basis.shape[1] == 0:
        return lambda v: v
    q, _ = np.linalg.qr(basis)
    return lambda v: v - q @ (q.T @ v)

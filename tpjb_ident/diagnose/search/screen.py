"""Screen: the score test of every candidate at the present model: one model run each, no fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import ForwardModel
from tpjb_ident.diagnose.forward.workers import Map
from tpjb_ident.diagnose.search.fit import Fit, Misfit, slope


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


def screen(
    run: Map, misfit: Misfit, model: Fit, pool: Sequence[Candidate],
    known: Mapping[Candidate, FloatArray] | None = None, renewed: int = 0,
) -> list[Score]:  # fmt: skip
    """Score every candidate of a pool against a fitted model, best first.

    Parameters
    ----------
    run : Map
        See `workers`.
    misfit : Misfit
    model : Fit
    pool : sequence of Candidate
    known : mapping of Candidate to (n,) ndarray, optional
        Columns found at another model; they serve for a first ranking here.
    renewed : int
        Of the candidates that rank best by known columns so many get new ones.
    """
    if known is None:
        columns = run(_column, [(model, candidate) for candidate in pool])
        return _ranked(misfit, model, dict(zip(pool, columns, strict=True)))
    table = {c: known[c] for c in pool}
    first = [s.candidate for s in _ranked(misfit, model, table)[:renewed]]
    table |= dict(zip(first, run(_column, [(model, c) for c in first]), strict=True))
    return _ranked(misfit, model, table)


def _ranked(misfit: Misfit, model: Fit, columns: Mapping[Candidate, FloatArray]) -> list[Score]:
    residual = misfit.whiten(misfit.value - model.prediction)
    project = _projector(misfit.whiten(model.jacobian))
    scores = []
    for candidate, column in columns.items():
        seen = project(misfit.whiten(column))
        scores.append(_score(candidate, column, seen, float(seen @ seen), residual))
    return sorted(scores, key=lambda s: -s.gain)


def _column(forward: ForwardModel, model: Fit, candidate: Candidate) -> FloatArray:
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


def _projector(basis: FloatArray) -> Callable[[FloatArray], FloatArray]:
    if basis.shape[1] == 0:
        return lambda v: v
    q, _ = np.linalg.qr(basis)
    return lambda v: v - q @ (q.T @ v)

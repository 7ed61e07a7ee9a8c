"""Screen: what every candidate could do to the residual, to first order; the best are worth a fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.forward.forward import ForwardModel
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.search.amplitude_path import NODES, AmplitudePath, path_through
from tpjb_ident.diagnosis.search.assessment import Linear, assess
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit
from tpjb_ident.diagnosis.search.minimise import attempt, slope
from tpjb_ident.diagnosis.search.problem import Problem

#: Shares of a model's own error scales at which candidates are scored: with the right effect added they fall.
_SHARES = (1.0, 0.1, 0.01, 0.001)
#: Effects that solve the pads' own heat or bending: seconds a run, and nearly linear at any size that a rig has.
_SLOW = frozenset({"pad_bending", "pad_conduction"})


@dataclass(frozen=True)
class Score:
    """What some candidates could do to a model's residual."""

    candidates: tuple[Candidate, ...]
    gain: float
    amplitudes: tuple[FloatArray, ...]  #: (k,): at which they promise it


Columns = Mapping[Candidate, FloatArray]
AmplitudePaths = Mapping[Candidate, AmplitudePath]


@dataclass(frozen=True)
class Survey:
    """What every candidate does beside a model, for itself."""

    secants: Columns  #: (n, k)
    slopes: Columns  #: (n, k): the same at the model itself where the curvature is known
    paths: AmplitudePaths


def survey(run: Map, model: Fit, pool: Sequence[Candidate]) -> Survey:
    """Ask what every candidate does: its course over its amplitude where it has one.

    A clearance that grows by a third of itself does not do three times what a ninth does: to first order a large
    effect explains little, and others would be fitted in its place.
    """
    # the longest ones begin: nobody waits for them at the end
    order = sorted(pool, key=lambda c: c.name not in _SLOW)
    surveyed = dict(zip(order, run(_surveyed, [(model.start, model.prediction, c) for c in order]), strict=True))
    secants, slopes = ({c: surveyed[c][i] for c in pool} for i in range(2))
    return Survey(secants, slopes, {c: path for c in pool if (path := surveyed[c][2]) is not None})


def _surveyed(
    forward: ForwardModel, problem: Problem, model: InitialFit, y: FloatArray, candidate: Candidate
) -> tuple[FloatArray, FloatArray, AmplitudePath | None]:
    """Secants, slopes, and the course where it can be told."""
    if len(candidate.steps) == 1 and candidate.name not in _SLOW:
        path = _path(forward, problem, model, y, candidate)
        if path is not None:
            nearest = int(np.argmin(np.where(path.at == 0.0, np.inf, np.abs(path.at - NODES[0] * candidate.step))))
            secant = path.columns[:, nearest] / path.at[nearest]
            return secant[:, None], path.neutral_slope[:, None], path
    parts = [_column(forward, problem, model, y, candidate, i) for i in range(len(candidate.steps))]
    derivatives = np.column_stack(parts)
    return derivatives, derivatives, None


def _path(
    forward: ForwardModel, problem: Problem, model: InitialFit, y: FloatArray, candidate: Candidate
) -> AmplitudePath | None:  # fmt: skip
    """What the model says beside the neutral amplitude; None where it has no equilibrium near it."""
    low, high = (float(v[0]) for v in candidate.limits)
    around, step = candidate.neutral, candidate.step
    asked: list[float] = []
    changes: list[FloatArray] = []
    for share in (s for s in NODES if low <= around + s * step <= high):
        start = replace(model, candidates=(*model.candidates, candidate),
                        amplitudes=(*model.amplitudes, np.array([around + share * step])))  # fmt: skip
        prediction = attempt(forward, problem, start)
        if prediction is None and len(changes) < 2:
            return None
        if prediction is not None:
            asked.append(share * step)
            changes.append(prediction - y)
    return path_through(asked, changes) if len(changes) > 1 else None


def columns(run: Map, model: Fit, pool: Sequence[Candidate]) -> dict[Candidate, FloatArray]:
    """Change of the prediction per unit of every amplitude of every candidate, at a model; (n, k) each."""
    jobs = [(model.start, model.prediction, c, i) for c in pool for i in range(len(c.steps))]
    found = iter(run(_column, jobs))
    return {c: np.column_stack([next(found) for _ in c.steps]) for c in pool}


def _column(
    forward: ForwardModel, problem: Problem, model: InitialFit, y: FloatArray, candidate: Candidate, index: int
) -> FloatArray:
    start = replace(model, candidates=(*model.candidates, candidate), amplitudes=(*model.amplitudes, candidate.origin))
    at = sum(len(a) for a in model.amplitudes) + index
    # a step of the size one would expect: some effects act late, or by their square
    return slope(forward, problem, start, y, at, 0.5)


def scores(
    problem: Problem, model: Fit, table: Columns, pairs: bool = False, paths: AmplitudePaths | None = None
) -> list[Score]:  # fmt: skip
    """Score candidates, or all pairs of them, beside a model; best first; `table` (n, k) each."""
    levels = [_Level(problem, model, table, share, paths or {}) for share in _SHARES]
    pool = list(table)
    chosen: list[tuple[Candidate, ...]] = [(c,) for c in pool]
    if pairs:
        chosen = [(a, b) for i, a in enumerate(pool) for b in pool[i + 1 :]]
    found = [max((level.score(candidates) for level in levels), key=lambda s: s.gain) for candidates in chosen]
    return sorted(found, key=lambda s: -s.gain)


def alone(problem: Problem, model: Fit, table: Columns, paths: AmplitudePaths) -> list[Score]:
    """Score candidates by how much of the squared gap they close with nothing else moved, best first.

    In units of noise and stated tolerance, element by element. What a large effect does is known between the sizes that
    were asked for to some per cent only, and where a pad comes out of contact to less: correlated errors far below that
    would hold it against the effect, and nuisances, linear as they are, would take up what it does.

    `table` (n, k) each.
    """
    gap = problem.scaled(problem.observations.value - model.prediction)
    return sorted((_closing(problem, gap, c, table[c], paths.get(c)) for c in table), key=lambda s: -s.gain)


def _closing(problem: Problem, gap: FloatArray, c: Candidate, column: FloatArray, path: AmplitudePath | None) -> Score:
    low, high = ((v - c.origin) / c.width for v in c.limits)
    if path is None:
        unit = problem.scaled(column) * c.width
        moved = np.linalg.solve(unit.T @ unit + np.eye(unit.shape[1]), unit.T @ gap)
        tried = np.clip(moved, np.maximum(low, -1.0), np.minimum(high, 1.0))[None, :]
        change = tried @ unit.T
    else:
        tried = _grid(low[0], high[0])[:, None]
        change = path.weights(tried[:, 0] * c.width[0]) @ problem.scaled(path.columns).T
    remaining = np.sum((gap - change) ** 2, axis=1) + np.sum(tried**2, axis=1)
    best = int(np.argmin(remaining))
    return Score((c,), 0.5 * float(gap @ gap - remaining[best]), (c.origin + tried[best] * c.width,))


def _grid(low: float, high: float) -> FloatArray:
    """Amplitudes at which a course is looked at, in units of the prior's width, between bounds in the same."""
    return np.linspace(max(low, -1.0), min(high, 1.0), 81)


class _Level:
    """Scores at one level of the error scales."""

    def __init__(self, problem: Problem, model: Fit, table: Columns, share: float, paths: AmplitudePaths) -> None:
        linear = model.assessment.linear
        assessment = assess(problem.basis, linear, np.maximum(model.assessment.scales * share, 1e-5), fixed=True)
        self.offset = assessment.evidence - model.evidence
        residual = model.assessment.linear.residual
        self.at: dict[Candidate, slice] = {}
        parts, width, count = [], [], 0
        for c, column in table.items():
            parts.append(problem.scaled(column) * c.width)
            width.append(c.width)
            self.at[c] = slice(count, count + column.shape[1])
            count += column.shape[1]
        unit = np.column_stack(parts)
        weighted = assessment.inverse @ unit
        self.gram, self.toward = unit.T @ weighted, weighted.T @ residual
        self.width = np.concatenate(width)
        self.paths: dict[Candidate, tuple[AmplitudePath, FloatArray, FloatArray]] = {}
        for c in table.keys() & paths.keys():
            whole = problem.scaled(paths[c].columns)
            weighed = assessment.inverse @ whole
            self.paths[c] = paths[c], weighed.T @ residual, whole.T @ weighed

    def _along(self, c: Candidate) -> Score:
        """Score of one amplitude along its course: the best of a grid, and the Gaussian there."""
        width = self.width[self.at[c].start]
        projection, toward, gram = self.paths[c]
        t = _grid(*((float(v[0]) - c.neutral) / width for v in c.limits))
        path, slopes = projection.weights(t * width), projection.slope_weights(t * width) * width
        gain = path @ toward - 0.5 * (t**2 + np.einsum("ti,ij,tj->t", path, gram, path))
        gain -= 0.5 * np.log1p(np.einsum("ti,ij,tj->t", slopes, gram, slopes))
        best = int(np.argmax(gain))
        return Score((c,), float(gain[best]) + self.offset, (np.array([c.neutral + t[best] * width]),))

    def score(self, chosen: tuple[Candidate, ...]) -> Score:
        if len(chosen) == 1 and chosen[0] in self.paths:
            return self._along(chosen[0])
        rows = np.concatenate([np.arange(self.at[c].start, self.at[c].stop) for c in chosen])
        inner = self.gram[np.ix_(rows, rows)] + np.eye(len(rows))
        moved = np.linalg.solve(inner, self.toward[rows])
        origin = np.concatenate([c.origin for c in chosen])
        low, high = (np.concatenate(v) for v in zip(*(c.limits for c in chosen), strict=True))
        inside = np.clip(origin + moved * self.width[rows], low, high)
        shift = (inside - origin) / self.width[rows]
        # careful: no further out than the prior's width, beyond which the first-order step means little
        shift = np.clip(shift, -1.0, 1.0)
        gain = float(shift @ self.toward[rows] - 0.5 * shift @ inner @ shift)
        gain -= 0.5 * float(np.linalg.slogdet(inner)[1])
        flat, amplitudes, at = origin + shift * self.width[rows], [], 0
        for c in chosen:
            amplitudes.append(flat[at : at + len(c.steps)])
            at += len(c.steps)
        return Score(chosen, gain + self.offset, tuple(amplitudes))


def with_model(model: Fit, score: Score, table: Columns, paths: AmplitudePaths | None = None) -> InitialFit:
    """Start of a fit of a model with what was scored."""
    parts = []
    for c, amplitudes in zip(score.candidates, score.amplitudes, strict=True):
        path = (paths or {}).get(c)
        parts.append(table[c] if path is None else path.slope(amplitudes[0] - c.neutral)[:, None])
    jacobian = np.column_stack([model.jacobian, *parts])
    return InitialFit((*model.candidates, *score.candidates), (*model.amplitudes, *score.amplitudes), jacobian,
                 model.nuisance, model.columns)  # fmt: skip


def instead(problem: Problem, model: Fit, table: Columns, beyond: float) -> list[InitialFit]:
    """Starts in which an effect takes over from what is off further than its tolerance allows and does the same.

    Oil that is three tolerances too thin has the evidence of an effect, and no residual that would ask for it.

    `table` (n, k) each.
    """
    size = model.assessment.free[model.jacobian.shape[1] :]
    out = []
    for c, column in table.items():
        for i in problem.aliases(c):
            if abs(size[i]) <= beyond or column.shape[1] != 1:
                continue
            new, old = problem.scaled(column)[:, 0], problem.scaled(model.columns)[:, i] * size[i]
            low, high = c.limits
            amplitude = np.clip(c.origin + (new @ old) / max(float(new @ new), 1e-300), low, high)
            nuisance = model.nuisance.copy()
            nuisance[i] = 0.0
            jacobian = np.column_stack([model.jacobian, column])
            out.append(
                InitialFit((*model.candidates, c), (*model.amplitudes, amplitude), jacobian, nuisance, model.columns)
            )
    return out


def visible(problem: Problem, model: Fit, candidate: Candidate, column: FloatArray) -> float:
    """Size of a typical step of a candidate beside a model, in standard deviations of everything else.

    `column` (n, k).
    """
    shift = problem.scaled(column) @ candidate.steps
    return math.sqrt(max(float(shift @ model.assessment.inverse @ shift), 0.0))


def without(model: Fit, gone: Sequence[int]) -> Linear:
    """A model's linear form without some nuisances, by their numbers."""
    count = model.jacobian.shape[1]
    return model.assessment.linear.without([count + i for i in gone])

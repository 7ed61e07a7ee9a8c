"""Screen: what every candidate could do to the residual, to first order; the best are worth a fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import ForwardModel
from tpjb_ident.diagnose.forward.workers import Map
from tpjb_ident.diagnose.search.assessment import Linear, assess
from tpjb_ident.diagnose.search.descend import TIGHT, attempt, slope
from tpjb_ident.diagnose.search.fit import Fit, Start
from tpjb_ident.diagnose.search.problem import Problem

#: Shares of a model's own error scales at which candidates are scored: with the right effect added they fall.
SHARES = (1.0, 0.1, 0.01, 0.001)
#: Effects that solve the pads' own heat or bending: seconds a run, and nearly linear at any size that a rig has.
SLOW = frozenset({"pad_bending", "pad_conduction"})
#: Amplitudes at which a candidate's course is told, in typical sizes: the nearest where a rig is expected, the others
#: where a large effect lies.
ALONG = (0.8, -0.8, 2.4, -2.4)


@dataclass(frozen=True)
class Score:
    """What some candidates could do to a model's residual.

    Attributes
    ----------
    candidates : tuple of Candidate
        One, or two at once.
    gain : float
        Rise of the log evidence that they promise.
    amplitudes : tuple of (k,) ndarray
        At which they promise it.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    amplitudes: tuple[FloatArray, ...]


Columns = Mapping[Candidate, FloatArray]


@dataclass(frozen=True)
class Survey:
    """What every candidate does beside a model, for itself.

    Attributes
    ----------
    secants : mapping of Candidate to (n, k) ndarray
        Change of the prediction per unit of every amplitude, over a step of a size that one would expect.
    slopes : mapping of Candidate to (n, k) ndarray
        The same at the model itself where the curvature is known.
    curved : mapping of Candidate to (n, m) ndarray
        Coefficients of the second and higher powers of the amplitude, of candidates of one amplitude.
    """

    secants: Columns
    slopes: Columns
    curved: Columns


def survey(run: Map, model: Fit, pool: Sequence[Candidate]) -> Survey:
    """Ask what every candidate does: its course over its amplitude where it has one.

    A clearance that grows by a third of itself does not do three times what a ninth does: to first order a large
    effect explains little, and others would be fitted in its place.

    Parameters
    ----------
    run : Map
        See `workers`.
    model : Fit
    pool : sequence of Candidate
    """
    slim = Start(model.candidates, model.amplitudes, model.jacobian, model.nuisance, model.columns)
    # the longest ones begin: nobody waits for them at the end
    order = sorted(pool, key=lambda c: c.name not in SLOW)
    found = dict(zip(order, run(_surveyed, [(slim, model.prediction, c) for c in order]), strict=True))
    secants, slopes = ({c: found[c][i] for c in pool} for i in range(2))
    return Survey(secants, slopes, {c: found[c][2] for c in pool if found[c][2] is not None})


def _surveyed(
    forward: ForwardModel, problem: Problem, model: Start, y: FloatArray, candidate: Candidate
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Secants, slopes, and what goes with higher powers where it can be told."""
    if len(candidate.steps) == 1 and candidate.name not in SLOW:
        course = _course(forward, problem, model, y, candidate)
        if course is not None:
            return course
    parts = [_column(forward, problem, model, y, candidate, i) for i in range(len(candidate.steps))]
    found = np.column_stack(parts)
    return found, found, None


def _course(
    forward: ForwardModel, problem: Problem, model: Start, y: FloatArray, candidate: Candidate
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """A polynomial through amplitudes beside the neutral one; None where the model has no equilibrium near it."""
    low, high = (float(v[0]) for v in candidate.limits)
    around, step = candidate.neutral, candidate.step
    shares: list[float] = []
    rows: list[FloatArray] = []
    for share in (s for s in ALONG if low <= around + s * step <= high):
        start = replace(model, candidates=(*model.candidates, candidate),
                        amplitudes=(*model.amplitudes, np.array([around + share * step])))  # fmt: skip
        other = attempt(forward, problem, start)
        if other is None and len(rows) < 2:
            return None
        if other is not None:
            shares.append(share * step)
            rows.append((other - y) / (share * step))
    if len(rows) < 2:
        return None
    powers = np.vander(shares, increasing=True)
    course = np.linalg.solve(powers / np.abs(powers).max(axis=0), np.array(rows)).T / np.abs(powers).max(axis=0)
    return rows[0][:, None], course[:, :1], course[:, 1:]


def columns(run: Map, model: Fit, pool: Sequence[Candidate]) -> dict[Candidate, FloatArray]:
    """Change of the prediction per unit of every amplitude of every candidate, at a model; (n, k) each.

    Parameters
    ----------
    run : callable
        Maps a task over jobs, in this process or in workers.
    model : Fit
        A fitted model.
    pool : sequence of Candidate
        Candidates that are asked about.
    """
    slim = Start(model.candidates, model.amplitudes, model.jacobian, model.nuisance, model.columns)
    jobs = [(slim, model.prediction, c, i) for c in pool for i in range(len(c.steps))]
    found = iter(run(_column, jobs))
    return {c: np.column_stack([next(found) for _ in c.steps]) for c in pool}


def _column(
    forward: ForwardModel, problem: Problem, model: Start, y: FloatArray, candidate: Candidate, index: int
) -> FloatArray:
    start = replace(model, candidates=(*model.candidates, candidate), amplitudes=(*model.amplitudes, candidate.origin))
    at = sum(len(a) for a in model.amplitudes) + index
    # a step of the size one would expect: some effects act late, or by their square
    return slope(forward, problem, start, y, at, 0.5)


def scores(
    problem: Problem, model: Fit, table: Columns, pairs: bool = False, curved: Columns | None = None
) -> list[Score]:  # fmt: skip
    """Score candidates, or all pairs of them, beside a model; best first.

    Parameters
    ----------
    problem : Problem
    model : Fit
    table : mapping of Candidate to (n, k) ndarray
    pairs : bool
    curved : mapping of Candidate to (n, m) ndarray, optional
        See `Survey`.
    """
    levels = [_Level(problem, model, table, share, curved or {}) for share in SHARES]
    pool = list(table)
    chosen: list[tuple[Candidate, ...]] = [(c,) for c in pool]
    if pairs:
        chosen = [(a, b) for i, a in enumerate(pool) for b in pool[i + 1 :]]
    found = [max((level.score(one) for level in levels), key=lambda s: s.gain) for one in chosen]
    return sorted(found, key=lambda s: -s.gain)


def alone(problem: Problem, model: Fit, table: Columns, curved: Columns) -> list[Score]:
    """Score candidates by what they do nearly alone, best first.

    Far from the answer nuisances, linear as they are, take up what a large effect does: here they are as good as known,
    and the model is as wrong as stated, as in the first steps of a fit.

    Parameters
    ----------
    problem : Problem
    model : Fit
    table, curved : mapping of Candidate to (n, k) ndarray
        See `Survey`.
    """
    level = _Level(problem, model, table, None, curved)
    return sorted((level.score((c,)) for c in table), key=lambda s: -s.gain)


class _Level:
    """Scores at one level of the error scales; at the stated ones, nuisances hardly free, where none is given."""

    def __init__(self, problem: Problem, model: Fit, table: Columns, share: float | None, curved: Columns) -> None:
        known = model.assessment.linear
        if share is None:
            known = replace(known, width=TIGHT * known.width)
            found = assess(problem.basis, known, problem.basis.stated, fixed=True)
        else:
            found = assess(problem.basis, known, np.maximum(model.assessment.scales * share, 1e-5), fixed=True)
        self.offset = found.evidence - model.evidence
        residual = model.assessment.linear.residual
        self.at: dict[Candidate, slice] = {}
        parts, width, count = [], [], 0
        for c, column in table.items():
            parts.append(problem.scaled(column) * c.width)
            width.append(c.width)
            self.at[c] = slice(count, count + column.shape[1])
            count += column.shape[1]
        unit = np.column_stack(parts)
        weighted = found.inverse @ unit
        self.gram, self.toward = unit.T @ weighted, weighted.T @ residual
        self.width = np.concatenate(width)
        self.courses: dict[Candidate, tuple[FloatArray, FloatArray]] = {}
        for c in table.keys() & curved.keys():
            course = np.column_stack([table[c], curved[c]]) * c.width[0] ** np.arange(1, curved[c].shape[1] + 2)
            whole = problem.scaled(course)
            weighed = found.inverse @ whole
            self.courses[c] = weighed.T @ residual, whole.T @ weighed

    def _along(self, c: Candidate) -> Score:
        """Score of one amplitude along its course: the best of a grid, and the Gaussian there."""
        at = self.at[c].start
        toward, gram = self.courses[c]
        low, high = ((float(v[0]) - c.neutral) / self.width[at] for v in c.limits)
        t = np.linspace(max(low, -1.0), min(high, 1.0), 81)
        power = np.arange(1, len(toward) + 1)
        course = t[:, None] ** power
        slopes = power * t[:, None] ** (power - 1)
        gain = course @ toward - 0.5 * (t**2 + np.einsum("ti,ij,tj->t", course, gram, course))
        gain -= 0.5 * np.log1p(np.einsum("ti,ij,tj->t", slopes, gram, slopes))
        best = int(np.argmax(gain))
        return Score((c,), float(gain[best]) + self.offset, (np.array([c.neutral + t[best] * self.width[at]]),))

    def score(self, chosen: tuple[Candidate, ...]) -> Score:
        if len(chosen) == 1 and chosen[0] in self.courses:
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


def with_model(model: Fit, score: Score, table: Columns, curved: Columns | None = None) -> Start:
    """Start of a fit of a model with what was scored.

    Parameters
    ----------
    model : Fit
        A fitted model.
    score : Score
        What was scored beside the model.
    table : mapping of Candidate to array
        Derivatives by candidate, (n, k) each.
    curved : mapping, optional
        Higher powers of their amplitudes; see `Survey`.
    """
    parts = []
    for c, amplitudes in zip(score.candidates, score.amplitudes, strict=True):
        course = (curved or {}).get(c)
        parts.append(table[c])
        if course is not None:
            power = np.arange(2, course.shape[1] + 2)
            parts[-1] = table[c] + (course @ (power * (amplitudes[0] - c.neutral) ** (power - 1)))[:, None]
    jacobian = np.column_stack([model.jacobian, *parts])
    return Start((*model.candidates, *score.candidates), (*model.amplitudes, *score.amplitudes), jacobian,
                 model.nuisance, model.columns)  # fmt: skip


def instead(problem: Problem, model: Fit, table: Columns, beyond: float) -> list[Start]:
    """Starts in which an effect takes over from what is off further than its tolerance allows and does the same.

    Oil that is three tolerances too thin has the evidence of an effect, and no residual that would ask for it.

    Parameters
    ----------
    problem : Problem
    model : Fit
        A fitted model.
    table : mapping of Candidate to (n, k) ndarray
        Derivatives by candidate.
    beyond : float
        In standard deviations.
    """
    size = model.assessment.free[model.jacobian.shape[1] :]
    out = []
    for c, column in table.items():
        for i in problem.twins(c):
            if abs(size[i]) <= beyond or column.shape[1] != 1:
                continue
            own, other = problem.scaled(column)[:, 0], problem.scaled(model.columns)[:, i] * size[i]
            low, high = c.limits
            amplitude = np.clip(c.origin + (own @ other) / max(float(own @ own), 1e-300), low, high)
            nuisance = model.nuisance.copy()
            nuisance[i] = 0.0
            jacobian = np.column_stack([model.jacobian, column])
            out.append(Start((*model.candidates, c), (*model.amplitudes, amplitude), jacobian, nuisance, model.columns))
    return out


def visible(problem: Problem, model: Fit, candidate: Candidate, column: FloatArray) -> float:
    """Size of a typical step of a candidate beside a model, in standard deviations of everything else.

    Parameters
    ----------
    problem : Problem
        Observations beside the baseline, with nuisances and candidates.
    model : Fit
        A fitted model.
    candidate : Candidate
        Effect that is tried.
    column : array, shape (n, k)
        Derivatives of the prediction for the candidate.
    """
    one = problem.scaled(column) @ candidate.steps
    return math.sqrt(max(float(one @ model.assessment.inverse @ one), 0.0))


def without(model: Fit, gone: Sequence[int]) -> Linear:
    """A model's linear form without some nuisances, by their numbers.

    Parameters
    ----------
    model : Fit
        A fitted model.
    gone : sequence of int
        Numbers of the nuisances to be left out.
    """
    count = model.jacobian.shape[1]
    return model.assessment.linear.without([count + i for i in gone])

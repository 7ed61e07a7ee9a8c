"""Fit: amplitudes of effects together with everything that may be off, where a model stands and what it is worth."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from model.effects import Effect
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.search.assessment import Assessment, Linear, assess
from tpjb_ident.diagnosis.search.problem import Problem


def build(candidates: Sequence[Candidate], amplitudes: Sequence[FloatArray]) -> tuple[Effect, ...]:
    """Effects of candidates at amplitudes; `amplitudes` (k_i,) each."""
    return tuple(c.effect(a) for c, a in zip(candidates, amplitudes, strict=True))


@dataclass(frozen=True)
class InitialFit:
    """Where a model stands: where a fit begins, or a step leads."""

    candidates: tuple[Candidate, ...]
    amplitudes: tuple[FloatArray, ...]  #: (k_i,): in the nearly linear forms
    #: (n, k): per unit of every amplitude, as known from nearby; steps correct it
    jacobian: FloatArray = field(repr=False)
    #: (m,): where nuisances stand while amplitudes move, in standard deviations
    nuisance: FloatArray = field(repr=False)
    columns: FloatArray = field(repr=False)  #: (n, m): per standard deviation of every nuisance

    @property
    def free(self) -> FloatArray:
        """Amplitudes and nuisances, counted from their priors' means, (k + m,)."""
        moved = [a - c.origin for c, a in zip(self.candidates, self.amplitudes, strict=True)]
        return np.concatenate([*moved, self.nuisance]) if moved else self.nuisance

    @property
    def width(self) -> FloatArray:
        """Standard deviations of their priors, (k + m,)."""
        return np.concatenate([*(c.width for c in self.candidates), np.ones(len(self.nuisance))])

    def split(self, flat: FloatArray) -> tuple[FloatArray, ...]:
        """Amplitudes by candidate, inside their bounds; `flat` (k,)."""
        out, at = [], 0
        for c in self.candidates:
            low, high = c.limits
            out.append(np.clip(flat[at : at + len(low)], low, high))
            at += len(low)
        return tuple(out)


@dataclass(frozen=True)
class Fit(InitialFit):
    """Effects fitted together, nuisances beside them."""

    prediction: FloatArray = field(repr=False)  #: (n,): where the model stands, readings included
    assessment: Assessment = field(repr=False)
    converged: bool = field(default=False, repr=False)

    @property
    def start(self) -> InitialFit:
        """Where it stands, without what it is worth: little to send to another process."""
        return InitialFit(self.candidates, self.amplitudes, self.jacobian, self.nuisance, self.columns)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted sizes."""
        return build(self.candidates, self.amplitudes)

    @property
    def label(self) -> str:
        """Names, joined."""
        return " + ".join(c.label for c in self.candidates) or "baseline"

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(c.name for c in self.candidates)

    @property
    def evidence(self) -> float:
        """Log evidence [nats]."""
        return self.assessment.evidence

    @property
    def slices(self) -> tuple[slice, ...]:
        """Where every candidate's amplitudes stand among the free numbers."""
        ends = np.cumsum([0, *(len(a) for a in self.amplitudes)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))

    @property
    def errors(self) -> FloatArray:
        """Standard errors of all amplitudes, (k,)."""
        count = self.jacobian.shape[1]
        return np.sqrt(np.maximum(np.diag(self.assessment.covariance)[:count], 0.0))

    @property
    def at_bound(self) -> bool:
        """Whether some amplitude has run into a physical bound."""
        for c, a in zip(self.candidates, self.amplitudes, strict=True):
            low, high = c.limits
            size = 1e-6 * np.maximum(np.abs(low), np.abs(high))
            size = np.where(np.isfinite(size), size, 0.0)
            if np.any((a <= low + size) | (a >= high - size)):
                return True
        return False

    def at(self, free: FloatArray) -> FloatArray:
        """Prediction at other free numbers, to first order, (n,); `free` (k + m,)."""
        columns = np.column_stack([self.jacobian, self.columns])
        return self.prediction + columns @ (free - self.free)


def linear(problem: Problem, start: InitialFit, prediction: FloatArray, slack: float = 1.0) -> Linear:
    """Linear model about a prediction; `prediction` (n,)."""
    columns = problem.scaled(np.column_stack([start.jacobian, start.columns]))
    width = start.width.copy()
    width[start.jacobian.shape[1] :] *= slack
    residual = problem.scaled(problem.observations.value - prediction) + columns @ start.free
    return Linear(residual, columns, width)


def fitted(problem: Problem, start: InitialFit, prediction: FloatArray, scales: FloatArray | None = None) -> Fit:
    """A fit where a model stands, assessed; `prediction` (n,), `scales` (c,)."""
    assessment = assess(problem.basis, linear(problem, start, prediction), scales)
    return Fit(
        start.candidates, start.amplitudes, start.jacobian, start.nuisance, start.columns, prediction, assessment
    )

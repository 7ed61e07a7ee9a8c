"""Values of the terms' parameters with their priors: those that all points share, and a table of the points' own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from tpjb_ident.estimate.arrowhead import Prior, Step
from tpjb_ident.estimate.term import Fitted, Term


class Parameters:
    """q shared ones, and L of every group of points; where a group has none of a term, its place stays as it is."""

    def __init__(self, terms: Sequence[Term], group: IntArray, groups: int) -> None:
        self.terms = tuple(term for term in terms if term.parameters)
        self.shared = [term for term in self.terms if not term.points]
        self.local = [term for term in self.terms if term.points]
        self._group = group
        self._part: dict[str, slice] = {}
        for alike in (self.shared, self.local):
            ends = np.cumsum([0] + [term.width for term in alike])
            self._part |= {term.name: slice(int(a), int(b)) for term, a, b in zip(alike, ends, ends[1:])}
        chosen = [p for term in self.shared for p in term.parameters]
        always = np.array([term.always_estimated for term in self.shared for _ in term.parameters], dtype=bool)
        self._mean = np.array([p.mean for p in chosen])
        self._prior = Prior(np.zeros(len(chosen)), 1 / np.array([p.deviation for p in chosen]) ** 2, always)
        self.value = self._mean.copy()
        columns = sum(term.width for term in self.local)
        self._own_mean = np.zeros((groups, columns))
        self._own = Prior(np.zeros((groups, columns)), np.ones((groups, columns)), np.zeros((groups, columns), bool))
        for term in self.local:
            place = self._place(term)
            self._own_mean[place] = np.reshape([p.mean for p in term.parameters], (-1, term.width))
            self._own.precision[place] = np.reshape([p.deviation for p in term.parameters], (-1, term.width)) ** -2.0
            self._own.always[place] = term.always_estimated
        self.own = self._own_mean.copy()

    def _place(self, term: Term) -> tuple[IntArray, slice]:
        groups = self._group[list(term.points)]
        assert len(np.unique(groups)) == len(groups), f"{term.name}: points of one group have nothing of their own"
        return groups, self._part[term.name]

    def of(self, term: Term) -> FloatArray:
        """Values of a term's parameters, in its order."""
        return self.own[self._place(term)].ravel() if term.points else self.value[self._part[term.name]]

    def by_term(self) -> dict[str, FloatArray]:
        """Values by the term's name."""
        return {term.name: self.of(term) for term in self.terms}

    def priors(self) -> tuple[Prior, Prior]:
        """Of the shared ones and of the points' own, as far as the values are from their means."""
        shared = Prior(self._mean - self.value, self._prior.precision, self._prior.always)
        return shared, Prior(self._own_mean - self.own, self._own.precision, self._own.always)

    def move(self, taken: Step) -> None:
        """Take a step of the solve."""
        self.value = self.value + taken.theta
        self.own = self.own + taken.own.change

    def fitted(self, term: Term, last: Step, unexplained: float) -> Fitted:
        """What the last step says of a term's parameters."""
        if term.points:
            place = self._place(term)
            posterior, estimated = last.own.deviation[place].ravel(), last.own.estimated[place].ravel()
        else:
            part = self._part[term.name]
            posterior, estimated = last.deviation[part], last.estimated[part]
        return Fitted(self.of(term), posterior, estimated, unexplained)

    def share(self, term: Term, last: Step, factors: FloatArray) -> FloatArray:
        """Covariance (P, k, k) of the points' numbers by a term's prior; `factors` (q, P, k) of the shared ones."""
        part = self._part[term.name]
        if term.points:
            chosen = np.zeros(self.own.shape, dtype=bool)
            chosen[self._place(term)] = True
            return last.own_share(chosen)
        return np.einsum("qpa,qpb->pab", factors[part], factors[part])

"""Assessment: what a model is worth to the data, seen and unseen, with everything that may be off left free.

At a fitted model the observation vector is linear in amplitudes a and nuisances n,

    y = f + J (a - a0) + N n + e,   a ~ N(a00, A), n ~ N(0, 1), e ~ N(0, S + sum_k t_k D_k),

S from identification, D_k the components of the stated model tolerance. The scales t_k maximise the evidence p(y)
with a half-Cauchy prior on sqrt(t_k) whose scale is the stated tolerance (Gelman, Bayesian Analysis 1 (2006) 515).
Every fold is then predicted from all others, in closed form.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_array

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.folds import Fold
from tpjb_ident.diagnosis.search.components import Component

#: Most steps of the scales: with 12 a baseline ended 7 nats short of its best, and what was fitted from there led.
_STEPS = 40
#: A step that has helped may be so many times as long the next time: residuals far below a scale bring it down by a
#: factor of e a step.
_LONGEST = 8.0
#: Change of the log scales at which they count as found.
_FOUND = 0.05


@dataclass(frozen=True)
class Basis:
    """What every assessment of a campaign shares; all in units of `total_sigma`."""

    noise: FloatArray = field(repr=False)  #: (n, n): covariance of identification
    components: tuple[Component, ...] = field(repr=False)
    folds: tuple[Fold, ...] = field(repr=False)

    @property
    def stated(self) -> FloatArray:
        """Scales of a model that is as wrong as stated and no more, (c,)."""
        return np.array([1e-5 if component.name in {"scatter", "beyond"} else 1.0 for component in self.components])

    @functools.cached_property
    def coarse(self) -> Basis:
        """The same, with every element off by its own `total_sigma` besides."""
        return Basis(self.noise + np.eye(len(self.noise)), self.components, self.folds)

    def covariance(self, scales: FloatArray) -> FloatArray:
        """Noise and model error at scales t_k, (n, n); `scales` (c,)."""
        all_scales = np.array(scales, float)
        for component, scale in zip(self.components, scales, strict=True):
            all_scales[list(component.made_of)] += scale
        out = self.noise.copy()
        for component, scale, at in zip(self.components, all_scales, self._at, strict=True):
            if not component.made_of:
                out[at] += scale * component.matrix
        return out

    @functools.cached_property
    def _at(self) -> list[Any]:
        """Where every component stands in the whole covariance."""
        whole = len(self.noise)
        return [np.s_[:, :] if len(c.rows) == whole else np.ix_(c.rows, c.rows) for c in self.components]

    @functools.cached_property
    def sparse(self) -> csr_array:
        """The first component's matrix: identification ties the entries of one point together, and nothing else."""
        return csr_array(self.components[0].matrix)


@dataclass(frozen=True)
class Linear:
    """A model, linear about where it was fitted; all in units of `total_sigma`."""

    residual: FloatArray = field(repr=False)  #: (n,)
    columns: FloatArray = field(repr=False)  #: (n, k): J and N side by side
    width: FloatArray = field(repr=False)  #: (k,): standard deviations of their priors

    @property
    def spread(self) -> FloatArray:
        """Covariance that the free numbers add, (n, n)."""
        scaled = self.columns * self.width
        return np.asarray(scaled @ scaled.T)

    def without(self, gone: Sequence[int]) -> Linear:
        """Return the same without some columns."""
        remaining = np.setdiff1d(np.arange(self.columns.shape[1]), np.asarray(gone, int))
        return Linear(self.residual, self.columns[:, remaining], self.width[remaining])


@dataclass(frozen=True)
class Assessment:
    """What a model is worth."""

    scales: FloatArray  #: (c,): t_k
    evidence: float
    inverse: FloatArray = field(repr=False)  #: (n, n): of the whole covariance
    linear: Linear = field(repr=False)
    folds: tuple[Fold, ...] = field(repr=False)

    @property
    def free(self) -> FloatArray:
        """Posterior mean of the free numbers, from their priors' means, (k,)."""
        return self._from(self.inverse @ self.linear.residual)

    @property
    def covariance(self) -> FloatArray:
        """Posterior covariance of the free numbers, (k, k)."""
        scaled = self.linear.columns * self.linear.width
        inner = np.eye(scaled.shape[1]) - scaled.T @ self.inverse @ scaled
        return np.asarray(inner * np.outer(self.linear.width, self.linear.width))

    def scores(self) -> FloatArray:
        """Log density of every fold given all others, (folds,) [nats]."""
        weighted = self.inverse @ self.linear.residual
        out = []
        for fold in self.folds:
            rows = fold.members
            block = self.inverse[np.ix_(rows, rows)]
            error = np.linalg.solve(block, weighted[rows])
            log_det = float(np.linalg.slogdet(block)[1])
            out.append(0.5 * (log_det - float(error @ weighted[rows]) - len(rows) * math.log(2 * math.pi)))
        return np.array(out)

    def unseen(self, fold: Fold) -> FloatArray:
        """Free numbers as all elements but a fold's tell them, (k,)."""
        weighted = self.inverse @ self.linear.residual
        rows = fold.members
        error = np.linalg.solve(self.inverse[np.ix_(rows, rows)], weighted[rows])
        return self._from(weighted - self.inverse[:, rows] @ error)

    def _from(self, weighted: FloatArray) -> FloatArray:
        return np.asarray(self.linear.width**2 * (self.linear.columns.T @ weighted))


def assess(basis: Basis, linear: Linear, start: FloatArray | None = None, fixed: bool = False) -> Assessment:
    """Assess a model; scales by Fisher scoring on their logarithms, damped where a step does not help."""
    logs = np.log(start) if start is not None else np.full(len(basis.components), math.log(0.1))
    # scatter beyond what is stated is rare
    if start is None:
        logs[0] = math.log(1e-2)
    spread = linear.spread
    value, factor = _evidence(basis, linear, spread, logs)
    inverse = _inverse(factor)
    damping, stride = 1e-3, 1.0
    lowest, highest = np.array([(component.lowest, component.highest) for component in basis.components]).T
    for _ in range(0 if fixed else _STEPS):
        gradient, fisher = _slopes(basis, linear, inverse, logs)
        moved = np.linalg.solve(fisher + damping * np.diag(np.diag(fisher)) + 1e-9 * np.eye(len(logs)), gradient)
        for share in dict.fromkeys((stride, 1.0)):
            new = np.clip(logs + np.clip(share * moved, -3.0, 3.0), lowest, highest)
            trial, factor = _evidence(basis, linear, spread, new)
            if trial >= value:
                break
        stride = min(2.0 * share, _LONGEST) if trial >= value else 1.0
        if trial < value:
            damping = max(10.0 * damping, 0.1)
            if damping > 1e4:
                break
            continue
        done = np.max(np.abs(new - logs)) < _FOUND or trial - value < 0.01
        logs, value, inverse, damping = new, trial, _inverse(factor), 0.1 * damping
        if done:
            break
    return Assessment(np.exp(logs), value, inverse, linear, basis.folds)


def _evidence(basis: Basis, linear: Linear, spread: FloatArray, logs: FloatArray) -> tuple[float, FloatArray]:
    """Log evidence, and the Cholesky factor of the whole covariance."""
    total = basis.covariance(np.exp(logs)) + spread
    factor, failed = lapack.dpotrf(total.T, lower=1, clean=1, overwrite_a=1)  # symmetric, and as Fortran has it
    if failed:
        return -math.inf, total
    white = lapack.dtrtrs(factor, linear.residual, lower=1)[0]
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor))))
    value = -0.5 * (float(white @ white) + log_det + len(total) * math.log(2 * math.pi))
    return value + _prior(logs), factor


def _inverse(factor: FloatArray) -> FloatArray:
    lower = lapack.dpotri(factor, lower=1)[0]
    return np.asarray(lower + np.tril(lower, -1).T)


def _prior(logs: FloatArray) -> float:
    """Log density of log t when sqrt(t) is half-Cauchy about the stated tolerance."""
    return float(np.sum(0.5 * logs - np.log1p(np.exp(logs)) - math.log(math.pi)))


def _slopes(
    basis: Basis, linear: Linear, inverse: FloatArray, logs: FloatArray
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    scales = np.exp(logs)
    weighted = inverse @ linear.residual
    components = basis.components
    basic = [i for i, component in enumerate(components) if not component.made_of]
    # Q D_k over the rows that each acts on
    products = {
        i: inverse[:, components[i].rows] @ components[i].matrix if i else (basis.sparse @ inverse).T for i in basic
    }
    combined = np.zeros((len(components), len(basic)))  # what is made of others has their sums
    for i, component in enumerate(components):
        combined[i, [basic.index(k) for k in component.made_of or (i,)]] = 1.0
    trace = combined @ [np.trace(products[i][components[i].rows]) for i in basic]
    square = combined @ [
        weighted[components[i].rows] @ components[i].matrix @ weighted[components[i].rows] for i in basic
    ]
    share = scales / (1.0 + scales)
    gradient = 0.5 * scales * (square - trace) + 0.5 - share
    both = np.zeros((len(basic), len(basic)))
    for a, i in enumerate(basic):
        for b, j in enumerate(basic[a:], a):
            # tr(Q D_i Q D_j) over the rows that each acts on
            both[a, b] = both[b, a] = float(np.vdot(products[i][components[j].rows], products[j][components[i].rows].T))
    fisher = 0.5 * np.outer(scales, scales) * (combined @ both @ combined.T)
    return gradient, fisher + np.diag(share * (1.0 - share))

"""Components: how a model may be wrong within its stated tolerance, smoothly over operating points.

A model that is trusted to 1.5 % is not wrong by 1.5 % at random in every point: it is wrong much the same way at
neighbouring points. Per kind of observable there is one covariance, of the stated tolerance's size, whose scale a
campaign's own residual tells (`assessment`): half of it constant, nearly half smooth over load, frequency, direction
and speed, a little by point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from tpjb_ident.diagnosis.observations.gap import coordinate
from tpjb_ident.diagnosis.observations.observe import Element, Observations

#: Scales are fitted as logarithms, within what can still be told from nothing and what drowns everything.
NOTHING, _LOWEST, HIGHEST = math.log(1e-5), math.log(0.1**2), math.log(1e5)
#: Parts of the variance: the same at all points, smooth over the range that was measured, each point by itself (a
#: tenth of the standard deviation: programs that solve the same equations differ like that).
_CONSTANT, _SMOOTH, _ROUGH = 0.5, 0.49, 0.01
_KINDS = {
    "h": "h", "locus": "position", "load": "load", "clearance": "polygon", "dry": "dry", "temperature": "temperature",
}  # fmt: skip


@dataclass(frozen=True)
class Component:
    """One way to be wrong."""

    name: str
    rows: IntArray = field(repr=False)  #: (m,)
    matrix: FloatArray = field(repr=False)  #: (m, m)
    lowest: float = _LOWEST
    highest: float = 0.0
    made_of: tuple[int, ...] = ()


def components(observations: Observations) -> tuple[Component, ...]:
    """Components of an observation vector, scaled by its `total_sigma`."""
    scale = observations.total_sigma
    everything = np.arange(len(observations))
    out = [Component("scatter", everything, observations.covariance / np.outer(scale, scale), NOTHING)]
    share = observations.sigma / scale
    combined = np.zeros_like(observations.covariance)  # all kinds together
    kinds = np.array([_KINDS[e.family] for e in observations.elements])
    for kind in dict.fromkeys(kinds):
        rows = np.flatnonzero(kinds == kind)
        members = [observations.elements[i] for i in rows]
        matrix = _correlation(members) * np.outer(share[rows], share[rows])
        combined[np.ix_(rows, rows)] = matrix
        out.append(Component(str(kind), rows, matrix))
    return (*out, Component("beyond", everything, combined, NOTHING, HIGHEST, tuple(range(1, len(out)))))


def _correlation(elements: Sequence[Element]) -> FloatArray:
    """Correlation between elements of one kind: only the same observable of the same pad has any."""
    keys = [(e.observable, e.place("pad") if e.place("pad") == e.place("pad") else 0.0) for e in elements]
    equal = np.array([[a == b for b in keys] for a in keys], dtype=float)
    distance = np.zeros_like(equal)
    for name in ("load", "excitation", "speed"):
        x = coordinate(elements, name)
        distance += 0.5 * (x[:, None] - x[None, :]) ** 2
    angle = np.nan_to_num(np.array([e.place("direction") for e in elements]))
    distance += 1.0 - np.cos(angle[:, None] - angle[None, :])
    around = elements[0].family in {"locus", "load"}
    # the constant part of a locus is its centre, which is free
    constant, smooth = (0.0, _CONSTANT + _SMOOTH) if around else (_CONSTANT, _SMOOTH)
    return equal * (constant + smooth * np.exp(-distance)) + _ROUGH * np.eye(len(elements))


#: Share of the stated tolerance that campaigns turn out to need, for what is planned before any is there: with models
#: that solve the same equations 0.1 to 0.2, see `docs/diagnosis.md`.
_USUAL = 0.2


def usual_factor(observations: Observations, columns: FloatArray) -> FloatArray:
    """Cholesky factor of the covariance to expect: identification, model error and nuisances, (n, n).

    `columns` (n, m).
    """
    scale = observations.total_sigma
    share = observations.sigma / scale
    total = (observations.covariance + columns @ columns.T) / np.outer(scale, scale)
    for component in components(observations)[1:-1]:
        total[np.ix_(component.rows, component.rows)] += _USUAL**2 * component.matrix
    total += 1e-6 * np.diag(share**2)
    return np.asarray(scale[:, None] * np.linalg.cholesky(total))

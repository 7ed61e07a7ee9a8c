"""Model error: how a model may be wrong within its stated tolerance, smoothly over operating points.

A model that is trusted to 1.5 % is not wrong by 1.5 % at random in every point: it is wrong much the same way at
neighbouring points. One covariance of the stated tolerance's size holds all kinds of observable; its scale is summed
over (`comparison.evidence`).
"""

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import coordinate
from tpjb_ident.diagnosis.observations.observe import Element, Observations, named, places


def model_error(observations: Observations) -> FloatArray:
    """Covariance of the stated model tolerance in units of `total_sigma`, (n, n)."""
    share = observations.sigma / observations.total_sigma
    family, out = named(observations.elements, "family"), np.zeros_like(observations.covariance)
    for name in set(family):
        rows = np.flatnonzero(family == name)
        correlation = _correlation([observations.elements[i] for i in rows])
        out[np.ix_(rows, rows)] = correlation * np.outer(share[rows], share[rows])
    return out


def _correlation(elements: Sequence[Element]) -> FloatArray:
    """Correlation between elements of one kind: only the same observable of the same pad has any."""
    names, pads = named(elements, "observable"), np.nan_to_num(places(elements, "pad"))
    equal = (names[:, None] == names) & (pads[:, None] == pads)
    distance = np.zeros(equal.shape)
    for name in ("load", "excitation", "speed"):
        x = coordinate(elements, name)
        distance += 0.5 * (x[:, None] - x[None, :]) ** 2
    angle = np.nan_to_num(places(elements, "direction"))
    distance += 1.0 - np.cos(angle[:, None] - angle[None, :])
    around = elements[0].family in {"locus", "load"}
    # the constant part of a locus is its centre, which is free
    constant, smooth, rough = Deciding.parts
    constant, smooth = (0.0, constant + smooth) if around else (constant, smooth)
    return equal * (constant + smooth * np.exp(-distance)) + rough * np.eye(len(elements))


def usual_factor(observations: Observations, columns: FloatArray) -> FloatArray:
    """Cholesky factor of the covariance to expect: identification, model error and nuisances (n, m), (n, n)."""
    scale = observations.total_sigma
    share = observations.sigma / scale
    total = (observations.covariance + columns @ columns.T) / np.outer(scale, scale)
    total += Deciding.usual**2 * model_error(observations) + 1e-6 * np.diag(share**2)
    return np.asarray(scale[:, None] * np.linalg.cholesky(total))

"""Problem: all that a comparison needs, whether the model behind it is the real one or a stand-in."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel
from tpjb_ident.diagnosis.comparison.faults import Fault, faults_of
from tpjb_ident.diagnosis.deciding.constants import Deciding
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.forward.nuisance import Nuisance
from tpjb_ident.diagnosis.observations.folds import held_out
from tpjb_ident.diagnosis.observations.model_error import model_error
from tpjb_ident.diagnosis.observations.observe import Observations, Tolerance


@dataclass(frozen=True)
class Problem:
    """A campaign next to a baseline."""

    observations: Observations
    base: FloatArray = field(repr=False)  #: (n,): prediction of the baseline
    nuisances: tuple[Nuisance, ...] = field(repr=False)
    columns: FloatArray = field(repr=False)  #: (n, m): what they do at the baseline, per standard deviation
    pool: tuple[Candidate, ...] = field(repr=False)

    @functools.cached_property
    def sigma(self) -> FloatArray:
        """Measurement and stated model tolerance together: the unit of everything in a comparison, (n,)."""
        return self.observations.total_sigma

    @functools.cached_property
    def errors(self) -> ErrorModel:
        """Covariance of noise and model error at every scale."""
        noise = self.observations.covariance / np.outer(self.sigma, self.sigma)
        return ErrorModel(noise + 1e-9 * np.eye(len(noise)), model_error(self.observations))

    @functools.cached_property
    def faults(self) -> tuple[Fault, ...]:
        """What may be wrong."""
        return faults_of(self.pool, self.nuisances)

    @functools.cached_property
    def held(self) -> BoolArray:
        """Elements to which a model must extrapolate."""
        return held_out(self.observations)

    @functools.cached_property
    def measured(self) -> FloatArray:
        """The observations in units of `sigma`, (n,)."""
        return self.scaled(self.observations.value)

    def scaled(self, vector: FloatArray) -> FloatArray:
        """A vector (n,) or columns (n, k) in units of `sigma`."""
        return np.asarray(vector / (self.sigma if vector.ndim == 1 else self.sigma[:, None]))


def loosened(observations: Observations, shares: FloatArray, tolerance: Tolerance) -> Observations:
    """Trust no temperature of a pad that hardly carries in the baseline; `shares` (n,)."""
    idle = np.nan_to_num(shares, nan=1.0) < Deciding.idle
    noise = np.where(idle, tolerance.idle_temperature, 0.0)
    return replace(observations, covariance=observations.covariance + np.diag(noise**2))

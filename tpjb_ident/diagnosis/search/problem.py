"""Problem: all that a search needs, whether the model behind it is the real one or a stand-in."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.forward.nuisance import Nuisance
from tpjb_ident.diagnosis.observations.folds import Fold, folds, held_out
from tpjb_ident.diagnosis.observations.observe import Observations, Tolerance
from tpjb_ident.diagnosis.search.assessment import Basis
from tpjb_ident.diagnosis.search.components import components

#: Share of the static load below which a pad hardly carries: its attitude, and so its temperature, is not unique.
_HARDLY = 0.10


@dataclass(frozen=True)
class Problem:
    """A campaign beside a baseline."""

    observations: Observations
    base: FloatArray = field(repr=False)  #: (n,): prediction of the baseline
    nuisances: tuple[Nuisance, ...] = field(repr=False)
    columns: FloatArray = field(repr=False)  #: (n, m): what they do at the baseline, per standard deviation
    pool: tuple[Candidate, ...] = field(repr=False)

    @functools.cached_property
    def sigma(self) -> FloatArray:
        """Measurement and stated model tolerance together: the unit of everything in a search, (n,)."""
        return self.observations.total_sigma

    @functools.cached_property
    def basis(self) -> Basis:
        """What every assessment shares."""
        noise = self.observations.covariance / np.outer(self.sigma, self.sigma)
        return Basis(noise, components(self.observations), self.folds)

    @functools.cached_property
    def folds(self) -> tuple[Fold, ...]:
        """Blocks that are left out in turn."""
        return folds(self.observations)

    @functools.cached_property
    def held(self) -> BoolArray:
        """Elements to which a model must extrapolate."""
        return held_out(self.observations)

    def scaled(self, vector: FloatArray) -> FloatArray:
        """A vector (n,) or columns (n, k) in units of `sigma`."""
        return np.asarray(vector / (self.sigma if vector.ndim == 1 else self.sigma[:, None]))

    def aliases(self, candidate: Candidate) -> list[int]:
        """Nuisances that do what a candidate does."""
        names = {candidate.name, candidate.label}
        return [i for i, nuisance in enumerate(self.nuisances) if names & nuisance.aliases]


def loosened(observations: Observations, shares: FloatArray, tolerance: Tolerance) -> Observations:
    """Trust no temperature of a pad that hardly carries in the baseline; `shares` (n,)."""
    idle = np.nan_to_num(shares, nan=1.0) < _HARDLY
    noise = np.where(idle, tolerance.idle_temperature, 0.0)
    return replace(observations, covariance=observations.covariance + np.diag(noise**2))

"""Problem: all that a search needs, whether the model behind it is the real one or a surrogate."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.nuisance import Nuisances
from tpjb_ident.diagnose.observations.observe import Observations
from tpjb_ident.diagnose.observations.split import held_out
from tpjb_ident.diagnose.observations.tolerance import Tolerance
from tpjb_ident.diagnose.search.directions import Direction, directions
from tpjb_ident.diagnose.search.fit import Fit, Misfit

#: Share of the static load below which a pad hardly carries: its attitude, and so its temperature, is not unique.
HARDLY = 0.10


@dataclass(frozen=True)
class Problem:
    """A campaign beside a baseline.

    Attributes
    ----------
    observations : Observations
    base : (n,) ndarray
        Prediction of the baseline.
    nuisances : Nuisances
    pool : tuple of Candidate
        What may be added.
    shape : float
        Relative tolerance of what an effect does.
    """

    observations: Observations
    base: FloatArray = field(repr=False)
    nuisances: Nuisances = field(repr=False)
    pool: tuple[Candidate, ...] = field(repr=False)
    shape: float = Tolerance.shape

    @functools.cached_property
    def held(self) -> BoolArray:
        """Elements that no fit may see."""
        return held_out(self.observations)

    @functools.cached_property
    def covariance(self) -> FloatArray:
        """For inference: identification, fine tolerance, nuisances; (n, n)."""
        columns = self.nuisances.columns
        return self.observations.covariance + np.diag(self.observations.fine**2) + columns @ columns.T

    @functools.cached_property
    def misfit(self) -> Misfit:
        """Whitened residuals of the training elements."""
        return Misfit(self.observations.value, self.covariance, ~self.held)

    @functools.cached_property
    def groups(self) -> tuple[Direction, ...]:
        """Patterns that a residual is tested for."""
        return directions(self.observations.elements, self.base)

    @functools.cached_property
    def empty(self) -> Fit:
        """The baseline as a fit of nothing."""
        n = len(self.base)
        chi_square = self.misfit.chi_square(self.base)
        return Fit((), np.zeros(0), self.base, np.zeros((n, 0)), chi_square, np.zeros((0, 0)))

    def tolerant(self, fitted: Fit) -> FloatArray:
        """Covariance with the tolerance of what the fitted effects do, (n, n)."""
        return np.asarray(self.covariance + np.diag((self.shape * (fitted.prediction - self.base)) ** 2))


def loosened(observations: Observations, shares: FloatArray, tolerance: Tolerance) -> Observations:
    """Trust no temperature of a pad that hardly carries in the baseline.

    Parameters
    ----------
    observations : Observations
    shares : (n,) ndarray
        Share of the static load on the pad of every temperature element; NaN elsewhere.
    tolerance : Tolerance
    """
    idle = np.nan_to_num(shares, nan=1.0) < HARDLY
    fine = np.where(idle, np.maximum(observations.fine, tolerance.idle_temperature), observations.fine)
    sigma = np.where(idle, np.maximum(observations.sigma, tolerance.idle_temperature), observations.sigma)
    return replace(observations, fine=fine, sigma=sigma)

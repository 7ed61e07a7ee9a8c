"""Problem: all that a comparison needs, whether the model behind it is the real one or a stand-in."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel
from tpjb_ident.diagnosis.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnosis.forward.nuisance import OWN_NUMBERS, TOGETHER, Nuisance
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import held_out
from tpjb_ident.diagnosis.observations.model_error import model_error
from tpjb_ident.diagnosis.observations.observe import Observations

#: Pads that are all uneven are tolerances, one by one.
_TOLERANCES_ALREADY = frozenset({"uneven_pads"})
#: Amplitude at which a tolerance is held against an effect.
_SMALL = 1e-3


@dataclass(frozen=True)
class Fault:
    """One thing that may be wrong; two with one label are the same, wherever their fits began."""

    label: str
    candidate: Candidate = field(compare=False)
    prior: FloatArray = field(compare=False, repr=False)  #: (4, k): see `Candidate.prior`
    own: int = field(default=-1, compare=False)  #: number of its tolerance; -1: it has none
    sigma: float = field(default=math.nan, compare=False)  #: what is stated of that tolerance

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.candidate.name

    @property
    def width(self) -> FloatArray:
        """Standard deviations of the prior, (k,)."""
        return self.prior[1]

    @property
    def is_term(self) -> bool:
        """Whether it is a generic term and no effect of the library."""
        return self.name in TERMS

    def turned(self) -> Fault:
        """The same with its direction free beside the grid."""
        free = self.candidate.refined()
        return self if free is self.candidate else Fault(self.label, free, free.prior)

    def values(self, amplitudes: FloatArray) -> dict[str, float]:
        """Parameters of the effect at amplitudes (k,); bounded as the library has them."""
        if self.own < 0:
            return self.candidate.values(amplitudes)
        parameter = self.candidate.parameter
        value = OWN_NUMBERS[self.name].parameter(float(amplitudes[0]) * self.sigma)
        return {parameter.name: min(max(value, parameter.low), parameter.high), **self.candidate.fixed}


def faults_of(pool: Sequence[Candidate], nuisances: Sequence[Nuisance]) -> tuple[Fault, ...]:
    """Every fault of a campaign, a direction once for each of its grid."""
    out = []
    numbers = {nuisance.effect: i for i, nuisance in enumerate(nuisances)}
    for candidate in pool:
        index = numbers.get(candidate.label)
        if index is not None:
            out.append(_on_tolerance(candidate, index, nuisances[index]))
        elif candidate.name not in _TOLERANCES_ALREADY:
            label = candidate.name if "direction" in candidate.fixed else candidate.label
            out.append(Fault(label, candidate, candidate.prior))
    return tuple(out)


def _on_tolerance(candidate: Candidate, index: int, nuisance: Nuisance) -> Fault:
    """The wide prior reaches where the effect's three typical sizes do; bounds are those that the effect has."""
    number, parameter = OWN_NUMBERS[candidate.name], candidate.parameter
    reach = candidate.prior[1, 0] * np.array([-1.0, 1.0])
    ends = [number.change(parameter.from_linear(v)) for v in candidate.neutral + reach]
    bounds = sorted(number.change(v) for v in (parameter.low, parameter.high))
    prior = np.array([[0.0], [min(abs(end) for end in ends if end > -10.0)], *([v] for v in bounds)])
    return Fault(candidate.label, candidate, prior / nuisance.sigma, index, nuisance.sigma)


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

    def said_by(self, fault: Fault) -> dict[int, float]:
        """Tolerances that say a fault, one or all alike, and how far each goes per amplitude; none where none does."""
        if fault.own >= 0:
            return {fault.own: 1.0}
        single = TOGETHER.get(fault.name, "")
        members = {i: n.sigma for i, n in enumerate(self.nuisances) if n.effect.startswith(f"{single} ")}
        if not members:
            return {}
        value = fault.candidate.parameter.from_linear(fault.candidate.neutral + _SMALL)
        change = OWN_NUMBERS[single].change(value) / _SMALL
        return {i: change / sigma for i, sigma in members.items()}

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


def loosened(observations: Observations, shares: FloatArray) -> Observations:
    """Trust no temperature of a pad that hardly carries in the baseline; `shares` (n,)."""
    noise = np.where(np.nan_to_num(shares, nan=1.0) < Deciding.idle, Deciding.idle_temperature, 0.0)
    return replace(observations, covariance=observations.covariance + np.diag(noise**2))

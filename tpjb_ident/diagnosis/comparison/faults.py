"""Faults: what may be wrong with a wide prior. A tolerance's own number, or an effect that has no such number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnosis.forward.nuisance import OWN_NUMBERS, Nuisance

#: Pads that are all uneven are tolerances, one by one.
_TOLERANCES_ALREADY = frozenset({"uneven_pads"})


@dataclass(frozen=True)
class Fault:
    """One thing that may be wrong; two with one label are the same, wherever their fits began."""

    label: str
    candidate: Candidate = field(compare=False)
    origin: FloatArray = field(compare=False, repr=False)  #: (k,): where nothing happens
    width: FloatArray = field(compare=False, repr=False)  #: (k,): standard deviations of the prior
    low: FloatArray = field(compare=False, repr=False)  #: (k,)
    high: FloatArray = field(compare=False, repr=False)  #: (k,)
    own: int = field(default=-1, compare=False)  #: number of its tolerance; -1: it has none
    sigma: float = field(default=math.nan, compare=False)  #: what is stated of that tolerance

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.candidate.name

    @property
    def is_term(self) -> bool:
        """Whether it is a generic term and no effect of the library."""
        return self.name in TERMS

    def turned(self) -> Fault:
        """The same with its direction free beside the grid."""
        free = self.candidate.refined()
        if free is self.candidate:
            return self
        return Fault(self.label, free, free.origin, free.width, *free.limits)

    def values(self, amplitudes: FloatArray) -> dict[str, float]:
        """Parameters of the effect at amplitudes (k,); bounded as the library has them."""
        if self.own < 0:
            return self.candidate.values(amplitudes)
        parameter = self.candidate.free[0]
        value = OWN_NUMBERS[self.name].parameter(float(amplitudes[0]) * self.sigma)
        return {parameter.name: min(max(value, parameter.low), parameter.high), **self.candidate.fixed}


def faults_of(pool: Sequence[Candidate], nuisances: Sequence[Nuisance]) -> tuple[Fault, ...]:
    """Every fault of a campaign, a direction once for each of its grid."""
    out = []
    for candidate in pool:
        if candidate.name in _TOLERANCES_ALREADY:
            continue
        own = [i for i, nuisance in enumerate(nuisances) if nuisance.effect == candidate.label]
        if own:
            out.append(_on_tolerance(candidate, own[0], nuisances[own[0]]))
        else:
            label = candidate.name if "direction" in candidate.fixed else candidate.label
            out.append(Fault(label, candidate, candidate.origin, candidate.width, *candidate.limits))
    return tuple(out)


def _on_tolerance(candidate: Candidate, index: int, nuisance: Nuisance) -> Fault:
    """The wide prior reaches where the effect's three typical sizes do; bounds are those that the effect has."""
    number, parameter = OWN_NUMBERS[candidate.name], candidate.free[0]
    ends = [number.change(parameter.from_linear(candidate.neutral + s * candidate.width[0])) for s in (-1.0, 1.0)]
    inside = [abs(end) for end in ends if end > -10.0]
    width = np.array([min(inside) / nuisance.sigma])
    limits = np.sort([number.change(v) / nuisance.sigma for v in (parameter.low, parameter.high)])
    return Fault(candidate.label, candidate, np.zeros(1), width, limits[:1], limits[1:], index, nuisance.sigma)

"""Candidates: every effect of the library as numbers to fit, its discrete parameters spelt out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from model.effects import Effect, Parameter, known_effects
from model.effects.kind import EffectKind
from model.setup import Setup
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.constants import Deciding


@dataclass(frozen=True)
class Candidate:
    """One effect with one or several free amplitudes."""

    name: str
    free: tuple[Parameter, ...]
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    form: str = ""
    basis: tuple[tuple[float, ...], ...] = ()  #: parameters per amplitude, for several in common; one each by default

    @property
    def label(self) -> str:
        """Name with its fixed parameters: ``soft_pivot pad 5``."""
        spoken = (f"{k} {v:g}" for k, v in self.fixed.items())
        return " ".join([self.name, *filter(None, [self.form]), *spoken])

    @property
    def parameter(self) -> Parameter:
        """The first free one."""
        return self.free[0]

    @property
    def _leading(self) -> tuple[Parameter, ...]:
        """The parameter whose sizes every amplitude has; those of a matrix are alike."""
        return self.free[:1] * len(self.basis) or self.free

    @property
    def origin(self) -> FloatArray:
        """Amplitudes at which nothing happens, (k,)."""
        return np.array([p.to_linear(p.neutral) for p in self._leading])

    @property
    def steps(self) -> FloatArray:
        """Sizes that would not surprise, (k,)."""
        return np.array([p.typical_step for p in self._leading])

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Physical bounds of the amplitudes, (k,) each."""
        ends = np.array([sorted([p.to_linear(p.low), p.to_linear(p.high)]) for p in self._leading])
        return ends[:, 0], ends[:, 1]

    @property
    def prior(self) -> FloatArray:
        """Where nothing happens, standard deviations of the prior, and bounds counted from there, (4, k)."""
        low, high = self.limits
        return np.array([self.origin, Deciding.width * self.steps, low - self.origin, high - self.origin])

    @property
    def neutral(self) -> float:
        """The first of `origin`."""
        return float(self.origin[0])

    def values(self, amplitudes: FloatArray | float) -> dict[str, float]:
        """Parameters at amplitudes (k,), clipped to their bounds; fixed ones too."""
        inside = np.clip(np.atleast_1d(np.asarray(amplitudes, float)), *self.limits)
        sizes = np.transpose(self.basis) @ inside if self.basis else inside
        # inverse forms may round past their own bound
        pairs = zip(self.free, map(float, sizes), strict=True)
        return {**{p.name: min(max(p.from_linear(v), p.low), p.high) for p, v in pairs}, **self.fixed}

    def effect(self, amplitudes: FloatArray | float) -> Effect:
        """Build the effect with these amplitudes (clipped to their bounds); `amplitudes` (k,)."""
        return Effect(self.name, **self.values(amplitudes))

    def refined(self) -> Candidate:
        """Return the same with its direction free beside the grid; itself where it has none."""
        if "direction" not in self.fixed:
            return self
        fixed = dict(self.fixed)
        about = fixed.pop("direction")
        direction = next(p for p in known_effects()[self.name].parameters if p.name == "direction")
        free = replace(direction, neutral=about, typical=Deciding.turn / Deciding.width)
        return replace(self, free=(*self.free, free), fixed=fixed)


def candidates(setup: Setup, skip: frozenset[str] = frozenset()) -> tuple[Candidate, ...]:
    """List every effect of the library (registered ones too) that can act on a set-up."""
    bearing = setup.bearing
    out = []
    for kind in known_effects().values():
        if kind.name in skip or kind.missing(bearing):
            continue
        if kind.name in TERMS:
            out += _terms(kind)
            continue
        parameters = [_within(parameter, setup) for parameter in kind.parameters_of(len(bearing.pads))]
        free = tuple(p for p in parameters if not math.isnan(p.neutral))
        pads = range(1, len(bearing.pads) + 1)
        places = {p.name: pads if p.discrete else p.options for p in parameters if math.isnan(p.neutral)}
        for chosen in itertools.product(*places.values()):
            out.append(Candidate(kind.name, free, dict(zip(places, chosen, strict=True))))
    return tuple(out)


def _within(parameter: Parameter, setup: Setup) -> Parameter:
    """A parameter with the bounds that a set-up's own number leaves: no more can be missing than there is."""
    pads, housing = setup.bearing.pads, setup.instruments.housing_mass
    clearance, bore = min(setup.bearing.clearances), min(pad.pad_clearance for pad in pads)
    most_missing = {
        "mass_error": 0.5 * housing,  # who weighs a housing, or adds its parts up, is not wrong by more
        "radial_offset": clearance, "assembled_clearance_change": clearance, "clearance_change": clearance,
        "pad_clearance_change": bore,
    }  # fmt: skip
    return replace(parameter, low=max(parameter.low, -most_missing.get(parameter.name, math.inf)))


#: Generic terms beyond the library: effects with a 2 x 2 matrix as parameters.
TERMS = ("series_compliance", "parallel_stiffness", "parallel_damping")
_FORMS: dict[str, tuple[tuple[float, ...], ...]] = {
    "isotropic": ((1.0, 0.0, 0.0, 1.0),),
    "cross-coupled": ((0.0, 1.0, -1.0, 0.0),),
    "symmetric": ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
}
#: The same of a spring in series, which has xx, xy and yy only: nothing passive is cross-coupled.
_SERIES: dict[str, tuple[tuple[float, ...], ...]] = {
    "isotropic": ((1.0, 0.0, 1.0),),
    "symmetric": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}


def _terms(kind: EffectKind) -> list[Candidate]:
    """Forms of a generic term."""
    forms = _SERIES if len(kind.parameters) == 3 else _FORMS
    return [Candidate(kind.name, kind.parameters, {}, form, basis) for form, basis in forms.items()]

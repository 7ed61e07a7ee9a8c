"""Candidates: every effect of the library as numbers to fit, its discrete parameters spelt out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from model.bearing import Bearing
from model.effects import Effect, Parameter, known_effects
from model.effects.kind import EffectKind
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.constants import Deciding


@dataclass(frozen=True)
class Candidate:
    """One effect with one or several free amplitudes."""

    name: str
    free: tuple[Parameter, ...]
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    form: str = ""
    basis: tuple[tuple[float, ...], ...] = ()
    about: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def label(self) -> str:
        """Name with its fixed parameters: ``soft_pivot pad 5``."""
        spoken = (f"{k} {v:g}" for k, v in {**self.fixed, **self.about}.items())
        return " ".join([self.name, *([self.form] if self.form else []), *spoken])

    @property
    def parameter(self) -> Parameter:
        """The first free one."""
        return self.free[0]

    @property
    def origin(self) -> FloatArray:
        """Amplitudes at which nothing happens, (k,)."""
        if self.basis:
            return np.zeros(len(self.basis))
        return np.array([self.about.get(p.name, 0.0) if p.name in self.about else p.to_linear(p.neutral)
                         for p in self.free])  # fmt: skip

    @property
    def width(self) -> FloatArray:
        """Standard deviations of the prior, (k,)."""
        width = Deciding.width * self.steps
        if not self.basis:
            width[[p.name in self.about for p in self.free]] = Deciding.turn
        return width

    @property
    def steps(self) -> FloatArray:
        """Sizes that would not surprise, (k,)."""
        if self.basis:
            return np.full(len(self.basis), self.free[0].typical_step)
        return np.array([0.1 if p.name in self.about else p.typical_step for p in self.free])

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Physical bounds of the amplitudes, (k,) each."""
        if self.basis:
            reach = max(abs(self.free[0].low), abs(self.free[0].high))
            return np.full(len(self.basis), -reach), np.full(len(self.basis), reach)
        ends = np.array([sorted(p.to_linear(v) for v in (p.low, p.high)) for p in self.free])
        return ends[:, 0], ends[:, 1]

    @property
    def neutral(self) -> float:
        """The first of `origin`."""
        return float(self.origin[0])

    @property
    def step(self) -> float:
        """The first of `steps`."""
        return float(self.steps[0])

    @property
    def bounds(self) -> tuple[float, float]:
        """The first of `limits`."""
        low, high = self.limits
        return float(low[0]), float(high[0])

    def values(self, amplitudes: FloatArray) -> dict[str, float]:
        """Parameters at amplitudes (k,), clipped to their bounds; fixed ones too."""
        amplitudes = np.atleast_1d(np.asarray(amplitudes, float))
        if self.basis:
            sizes = np.asarray(self.basis).T @ amplitudes
            table = {p.name: float(v) for p, v in zip(self.free, sizes, strict=True)}
        else:
            low, high = self.limits
            inside = np.clip(amplitudes, low, high)
            # inverse forms may round past their own bound
            table = {p.name: min(max(p.from_linear(float(v)), p.low), p.high)
                     for p, v in zip(self.free, inside, strict=True)}  # fmt: skip
        return {**table, **self.fixed}

    def effect(self, amplitudes: FloatArray | float) -> Effect:
        """Build the effect with these amplitudes (clipped to their bounds); `amplitudes` (k,)."""
        return Effect(self.name, **self.values(np.atleast_1d(np.asarray(amplitudes, float))))

    def refined(self) -> Candidate:
        """Return the same with its direction free beside the grid; itself where it has none."""
        if "direction" not in self.fixed:
            return self
        kind = known_effects()[self.name]
        direction = next(p for p in kind.parameters if p.name == "direction")
        fixed = {k: v for k, v in self.fixed.items() if k != "direction"}
        return replace(self, free=(*self.free, direction), fixed=fixed, about={"direction": self.fixed["direction"]})


def candidates(bearing: Bearing, skip: frozenset[str] = frozenset()) -> tuple[Candidate, ...]:
    """List every effect of the library (registered ones too) for a bearing."""
    out: list[Candidate] = []
    for kind in known_effects().values():
        if kind.name in skip or kind.missing(bearing):
            continue
        if kind.name in TERMS:
            out += _terms(kind)
            continue
        parameters = kind.parameters_of(len(bearing.pads))
        free = tuple(p for p in parameters if p.neutral == p.neutral)
        choices: list[dict[str, float]] = [{}]
        for parameter in parameters:
            if parameter.neutral == parameter.neutral:
                continue
            options = range(1, len(bearing.pads) + 1) if parameter.discrete else parameter.options
            choices = [{**c, parameter.name: v} for c in choices for v in options]
        out += [Candidate(kind.name, free, c) for c in choices]
    return tuple(out)


def one_amplitude(bearing: Bearing) -> tuple[Candidate, ...]:
    """Return the candidates with one amplitude each, generic terms left out: what a plan asks about."""
    return tuple(c for c in candidates(bearing) if len(c.steps) == 1 and c.name not in TERMS)


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

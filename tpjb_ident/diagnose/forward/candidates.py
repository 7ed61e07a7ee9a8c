"""Candidates: every effect of the library as one number to fit, its discrete parameters spelt out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from model.bearing import Bearing
from model.effects import Effect, Parameter, known_effects


@dataclass(frozen=True)
class Candidate:
    """One effect with one free amplitude.

    Attributes
    ----------
    name : str
    parameter : Parameter
        The free one.
    fixed : mapping of str to float
        The others (pad number, direction).
    side : str
        ``"bearing"``, ``"structure"`` or ``"measurement"``.
    """

    name: str
    parameter: Parameter
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    side: str = "bearing"

    @property
    def label(self) -> str:
        """Name with its fixed parameters: ``soft_pivot pad 5``."""
        return " ".join([self.name, *(f"{k} {v:g}" for k, v in self.fixed.items())])

    @property
    def neutral(self) -> float:
        """Amplitude at which nothing happens, in the nearly linear form."""
        return self.parameter.to_linear(self.parameter.neutral)

    @property
    def bounds(self) -> tuple[float, float]:
        """Physical bounds of the amplitude, in the nearly linear form."""
        ends = sorted(self.parameter.to_linear(v) for v in (self.parameter.low, self.parameter.high))
        return ends[0], ends[1]

    @property
    def step(self) -> float:
        """A size that would not surprise."""
        return self.parameter.typical_step

    def effect(self, amplitude: float) -> Effect:
        """Build the effect with this amplitude (clipped to its bounds)."""
        low, high = self.bounds
        value = self.parameter.from_linear(min(max(amplitude, low), high))
        # inverse forms may round past their own bound
        value = min(max(value, self.parameter.low), self.parameter.high)
        return Effect(self.name, **{self.parameter.name: value, **self.fixed})


def candidates(bearing: Bearing, skip: frozenset[str] = frozenset()) -> tuple[Candidate, ...]:
    """List every effect of the library (registered ones too) for a bearing.

    Parameters
    ----------
    bearing : Bearing
        For the number of pads.
    skip : frozenset of str
        Names to leave out.
    """
    out: list[Candidate] = []
    for kind in known_effects().values():
        if kind.name in skip or kind.missing(bearing):
            continue
        free = [p for p in kind.parameters if p.neutral == p.neutral]
        choices: list[dict[str, float]] = [{}]
        for parameter in kind.parameters:
            if parameter in free:
                continue
            options = range(1, len(bearing.pads) + 1) if parameter.discrete else parameter.options
            choices = [{**c, parameter.name: v} for c in choices for v in options]
        if not free:  # one number per pad: no single amplitude
            continue
        # one amplitude per candidate: further continuous parameters stay neutral
        rest = {p.name: p.neutral for p in free[1:]}
        out += [Candidate(kind.name, free[0], {**c, **rest}, kind.side) for c in choices]
    return tuple(out)

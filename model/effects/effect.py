"""An effect with its parameters, and what a list of them makes of a `Setup`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from model.effects.kind import EffectError
from model.effects.registry import kind_of
from model.setup import Setup


@dataclass(frozen=True)
class Effect:
    """An effect with its parameters: ``Effect("soft_pivot", pad=5, stiffness_factor=0.3)``.

    Attributes
    ----------
    name : str
    parameters : mapping
        SI numbers by name.

    Raises
    ------
    EffectError
        Unknown effect or parameter, with the nearest known one.

    Examples
    --------
    >>> Effect("soft_pivot", pad=5, stiffness_factor=0.3)
    Effect('soft_pivot', pad=5, stiffness_factor=0.3)
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __init__(self, name: str, **parameters: Any) -> None:
        kind = kind_of(name)
        object.__setattr__(self, "name", kind.name)
        object.__setattr__(self, "parameters", MappingProxyType(kind.check(parameters)))

    def __reduce__(self) -> Any:
        return _rebuild, (self.name, dict(self.parameters))

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v:g}" for k, v in self.parameters.items())
        return f"Effect({self.name!r}{', ' if inside else ''}{inside})"

    def __hash__(self) -> int:
        return hash((self.name, tuple(sorted(self.parameters.items()))))


def _rebuild(name: str, parameters: dict[str, float]) -> Effect:
    return Effect(name, **parameters)


def apply_effects(setup: Setup, effects: Iterable[Effect]) -> Setup:
    """Apply effects one after the other."""
    pads = len(setup.bearing.pads)
    for effect in effects:
        kind = kind_of(effect.name)
        names = {p.name for p in kind.parameters_of(pads)}
        if set(effect.parameters) != names:
            raise EffectError(f"{effect.name}: the bearing has {pads} pads; give {', '.join(sorted(names))}.")
        if reason := kind.missing(setup.bearing):
            raise EffectError(f"{effect.name}: {reason}")
        pad = effect.parameters.get("pad")
        if pad is not None and pad > pads:
            raise EffectError(f"{effect.name}: pad {pad:g} does not exist; the bearing has {pads} pads.")
        setup = kind.apply(setup, **effect.parameters)
    return setup

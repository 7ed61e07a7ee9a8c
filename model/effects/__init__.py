"""The library of effects that a baseline model lacks (names and meanings: `docs/theory.md`).

To add one of your own, call `register` with an `EffectKind`: a name, its parameters and one
function that takes a `Setup` and returns a changed one.
"""

from model.effects.effect import Effect, apply_effects, load_effects
from model.effects.kind import EffectError, EffectKind, EffectWords, Parameter
from model.effects.registry import kind_of, known_effects, register

__all__ = [
    "Effect",
    "EffectError",
    "EffectKind",
    "EffectWords",
    "Parameter",
    "apply_effects",
    "kind_of",
    "known_effects",
    "load_effects",
    "register",
]

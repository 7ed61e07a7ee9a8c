"""What the model raises when it must refuse: one base, so that a caller needs to know one name.

Kinds of it stand with what they refuse: `model.bearing.BearingError`, `model.effects.EffectError`,
`model.units.UnitError`, `model.predict.OperatingPointError`.
"""

from __future__ import annotations


class ModelError(ValueError):
    """Something that the model was given cannot be used; the message says what, where and what to do."""


class OptionError(ModelError):
    """A mesh, a model of heat or cavitation, or another option that there is not; names the nearest there is."""

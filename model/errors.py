"""What the model raises when it must refuse: one base, so that a caller needs to know one name.

Kinds of it stand with what they refuse: `model.bearing.BearingError`, `model.effects.EffectError`,
`model.predict.OperatingPointError`.
"""

from collections.abc import Iterable

from rigdata.near_names import hint


class ModelError(ValueError):
    """Something that the model was given cannot be used; the message says what, where and what to do."""


class OptionError(ModelError):
    """A mesh, a model of heat or cavitation, or another option that there is not; names the nearest there is."""


def check_known(option: str, name: object, choices: Iterable[str]) -> None:
    """Refuse an option's value that there is not."""
    names = list(choices)
    if name not in names:
        raise OptionError(
            f"{option} must be one of {', '.join(names)}, got {name!r}. {hint(name, names, 'Use one of')}"
        )

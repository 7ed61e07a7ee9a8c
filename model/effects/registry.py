"""Which effects there are: one file each beside this one, and those that a user registers."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from pathlib import Path
from string import Formatter

from model.effects.kind import EffectError, EffectKind
from rigdata.near_names import hint

_registered: dict[str, EffectKind] = {}


@functools.cache
def _bundled() -> dict[str, EffectKind]:
    kinds: dict[str, EffectKind] = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        kind = getattr(importlib.import_module(f"model.effects.{module.name}"), "KIND", None)
        if isinstance(kind, EffectKind):
            kinds[kind.name] = kind
    return kinds


def known_effects() -> dict[str, EffectKind]:
    """Every effect by name: the bundled ones and those registered."""
    return {**_bundled(), **_registered}


def kind_of(name: str) -> EffectKind:
    """Look an effect up."""
    kinds = known_effects()
    if name not in kinds:
        raise EffectError(f"effect {name!r} is not known. {hint(name, sorted(kinds), 'Known effects:')}")
    return kinds[name]


def register(kind: EffectKind) -> EffectKind:
    """Add an effect of your own to the library.

    Parameters
    ----------
    kind : EffectKind
        Its name, parameters and function.

    Returns
    -------
    EffectKind
        The same, so that it may be bound to a name.

    Raises
    ------
    EffectError
        The name is taken by a bundled effect, or its words name a parameter that it has not.
    """
    if kind.name in _bundled():
        raise EffectError(f"effect {kind.name!r} is bundled; give yours another name.")
    if kind.words is not None:
        names = {p.name for p in (*kind.parameters, kind.per_pad) if p is not None}
        fields = {field for _, field, _, _ in Formatter().parse(kind.words.finding) if field is not None}
        if not fields <= names:
            raise EffectError(
                f"effect {kind.name!r}: its words name {', '.join(sorted(fields - names))}, no parameter."
            )
    _registered[kind.name] = kind
    return kind

"""The library of effects that a baseline model lacks (names and meanings: `physics.md`).

One effect, one file. To add one of your own, call `register` with an `EffectKind`: a name, its parameters and one
function that takes a `Setup` and returns a changed one.
"""

from __future__ import annotations

import difflib
import functools
import importlib
import pkgutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from model.effects.kind import Effect, EffectError, EffectKind, Parameter
from model.setup import Setup
from model.toml_text import parse_toml

__all__ = [
    "Effect",
    "EffectError",
    "EffectKind",
    "Parameter",
    "apply_effects",
    "kind_of",
    "known_effects",
    "load_effects",
    "register",
]

_registered: dict[str, EffectKind] = {}


@functools.cache
def _bundled() -> dict[str, EffectKind]:
    kinds = {}
    for module in pkgutil.iter_modules(__path__):
        if module.name != "kind":
            kind: EffectKind = importlib.import_module(f"{__name__}.{module.name}").KIND
            kinds[kind.name] = kind
    return kinds


def known_effects() -> dict[str, EffectKind]:
    """Every effect by name: the bundled ones and those registered."""
    return {**_bundled(), **_registered}


def kind_of(name: str) -> EffectKind:
    """Look an effect up.

    Raises
    ------
    EffectError
        Not known; names the nearest known one.
    """
    kinds = known_effects()
    if name not in kinds:
        near = difflib.get_close_matches(str(name), kinds, n=1)
        hint = f"Did you mean {near[0]!r}?" if near else f"Known effects: {', '.join(sorted(kinds))}."
        raise EffectError(f"effect {name!r} is not known. {hint}")
    return kinds[name]


def register(kind: EffectKind) -> EffectKind:
    """Add an effect of your own to the library.

    Raises
    ------
    EffectError
        The name is taken by a bundled effect.
    """
    if kind.name in _bundled():
        raise EffectError(f"effect {kind.name!r} is bundled; give yours another name.")
    _registered[kind.name] = kind
    return kind


def apply_effects(setup: Setup, effects: Iterable[Effect]) -> Setup:
    """Apply effects one after the other.

    Raises
    ------
    EffectError
        A pad number beyond the bearing's pads.
    """
    for effect in effects:
        pad = effect.parameters.get("pad")
        if pad is not None and pad > len(setup.bearing.pads):
            raise EffectError(
                f"{effect.name}: pad {pad:g} does not exist; the bearing has {len(setup.bearing.pads)} pads."
            )
        setup = kind_of(effect.name).apply(setup, **effect.parameters)
    return setup


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """Read an effects file: ``[[effects]]`` tables with ``name`` and the parameters.

    Parameters are SI numbers or quantities with units; further keys of a table (``lo``, ``hi``, ``prior``, ..) may
    stand in a sub-table and are not read.

    Raises
    ------
    EffectError
        Missing or broken file, unknown effect or parameter.
    """
    path = Path(path)
    try:
        if path.stat().st_size > 1_000_000:
            raise EffectError(f"{path.name}: larger than 1 MB. An effects file is a page of text; check the path.")
        data = parse_toml(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise EffectError(f"{path}: no such file. Give the path of an effects file (TOML).") from error
    except (OSError, ValueError) as error:  # not text, not TOML
        raise EffectError(f"{path}: cannot be read: {error}. Mend that line.") from error
    schema = data.get("schema", "tpjb-effects/1")
    if schema != "tpjb-effects/1":
        raise EffectError(f"{path.name}, schema: need 'tpjb-effects/1', got {schema!r}.")
    tables = data.get("effects", [])
    if not isinstance(tables, list):
        raise EffectError(f"{path.name}: 'effects' must be a list of tables. Write [[effects]].")
    return tuple(_read_effect(table, f"{path.name}, effect {i}") for i, table in enumerate(tables, start=1))


def _read_effect(table: Any, where: str) -> Effect:
    if not isinstance(table, dict) or not isinstance(table.get("name"), str):
        raise EffectError(f'{where}: has no name. Add name = "...".')
    parameters = {k: v for k, v in table.items() if k != "name" and not isinstance(v, dict)}
    try:
        return Effect(table["name"], **parameters)
    except ValueError as error:
        raise EffectError(f"{where}: {error}") from error

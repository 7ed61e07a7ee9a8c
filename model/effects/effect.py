"""An effect with its parameters, what a list of them makes of a `Setup`, and files of them (`tpjb-effects/1`, TOML)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from model.effects.kind import EffectError
from model.effects.registry import kind_of
from model.setup import Setup
from model.toml_text import read_page, read_table


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
        return partial(Effect, self.name, **self.parameters), ()

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v:g}" for k, v in self.parameters.items())
        return f"Effect({self.name!r}{', ' if inside else ''}{inside})"

    def __hash__(self) -> int:
        return hash((self.name, tuple(sorted(self.parameters.items()))))


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


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    r"""Read an effects file: ``[[effects]]`` tables with ``name`` and the parameters.

    Parameters are SI numbers or quantities with units; further keys of a table (``lo``, ``hi``, ``prior``, ..) may
    stand in a sub-table and are not read.

    Parameters
    ----------
    path : str or Path
        TOML file.

    Returns
    -------
    tuple of Effect
        In the order of the file.

    Raises
    ------
    EffectError
        Missing or broken file, unknown effect or parameter.

    Examples
    --------
    >>> text = '[[effects]]\nname = "pad_offset"\npad = 1\nradial_offset = "5 um"'
    >>> _ = Path("offset.toml").write_text(text)
    >>> load_effects("offset.toml")
    (Effect('pad_offset', pad=1, radial_offset=5e-06),)
    """
    path = Path(path)
    text = read_page(path, EffectError, "An effects file is a page of text", "Give the path of an effects file (TOML).")
    tables = read_table(text, path.name, "tpjb-effects/1", EffectError).get("effects", [])
    if not isinstance(tables, list):
        raise EffectError(f"{path.name}: 'effects' must be a list of tables. Write [[effects]].")
    return tuple(_read_effect(table, f"{path.name}, effect {i}") for i, table in enumerate(tables, start=1))


def _read_effect(table: Any, place: str) -> Effect:
    if not isinstance(table, dict) or not isinstance(table.get("name"), str):
        raise EffectError(f'{place}: has no name. Add name = "...".')
    entries = {key: value for key, value in table.items() if not isinstance(value, dict)}
    try:
        return Effect(**entries)
    except ValueError as error:
        raise EffectError(f"{place}: {error}") from error

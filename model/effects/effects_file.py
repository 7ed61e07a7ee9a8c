"""Effects files (`tpjb-effects/1`, TOML): what `predict --effects` reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from model.effects.effect import Effect
from model.effects.kind import EffectError
from model.toml_text import parse_toml


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


def _read_effect(table: Any, place: str) -> Effect:
    if not isinstance(table, dict) or not isinstance(table.get("name"), str):
        raise EffectError(f'{place}: has no name. Add name = "...".')
    parameters = {k: v for k, v in table.items() if k != "name" and not isinstance(v, dict)}
    try:
        return Effect(table["name"], **parameters)
    except ValueError as error:
        raise EffectError(f"{place}: {error}") from error

"""Which effects there are: those of `effects.toml`, and those that a user registers."""

from __future__ import annotations

import functools
import importlib.util
import tomllib
from collections.abc import Callable
from pathlib import Path
from string import Formatter
from typing import Any

from model.bearing import Bearing
from model.effects import bundled
from model.effects.kind import DIRECTION, PAD, EffectError, EffectKind, EffectWords, Parameter
from rigdata.near_names import hint

_registered: dict[str, EffectKind] = {}
#: Parameters that rows of the table name.
_SHARED = {"pad": PAD, "direction": DIRECTION}


@functools.cache
def _bundled() -> dict[str, EffectKind]:
    rows = tomllib.loads(Path(__file__).with_name("effects.toml").read_text(encoding="utf-8"))
    return {name: _kind(name, rows[name]) for name in sorted(rows)}


def _kind(name: str, row: dict[str, Any]) -> EffectKind:
    """An effect of its row in `effects.toml` and its function in `model.effects.bundled`."""
    words = EffectWords(row["finding"], row["physics"], row["on_the_rig"], row["check"])
    parameters = [_SHARED[p] if isinstance(p, str) else _parameter(p) for p in row.get("parameters", ())]
    per_pad = _parameter(row["per_pad"]) if "per_pad" in row else None
    obstacle = _only_on(row["pivots"], row["otherwise"]) if "pivots" in row else None
    apply = getattr(bundled, name)
    return EffectKind(name, row["side"], tuple(parameters), apply, row["source"], per_pad, obstacle, words)


def _parameter(row: dict[str, Any]) -> Parameter:
    return Parameter(**row | {"options": tuple(row.get("options", ()))})


def _only_on(kinds: list[str], otherwise: str) -> Callable[[Bearing], str]:
    """Which pivots have what an effect acts on: rockers roll, spheres slide, knife edges only tilt."""

    def obstacle(bearing: Bearing) -> str:
        if not bearing.like_pivots:
            return "its pivots differ from pad to pad, and the model holds the tilt of all pads alike."
        return "" if bearing.pivot.kind in kinds else otherwise

    return obstacle


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


def load_library(path: str | Path) -> tuple[EffectKind, ...]:
    """Run a Python file and register every `EffectKind` that it defines."""
    path = Path(path)
    spec = importlib.util.spec_from_file_location(f"effects_of_{path.stem}", path) if path.is_file() else None
    if spec is None or spec.loader is None:
        raise EffectError(f"{path}: no such Python file. Give the path of a .py file that defines effects.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise EffectError(f"{path}: fails with {type(error).__name__}: {error}. Mend it.") from error
    defined = dict.fromkeys(v for v in vars(module).values() if isinstance(v, EffectKind))
    kinds = tuple(k for k in defined if known_effects().get(k.name) is not k)
    if not kinds:
        raise EffectError(f"{path}: defines no effect. Make an EffectKind with a name of its own.")
    return tuple(register(kind) for kind in kinds)

"""Which effects there are: those of the files beside this one, and those that a user registers."""

import functools
import importlib
import importlib.util
import pkgutil
from pathlib import Path
from string import Formatter
from types import ModuleType

from model.effects.kind import EffectError, EffectKind
from rigdata.near_names import hint

_registered: dict[str, EffectKind] = {}


@functools.cache
def _bundled() -> dict[str, EffectKind]:
    kinds = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        for kind in _defined(importlib.import_module(f"model.effects.{module.name}")):
            kinds[kind.name] = kind
    return dict(sorted(kinds.items()))


def _defined(module: ModuleType) -> tuple[EffectKind, ...]:
    return tuple(dict.fromkeys(v for v in vars(module).values() if isinstance(v, EffectKind)))


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
    kinds = tuple(k for k in _defined(module) if known_effects().get(k.name) is not k)
    if not kinds:
        raise EffectError(f"{path}: defines no effect. Make an EffectKind with a name of its own.")
    for kind in kinds:
        register(kind)
    return kinds

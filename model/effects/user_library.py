"""Effects from a user's own file: an explicit choice, since the file's code is run."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from model.effects.kind import EffectError, EffectKind
from model.effects.registry import known_effects, register


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
    kinds = tuple(dict.fromkeys(v for v in vars(module).values() if isinstance(v, EffectKind)))
    kinds = tuple(k for k in kinds if known_effects().get(k.name) is not k)
    if not kinds:
        raise EffectError(f"{path}: defines no effect. Make an EffectKind with a name of its own.")
    return tuple(register(kind) for kind in kinds)

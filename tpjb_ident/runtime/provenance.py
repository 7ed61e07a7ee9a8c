"""Where a result comes from: versions and fingerprints, and the JSON files that we wrote and read back."""

import functools
import hashlib
import json
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tpjb_ident.errors import BadInputError

_PACKAGES = ("tpjb-ident", "numpy", "scipy", "pandas", "statsmodels", "h5py", "numba", "matplotlib")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    import importlib.metadata  # with the mail parser behind it, an eighth of what help waits for

    installed = {"python": platform.python_version(), "platform": platform.system()}
    for package in _PACKAGES:
        try:
            installed[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            installed[package] = "not installed"
    return installed


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@functools.cache
def source_stamp() -> str:
    """SHA-256 of the versions of all packages and of our sources, the model's apart.

    Kept results of other code count for nothing.
    """
    import importlib.util

    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for package in ("rigdata", "tpjb_ident"):
        spec = importlib.util.find_spec(package)
        for folder in sorted(spec.submodule_search_locations or ()) if spec else ():
            for source in sorted(Path(folder).rglob("*.py")):
                digest.update(source.relative_to(folder).as_posix().encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()


Document = dict[str, Any]
#: Larger documents are refused before they are read [bytes].
_LARGEST = 2**26


def _run_from_1(document: Document) -> Document:
    """Version 1 did not tell the options as they were typed from the settings that they became."""
    commands = document.get("commands")
    for entry in commands.values() if isinstance(commands, dict) else ():
        settings = entry.get("settings") if isinstance(entry, dict) else None
        if isinstance(settings, dict) and isinstance(places := entry.get("inputs_at"), dict):
            # a file without a place of its own is one that the campaign carries: nobody typed it
            typed = {}
            for key, value in settings.items():
                if key in places or not str(value).endswith(".toml"):
                    typed[key] = value
            entry.setdefault("options", typed)
    return document


#: Kind of document: one step per version before today's, so that today's version is their number plus one.
_STEPS: dict[str, tuple[Callable[[Document], Document], ...]] = {"tpjb-run": (_run_from_1,), "tpjb-check": ()}
#: Version of all tables: stated in run.json and in the metadata of Parquet files.
TABLE_SCHEMA = "tpjb-tables/1"


def schema(kind: str) -> str:
    """Today's schema of a kind of document."""
    return f"{kind}/{len(_STEPS[kind]) + 1}"


def read_document(path: Path, kind: str) -> Document:
    """Content of a JSON file as of today's version; refused where it is none, or of a newer one."""
    remedy = f"Give the folder as tpjb wrote it, or run the command again; {schema(kind)} is read"
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"larger than {_LARGEST >> 20} MB")
        document = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BadInputError(f"{path}: cannot be read as JSON ({error}). {remedy}.") from error
    version = document.get("schema") if isinstance(document, dict) else None
    steps = _STEPS[kind]
    versions = [f"{kind}/{number}" for number in range(1, len(steps) + 2)]
    if version not in versions:
        raise BadInputError(f"{path}: its schema is {str(version)[:40]!r}. {remedy} and what is older.")
    for step in steps[versions.index(version) :]:
        document = step(document)
    return dict(document)

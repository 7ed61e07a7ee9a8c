"""Pad solutions kept between processes: a few files in the user's cache folder, and never a reason to fail."""

import hashlib
import logging
import os
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray

_LOG = logging.getLogger(__name__)
_MOST = 200_000_000  # bytes of all files
_SOURCES = ("line", "mesh", "operators", "block_cholesky")


def cache_folder() -> Path | None:
    """Folder for pad solutions."""
    chosen = os.environ.get("TPJB_CACHE")
    if chosen is not None:
        return None if chosen.strip().lower() in {"", "off"} else Path(chosen)
    try:
        home = Path.home()
    except RuntimeError:  # no home folder: a service account
        return None
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "tpjb-ident"


def storage_key(subject: object) -> str:
    """Hash of `what` (by its repr) and of the solver's source, so that neither can change unnoticed."""
    return hashlib.sha256(f"{_source_digest()}{subject!r}".encode()).hexdigest()[:32]


@cache
def _source_digest() -> str:
    digest = hashlib.sha256()
    for name in _SOURCES:
        digest.update(Path(__file__).with_name(f"{name}.py").read_bytes())
    return digest.hexdigest()


def load_arrays(key: str, names: Iterable[str]) -> dict[str, FloatArray] | None:
    """Arrays stored under `key`, or None if there are none, or none of these names and finite."""
    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"pad-{key}.npz"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: np.asarray(stored[name], dtype=float) for name in names}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile) as error:
        _LOG.info("%s is unreadable (%s); solving again.", path, error)
        return None
    if not all(np.isfinite(array).all() for array in arrays.values()):
        _LOG.info("%s does not hold what its name promises; solving again.", path)
        return None
    return arrays


def save_arrays(key: str, arrays: Mapping[str, FloatArray]) -> bool:
    """Store arrays whole or not at all; a folder that cannot be written leaves the solution in memory only."""
    folder = cache_folder()
    if folder is None:
        return False
    temporary: Path | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix="pad-", suffix=".tmp", dir=folder)
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        temporary.replace(folder / f"pad-{key}.npz")
        _prune(folder)
    except OSError as error:
        _LOG.info("Pad solution not stored in %s: %s", folder, error)
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        return False
    return True


def _prune(folder: Path) -> None:
    """Remove all but the newest files: a sweep over geometries must not fill a disk."""
    latest = time.time() + 60.0  # what is later was stored while the clock was ahead: it must not outlive all others
    files = [(path.stat(), path) for path in folder.glob("pad-*.npz")]
    files.sort(key=lambda pair: pair[0].st_mtime if pair[0].st_mtime < latest else 0.0, reverse=True)
    size = 0
    for state, path in files:
        size += state.st_size
        if size > _MOST:
            path.unlink(missing_ok=True)

"""Where a result comes from: versions of everything that computed it, fingerprints of what it was computed from."""

from __future__ import annotations

import functools
import hashlib
import json
import platform
from pathlib import Path

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
def source_stamp(packages: tuple[str, ...] = ("rigdata", "tpjb_ident")) -> str:
    """SHA-256 of the versions of all packages and of the sources of some.

    Kept results of other code count for nothing.
    """
    import importlib.util

    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for package in packages:
        spec = importlib.util.find_spec(package)
        for folder in sorted(spec.submodule_search_locations or ()) if spec else ():
            for source in sorted(Path(folder).rglob("*.py")):
                digest.update(source.relative_to(folder).as_posix().encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()

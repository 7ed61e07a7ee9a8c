"""File names from a manifest, which a stranger may have written: kept inside the campaign folder."""

import re
from pathlib import Path, PureWindowsPath

from rigdata.problem import refuse

_DRIVE = re.compile(r"^[A-Za-z]:|^[\\/]{2}")
_MAX_NAME = 1000


def inside(folder: Path, name: str, file: str, place: str, run: str | None = None) -> Path:
    r"""Resolve `name` below `folder`."""
    target = folder
    fault = ""
    parts = name.replace("\\", "/").split("/")
    if not name.strip() or len(name) > _MAX_NAME or not name.isprintable():
        fault = "is empty, too long or holds control characters"
    elif _DRIVE.match(name) or name.startswith(("/", "\\", "~")) or PureWindowsPath(name).drive:
        fault = "is not relative"
    elif ".." in parts:
        fault = "leaves the campaign folder by '..'"
    else:
        root = folder.resolve()
        try:
            target = root.joinpath(*parts).resolve()
        except (OSError, RuntimeError) as error:  # a loop of symlinks
            fault = f"cannot be resolved ({type(error).__name__})"
        else:
            fault = "" if target.is_relative_to(root) else "leaves the campaign folder by a symlink"
    if fault:
        cure = "Give a path relative to the campaign folder, inside it"
        raise refuse(file, place, f"file {name[:120]!a} {fault}", cure, run)
    return target

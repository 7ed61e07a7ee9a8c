"""File names from a manifest, which a stranger may have written: kept inside the campaign folder."""

from __future__ import annotations

import re
from pathlib import Path, PureWindowsPath

from rigdata.problem import Problem, RigDataError

_DRIVE = re.compile(r"^[A-Za-z]:|^[\\/]{2}")
_MAX_NAME = 1000


def inside(folder: Path, name: str, file: str, place: str, run: str | None = None) -> Path:
    r"""Resolve `name` below `folder`."""

    def refuse(why: str) -> RigDataError:
        cure = "Give a path relative to the campaign folder, inside it"
        return RigDataError(Problem("error", file, place, f"file {name[:120]!a} {why}", cure, run))

    if not name.strip() or len(name) > _MAX_NAME or not name.isprintable():
        raise refuse("is empty, too long or holds control characters")
    if _DRIVE.match(name) or name.startswith(("/", "\\", "~")) or PureWindowsPath(name).drive:
        raise refuse("is not relative")
    parts = name.replace("\\", "/").split("/")
    if ".." in parts:
        raise refuse("leaves the campaign folder by '..'")
    root = folder.resolve()
    try:
        target = root.joinpath(*parts).resolve()
    except (OSError, RuntimeError) as error:  # a loop of symlinks
        raise refuse(f"cannot be resolved ({type(error).__name__})") from error
    if not target.is_relative_to(root):
        raise refuse("leaves the campaign folder by a symlink")
    return target

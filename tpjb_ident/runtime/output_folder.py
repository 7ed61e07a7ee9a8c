"""The output folder of a command: written whole or not at all, and never among somebody's raw data."""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.locks import hold, is_abandoned, locked, release
from tpjb_ident.runtime.publish import RECORD, flush, former_runs, move_in

__all__ = ["RECORD", "former_runs", "output_folder"]

#: Full: the disk, the user's share of it, or the largest file that the system allows.
_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}


@contextlib.contextmanager
def output_folder(out: Path, command: str, inputs: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Give a temporary folder to fill; move its content to `out` when the block ends well."""
    target = _checked(out, inputs)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.part-"))
    except OSError as error:
        raise BadInputError(f"--out {out}: cannot be made ({error.strerror or error}). Give another folder.") from error
    lock = hold(staging)
    _clear_abandoned(target)
    try:
        yield staging
        staging.chmod(0o755)
        _bring(staging, target, command)
    except OSError as error:
        if error.errno is None or error.errno not in _FULL:
            raise
        why = os.strerror(error.errno)  # libraries wrap it into words of their own
        raise BadInputError(
            f"--out {out}: {why}; nothing was written. Make room on the disk or give a folder on another one."
        ) from error
    finally:
        release(lock)
        if staging.exists():
            shutil.rmtree(staging)


def _bring(staging: Path, target: Path, command: str) -> None:
    """Give the results their place: a new folder in one step, an existing one under its lock."""
    if not target.exists():
        flush(staging)
        with contextlib.suppress(OSError):  # another run has made it in this moment
            staging.rename(target)
            flush(target.parent, deep=False)
            return
    with locked(target):
        move_in(staging, target, command)


def _clear_abandoned(target: Path) -> None:
    """Delete what killed runs into the same folder have left beside it."""
    for rest in target.parent.glob(f".{glob.escape(target.name)}.part-*"):
        if is_abandoned(rest):
            shutil.rmtree(rest, ignore_errors=True)  # whoever else clears it at the same time may be quicker


def _checked(out: Path, inputs: tuple[Path, ...]) -> Path:
    target = out.resolve()
    if target.exists() and not target.is_dir():
        raise BadInputError(f"--out {out}: is a file. Give a folder.")
    for folder in (target, *target.parents):
        if (folder / "campaign.toml").exists():
            raise BadInputError(f"--out {out}: {folder} holds a campaign's raw data. Give a folder outside it.")
    for source in inputs:
        real = source.resolve()
        if real.is_dir() and (target == real or real in target.parents):
            raise BadInputError(f"--out {out}: lies inside the campaign {source}, whose raw data stays untouched. "
                           "Give a folder outside it.")  # fmt: skip
    return target

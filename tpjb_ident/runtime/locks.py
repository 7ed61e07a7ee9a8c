"""Locks on folders that the system drops when a process ends, however it ends."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: no advisory locks on folders; two runs into one folder then rely on renames alone
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder` while the block runs; wait for whoever has it."""
    handle = _open(folder, wait=True)
    try:
        yield
    finally:
        release(handle)


def hold(folder: Path) -> int | None:
    """Take the lock of a folder that nobody else knows yet; give it to `release`."""
    return _open(folder, wait=False)


def release(handle: int | None) -> None:
    """Drop a lock."""
    if handle is not None:
        os.close(handle)


def is_abandoned(folder: Path) -> bool:
    """Whether the process that held the lock of `folder` is gone; False where that cannot be told."""
    if fcntl is None:
        return False
    try:
        handle = _open(folder, wait=False)
    except OSError:  # held, or gone by now
        return False
    release(handle)
    return True


def _open(folder: Path, wait: bool) -> int | None:
    if fcntl is None:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BaseException as error:
        os.close(handle)
        if isinstance(error, OSError) and wait:  # a file system without locks, as some network shares
            return None
        raise
    return handle

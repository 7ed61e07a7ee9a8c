"""When a record has landed: nobody has written to it for a while, and nobody did while it was read."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class FileState:
    """What tells whether a file is still the one that was read."""

    size: int
    changed: int
    node: int


def file_state(path: Path) -> FileState | None:
    """State of an ordinary file; None where there is none, or none that may be looked at."""
    try:
        found = path.stat()
    except OSError:
        return None
    return FileState(found.st_size, found.st_mtime_ns, found.st_ino) if path.is_file() else None


class Landings:
    """Follows files until they rest."""

    def __init__(
        self,
        settle: float,
        clock: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settle, self._clock, self._steady = settle, clock, steady
        self._since: dict[Path, tuple[FileState, float]] = {}

    def look(self, paths: Iterable[Path]) -> tuple[dict[Path, FileState], list[Path]]:
        """Files at rest with their state, and those that are still being written.

        An empty file is still being written: a logger has opened it and holds the samples back.
        """
        resting: dict[Path, FileState] = {}
        moving: list[Path] = []
        now = self._steady()
        for path in paths:
            state = file_state(path)
            if state is None:
                self._since.pop(path, None)
                continue
            before = self._since.get(path)
            if before is None or before[0] != state:
                # a file that was finished before we first looked need not be waited for
                age = self._clock() - 1e-9 * state.changed if before is None else 0.0
                self._since[path] = (state, now - max(0.0, age))
            if state.size > 0 and now - self._since[path][1] >= self._settle:
                resting[path] = state
            else:
                moving.append(path)
        return resting, moving

"""Threads of linear algebra: what its libraries read when they are loaded, and how they are told later."""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: Functions of OpenBLAS by the names that its builds give them.
_NAMES = tuple(f"{a}openblas_{{}}_num_threads{b}" for a in ("scipy_", "") for b in ("64_", ""))


@functools.cache
def _loaded() -> tuple[tuple[Callable[[], int], Callable[[int], None]], ...]:
    """Getter and setter of every OpenBLAS in this process; none where the system does not list what is loaded."""
    maps = Path("/proc/self/maps")
    if not maps.exists():
        return ()
    lines = maps.read_text(encoding="utf-8", errors="replace").splitlines()
    paths = dict.fromkeys(line.split(maxsplit=5)[-1] for line in lines if "openblas" in line)
    limits = []
    for path in paths:
        try:
            library = ctypes.CDLL(path)
        except OSError:  # replaced on disk since it was loaded
            continue
        for name in _NAMES:
            if hasattr(library, name.format("set")):
                limits.append((getattr(library, name.format("get")), getattr(library, name.format("set"))))
                break
    return tuple(limits)


def limit_threads(count: int = 1) -> None:
    """Let linear algebra that is loaded take so many threads.

    The variables of the environment act on libraries that are loaded later: numpy is there before any worker is, and
    processes that are forked have what their parent has.
    """
    for _, limit in _loaded():
        limit(count)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes share the cores already: linear algebra with threads of its own would only be in the way, here too."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    numbers = [asked() for asked, _ in _loaded()]
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    limit_threads()
    try:
        yield
    finally:
        for (_, limit), number in zip(_loaded(), numbers, strict=True):
            limit(number)
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value

"""Columns of record files that were read last, as many as memory allows; one for all readers of a campaign."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Protocol

#: Parsed columns kept by a campaign before the oldest run is let go [bytes].
CACHE_BYTES = 96 * 2**20
_MAX_DIALECTS = 10_000


class _Sized(Protocol):
    @property
    def nbytes(self) -> int:
        """Memory taken [bytes]."""


class TableCache:
    """Parsed tables and dialects of a campaign's files, the last used ones, up to a number of bytes."""

    def __init__(self, limit: int = CACHE_BYTES) -> None:
        self._limit = limit
        self._tables: OrderedDict[tuple[object, ...], _Sized] = OrderedDict()
        self._dialects: dict[tuple[object, ...], Any] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[TableCache], tuple[int]]:
        return TableCache, (self._limit,)  # a worker process starts with an empty one

    def get(self, key: tuple[object, ...]) -> Any:
        """Give the table under `key`, None where it is not kept."""
        with self._lock:
            table = self._tables.get(key)
            if table is not None:
                self._tables.move_to_end(key)
            return table

    def put(self, key: tuple[object, ...], table: _Sized) -> None:
        """Keep `table`, letting go of the longest unused ones."""
        with self._lock:
            self._tables[key] = table
            self._tables.move_to_end(key)
            size = sum(t.nbytes for t in self._tables.values())
            while size > self._limit and len(self._tables) > 1:
                _, old = self._tables.popitem(last=False)
                size -= old.nbytes

    def dialect(self, key: tuple[object, ...], find: Callable[[], Any]) -> Any:
        """Give the dialect under `key`, found once."""
        known = self._dialects.get(key)
        if known is None:
            known = find()
            with self._lock:
                if len(self._dialects) >= _MAX_DIALECTS:
                    self._dialects.clear()
                self._dialects[key] = known
        return known

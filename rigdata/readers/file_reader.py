"""A record in a file that is parsed as a whole: text, or the format of a logger, each read by its own library.

The libraries are extras: ``pip install "tpjb-ident[tdms]"``. What they raise on a broken file becomes a `RigDataError`
that names the file. What was parsed is cached, the last used of a campaign, as much as memory allows.
"""

from __future__ import annotations

import importlib
import stat
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.device import Grid
from rigdata.near_names import hint
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import FORMATS, RecordFile, RunReader, suffix_hint
from rigdata.readers.series import Contents, Layout, Series, arranged, table, with_unique_names

#: Larger files of a logger's format are rejected: they are read whole [bytes].
LARGEST = 2**31
#: Parsed columns cached by a campaign before the oldest run is let go [bytes].
_CACHE_BYTES = 96 * 2**20
_Value = TypeVar("_Value")


class ReadingCache:
    """Contents of a campaign's files, the last used ones, up to a number of bytes."""

    def __init__(self, limit: int = _CACHE_BYTES) -> None:
        self._limit = limit
        self._entries: OrderedDict[tuple[object, ...], Any] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[ReadingCache], tuple[int]]:
        return ReadingCache, (self._limit,)  # a worker process starts with an empty one

    def get(self, key: tuple[object, ...], make: Callable[[], _Value]) -> _Value:
        """Give the value under `key`, made where it is not cached; the longest unused ones go."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
                cached: _Value = self._entries[key]
                return cached
        value = make()
        with self._lock:
            self._entries[key] = value
            while self.nbytes > self._limit and len(self._entries) > 1:
                self._entries.popitem(last=False)
        return value

    @property
    def nbytes(self) -> int:
        """Memory taken by all columns [bytes]."""
        return sum(int(getattr(value, "nbytes", 0)) for value in self._entries.values())


def read_series(path: Path, file: str) -> list[Series]:
    """Read every channel of a file without a manifest, each at its own times."""
    return list(read_contents(RecordFile(path, file)).series)


def read_contents(record: RecordFile) -> Contents:
    """Read the channels of a file, each at its own times."""
    path, again = record.path, "Export or copy it again from the logger"
    if not path.is_file():
        raise record.refuse("", "the file is not there", "Restore it, or delete the run")
    size = path.stat().st_size
    if size == 0:
        raise record.refuse("", "is empty", again)
    name, function, extra = FORMATS.get(path.suffix.lower(), ("", "", ""))
    if name and size > LARGEST:
        raise record.refuse("", f"is larger than {LARGEST >> 30} GB", "Split the run")
    try:
        if name:
            contents = Contents(getattr(importlib.import_module(f"rigdata.readers.{name}"), function)(path))
        else:
            contents = importlib.import_module("rigdata.readers.text.csv").read_text(record)
    except RigDataError as error:
        remedy = suffix_hint(path)
        problems = [replace(p, file=record.file, cure=remedy or p.cure, run=record.run) for p in error.problems]
        raise RigDataError(problems) from error
    except ModuleNotFoundError as error:
        fault = f"{path.suffix} files need the library {error.name}, which is not installed"
        raise record.refuse("", fault, f'Install it with: pip install "tpjb-ident[{extra}]"') from error
    except MemoryError as error:  # of a file that is small enough: it claims more than it holds
        remedy = "Export or copy it again, or split the run"
        raise record.refuse("", "claims more data than fit in memory", remedy) from error
    except (PermissionError, UnicodeError) as error:
        raise record.refuse("", f"cannot be read ({error})", "Check the file and its rights") from error
    except Exception as error:  # whatever another library raises on a broken file: it is the file's fault here
        fault = f"cannot be read as {path.suffix.lstrip('.').upper()} ({type(error).__name__}: {str(error)[:120]})"
        raise record.refuse("", fault, again) from error
    contents = table(contents, record.channels, record.stated_rate)
    if not contents.series:
        raise record.refuse("", "holds no channel of numbers", "Export the run again, with its channels")
    return contents


@dataclass(frozen=True)
class FileReader(RunReader):
    """One run's file; it is parsed when something of it is asked for."""

    cache: ReadingCache = field(default_factory=ReadingCache, repr=False, compare=False)

    def _signature(self) -> tuple[Path, int, int, str | None]:
        """A key that changes when the file does, so that the cache never serves an old one."""
        try:
            state = self.path.stat()
        except OSError as error:
            raise self.refuse("", "the file is not there", "Restore it, or delete the run") from error
        if not stat.S_ISREG(state.st_mode):
            raise self.refuse("", "is not an ordinary file", "Name a record in the manifest")
        return self.path, state.st_size, state.st_mtime_ns, self.run

    def _layout(self) -> Layout:
        """All channels at their own times."""
        return self.cache.get(self._signature(), self._arranged)

    def _arranged(self) -> Layout:
        contents = read_contents(self)
        layout = arranged(with_unique_names(contents.series), self.channels, self.stated_rate, self.file, self.run)
        return replace(layout, unread=contents.unread, problems=contents.problems)

    def _grids(self) -> Sequence[Grid]:
        return self._layout().grids

    def _faults(self) -> Mapping[str, RigDataError]:
        return self._layout().faults

    def _clock_times(self, clock: str, start: int, stop: int) -> FloatArray:
        return self._layout().times[clock][start:stop].copy()

    def read_device(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of channels of one device, (stop - start,) each."""
        layout = self._layout()
        for name in names:
            if name not in layout.values:
                held = [column.partition(" [")[0] for column in (*layout.values, *layout.unread)]
                raise self.refuse(f"channel {name}", "is missing in the file", hint(name, held, "It holds:")[:220])
        return [np.asarray(layout.values[name][start:stop], dtype=float) for name in names]

    def problems(self) -> tuple[Problem, ...]:
        """What was repaired while parsing, units other than the manifest's, and channels that nobody describes."""
        layout = self._layout()
        members = "columns" if layout.unread else "channels"
        return (*layout.problems, *self._notes(members, (*layout.values, *layout.unread), layout.units))

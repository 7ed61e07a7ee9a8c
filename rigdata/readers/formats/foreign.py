"""Records in the formats of other loggers, each read by its own well-kept library, all through one reader.

The libraries are extras: ``pip install "tpjb-ident[tdms]"``. What they raise on a broken file becomes a `RigDataError`
that names the file.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import FORMATS, missing_channel, rate_of_time, suffix_hint, undescribed
from rigdata.readers.series import Columns, Series, on_one_clock
from rigdata.readers.table_cache import TableCache

#: Larger files are refused: these formats are read whole [bytes].
LARGEST = 2**31
_TEXT = (".asc", ".txt")


def is_foreign(path: Path) -> bool:
    """Whether a record is for this reader: by its suffix, or a text file with several time bases."""
    if path.suffix.lower() in FORMATS:
        return True
    if path.suffix.lower() not in _TEXT or not path.is_file():
        return False
    from rigdata.readers.text.catman import has_several_clocks

    return has_several_clocks(path)


def read_foreign(path: Path, file: str, run: str | None = None) -> list[Series]:
    """Read every channel of a file, each on its own clock."""

    def refuse(what: str, cure: str) -> RigDataError:
        return RigDataError(Problem("error", file, "", what, cure, run))

    if not path.is_file():
        raise refuse("the file is not there", "Restore it, or delete the run")
    if path.stat().st_size == 0:
        raise refuse("is empty", "Export or copy it again from the logger")
    if path.stat().st_size > LARGEST:
        raise refuse(f"is larger than {LARGEST >> 30} GB", "Split the run")
    name, extra = FORMATS.get(path.suffix.lower(), ("text.catman", ""))
    module = importlib.import_module(f"rigdata.readers.{name}")
    try:
        series: list[Series] = module.read_series(path)
    except RigDataError as error:
        hint = suffix_hint(path)
        named = [Problem(p.severity, file, p.place, p.what, hint or p.cure, run) for p in error.problems]
        raise RigDataError(named) from error
    except ModuleNotFoundError as error:
        what = f"{path.suffix} files need the library {error.name}, which is not installed"
        raise refuse(what, f'Install it with: pip install "tpjb-ident[{extra}]"') from error
    except MemoryError as error:  # of a file that is small enough: it claims more than it holds
        raise refuse("claims more data than fit in memory", "Export or copy it again, or split the run") from error
    except Exception as error:  # whatever another library raises on a broken file: it is the file's fault here
        what = f"cannot be read as {path.suffix.lstrip('.').upper()} ({type(error).__name__}: {str(error)[:120]})"
        raise refuse(what, "Export or copy it again from the logger") from error
    if not series:
        raise refuse("holds no channel of numbers", "Export the run again, with its channels")
    return series


@dataclass(frozen=True)
class ForeignReader:
    """One run's file in a foreign format."""

    path: Path
    file: str
    run: str
    described: frozenset[str] = field(default=frozenset(), repr=False)
    stated_rate: float | None = None
    cache: TableCache = field(default_factory=TableCache, repr=False, compare=False)

    def _error(self, place: str, what: str, cure: str) -> RigDataError:
        return RigDataError(Problem("error", self.file, place, what, cure, self.run))

    def _columns(self) -> Columns:
        try:
            state = self.path.stat()
        except OSError as error:
            raise self._error("", "the file is not there", "Restore it, or delete the run") from error
        key = (self.path, state.st_size, state.st_mtime_ns)
        known = self.cache.get(key)
        if known is None:
            known = on_one_clock(read_foreign(self.path, self.file, self.run), self.file, self.run)
            self.cache.put(key, known)
        return known

    def names(self) -> tuple[str, ...]:
        """Names of all channels."""
        return tuple(self._columns().values)

    def length(self) -> int:
        """Count the samples per channel."""
        return self._columns().length

    def rate(self) -> float:
        """Give the sample rate [Hz]: the file's, else the manifest's."""
        time = self._columns().time
        rate = rate_of_time(time) if time is not None else float("nan")
        if rate > 0:
            return rate
        if self.stated_rate is None:
            raise self._error("", "the file knows no times", "Add sample_rate to the run or to [acquisition]")
        return self.stated_rate

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`."""
        values = self._columns().values
        for name in names:
            if name not in values:
                raise self._error(*missing_channel(name, values, "It holds"))
        return [np.asarray(values[name][start:stop], dtype=float) for name in names]

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds: the file's own, else counted from the rate."""
        time = self._columns().time
        return np.arange(start, stop) / self.rate() if time is None else time[start:stop].copy()

    def problems(self) -> tuple[Problem, ...]:
        """Tell which channels nobody describes, and what was interpolated."""
        columns = self._columns()
        cure = "Nothing, if that is meant"
        notes = tuple(Problem("note", self.file, "", note, cure, self.run) for note in columns.notes)
        extra = [n for n in columns.values if n not in self.described]
        return (*notes, *undescribed(extra, "channels", self.file, self.run))

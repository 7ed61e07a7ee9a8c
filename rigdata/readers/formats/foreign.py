"""Records in the formats of other loggers, each read by its own well-kept library, all through one reader.

The libraries are extras: ``pip install "tpjb-ident[tdms]"``. What they raise on a broken file becomes a `RigDataError`
that names the file.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from rigdata.calibration import Channel
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import FORMATS, suffix_hint, undescribed
from rigdata.readers.cached_reader import CachedReader
from rigdata.readers.grids import Layout, arranged, table
from rigdata.readers.series import Series, with_unique_names
from rigdata.stated_units import unit_problems

#: Larger files are rejected: these formats are read whole [bytes].
LARGEST = 2**31


def is_foreign(path: Path) -> bool:
    """Whether a record is for this reader, by its suffix."""
    return path.suffix.lower() in FORMATS


def read_foreign(
    path: Path,
    file: str,
    run: str | None = None,
    channels: Mapping[str, Channel] | None = None,
    stated_rate: float | None = None,
) -> list[Series]:
    """Read every channel of a file, each at its own times."""
    again = "Export or copy it again from the logger"
    if not path.is_file():
        raise refuse(file, "", "the file is not there", "Restore it, or delete the run", run)
    if path.stat().st_size == 0:
        raise refuse(file, "", "is empty", again, run)
    if path.stat().st_size > LARGEST:
        raise refuse(file, "", f"is larger than {LARGEST >> 30} GB", "Split the run", run)
    name, extra = FORMATS.get(path.suffix.lower(), ("text.catman", ""))
    module = importlib.import_module(f"rigdata.readers.{name}")
    try:
        series: list[Series] = module.read_series(path)
    except RigDataError as error:
        hint = suffix_hint(path)
        raise RigDataError([replace(p, file=file, cure=hint or p.cure, run=run) for p in error.problems]) from error
    except ModuleNotFoundError as error:
        fault = f"{path.suffix} files need the library {error.name}, which is not installed"
        raise refuse(file, "", fault, f'Install it with: pip install "tpjb-ident[{extra}]"', run) from error
    except MemoryError as error:  # of a file that is small enough: it claims more than it holds
        remedy = "Export or copy it again, or split the run"
        raise refuse(file, "", "claims more data than fit in memory", remedy, run) from error
    except Exception as error:  # whatever another library raises on a broken file: it is the file's fault here
        fault = f"cannot be read as {path.suffix.lstrip('.').upper()} ({type(error).__name__}: {str(error)[:120]})"
        raise refuse(file, "", fault, again, run) from error
    if not series:
        raise refuse(file, "", "holds no channel of numbers", "Export the run again, with its channels", run)
    return table(series, channels or {}, stated_rate)


class ForeignReader(CachedReader):
    """One run's file in a foreign format."""

    def _layout(self) -> Layout:
        return self.cache.get(self._signature(), self._arranged)

    def _arranged(self) -> Layout:
        series = read_foreign(self.path, self.file, self.run, self.channels, self.stated_rate)
        return arranged(with_unique_names(series), self.channels, self.stated_rate, self.file, self.run)

    def names(self) -> tuple[str, ...]:
        """Names of all channels."""
        return tuple(self._layout().values)

    def problems(self) -> tuple[Problem, ...]:
        """Which channels nobody describes, and which state another unit than the manifest."""
        extra = [name for name in self.names() if name not in self.channels]
        units = unit_problems(self.channels, self._layout().units, self.file, self.run)
        return (*units, *self._other_devices(), *undescribed(extra, "channels", self.file, self.run))

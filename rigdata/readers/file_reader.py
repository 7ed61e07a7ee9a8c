"""A record in a file that is parsed as a whole: text, or the format of a logger, each read by its own library.

The libraries are extras: ``pip install "tpjb-ident[tdms]"``. What they raise on a broken file becomes a `RigDataError`
that names the file. What was parsed is cached, the last used of a campaign, as much as memory allows.
"""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.device import RATE_MISS, Grid, timed_grid
from rigdata.near_names import hint
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import FORMATS, Layout, RecordFile, RunReader, suffix_hint
from rigdata.readers.series import SAME_STEP, Contents, is_time, table, with_unique_names
from rigdata.units import TIME_FACTORS

#: Larger files of a logger's format are rejected: they are read whole [bytes].
LARGEST = 2**31
_MOST_TIMES = 1000


def read_contents(record: RecordFile) -> Contents:
    """Read the channels of a file, each at its own times."""
    path, again = record.path, "Export or copy it again from the logger"
    if not path.is_file():
        fault = "is not an ordinary file" if path.exists() else "the file is not there"
        raise record.refuse("", fault, "Restore it, or delete the run")
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
    except Exception as error:  # whatever another library raises on a broken file: it is the file's fault here
        fault = f"cannot be read as {path.suffix.lstrip('.').upper()} ({type(error).__name__}: {str(error)[:120]})"
        if isinstance(error, MemoryError):  # of a file that is small enough
            fault = "claims more data than fit in memory"
        raise record.refuse("", fault, f"{again}, and check its rights") from error
    contents = table(contents, record)
    if not contents.series:
        raise record.refuse("", "holds no channel of numbers", "Export the run again, with its channels")
    return contents


@dataclass(frozen=True)
class _Columns(Layout):
    """All channels of a file at their own times."""

    values: Mapping[str, FloatArray]
    times: Mapping[str, FloatArray]  #: by clock, s
    units: Mapping[str, str]  #: as the file states them
    unread: tuple[str, ...]  #: columns that nobody describes
    problems: tuple[Problem, ...]

    @property
    def nbytes(self) -> int:
        """Size of all channels [bytes]."""
        return sum(array.nbytes for array in (*self.values.values(), *self.times.values()))


@dataclass(frozen=True)
class FileReader(RunReader):
    """One run's file; it is parsed when something of it is asked for."""

    def _read_layout(self) -> _Columns:
        return self._arranged(read_contents(self))

    def _arranged(self, contents: Contents) -> _Columns:
        series = with_unique_names(contents.series)
        faults = {}
        timings = {}
        times: dict[str, FloatArray] = {}
        values, units = {}, {}
        for channel in series:
            name, time = channel.name, channel.time
            values[name], units[name] = channel.values, channel.unit
            if time is None:
                timings[name] = Grid(len(channel))
                continue
            wrong = ~np.isfinite(time)
            wrong[1:] |= np.diff(time) < 0
            if wrong.any():
                fault = f"its times have gaps or run backwards (sample {np.argmax(wrong) + 1})"
                remedy = "Sort or split the run, or export without times"
                faults[name] = self.refuse(f"channel {name}", fault, remedy)
                continue
            clock = next((key for key, shared in times.items() if _alike(shared, time)), f"times {len(times) + 1}")
            times.setdefault(clock, time)
            if len(times) > _MOST_TIMES:
                raise self.refuse("", f"has more than {_MOST_TIMES} different times", "Split the run")
            grid = timed_grid(len(channel), clock, times[clock], channel.group, self.stated_rate)
            self._refuse_other_unit(contents.clocks, grid.rate)
            label = grid.label if is_time(grid.label) else f"{grid.rate:.6g} Hz"
            timings[name] = replace(grid, label=label)
        remedy = "Export it with its times, or correct sample_rate"
        grids, untimed = self._planned(timings, self.stated_rate, "channel", remedy)
        faults |= untimed
        if not grids:
            problems: list[Problem] = []
            for error in faults.values():
                problems += error.problems
            raise RigDataError(problems)
        return _Columns(grids, faults, values, times, units, contents.unread, contents.problems)

    def _refuse_other_unit(self, clocks: Mapping[str, str], rate: float) -> None:
        """Refuse times of no stated unit that miss the stated rate by what another unit differs from a second."""
        ratio = (self.stated_rate or 0.0) / rate
        slips = (abs(ratio * factor - 1.0) <= RATE_MISS for factor in {*TIME_FACTORS.values()} - {1.0})
        if not any(clocks.values()) and any(slips):
            raise self.refuse(
                f"column {', '.join(clocks)}",
                f"its times, taken for seconds, make {rate:.4g} Hz, sample_rate is {self.stated_rate:g} Hz",
                'State their unit: [channels.NAME] with quantity = "time", or give the run its own sample_rate',
            )

    def _clock_times(self, clock: str, start: int, stop: int) -> FloatArray:
        return np.array(self._layout().times[clock][start:stop])

    def _stored(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
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


def _alike(time: FloatArray, reference: FloatArray) -> bool:
    """Whether two channels are sampled at the same times."""
    if time is reference or len(time) != len(reference):
        return time is reference
    step = (reference[-1] - reference[0]) / max(len(reference) - 1, 1) if len(reference) else 0.0
    return bool(np.all(np.abs(time - reference) <= SAME_STEP * step))

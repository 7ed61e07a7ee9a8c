"""Find the records in a folder and read them without a manifest."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata.campaign import inside
from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import FORMATS, TEXT, RecordFile
from rigdata.readers.file_reader import read_contents
from rigdata.readers.series import Series, with_unique_names
from rigdata.readers.text.head import find_head
from rigdata.survey.channels import Entry, Tables
from rigdata.units import TIME_FACTORS

_MOST_FILES = 5000
#: Slower records of a whole folder are none of a turning shaft [Hz].
_SLOWEST = 20.0


@dataclass(frozen=True)
class Export:
    """One record file as it was found."""

    name: str
    series: tuple[Series, ...]
    clocks: Mapping[str, str] = field(default_factory=dict)  #: unit of every time column, by name; "" if not stated
    nameless: int = 0

    @property
    def states_times(self) -> bool:
        """Whether it has no time column, or one of its time columns a unit."""
        return not self.clocks or any(self.clocks.values())

    @property
    def rate(self) -> float:
        """Rate of the fastest channel [Hz]; NaN if the file knows no times."""
        return max((s.rate for s in self.series if s.rate > 0), default=np.nan)


def record_files(folder: Path) -> list[Path]:
    """List files below `folder` that may be records, by suffix, in order of name."""
    records = records_below(folder)
    if not records:
        raise refuse(str(folder), "", "holds no records", f"Known are {', '.join((*TEXT, *FORMATS))}")
    return records


def records_below(folder: Path) -> list[Path]:
    """Files below `folder` that may be records, none among them; hidden ones are left alone."""
    suffixes = (*TEXT, *FORMATS)
    records = []
    for path in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.suffix.lower() in suffixes and path.is_file() and not hidden:
            records.append(path)
        if len(records) > _MOST_FILES:
            raise refuse(str(folder), "", f"holds more than {_MOST_FILES} records", "Give a folder below")
    return records


def read_export(path: Path, name: str | None = None, names: Sequence[str] = ()) -> Export:
    """Read one record file of any known kind, without a manifest; `names` are of columns that have none."""
    record, nameless = RecordFile(path, name or path.name), 0
    if path.suffix.lower() in TEXT:
        head = find_head(record)
        if not head.header_line:
            record, nameless = replace(record, spec=CsvSpec(names=tuple(names))), len(head.names)
    contents = read_contents(record)
    series, clocks = tuple(with_unique_names(contents.series)), contents.clocks
    times = next((s for s in series if _counts_evenly(s)), None)
    if nameless and not clocks and times is not None:
        series = tuple(replace(s, time=times.values) for s in series if s is not times)
        clocks = {times.name: ""}
    return Export(record.file, series, clocks, nameless)


def in_seconds(exports: Sequence[Export], described: Tables) -> tuple[list[Export], dict[str, Entry]]:
    """Exports and the units of their time columns; one that the file does not state is the manifest's, or guessed.

    Nobody records a rig slower than the shaft turns: times that would say so are thousandths or millionths.
    """
    unstated = [export for export in exports if not export.states_times]
    rate = max((export.rate for export in unstated), default=np.nan)
    units, open_ = {}, set()
    for export in exports:
        for name, clock_unit in export.clocks.items():
            units[name] = Entry(clock_unit, "file")
            if not export.states_times:
                open_.add(name)
    typed = {described[name].get("unit") for name in open_ if name in described}
    likely = next((unit for unit in ("s", "ms", "us") if rate / TIME_FACTORS[unit] >= _SLOWEST), "s")
    unit = next((unit for unit in TIME_FACTORS if unit in typed), likely)
    source = "file" if typed or unit == "s" else "guess"
    units |= dict.fromkeys(open_, Entry(unit, source, f"not stated: as seconds it would be {rate:.3g} Hz"))
    return [export if export.states_times or unit == "s" else _scaled(export, unit) for export in exports], units


def _scaled(export: Export, unit: str) -> Export:
    """An export with its times from this unit to seconds."""
    scaled = {id(s.time): s.time * TIME_FACTORS[unit] for s in export.series if s.time is not None}
    return replace(export, series=tuple(replace(s, time=scaled.get(id(s.time))) for s in export.series))


def _counts_evenly(series: Series) -> bool:
    """Whether a nameless column rises in equal steps, as times do and nothing that is measured."""
    steps = np.diff(series.values)
    mean = steps.mean() if len(steps) > 8 else 0.0
    return mean > 0 and bool(np.all(np.abs(steps - mean) < 0.1 * mean))


def read_exports(folder: Path, problems: list[Problem], names: Sequence[str] = ()) -> Iterator[Export]:
    """Read all records of a folder one by one; what cannot be read is noted in `problems` and left out."""
    for path in record_files(folder):
        name = path.relative_to(folder).as_posix()
        try:
            yield read_export(inside(folder, name, name, ""), name, names)
        except RigDataError as error:
            problems.extend(error.problems)

"""Find the records in a folder and read them without a manifest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import FORMATS, TEXT, RecordFile, suffix_hint
from rigdata.readers.file_reader import read_contents
from rigdata.readers.series import Series, with_unique_names
from rigdata.readers.text.head import find_head
from rigdata.safe_path import inside

_MOST_FILES = 5000


@dataclass(frozen=True)
class Export:
    """One record file as it was found."""

    name: str
    series: tuple[Series, ...] = field(repr=False)
    clock: str = ""
    nameless: int = 0

    @property
    def rate(self) -> float:
        """Rate of the fastest channel [Hz]; NaN if the file knows no times."""
        rates = [s.rate for s in self.series if s.rate > 0]
        return max(rates, default=float("nan"))


def record_files(folder: Path) -> list[Path]:
    """List files below `folder` that may be records, by suffix, in order of name."""
    records = records_below(folder)
    if not records:
        unlisted = [p for p in sorted(folder.rglob("*")) if p.is_file() and not p.name.startswith(".")][:1]
        hint = suffix_hint(unlisted[0]) if unlisted else f"known are {', '.join((*TEXT, *FORMATS))}"
        remedy = f"{unlisted[0].name}: {hint}" if unlisted else hint.capitalize()
        raise refuse(str(folder), "", "holds no records", remedy)
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
    series, clock = tuple(with_unique_names(contents.series)), contents.clock
    times = next((s for s in series if _counts_evenly(s)), None)
    if nameless and not clock and times is not None:
        series = tuple(replace(s, time=times.values) for s in series if s is not times)
        clock = times.name
    return Export(record.file, series, clock, nameless)


def _counts_evenly(series: Series) -> bool:
    """Whether a nameless column rises in equal steps, as times do and nothing that is measured."""
    steps = np.diff(series.values)
    mean = float(steps.mean()) if len(steps) > 8 else 0.0
    return mean > 0 and bool(np.all(np.abs(steps - mean) < 0.1 * mean))


def read_exports(folder: Path, problems: list[Problem], names: Sequence[str] = ()) -> Iterator[Export]:
    """Read all records of a folder one by one; what cannot be read is noted in `problems` and left out."""
    for path in record_files(folder):
        name = path.relative_to(folder).as_posix()
        try:
            yield read_export(inside(folder, name, name, ""), name, names)
        except RigDataError as error:
            problems.extend(error.problems)

"""Runs in CSV files: parsed by pyarrow in blocks, bad cells named by line and column, cached while memory allows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError, Severity
from rigdata.readers.base import MAX_SAMPLES, suffix_hint, undescribed
from rigdata.readers.cached_reader import CachedReader
from rigdata.readers.grids import Layout, arranged, table, time_columns
from rigdata.readers.series import Columns, Series, seconds, to_temporary_file
from rigdata.readers.text.byte_stream import all_lines, is_ascii_based, open_numbers
from rigdata.readers.text.cells import MISSING, is_missing, is_number, is_stamp, number_pattern, stamp_seconds
from rigdata.readers.text.head import Head, find_head, split_line
from rigdata.stated_units import unit_problems

#: A file above this size is parsed column by column, not all channels at once [bytes].
_LARGE_FILE = 2**29
#: Lines longer than this are rejected [bytes].
_BLOCK = 2**22
#: Faults that are listed, and odd lines that are counted.
_LISTED, _MOST_ODD = 5, 1000


@dataclass(frozen=True)
class CsvReader(CachedReader):
    """One run's CSV file."""

    spec: CsvSpec = field(default_factory=CsvSpec)

    def _head(self) -> Head:
        try:
            return self.cache.get(
                (*self._signature(), "head"),
                lambda: find_head(self.path, self.file, self.run, self.spec, self.channels),
            )
        except RigDataError as error:
            hint = suffix_hint(self.path)
            if not hint:
                raise
            raise RigDataError([replace(p, cure=hint) for p in error.problems]) from error
        except (OSError, UnicodeError) as error:
            fault = f"cannot be read ({getattr(error, 'strerror', error)})"
            raise self._refuse("", fault, "Check the file and its rights") from error

    def names(self) -> tuple[str, ...]:
        """Names of all columns, "" where one has none."""
        return self._head().names

    def _columns(self, names: Sequence[str]) -> Columns:
        signature = self._signature()
        is_large = signature[1] > _LARGE_FILE
        key = (*signature, *names) if is_large else signature
        return self.cache.get(key, lambda: self._parsed(names if is_large else None))

    def _used(self, names: Sequence[str]) -> list[str]:
        """Those of the columns that are used."""
        used = {name for name, channel in self.channels.items() if channel.quantity != "ignore"}
        wanted = [name for name in names if name in used]
        if not wanted:
            fault = "holds none of the channels that are used"
            raise self._refuse("", fault, "Check the channels' names")
        return wanted

    def _parsed(self, names: Sequence[str] | None) -> Columns:
        """All channels that are used; of a large file one, for the number of samples, and `names`."""
        head, clock = self._head(), self._clock()
        clock_name = "" if clock is None else clock.name
        wanted = self._used(head.names)
        if clock_name in head.names and clock_name not in wanted:
            wanted.append(clock_name)
        if names is not None:
            first = clock_name if clock_name in wanted else wanted[0]
            wanted = [name for name in wanted if name == first or name in names]
        return self._read_table(head, clock_name, wanted)

    def _read_table(self, head: Head, clock_name: str, wanted: Sequence[str]) -> Columns:
        try:
            return read_table(Source(self.path, self.file, self.run, head, clock_name), wanted)
        except OSError as error:
            fault = f"cannot be read ({error})"
            raise self._refuse("", fault, "Check the file and its rights") from error

    def _time_columns(self) -> list[int]:
        """Places of the columns of times; one that nobody describes counts where nothing else tells the times."""
        head = self._head()
        places = [i for i in time_columns(head.names, self.channels) if i not in head.dates]
        is_needed = len(places) > 1 or self.stated_rate is None
        return [i for i in places if is_needed or head.names[i] in self.channels]

    def _clock(self) -> Channel | None:
        """The one time column."""
        head = self._head()
        for i in self._time_columns():
            name, unit = head.names[i], head.units[i]
            return self.channels.get(name) or Channel(name, "time", unit, float(seconds(np.ones(1), unit)[0]))
        return next((c for c in self.channels.values() if c.quantity == "time"), None)

    def _layout(self) -> Layout | None:
        """Columns at several times: several time columns, or channels with a clock's times or a rate of their own."""
        return self.cache.get((*self._signature(), "layout"), self._arranged)

    def _arranged(self) -> Layout | None:
        head, clocks = self._head(), self._time_columns()
        known = [channel for name, channel in self.channels.items() if name in head.names]
        has_rates = any(c.sample_rate for c in known if c.quantity not in ("time", "ignore"))
        has_letter = any(c.quantity == "time" and c.clock for c in known)
        if len(clocks) < 2 and not has_rates and not has_letter:
            return None
        used = self._used(head.names)
        places = [i for i, name in enumerate(head.names) if name in used or i in clocks]
        labels = tuple(name if head.names.count(name) < 2 else f"{name} ({i + 1})" for i, name in enumerate(head.names))
        wanted = [labels[i] for i in places]
        is_large = self._signature()[1] > _LARGE_FILE
        columns: dict[str, FloatArray] = {}
        problems: tuple[Problem, ...] = ()
        for names in [[label] for label in wanted] if is_large else [wanted]:
            parsed = self._read_table(replace(head, names=labels), "", names)
            columns.update({name: to_temporary_file(values) for name, values in parsed.values.items()})
            problems = problems or parsed.problems
        series = [Series(head.names[i], head.units[i], columns[labels[i]]) for i in places]
        series = table(series, self.channels, self.stated_rate)
        return replace(arranged(series, self.channels, self.stated_rate, self.file, self.run), problems=problems)

    def _times(self) -> FloatArray | None:
        clock = self._clock()
        if clock is None:
            return None
        if self.stated_rate is not None and clock.name not in self._columns((clock.name,)).values:
            return None
        return self.cache.get((*self._signature(), "seconds"), lambda: self._usable_times(clock))

    def _usable_times(self, clock: Channel) -> FloatArray:
        """The time column, missing times filled in between."""
        (raw,) = self.read([clock.name], 0, self.length())
        times = clock.to_si(raw)
        place = f"column {clock.name}"
        usable = np.flatnonzero(np.isfinite(times))
        if len(usable) < min(2, len(times)):
            raise self._refuse(place, "holds no times", "Set its quantity to ignore")
        if len(usable) < len(times):
            times = np.interp(np.arange(len(times)), usable, times[usable])
        back = np.flatnonzero(np.diff(times) < 0)
        if len(back):
            before, after = times[back[0]], times[back[0] + 1]
            place = f"line {self._head().data_line + int(back[0]) + 1}, {place}"
            fault = f"time runs backwards ({before:g} s, then {after:g} s)"
            raise self._refuse(place, fault, "Sort or split the run")
        return times

    def problems(self) -> tuple[Problem, ...]:
        """What was repaired while parsing, and which columns nobody describes."""
        head, layout = self._head(), self._layout()
        known = {*self.channels, *(head.names[i] for i in self._time_columns())}
        extra = [name for name in head.names if name and name not in known]
        repaired = self._columns(()).problems if layout is None else layout.problems
        units = unit_problems(self.channels, dict(zip(head.names, head.units, strict=True)), self.file, self.run)
        return (*repaired, *units, *self._other_devices(), *undescribed(extra, "columns", self.file, self.run))


@dataclass(frozen=True)
class Source:
    """A CSV file and how to speak of it; `clock` names its time column, if any."""

    path: Path
    file: str
    run: str | None
    head: Head = field(repr=False)
    clock: str = ""

    def problem(self, severity: Severity, place: str, fault: str, remedy: str) -> Problem:
        """Something wrong with the file."""
        return Problem(severity, self.file, place, fault, remedy, self.run)

    def refuse(self, place: str, fault: str, remedy: str) -> RigDataError:
        """The error that stops the reading of the file."""
        return RigDataError(self.problem("error", place, fault, remedy))

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line number, from 1, and cells of every line of samples that is not blank."""
        for number, line in enumerate(all_lines(self.path, self.head.encoding), start=1):
            cells = split_line(line, self.head.delimiter) if number >= self.head.data_line else []
            if cells:
                yield number, cells


def read_table(source: Source, names: Sequence[str]) -> Columns:
    """Parse the columns `names`."""
    import pyarrow as pa

    try:
        columns, odd_lines = _parse(source, names, numbers=True)
    except pa.ArrowInvalid:
        if not source.head.decimal_certain:
            head = replace(source.head, decimal=",", decimal_certain=True)
            return read_table(replace(source, head=head), names)
        # Rare spellings of numbers, or text: as text once more, to repair the first and to locate the second.
        columns, odd_lines = _parse(source, names, numbers=False)
    length = _length_without_empty_tail(columns, source.clock)
    problems = _judge_odd_lines(source, odd_lines) if odd_lines else ()
    if not odd_lines and length and _is_cut_inside_last_cell(source):
        length -= 1
        fault = "the last line is cut off inside its last number; taken without that line"
        problems = (_cut_off(source, "last line", fault),)
    columns = {name: column[:length] for name, column in columns.items()}
    for column in columns.values():
        column.setflags(write=False)
    return Columns(columns, problems=problems)


def _length_without_empty_tail(columns: dict[str, FloatArray], clock: str) -> int:
    """Leave out lines at the end that hold not even a time, as spreadsheets write them."""
    whole = length = len(next(iter(columns.values())))
    while length > 0 and clock in columns and all(np.isnan(c[length - 1]) for c in columns.values()):
        length -= 1
    return length or whole


def _options(source: Source, names: Sequence[str], numbers: bool, odd_lines: list[int]) -> dict[str, Any]:
    import pyarrow as pa
    import pyarrow.csv as pv

    head = source.head
    labels = [f"c{i}" for i in range(len(head.names))]  # names of a file need not be unique or present
    types = {}
    for name in names:
        index = head.names.index(name)
        types[labels[index]] = pa.float64() if numbers and index not in head.stamps else pa.string()

    def note(row: Any) -> str:
        if row.text.strip() and len(odd_lines) < _MOST_ODD:
            odd_lines.append(row.actual_columns)
        return "skip"

    delimiter = "\t" if head.delimiter == " " else head.delimiter
    return {
        "read_options": pv.ReadOptions(
            use_threads=numbers, block_size=_BLOCK, column_names=labels, skip_rows=head.data_line - 1
        ),
        "parse_options": pv.ParseOptions(delimiter=delimiter, invalid_row_handler=note),
        "convert_options": pv.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=list(MISSING),
            strings_can_be_null=False,
            decimal_point=head.decimal,
            check_utf8=False,
        ),
    }


def _parse(source: Source, names: Sequence[str], numbers: bool) -> tuple[dict[str, FloatArray], list[int]]:
    """Columns by name, and the number of cells of each line with a wrong one."""
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.csv as pv

    head = source.head
    stamped = {n for n in names if head.names.index(n) in head.stamps}
    odd_lines: list[int] = []
    parts: dict[str, list[Any]] = {n: [np.empty(0)] for n in names}
    bad: set[str] = set()
    length = 0
    with open_numbers(source.path, head.encoding, head.delimiter) as stream:
        try:
            for batch in pv.open_csv(stream, **_options(source, names, numbers, odd_lines)):
                length += batch.num_rows
                if length > MAX_SAMPLES:
                    raise source.refuse("", "has too many lines", "Split the run")
                for name, column in zip(names, batch.columns, strict=True):
                    if name in stamped:
                        column = pc.ascii_trim_whitespace(column)
                    elif not numbers:
                        column, is_sound = _to_numbers(column, head.decimal)
                        bad |= set() if is_sound else {name}
                    parts[name].append(np.array(column.to_pylist(), object) if name in stamped else _values(column))
        except pa.ArrowInvalid as error:
            if numbers:
                raise
            fault = f"cannot be parsed ({str(error).splitlines()[0][:160]})"
            raise source.refuse("", fault, "Export the run again") from error
    columns = {name: np.concatenate(column) for name, column in parts.items()}
    for name in stamped:
        cells = [None if cell is None or is_missing(cell) else cell for cell in columns[name]]
        columns[name], count = stamp_seconds(cells)
        bad |= {name} if count else set()
    if bad:
        raise RigDataError(_locate_text(source, [name for name in names if name in bad]))
    return columns, odd_lines


def _values(column: Any) -> FloatArray:
    """Readings of a column, NaN where there is none; `to_numpy` would import pandas in every worker."""
    import pyarrow as pa
    import pyarrow.compute as pc

    numbers = pc.fill_null(column.cast(pa.float64()), float("nan"))
    return np.frombuffer(numbers.buffers()[1], np.float64, len(numbers), 8 * numbers.offset)


def _to_numbers(column: Any, decimal: str) -> tuple[Any, bool]:
    """Numbers from cells as text, blanks around them and a leading plus taken; and whether all others are missing."""
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pc.ascii_trim_whitespace(column)
    missing = pc.is_in(text, value_set=pa.array(MISSING))
    good = pc.match_substring_regex(text, number_pattern(decimal))
    is_sound = pc.all(pc.or_(missing, good)).as_py() is not False
    text = pc.replace_substring(pc.replace_substring_regex(text, r"^\+", ""), decimal, ".")
    return pc.if_else(good, text, None).cast(pa.float64()), is_sound


def _locate_text(source: Source, names: Sequence[str]) -> list[Problem]:
    """Name the first line on which each of the columns `names` holds text."""
    head = source.head
    places: dict[str, tuple[int, str]] = {}
    counts = dict.fromkeys(names, 0)
    for number, cells in source.rows():
        if len(cells) != len(head.names):
            continue
        for name in names:
            index = head.names.index(name)
            cell = cells[index]
            is_good = is_stamp(cell) if index in head.stamps else is_number(cell, head.decimal)
            if not (is_good or is_missing(cell)):
                counts[name] += 1
                places.setdefault(name, (number, cell[:40]))
    remedy = "Delete or repair these cells; an empty cell counts as missing"
    problems = []
    for name in names:
        index = head.names.index(name)
        number, cell = places.get(name, (head.data_line, "?"))
        more = f", and in {counts[name] - 1} more lines" if counts[name] > 1 else ""
        kind = "time stamp" if index in head.stamps else "number"
        place = f"line {number}, column {index + 1} ({name})"
        problems.append(source.problem("error", place, f"{cell!r} is not a {kind}{more}", remedy))
    return problems


def _cut_off(source: Source, place: str, fault: str) -> Problem:
    return source.problem("warning", place, fault, "Copy the file again from the rig")


def _judge_odd_lines(source: Source, odd_lines: list[int]) -> tuple[Problem, ...]:
    """Take a file whose last line is cut off, reject other lines with a wrong number of cells."""
    width = len(source.head.names)
    wrong: list[tuple[int, int]] = []
    last = 0
    for last, cells in source.rows():
        if len(cells) != width and len(wrong) < _MOST_ODD:
            wrong.append((last, len(cells)))
    if len(odd_lines) == 1 and len(wrong) == 1 and wrong[0][0] == last and wrong[0][1] < width:
        fault = f"the last line is cut off ({wrong[0][1]} of {width} cells); taken without that line"
        return (_cut_off(source, f"line {last}", fault),)
    remedy = "Check [csv] delimiter and decimal, or repair the line"
    problems = []
    for number, count in wrong[:_LISTED]:
        fault = f"has {count} cells, the names have {width}"
        problems.append(source.problem("error", f"line {number}", fault, remedy))
    if not problems:
        raise source.refuse("", f"{len(odd_lines)} lines have a wrong number of cells", remedy)
    raise RigDataError(problems)


def _is_cut_inside_last_cell(source: Source) -> bool:
    """Whether the last line has no end and its last number fewer decimals than the lines before."""
    head = source.head
    if not is_ascii_based(head.encoding.removesuffix("-sig")):
        return False
    with source.path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 65536))
        tail = stream.read()
    if not tail or tail.endswith((b"\n", b"\r")):
        return False
    lines = [line for line in tail.decode(head.encoding, "replace").splitlines() if line.strip()]
    rows = [split_line(line, head.delimiter) for line in lines[-6:]]
    decimals = [_decimals(row[-1], head.decimal) for row in rows if len(row) == len(head.names)]
    *usual, last = decimals or [0]
    return len(usual) >= 2 and len(set(usual)) == 1 and last < usual[0]


def _decimals(cell: str, decimal: str) -> int:
    _, mark, digits = cell.partition(decimal)
    return len(digits) if mark else -1

"""Text files as columns of numbers: parsed by pyarrow in blocks, bad cells named by line and column."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import OVERFLOW
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import MAX_SAMPLES, RecordFile
from rigdata.readers.series import Contents, GrowingChannel, Series, is_time, time_columns
from rigdata.readers.text.cells import (
    MISSING,
    all_lines,
    is_ascii_based,
    is_missing,
    is_number,
    is_stamp,
    number_pattern,
    open_numbers,
    stamp_seconds,
)
from rigdata.readers.text.head import Head, find_head, plain_name, split_line

#: Lines longer than this are rejected [bytes].
_BLOCK = 2**22
#: Faults that are listed, and odd lines that are counted.
_LISTED, _MOST_ODD = 5, 1000


@dataclass(frozen=True)
class Source:
    """A text file and how it is written."""

    record: RecordFile
    head: Head = field(repr=False)

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line number, from 1, and cells of every line of samples that is not blank."""
        for number, line in enumerate(all_lines(self.record.path, self.head.encoding), start=1):
            cells = split_line(line, self.head.delimiter) if number >= self.head.data_line else []
            if cells:
                yield number, cells


def read_text(record: RecordFile) -> Contents:
    """Read the columns of a text file that the manifest uses; without one, all that hold numbers."""
    head = find_head(record)
    if not record.channels:
        head = replace(head, names=tuple(map(plain_name, head.names)))
    source, names = Source(record, head), head.names
    clocks = _clocks(source)
    places = _used(source, clocks)
    columns, problems = read_table(source, places)
    length = _length_without_empty_tail(columns, clocks)
    if len(clocks) == 1:
        _check_times(source, clocks[0], columns[clocks[0]][:length])
    units = ["s" if i in head.stamps else unit for i, unit in enumerate(head.units)]
    series = [Series(names[i], units[i], columns[i][:length], None, f"column {i + 1}") for i in places]
    if not record.channels:
        series = [column for column in series if column.name and np.isfinite(column.values).any()]
        if all(is_time(column.name) for column in series):
            raise record.refuse("", "holds no column of numbers", "Export the run again")
    described = {*record.channels, *(names[i] for i in clocks)}
    unread = tuple(name for name in names if name and name not in described) if record.channels else ()
    return Contents(series, unread=unread, problems=problems)


def _clocks(source: Source) -> list[int]:
    """Places of the time columns; one that nobody describes counts where nothing else tells the times."""
    names, record = source.head.names, source.record
    places = [i for i in time_columns(names, record.channels) if i not in source.head.dates]
    is_needed = len(places) > 1 or record.stated_rate is None
    return [i for i in places if is_needed or names[i] in record.channels]


def _used(source: Source, clocks: Sequence[int]) -> list[int]:
    """Places of the columns that are used; without a manifest all but dates."""
    record, head = source.record, source.head
    if not record.channels:
        return [i for i in range(len(head.names)) if i not in head.dates]
    used = {name for name, channel in record.channels.items() if channel.quantity != "ignore"}
    if not used.intersection(head.names):
        raise record.refuse("", "holds none of the channels that are used", "Check the channels' names")
    return [i for i, name in enumerate(head.names) if name in used or i in clocks]


def _length_without_empty_tail(columns: dict[int, FloatArray], clocks: Sequence[int]) -> int:
    """Samples without those at the end that hold not even a time, as spreadsheets write them."""
    whole = length = len(next(iter(columns.values())))
    while clocks and length > 0 and all(np.isnan(column[length - 1]) for column in columns.values()):
        length -= 1
    return length or whole


def _check_times(source: Source, clock: int, times: FloatArray) -> None:
    """Refuse the only time column, by its line, where it holds no times or runs backwards."""
    place = f"column {source.head.names[clock]}"
    usable = np.flatnonzero(np.abs(times) < OVERFLOW)
    if len(usable) < min(2, len(times)):
        raise source.record.refuse(place, "holds no times", "Set its quantity to ignore")
    back = np.flatnonzero(np.diff(times[usable]) < 0)
    if len(back):
        before, after = usable[back[0]], usable[back[0] + 1]
        place = f"line {source.head.data_line + int(after)}, {place}"
        fault = f"time runs backwards ({times[before]:g}, then {times[after]:g})"
        raise source.record.refuse(place, fault, "Sort or split the run")


def read_table(source: Source, places: Sequence[int]) -> tuple[dict[int, FloatArray], tuple[Problem, ...]]:
    """Parse the columns at `places`; what was repaired is told."""
    import pyarrow as pa

    try:
        columns, odd_lines = _parse(source, places, numbers=True)
    except pa.ArrowInvalid:
        if not source.head.decimal_certain:
            head = replace(source.head, decimal=",", decimal_certain=True)
            return read_table(replace(source, head=head), places)
        # Rare spellings of numbers, or text: as text once more, to repair the first and to locate the second.
        columns, odd_lines = _parse(source, places, numbers=False)
    if odd_lines:
        return columns, _judge_odd_lines(source, odd_lines)
    if not len(columns[places[0]]) or not _is_cut_inside_last_cell(source):
        return columns, ()
    fault = "the last line is cut off inside its last number; taken without that line"
    whole = {place: column[:-1] for place, column in columns.items()}
    return whole, (_cut_off(source, "last line", fault),)


def _options(source: Source, places: Sequence[int], numbers: bool, odd_lines: list[int]) -> dict[str, Any]:
    import pyarrow as pa
    import pyarrow.csv as pv

    head = source.head
    labels = [f"c{i}" for i in range(len(head.names))]  # names of a file need not be unique or present
    types = {labels[i]: pa.float64() if numbers and i not in head.stamps else pa.string() for i in places}

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


def _parse(source: Source, places: Sequence[int], numbers: bool) -> tuple[dict[int, FloatArray], list[int]]:
    """Columns by place, and the number of cells of each line with a wrong one."""
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.csv as pv

    head, record = source.head, source.record
    odd_lines: list[int] = []
    stamps: dict[int, list[str | None]] = {i: [] for i in places if i in head.stamps}
    bad: set[int] = set()
    length = 0
    with ExitStack() as files:
        stream = files.enter_context(open_numbers(record.path, head.encoding, head.delimiter))
        numeric = {i: files.enter_context(GrowingChannel()) for i in places if i not in head.stamps}
        try:
            for batch in pv.open_csv(stream, **_options(source, places, numbers, odd_lines)):
                length += batch.num_rows
                if length > MAX_SAMPLES:
                    raise record.refuse("", "has too many lines", "Split the run")
                for i, column in zip(places, batch.columns, strict=True):
                    if i in head.stamps:
                        stamps[i] += pc.ascii_trim_whitespace(column).to_pylist()
                        continue
                    if not numbers:
                        column, is_sound = _to_numbers(column, head.decimal)
                        bad |= set() if is_sound else {i}
                    numeric[i].write(_values(column).tobytes())
        except pa.ArrowInvalid as error:
            if numbers:
                raise
            fault = f"cannot be parsed ({str(error).splitlines()[0][:160]})"
            raise record.refuse("", fault, "Export the run again") from error
        columns = {i: channel.values() for i, channel in numeric.items()}
    for i, cells in stamps.items():
        columns[i], count = stamp_seconds([None if cell is None or is_missing(cell) else cell for cell in cells])
        bad |= {i} if count else set()
    if bad:
        raise RigDataError(_locate_text(source, sorted(bad)))
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


def _locate_text(source: Source, places: Sequence[int]) -> list[Problem]:
    """Name the first line on which each of the columns at `places` holds text."""
    head = source.head
    first: dict[int, tuple[int, str]] = {}
    counts = dict.fromkeys(places, 0)
    for number, cells in source.rows():
        if len(cells) != len(head.names):
            continue
        for i in places:
            is_good = is_stamp(cells[i]) if i in head.stamps else is_number(cells[i], head.decimal)
            if not (is_good or is_missing(cells[i])):
                counts[i] += 1
                first.setdefault(i, (number, cells[i][:40]))
    remedy = "Delete or repair these cells; an empty cell counts as missing"
    problems = []
    for i in places:
        number, cell = first.get(i, (head.data_line, "?"))
        more = f", and in {counts[i] - 1} more lines" if counts[i] > 1 else ""
        kind = "time stamp" if i in head.stamps else "number"
        place = f"line {number}, column {i + 1} ({head.names[i]})"
        problems.append(source.record.problem("error", place, f"{cell!r} is not a {kind}{more}", remedy))
    return problems


def _cut_off(source: Source, place: str, fault: str) -> Problem:
    return source.record.problem("warning", place, fault, "Copy the file again from the rig")


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
        problems.append(source.record.problem("error", f"line {number}", fault, remedy))
    if not problems:
        raise source.record.refuse("", f"{len(odd_lines)} lines have a wrong number of cells", remedy)
    raise RigDataError(problems)


def _is_cut_inside_last_cell(source: Source) -> bool:
    """Whether the last line has no end and its last number fewer decimals than the lines before."""
    head = source.head
    if not is_ascii_based(head.encoding.removesuffix("-sig")):
        return False
    with source.record.path.open("rb") as stream:
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

"""Text files as columns of numbers: parsed by pyarrow in blocks, bad cells named by line and column."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pv

from rigdata.arrays import FloatArray
from rigdata.calibration import OVERFLOW
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import MAX_SAMPLES, RecordFile
from rigdata.readers.series import Contents, GrowingChannel, Series, is_time, serving, time_columns
from rigdata.readers.text.cells import (
    BLOCK,
    MISSING,
    THOUSANDS,
    is_ascii_based,
    is_number,
    is_stamp,
    number_blocks,
    number_pattern,
    stamp_seconds,
)
from rigdata.readers.text.head import Head, find_head, plain_name, split_line

#: Lines of a wrong number of cells that are listed.
_LISTED = 5


def read_text(record: RecordFile) -> Contents:
    """Read the columns of a text file that the manifest uses; without one, all that hold numbers."""
    head, channels = find_head(record), record.channels
    if not channels:
        head = replace(head, names=tuple(map(plain_name, head.names)))
    names = head.names
    clocks = [i for i in time_columns(names, channels) if i not in head.dates]
    if len(clocks) == 1 and record.stated_rate is not None:  # nobody needs one that is not described
        clocks = [i for i in clocks if names[i] in channels]
    used = {name for name, channel in channels.items() if channel.quantity != "ignore"} if channels else {*names}
    if not used.intersection(names):
        raise record.refuse("", "holds none of the channels that are used", "Check the channels' names")
    places = sorted({i for i, name in enumerate(names) if name in used}.difference(head.dates).union(clocks))
    columns, problems = read_table(head, places)
    length = len(columns[places[0]])
    timing = places if None in serving(names, clocks, channels) else clocks
    # spreadsheets write lines at the end that hold no time, blank or of means and extremes
    while clocks and length > 1 and all(np.isnan(columns[i][length - 1]) for i in timing):
        length -= 1
    if any(np.isfinite(column[length:]).any() for column in columns.values()):
        fault = "values without a time; taken without these lines"
        problems += (
            record.problem("warning", f"line {head.data_line + length} and on", fault, "Are they statistics?"),
        )
    if len(clocks) == 1:
        _check_times(head, clocks[0], columns[clocks[0]][:length])
    units = ["s" if i in head.stamps else unit for i, unit in enumerate(head.units)]
    series = [Series(names[i], units[i], columns[i][:length], None, f"column {i + 1}") for i in places]
    if channels:
        described = {"", *channels, *(names[i] for i in clocks)}
        return Contents(series, unread=tuple(n for n in names if n not in described), problems=problems)
    series = [column for column in series if column.name and np.isfinite(column.values).any()]
    if all(is_time(column.name) for column in series):
        raise record.refuse("", "holds no column of numbers", "Export the run again")
    return Contents(series, problems=problems)


def _check_times(head: Head, clock: int, times: FloatArray) -> None:
    """Refuse the only time column, by its line, where it holds no times or runs backwards."""
    place = f"column {head.names[clock]}"
    usable = np.flatnonzero(np.abs(times) < OVERFLOW)
    if len(usable) < min(2, len(times)):
        raise head.record.refuse(place, "holds no times", "Set its quantity to ignore")
    back = np.flatnonzero(np.diff(times[usable]) < 0)
    if len(back):
        before, after = usable[back[0] : back[0] + 2]
        fault = f"time runs backwards ({times[before]:g}, then {times[after]:g})"
        raise head.record.refuse(
            f"line {head.data_line + int(after)}, {place}", fault, "Sort, split, or export seconds"
        )


def read_table(head: Head, places: Sequence[int]) -> tuple[dict[int, FloatArray], tuple[Problem, ...]]:
    """Parse the columns at `places`; what was repaired is told."""
    try:
        columns, odd_lines = _parse(head, places, numbers=True)
    except pa.ArrowInvalid:
        if not head.decimal_certain:
            return read_table(replace(head, decimal=",", decimal_certain=True), places)
        # Rare spellings of numbers, or text: as text once more, to repair the first and to locate the second.
        columns, odd_lines = _parse(head, places, numbers=False)
    if odd_lines:
        return columns, _judged(head, (), odd_lines)
    if not len(columns[places[0]]) or not _is_cut_inside_last_cell(head):
        return columns, ()
    fault = "the last line is cut off inside its last number; taken without that line"
    problem = head.record.problem("warning", "last line", fault, "Copy the file again from the rig")
    return {place: column[:-1] for place, column in columns.items()}, (problem,)


def _options(head: Head, places: Sequence[int], numbers: bool, skip: Any) -> dict[str, Any]:
    """How pyarrow is to read the columns, as numbers or as texts; `skip` is asked about lines of a wrong width."""
    labels = [f"c{i}" for i in range(len(head.names))]  # names of a file need not be unique or present
    texts = head.stamps if numbers else places
    types = {labels[i]: pa.string() if i in texts else pa.float64() for i in places}
    delimiter = "\t" if head.delimiter == " " else head.delimiter
    return {
        "read_options": pv.ReadOptions(
            use_threads=False, block_size=4 * BLOCK, column_names=labels, skip_rows=head.data_line - 1
        ),
        "parse_options": pv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
        "convert_options": pv.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=list(MISSING),
            strings_can_be_null=False,
            decimal_point=head.decimal,
            check_utf8=False,
        ),
    }


def _parse(head: Head, places: Sequence[int], numbers: bool) -> tuple[dict[int, FloatArray], int]:
    """Columns by place, and how many lines have a wrong number of cells."""
    record, length, odd_lines = head.record, 0, 0
    stamps: dict[int, list[str | None]] = {i: [] for i in places if i in head.stamps}
    bad = set()

    def skip(row: Any) -> str:
        nonlocal odd_lines
        odd_lines += bool(row.text.strip())
        return "skip"

    with ExitStack() as files:
        numeric = {i: files.enter_context(GrowingChannel()) for i in places if i not in head.stamps}
        try:
            options = _options(head, places, numbers, skip)
            for block in number_blocks(record.path, head.encoding, head.delimiter):
                copied = pa.BufferOutputStream()  # the library's own memory: none of Python's is left to its threads
                copied.write(block)
                rows = pv.read_csv(pa.BufferReader(copied.getvalue()), **options)
                options["read_options"].skip_rows = 0
                length += rows.num_rows
                if length > MAX_SAMPLES:
                    raise record.refuse("", "has too many lines", "Split the run")
                for i, cells in zip(places, rows.columns, strict=True):
                    column = cells.combine_chunks()
                    if i in head.stamps:
                        stamps[i] += pc.ascii_trim_whitespace(column).to_pylist()
                        continue
                    if not numbers:
                        column, is_sound = _to_numbers(column, head.decimal)
                        if not is_sound:
                            bad.add(i)
                    filled = pc.fill_null(column.cast(pa.float64()), np.nan)
                    # `to_numpy` would import pandas in every worker
                    values = np.frombuffer(filled.buffers()[1], np.float64, len(filled), 8 * filled.offset)
                    numeric[i].write(values.tobytes())
        except pa.ArrowInvalid as error:
            if numbers:
                raise
            fault = f"cannot be parsed ({str(error).splitlines()[0][:160]})"
            raise record.refuse("", fault, "Export the run again") from error
        columns = {i: channel.values() for i, channel in numeric.items()}
    for i, cells in stamps.items():
        columns[i], count = stamp_seconds([None if cell is None or cell in MISSING else cell for cell in cells])
        if count:
            bad.add(i)
    if bad:
        _judged(head, sorted(bad), odd_lines)
    return columns, odd_lines


def _to_numbers(column: Any, decimal: str) -> tuple[Any, bool]:
    """Numbers from cells as text, blanks around them and a leading plus taken; and whether all others are missing."""
    text = pc.ascii_trim_whitespace(column)
    missing = pc.is_in(text, value_set=pa.array(list(MISSING)))
    good = pc.match_substring_regex(text, number_pattern(decimal))
    is_sound = pc.all(pc.or_(missing, good)).as_py() is not False
    text = pc.replace_substring_regex(text, rf"^\+|\{THOUSANDS[decimal]}", "")
    text = pc.replace_substring(text, decimal, ".")
    return pc.if_else(good, text, None).cast(pa.float64()), is_sound


def _judged(head: Head, places: Sequence[int], odd_lines: int) -> tuple[Problem, ...]:
    """Take a file whose last line is cut off; reject other lines of a wrong width, and text in columns at `places`."""
    record, width, last = head.record, len(head.names), 0
    texts: dict[int, list[tuple[int, str]]] = {i: [] for i in places}
    wrong = []
    for last, cells in head.rows():
        if len(cells) != width:
            wrong.append((last, len(cells)))
            continue
        for i in places:
            cell = cells[i]
            is_good = is_stamp(cell) if i in head.stamps else is_number(cell, head.decimal)
            if not is_good and cell not in MISSING:
                texts[i].append((last, cell[:40]))
    problems = []
    for i, cells_of_text in texts.items():
        number, cell = cells_of_text[0] if cells_of_text else (head.data_line, "?")
        addition = f", and in {len(cells_of_text) - 1} more lines" if len(cells_of_text) > 1 else ""
        fault = f"{cell!r} is not a {'time stamp' if i in head.stamps else 'number'}{addition}"
        remedy = "Delete or repair these cells; an empty cell is a missing value, thousands have no mark between them"
        problems.append(record.problem("error", f"line {number}, column {i + 1} ({head.names[i]})", fault, remedy))
    if not problems and odd_lines == len(wrong) == 1 and wrong[0][0] == last and wrong[0][1] < width:
        fault = f"the last line is cut off ({wrong[0][1]} of {width} cells); taken without that line"
        return (record.problem("warning", f"line {last}", fault, "Copy the file again from the rig"),)
    remedy = "Check [csv] delimiter and decimal, or repair the line"
    for number, count in wrong[:_LISTED]:
        fault = f"has {count} cells, the names have {width}"
        problems.append(record.problem("error", f"line {number}", fault, remedy))
    if not problems:
        raise record.refuse("", f"{odd_lines} lines have a wrong number of cells", remedy)
    raise RigDataError(problems)


def _is_cut_inside_last_cell(head: Head) -> bool:
    """Whether the last line has no end and its last number fewer decimals than the lines before."""
    if not is_ascii_based(head.encoding.removesuffix("-sig")):
        return False
    with head.record.path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 65536))
        tail = stream.read()
    if not tail or tail.endswith((b"\n", b"\r")):
        return False
    decimals = []
    for line in tail.decode(head.encoding, "replace").splitlines():
        cells = split_line(line, head.delimiter)
        if cells:
            _, mark, digits = cells[-1].partition(head.decimal)
            decimals.append(len(digits) if mark else -1)
    *usual, last = decimals[-6:] or [0]
    return len(usual) >= 2 and len(set(usual)) == 1 and last < usual[0]

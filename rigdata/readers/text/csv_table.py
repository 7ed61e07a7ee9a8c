"""The samples of one CSV file, parsed by pyarrow in blocks; bad cells are named by line and column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import MAX_SAMPLES
from rigdata.readers.text.byte_stream import (
    AsciiOnly,
    all_lines,
    codec_of_bytes,
    is_ascii_based,
    open_ascii,
    skip_to,
    squeeze_blanks,
)
from rigdata.readers.text.cells import MISSING, is_missing, is_number, is_stamp, number_pattern, stamp_seconds
from rigdata.readers.text.dialect import Dialect, split_line

#: Lines longer than this are refused [bytes].
_BLOCK = 2**22
_LISTED = 5


@dataclass(frozen=True)
class Source:
    """A CSV file and how to speak of it; `clock` names its time column, if any."""

    path: Path
    file: str
    run: str | None
    dialect: Dialect = field(repr=False)
    clock: str = ""

    def problem(self, severity: Any, place: str, what: str, cure: str) -> Problem:
        """Make a finding about this file."""
        return Problem(severity, self.file, place, what, cure, self.run)


@dataclass(frozen=True)
class Table:
    """Parsed columns."""

    columns: dict[str, FloatArray]
    length: int
    problems: tuple[Problem, ...] = ()

    @property
    def nbytes(self) -> int:
        """Memory of the columns."""
        return sum(c.nbytes for c in self.columns.values())


def read_table(source: Source, names: Sequence[str]) -> Table:
    """Parse the columns `names`."""
    import pyarrow as pa

    try:
        columns, length, odd = _parse(source, names, numbers=True)
    except pa.ArrowInvalid:
        if not source.dialect.sure:
            return read_table(replace(source, dialect=replace(source.dialect, decimal=",", sure=True)), names)
        # Rare spellings of numbers, or text: as text once more, to mend the first and to locate the second.
        columns, length, odd = _parse(source, names, numbers=False)
    columns, length = _drop_empty_tail(columns, length, source.clock)
    problems = _judge_odd_rows(source, odd)
    if not odd and length and _cut_inside_last_cell(source):
        columns = {n: c[:-1] for n, c in columns.items()}
        length -= 1
        what = "the last line is cut off inside its last number; taken without that line"
        problems = (source.problem("warning", "last line", what, "Copy the file again from the rig"),)
    for column in columns.values():
        column.setflags(write=False)
    return Table(columns, length, problems)


def _drop_empty_tail(columns: dict[str, FloatArray], length: int, clock: str) -> tuple[dict[str, FloatArray], int]:
    """Leave out lines at the end that hold not even a time, as spreadsheets write them."""
    kept = length
    while kept > 0 and clock in columns and all(np.isnan(c[kept - 1]) for c in columns.values()):
        kept -= 1
    return ({n: c[:kept] for n, c in columns.items()}, kept) if 0 < kept < length else (columns, length)


def _options(source: Source, names: Sequence[str], numbers: bool, odd: list[Any]) -> dict[str, Any]:
    import pyarrow as pa
    import pyarrow.csv as pv

    dialect = source.dialect
    labels = [f"c{i}" for i in range(len(dialect.names))]  # names of a file need not be unique or present
    wanted = [labels[dialect.names.index(n)] for n in names]

    def note(row: Any) -> str:
        if row.text.strip() and len(odd) < 1000:
            odd.append((row.actual_columns, row.text))
        return "skip"

    return {
        "read_options": pv.ReadOptions(use_threads=numbers, block_size=_BLOCK, column_names=labels),
        "parse_options": pv.ParseOptions(
            delimiter="\t" if dialect.delimiter == " " else dialect.delimiter, invalid_row_handler=note
        ),
        "convert_options": pv.ConvertOptions(
            column_types={
                w: pa.float64() if numbers and int(w[1:]) not in dialect.stamps else pa.string() for w in wanted
            },
            include_columns=wanted,
            null_values=list(MISSING),
            strings_can_be_null=False,
            decimal_point=dialect.decimal,
            check_utf8=False,
        ),
    }


def _parse(
    source: Source, names: Sequence[str], numbers: bool
) -> tuple[dict[str, FloatArray], int, list[tuple[int, str]]]:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.csv as pv

    odd: list[tuple[int, str]] = []
    stamps = {i for i, n in enumerate(names) if source.dialect.names.index(n) in source.dialect.stamps}
    parts: list[list[FloatArray]] = [[] for _ in names]
    length = 0
    faults: list[list[str]] = [[] for _ in names]
    with open_ascii(source.path, source.dialect.encoding) as plain:
        skip_to(plain, source.dialect.data_offset)
        stream = AsciiOnly(squeeze_blanks(plain) if source.dialect.delimiter == " " else plain)
        try:
            reader = pv.open_csv(stream, **_options(source, names, numbers, odd))
            for batch in reader:
                length += batch.num_rows
                for index, column in enumerate(batch.columns):
                    if index in stamps:
                        parts[index].append(pc.ascii_trim_whitespace(column).to_numpy(zero_copy_only=False))
                        continue
                    values = column if numbers else _to_numbers(column, source.dialect.decimal, faults[index])
                    parts[index].append(values.to_numpy(zero_copy_only=False))
                if length > MAX_SAMPLES:
                    raise RigDataError(source.problem("error", "", "has too many lines", "Split the run"))
        except pa.ArrowInvalid as error:
            if numbers:
                raise
            what = f"cannot be parsed ({str(error).splitlines()[0][:160]})"
            raise RigDataError(source.problem("error", "", what, "Export the run again")) from error
    for index in stamps:
        cells = [None if c is None or is_missing(c) else c for part in parts[index] for c in part]
        seconds, bad = stamp_seconds(cells)
        parts[index] = [seconds]
        faults[index] += ["text"] * bad
    if any(faults):
        raise RigDataError(_locate_text(source, [n for n, f in zip(names, faults) if f]))
    empty = np.empty(0)
    return {n: np.concatenate(p) if p else empty for n, p in zip(names, parts)}, length, odd


def _to_numbers(column: Any, decimal: str, faults: list[str]) -> Any:
    """Numbers from cells as text: blanks around them and a leading plus are taken."""
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pc.ascii_trim_whitespace(column)
    missing = pc.is_in(text, value_set=pa.array(MISSING))
    good = pc.match_substring_regex(text, number_pattern(decimal))
    if not pc.all(pc.or_(missing, good)).as_py():
        faults.append("text")
    text = pc.replace_substring(pc.replace_substring_regex(text, r"^\+", ""), decimal, ".")
    return pc.if_else(good, text, None).cast(pa.float64())


def _locate_text(source: Source, names: Sequence[str]) -> list[Problem]:
    """Name the first lines on which each of the columns `names` holds text."""
    dialect = source.dialect
    found: dict[str, list[tuple[int, str]]] = {n: [] for n in names}
    counts = dict.fromkeys(names, 0)
    where = {n: dialect.names.index(n) for n in names}
    codec = codec_of_bytes(dialect.encoding)
    for number, line in enumerate(all_lines(source.path, dialect.encoding), start=1):
        if number < dialect.data_line:
            continue
        cells = split_line(line.decode(codec, "replace"), dialect.delimiter)
        if len(cells) != len(dialect.names):
            continue
        for name, index in where.items():
            known = is_stamp(cells[index]) if index in dialect.stamps else is_number(cells[index], dialect.decimal)
            if not (known or is_missing(cells[index])):
                counts[name] += 1
                if len(found[name]) < _LISTED:
                    found[name].append((number, cells[index][:40]))
    cure = "Delete or mend these cells; an empty cell counts as missing"
    problems = []
    for name, places in found.items():
        column = f"column {where[name] + 1} ({name})"
        line_number, text = places[0] if places else (dialect.data_line, "?")
        more = f", and in {counts[name] - 1} more lines" if counts[name] > 1 else ""
        kind = "time stamp" if where[name] in dialect.stamps else "number"
        what = f"{text!r} is not a {kind}{more}"
        problems.append(source.problem("error", f"line {line_number}, {column}", what, cure))
    return problems


def _judge_odd_rows(source: Source, odd: list[tuple[int, str]]) -> tuple[Problem, ...]:
    """Take a file whose last line is cut off, refuse other lines with a wrong number of cells."""
    if not odd:
        return ()
    dialect = source.dialect
    bad: list[tuple[int, int]] = []
    last = 0
    codec = codec_of_bytes(dialect.encoding)
    for number, line in enumerate(all_lines(source.path, dialect.encoding), start=1):
        if number < dialect.data_line:
            continue
        cells = split_line(line.decode(codec, "replace"), dialect.delimiter)
        if not cells:
            continue
        last = number
        if len(cells) != len(dialect.names) and len(bad) < 1000:
            bad.append((number, len(cells)))
    expected = len(dialect.names)
    if len(odd) == 1 and len(bad) == 1 and bad[0][0] == last and bad[0][1] < expected:
        what = f"the last line is cut off ({bad[0][1]} of {expected} cells); taken without that line"
        return (source.problem("warning", f"line {last}", what, "Copy the file again from the rig"),)
    cure = "Check [csv] delimiter and decimal, or mend the line"
    raise RigDataError(
        [
            source.problem("error", f"line {number}", f"has {cells} cells, the names have {expected}", cure)
            for number, cells in bad[:_LISTED]
        ]
        or [source.problem("error", "", f"{len(odd)} lines have a wrong number of cells", cure)]
    )


def _cut_inside_last_cell(source: Source) -> bool:
    """Whether the last line has no end and its last number fewer decimals than the lines before."""
    dialect = source.dialect
    if not is_ascii_based(dialect.encoding):
        return False
    with source.path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 65536))
        tail = stream.read()
    if not tail or tail.endswith((b"\n", b"\r")):
        return False
    lines = [t for t in tail.decode(codec_of_bytes(dialect.encoding), "replace").splitlines() if t.strip()][-6:]
    rows = [split_line(t, dialect.delimiter) for t in lines]
    rows = [r for r in rows if len(r) == len(dialect.names)]
    if len(rows) < 3:
        return False
    usual = {_decimals(r[-1], dialect.decimal) for r in rows[:-1]}
    return len(usual) == 1 and _decimals(rows[-1][-1], dialect.decimal) < usual.pop()


def _decimals(cell: str, decimal: str) -> int:
    _, mark, digits = cell.partition(decimal)
    return len(digits) if mark else -1

"""The head of a text file: encoding, delimiter, decimal mark, names, units and where the samples begin.

What the manifest gives is held against the file, everything else is detected. The names are in the line that holds the
manifest's channel names; without a manifest they are above the first lines of numbers.
"""

import contextlib
import csv
import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import mode

from rigdata.problem import RigDataError
from rigdata.readers.base import RecordFile
from rigdata.readers.series import is_time
from rigdata.readers.text.cells import (
    HEAD,
    MISSING,
    all_lines,
    head_lines,
    is_date,
    is_entry,
    is_number,
    is_stamp,
    looks_like,
    text_encoding,
)
from rigdata.units import measured_in

_DELIMITERS = (";", "\t", ",", "|", " ")
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
_RATE_TEXT = re.compile(r"\s+(?:\d+\s*)?-.*$")  # "Time  1 - default sample rate"
#: "X1A [V]", "X1A / V", "X1A, V": what follows a channel's name.
_BEHIND = re.compile(r"\s*[\[(/,]\s*(.*?)[\])]?\s*$")
#: Lines that are looked at to find the decimal mark and the columns of times of day.
_SAMPLE = 200
_MAX_UNIT_LINES = 5
#: So many lines in a row must be numbers for a table to begin.
_TABLE_LINES = 3


@dataclass(frozen=True)
class Head:
    """How a text file is written, and what its first lines say of its columns."""

    record: RecordFile
    encoding: str
    delimiter: str
    decimal: str
    decimal_certain: bool
    header_line: int  #: Line of the names, from 1; 0 where no line names the columns.
    data_line: int  #: First line of samples, from 1.
    names: tuple[str, ...]  #: One per column, "" where there is none.
    units: tuple[str, ...]
    stamps: frozenset[int] = frozenset()  #: Columns of times of day, and of dates alone.
    dates: frozenset[int] = frozenset()

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line number, from 1, and cells of every line of samples that is not blank."""
        for number, line in enumerate(all_lines(self.record.path, self.encoding), start=1):
            cells = split_line(line, self.delimiter) if number >= self.data_line else []
            if cells:
                yield number, cells


@dataclass(frozen=True)
class _NamesLine:
    line: int
    delimiter: str
    names: tuple[str, ...]
    cells: tuple[str, ...]  #: as they are written, with units
    matched: int = 0  #: channels of the manifest among them


def find_head(record: RecordFile) -> Head:
    """Detect; a contradiction between manifest and file is an error that names both."""
    return _HeadFinder(record).find()


class _HeadFinder:
    def __init__(self, record: RecordFile) -> None:
        self.record, self.spec = record, record.spec
        self.channels = frozenset(record.channels)
        self.encoding = text_encoding(record.path, record.spec.encoding)
        self.lines = head_lines(record.path, self.encoding)
        self.delimiters = _DELIMITERS if self.spec.delimiter is None else (self.spec.delimiter,)

    def _refuse(self, line: int, fault: str, remedy: str) -> RigDataError:
        if any("\0" in text for text in self.lines):
            line, fault, remedy = 0, "holds bytes of zero, as no text does", "Name it by its format, such as .h5"
        return self.record.refuse(f"line {line}" if line else "", fault, remedy)

    def find(self) -> Head:
        if not any(map(str.strip, self.lines)):
            raise self._refuse(0, f"no line of text ends within its first {HEAD >> 10} kB", "Export the run again")
        if self.channels and not self.spec.names:
            header = self._header_by_channels()
            first = self._first_sample(header)
        else:
            header, first = self._header_by_numbers()
        for name in self.channels.intersection(header.names):
            columns = [str(i + 1) for i, cell in enumerate(header.names) if cell == name]
            if len(columns) > 1:
                fault = f"column name {name!r} is in columns {', '.join(columns)}"
                raise self._refuse(header.line, fault, "Give every column its own name; which one counts?")
        lines = (split_line(line, header.delimiter) for line in self.lines[first : first + _SAMPLE])
        sample = [cells for cells in lines if cells]
        cells = list(itertools.chain.from_iterable(sample))
        decimal = self._decimal(cells)
        names = self._names_of_all_cells(header, sample)
        return Head(
            record=self.record,
            encoding=self.encoding,
            delimiter=header.delimiter,
            decimal=decimal or ".",
            decimal_certain=decimal is not None,
            header_line=header.line,
            data_line=first + 1,
            names=names,
            units=self._units(header, first, names),
            stamps=_columns_of(is_stamp, sample),
            dates=_columns_of(is_date, sample),
        )

    def _header_by_channels(self) -> _NamesLine:
        """The line of the channels' names; refused where what the manifest says of it finds fewer than another."""
        every_line, line = range(len(self.lines)), self.spec.header_line
        best = self._best(_DELIMITERS, every_line)
        if best is None:
            names = ", ".join(sorted(self.channels)[:6])
            remedy = "Name the manifest's channels as the columns are named"
            raise self._refuse(0, f"no line holds a channel name of the manifest ({names}, ..)", remedy)
        candidate = self._best(self.delimiters, every_line[line - 1 : line] if line else every_line)
        matched = 0 if candidate is None else candidate.matched
        if candidate is not None and (matched >= best.matched or candidate.line != best.line):
            return candidate
        keys = ("header_line", "delimiter")
        settings = " and ".join(f"{key} {getattr(self.spec, key)!r}" for key in keys if getattr(self.spec, key))
        fault = f"{settings} of the manifest: {matched} channel names; line {best.line} with {best.delimiter!r} holds"
        raise self._refuse(0, f"{fault} {best.matched}", "Correct [csv], or leave it out")

    def _best(self, delimiters: tuple[str, ...], numbers: range) -> _NamesLine | None:
        """Find the line with most of the channel names; of equals the one that numbers follow."""
        best = None
        best_rank = (0, True)
        for number in numbers:
            if not any(name in self.lines[number] for name in self.channels):
                continue
            for delimiter in delimiters:
                names, written = [], split_line(self.lines[number], delimiter)
                for cell in written:
                    short = _BEHIND.sub("", cell)  # "X1A [V]" counts as X1A where the manifest knows only that
                    names.append(short if cell not in self.channels and short in self.channels else cell)
                matched = len(self.channels.intersection(names))
                below = self.lines[number + 1 : number + 2 + _MAX_UNIT_LINES]
                cells = itertools.chain.from_iterable(split_line(line, delimiter) for line in below)
                rank = (matched, any(map(looks_like, cells)))
                if matched and rank > best_rank:
                    best, best_rank = _NamesLine(number + 1, delimiter, tuple(names), tuple(written), matched), rank
            if best_rank == (len(self.channels), True):
                break
        return best

    def _header_by_numbers(self) -> tuple[_NamesLine, int]:
        """Names above the widest table of numbers, or the manifest's, and the index of its first line."""
        first, width, best = 0, 0, ""
        for delimiter in self.delimiters:
            if delimiter == " " and best:
                continue  # a blank within a time of day parts no cells where another delimiter does
            start, count = self._table_start(delimiter)
            if count > width:
                first, width, best = start, count, delimiter
        if not best:
            raise self._refuse(0, "no table of numbers begins in its first lines", "Is it a record?")
        if self.spec.names:
            return _NamesLine(first, best, self.spec.names, self.spec.names), first
        header, names = 0, [f"column{i + 1}" for i in range(width)]
        for number in range(first, max(first - 5, 0), -1):
            cells = split_line(self.lines[number - 1], best)
            if len(cells) > 1 and abs(len(cells) - width) <= 1:
                header, names = number, [*cells, ""][:width]
            elif cells:
                break
        return _NamesLine(header, best, tuple(names), tuple(names)), first

    def _table_start(self, delimiter: str) -> tuple[int, int]:
        """First line of the first run of lines of numbers, and how many columns they have: 0 without any."""
        count, width = 0, 0
        for number, line in enumerate(self.lines):
            cells = split_line(line, delimiter)
            if not (len(cells) > 1 and all(map(is_entry, cells)) and any(map(looks_like, cells))):
                count = 0
                continue
            count = count + 1 if len(cells) == width else 1
            width = len(cells)
            if count == _TABLE_LINES or number == len(self.lines) - 1:
                return number - count + 1, width
        return 0, 0

    def _first_sample(self, header: _NamesLine) -> int:
        """Index of the first line of samples: below the names and below lines of units."""
        skipped = 0
        for number in range(max(header.line, self.spec.units_line or 0), len(self.lines)):
            cells = split_line(self.lines[number], header.delimiter)
            if cells and (any(map(looks_like, cells)) or all(cell in MISSING for cell in cells)):
                return number
            skipped += bool(cells)
            if skipped > _MAX_UNIT_LINES:
                fault = "is neither names, units nor numbers"
                raise self._refuse(number + 1, fault, "Check [csv] delimiter and decimal")
        raise self._refuse(header.line, "no samples follow the names", "Export it again, or check [csv] units_line")

    def _decimal(self, cells: list[str]) -> str | None:
        """Decimal mark; None where the sample holds whole numbers only."""
        commas = [cell for cell in cells if "," in cell and is_number(cell, ",")]
        points = [cell for cell in cells if "." in cell and is_number(cell, ".")]
        mark = self.spec.decimal
        if len(commas) == len(points):
            return mark or ("." if points else None)
        observed, example = (",", commas[0]) if len(commas) > len(points) else (".", points[0])
        if mark is not None and mark != observed:
            fault = f"decimal is {mark!r} in the manifest, but numbers look like {example!r}"
            raise self._refuse(0, fault, f"Set [csv] decimal = {observed!r}, or leave it out")
        return observed

    def _names_of_all_cells(self, header: _NamesLine, sample: list[list[str]]) -> tuple[str, ...]:
        """Names for every cell of a line of samples: a trailing delimiter may be in one line only."""
        width, names = mode(map(len, sample)), header.names
        unnamed = itertools.chain.from_iterable(row[len(names) :] for row in sample if len(row) == width)
        if any(names[width:]) or any(unnamed):
            fault = f"has {len(list(filter(None, names)))} names, but the samples have {width} cells"
            raise self._refuse(header.line, fault, "Check [csv] delimiter and decimal; name every column")
        return (*names, *[""] * width)[:width]

    def _units(self, header: _NamesLine, first: int, names: tuple[str, ...]) -> tuple[str, ...]:
        """Units from the line below the names, or from brackets in these: "force (H)" may be its direction."""
        below = []
        line = self.spec.units_line or header.line + 1
        if 0 < header.line < line <= first:
            below = split_line(self.lines[line - 1], header.delimiter)
        units = []
        for i, name in enumerate(names):
            cell = "".join(header.cells[i : i + 1])
            bracket = (_UNIT if cell == name else _BEHIND).search(cell)
            text = "".join(below[i : i + 1]).strip("[]() ")
            units.append(text if bracket is None or measured_in(text) else bracket[1].strip())
        return tuple(units)


def _columns_of(kind: Callable[[str], bool], sample: list[list[str]]) -> frozenset[int]:
    """Columns whose cells are all of a kind, missing ones apart."""
    columns = []
    for index, column in enumerate(zip(*sample)):
        cells = [cell for cell in column if cell]
        if cells and all(map(kind, cells)):
            columns.append(index)
    return frozenset(columns)


def plain_name(name: str) -> str:
    """Name without its unit and without what catman says of its rate."""
    bare = _UNIT.sub("", name).strip()
    return _RATE_TEXT.sub("", bare) if is_time(bare) else bare


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line, stripped of white space and quotes; empty for a blank line."""
    if not line.strip():
        return []
    if delimiter == " ":
        return line.split()
    cells = line.split(delimiter)
    if '"' in line:
        with contextlib.suppress(csv.Error):
            cells = next(csv.reader([line], delimiter=delimiter))
    return [cell.strip() for cell in cells]

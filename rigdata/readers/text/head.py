"""The head of a text file: encoding, delimiter, decimal mark, names, units and where the samples begin.

What the manifest gives is held against the file, everything else is detected. The names are in the line that holds the
manifest's channel names; without a manifest they are above the first lines of numbers.
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from rigdata.problem import RigDataError
from rigdata.readers.base import RecordFile
from rigdata.readers.series import is_time
from rigdata.readers.text.cells import (
    HEAD,
    head_lines,
    is_date,
    is_missing,
    is_number,
    is_stamp,
    looks_like,
    text_encoding,
)

_DELIMITERS = (";", "\t", ",", "|", " ")
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
_RATE_TEXT = re.compile(r"\s+(?:\d+\s*)?-.*$")  # "Time  1 - default sample rate"
_BRACKETS = re.compile(r"\s*[\[(].*[\])]\s*$")
#: Lines that are looked at to find the decimal mark and the columns of times of day.
_SAMPLE = 200
_MAX_UNIT_LINES = 5
#: So many lines in a row must be numbers for a table to begin.
_TABLE_LINES = 3


@dataclass(frozen=True)
class Head:
    """How a text file is written, and what its first lines say of its columns."""

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


@dataclass(frozen=True)
class _NamesLine:
    line: int
    delimiter: str
    names: tuple[str, ...]
    matched: int = 0


def find_head(record: RecordFile) -> Head:
    """Detect; a contradiction between manifest and file is an error that names both."""
    return _HeadFinder(record).find()


class _HeadFinder:
    def __init__(self, record: RecordFile) -> None:
        self.record, self.spec = record, record.spec
        self.channels = frozenset(record.channels)
        self.encoding = text_encoding(record.path, record.spec.encoding)
        self.lines = head_lines(record.path, self.encoding)

    def _refuse(self, line: int | None, fault: str, remedy: str) -> RigDataError:
        return self.record.refuse("" if line is None else f"line {line}", fault, remedy)

    def find(self) -> Head:
        if not any(line.strip() for line in self.lines):
            fault = (
                "the file is empty"
                if self.record.path.stat().st_size < HEAD
                else f"no line ends within the first {HEAD >> 10} kB"
            )
            raise self._refuse(None, fault, "Export the run again")
        if self.channels or self.spec.names:
            header = self._header_without_names() if self.spec.names else self._header_by_channels()
            self._check_duplicates(header)
            first = self._first_sample(header)
        else:
            header, first = self._header_by_numbers()
        lines = (split_line(line, header.delimiter) for line in self.lines[first : first + _SAMPLE])
        sample = [cells for cells in lines if cells]
        all_cells = list(itertools.chain.from_iterable(sample))
        if not any(looks_like(cell) or is_missing(cell) for cell in all_cells):
            raise self._refuse(header.line, "no samples follow the names", "Export the run again")
        decimal = self._decimal(all_cells)
        names = self._names_of_all_cells(header, sample)
        return Head(
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
        every_line = range(len(self.lines))
        best = self._best(_DELIMITERS, every_line)
        names = sorted(self.channels)
        wanted = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        if best is None:
            remedy = "Name the manifest's channels as the columns are named"
            raise self._refuse(None, f"no line holds a channel name of the manifest ({wanted})", remedy)
        line, delimiter = self.spec.header_line, self.spec.delimiter
        remedy = f"The names are in line {best.line}; correct [csv] header_line"
        if line is not None and line > len(self.lines):
            raise self._refuse(line, f"header_line is {line}, beyond the first {len(self.lines)} lines", remedy)
        where = every_line if line is None else range(line - 1, line)
        stated = self._best(_DELIMITERS if delimiter is None else (delimiter,), where)
        if stated is not None and (delimiter is None or stated.matched >= best.matched or stated.line != best.line):
            return stated
        better = best if line is None else self._best(_DELIMITERS, where)
        if better is None or delimiter is None:
            raise self._refuse(line, f"holds no channel name ({wanted})", remedy)
        matched = 0 if stated is None else stated.matched
        fault = f"delimiter {delimiter!r} of the manifest finds {matched} channel names"
        fault += f", {better.delimiter!r} finds {better.matched}"
        raise self._refuse(better.line, fault, f"Set [csv] delimiter = {better.delimiter!r}, or leave it out")

    def _best(self, delimiters: Iterable[str], where: range) -> _NamesLine | None:
        """Find the line with most of the channel names; of equals the one that numbers follow."""
        best: _NamesLine | None = None
        best_rank = (0, True)
        for number in where:
            if not any(name in self.lines[number] for name in self.channels):
                continue
            for delimiter in delimiters:
                names = tuple(self._name(cell) for cell in split_line(self.lines[number], delimiter))
                matched = len(self.channels.intersection(names))
                if not matched:
                    continue
                below = self.lines[number + 1 : number + 2 + _MAX_UNIT_LINES]
                cells = itertools.chain.from_iterable(split_line(line, delimiter) for line in below)
                rank = (matched, any(map(looks_like, cells)))
                if rank > best_rank:
                    best, best_rank = _NamesLine(number + 1, delimiter, names, matched), rank
            if best_rank == (len(self.channels), True):
                break
        return best

    def _name(self, cell: str) -> str:
        """Name a column; ``X1A [V]`` counts as ``X1A`` where the manifest knows only that."""
        short = _BRACKETS.sub("", cell)
        return short if cell not in self.channels and short in self.channels else cell

    def _header_without_names(self) -> _NamesLine:
        """The line above the first line of numbers with as many cells as the manifest has names."""
        width = len(self.spec.names)
        for number, line in enumerate(self.lines):
            for delimiter in _DELIMITERS if self.spec.delimiter is None else (self.spec.delimiter,):
                cells = split_line(line, delimiter)
                numbers = sum(looks_like(cell) or is_stamp(cell) for cell in cells)
                if width <= len(cells) <= width + 1 and 0 < numbers >= width - 1:
                    return _NamesLine(number, delimiter, self.spec.names)
        fault = f"no line holds {width} numbers, as [csv] names has names"
        remedy = "Give one name per column, or delete [csv] names where the files name them"
        raise self._refuse(None, fault, remedy)

    def _header_by_numbers(self) -> tuple[_NamesLine, int]:
        """Names above the widest table of numbers, and the index of its first line."""
        first, width, best = 0, 0, ""
        for delimiter in _DELIMITERS:
            if delimiter == " " and best:
                continue  # a blank within a time of day parts no cells where another delimiter does
            table = self._table_start(delimiter)
            if table is not None and table[1] > width:
                first, width = table
                best = delimiter
        if not best:
            raise self._refuse(None, "no table of numbers begins in its first lines", "Is it a record?")
        header = -1
        for number in range(first - 1, max(first - 6, -1), -1):
            cells = split_line(self.lines[number], best)
            if len(cells) > 1 and abs(len(cells) - width) <= 1:
                header = number
            elif cells:
                break
        names = split_line(self.lines[header], best)[:width] if header >= 0 else []
        if not names:
            names = [f"column{i + 1}" for i in range(width)]
        return _NamesLine(header + 1, best, (*names, *[""] * (width - len(names)))), first

    def _table_start(self, delimiter: str) -> tuple[int, int] | None:
        """First line of the first run of lines of numbers, and how many columns they have."""
        count, width = 0, 0
        for number, line in enumerate(self.lines):
            cells = split_line(line, delimiter)
            if not _is_row_of_numbers(cells):
                count = 0
                continue
            count = count + 1 if count and len(cells) == width else 1
            width = len(cells)
            if count == _TABLE_LINES or number == len(self.lines) - 1:
                return number - count + 1, width
        return None

    def _check_duplicates(self, header: _NamesLine) -> None:
        for name in self.channels.intersection(header.names):
            columns = [str(i + 1) for i, cell in enumerate(header.names) if cell == name]
            if len(columns) > 1:
                fault = f"column name {name!r} is in columns {', '.join(columns)}"
                raise self._refuse(header.line, fault, "Give every column its own name; which one counts?")

    def _first_sample(self, header: _NamesLine) -> int:
        """Index of the first line of samples: below the names and below lines of units."""
        units_line = self.spec.units_line or 0
        if units_line > header.line + _MAX_UNIT_LINES:
            remedy = f"The names are in line {header.line}; correct [csv] units_line"
            raise self._refuse(units_line, "units_line is far below the names", remedy)
        skipped = 0
        for number in range(max(header.line, units_line), len(self.lines)):
            cells = split_line(self.lines[number], header.delimiter)
            if cells and (any(map(looks_like, cells)) or all(map(is_missing, cells))):
                return number
            skipped += bool(cells)
            if skipped > _MAX_UNIT_LINES:
                fault = "is neither names, units nor numbers"
                raise self._refuse(number + 1, fault, "Check [csv] delimiter and decimal")
        raise self._refuse(header.line, "no samples follow the names", "Export the run again")

    def _decimal(self, cells: list[str]) -> str | None:
        """Decimal mark; None where the sample holds whole numbers only."""
        commas = [cell for cell in cells if "," in cell and is_number(cell, ",")]
        points = [cell for cell in cells if "." in cell and is_number(cell, ".")]
        stated = self.spec.decimal
        if len(commas) == len(points):
            return stated or ("." if points else None)
        observed, example = (",", commas[0]) if len(commas) > len(points) else (".", points[0])
        if stated is not None and stated != observed:
            fault = f"decimal is {stated!r} in the manifest, but numbers look like {example!r}"
            raise self._refuse(None, fault, f"Set [csv] decimal = {observed!r}, or leave it out")
        return observed

    def _names_of_all_cells(self, header: _NamesLine, sample: list[list[str]]) -> tuple[str, ...]:
        """Names for every cell of a line of samples: a trailing delimiter may be in one line only."""
        widths = [len(row) for row in sample]
        width = max(set(widths), key=widths.count)
        names = header.names
        if len(names) < width:
            extra = []
            for row in sample:
                extra += row[len(names) :] if len(row) == width else []
            if any(extra):
                fault = f"has {len(names)} names, but the samples have {width} cells (the first extra is {extra[0]!r})"
                raise self._refuse(header.line, fault, "Check [csv] delimiter and decimal; name every column")
            return names + ("",) * (width - len(names))
        if any(names[width:]):
            named = len([name for name in names if name])
            fault = f"has {named} names, but the samples have {width} cells"
            raise self._refuse(header.line, fault, "Check [csv] delimiter and decimal")
        return names[:width]

    def _units(self, header: _NamesLine, first: int, names: tuple[str, ...]) -> tuple[str, ...]:
        """Units from brackets in the names, or from the line below the names."""
        below: list[str] = []
        line = self.spec.units_line or header.line + 1
        if 0 < header.line < line <= first:
            below = split_line(self.lines[line - 1], header.delimiter)
        units = []
        for i, name in enumerate(names):
            bracket = _UNIT.search(name)
            text = bracket[1] if bracket else "".join(below[i : i + 1])
            units.append(text.strip().strip("[]()"))
        return tuple(units)


def _is_row_of_numbers(cells: list[str]) -> bool:
    usual = all(looks_like(cell) or is_missing(cell) or is_stamp(cell) or is_date(cell) for cell in cells)
    return len(cells) > 1 and usual and any(map(looks_like, cells))


def _columns_of(kind: Callable[[str], bool], sample: list[list[str]]) -> frozenset[int]:
    """Columns whose cells are all of a kind, missing ones apart."""
    width = min((len(row) for row in sample), default=0)
    columns = set()
    for index in range(width):
        cells = [row[index] for row in sample if row[index]]
        if cells and all(map(kind, cells)):
            columns.add(index)
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

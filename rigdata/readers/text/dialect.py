"""The dialect of one CSV file: what the manifest gives, the rest detected from the file's head."""

from __future__ import annotations

import csv as _csv
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError
from rigdata.readers.text.byte_stream import HEAD, codec_of_bytes, head_lines, text_encoding
from rigdata.readers.text.cells import is_missing, is_number, is_stamp, looks_like

_DELIMITERS = (";", "\t", ",", "|", " ")
_SUFFIX = re.compile(r"\s*[\[(].*[\])]\s*$")
_SAMPLE = 200
_MAX_UNIT_LINES = 5


@dataclass(frozen=True)
class Dialect:
    """How a CSV file is written."""

    encoding: str
    delimiter: str
    decimal: str
    header_line: int
    data_line: int
    data_offset: int
    names: tuple[str, ...]
    sure: bool = True
    stamps: frozenset[int] = frozenset()


@dataclass(frozen=True)
class _Header:
    line: int
    delimiter: str
    names: tuple[str, ...]
    matched: int


class DialectFinder:
    """Finds the dialect of one file; `find` is the way in."""

    def __init__(self, path: Path, file: str, run: str | None, spec: CsvSpec, channels: Iterable[str]) -> None:
        self.path = path
        self.file = file
        self.run = run
        self.spec = spec
        self.channels = frozenset(channels)

    def _error(self, place: str, what: str, cure: str) -> RigDataError:
        return RigDataError(Problem("error", self.file, place, what, cure, self.run))

    def find(self) -> Dialect:
        """Detect; a contradiction between manifest and file is an error that names both."""
        encoding = text_encoding(self.path, self.spec.encoding)
        raw = head_lines(self.path, encoding)
        codec = codec_of_bytes(encoding)
        lines = [line.decode(codec, "replace") for line, _ in raw]
        if not any(line.strip() for line in lines):
            empty = self.path.stat().st_size < HEAD
            what = "the file is empty" if empty else f"no line ends within the first {HEAD >> 10} kB"
            raise self._error("", what, "Export the run again")
        header = self._header(lines)
        self._refuse_duplicates(header)
        first = self._first_data(lines, header)
        sample = [s for s in (split_line(t, header.delimiter) for t in lines[first : first + _SAMPLE]) if s]
        if not any(any(looks_like(c) or is_missing(c) for c in row) for row in sample):
            raise self._error(f"line {header.line}", "no samples follow the names", "Export the run again")
        decimal = self._decimal(sample)
        return Dialect(
            encoding=encoding,
            delimiter=header.delimiter,
            decimal=decimal or ".",
            header_line=header.line,
            data_line=first + 1,
            data_offset=raw[first][1],
            names=self._widen(header, sample),
            sure=decimal is not None,
            stamps=columns_of(is_stamp, sample),
        )

    def _header(self, lines: list[str]) -> _Header:
        if self.spec.names:
            return self._nameless(lines)
        free = self._best(lines, _DELIMITERS, range(len(lines)))
        if free is None:
            cure = "Name the manifest's channels as the columns are named"
            raise self._error("", f"no line holds a channel name of the manifest ({self._wanted()})", cure)
        given = self.spec.delimiter
        line = self.spec.header_line
        if line is not None and line > len(lines):
            cure = f"The names stand in line {free.line}; correct [csv] header_line"
            raise self._error(f"line {line}", f"header_line is {line}, beyond the first {len(lines)} lines", cure)
        where = range(len(lines)) if line is None else range(line - 1, line)
        found = self._best(lines, _DELIMITERS if given is None else (given,), where)
        if found is not None and (given is None or found.matched >= free.matched or found.line != free.line):
            return found
        there = free if line is None else self._best(lines, _DELIMITERS, where)
        if there is None or given is None:
            cure = f"The names stand in line {free.line}; correct [csv] header_line"
            raise self._error(f"line {line}", f"holds no channel name ({self._wanted()})", cure)
        what = (
            f"delimiter {given!r} of the manifest finds {found.matched if found else 0} channel names, "
            f"{there.delimiter!r} finds {there.matched}"
        )
        raise self._error(f"line {there.line}", what, f"Set [csv] delimiter = {there.delimiter!r}, or leave it out")

    def _nameless(self, lines: list[str]) -> _Header:
        """The first line of numbers with as many cells as the manifest has names."""
        width = len(self.spec.names)
        for number, line in enumerate(lines):
            for delimiter in _DELIMITERS if self.spec.delimiter is None else (self.spec.delimiter,):
                cells = split_line(line, delimiter)
                numbers = sum(looks_like(c) or is_stamp(c) for c in cells)
                if width <= len(cells) <= width + 1 and 0 < numbers >= width - 1:
                    return _Header(number, delimiter, self.spec.names, width)
        what = f"no line holds {width} numbers, as [csv] names has names"
        raise self._error("", what, "Give one name per column, or delete [csv] names where the files name them")

    def _wanted(self) -> str:
        names = sorted(self.channels)
        return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")

    def _best(self, lines: list[str], delimiters: Iterable[str], where: range) -> _Header | None:
        """Find the line with most of the channel names; of equals the one that numbers follow."""
        best: tuple[tuple[int, bool], _Header] | None = None
        complete = (len(self.channels), True)
        for number in where:
            if not any(name in lines[number] for name in self.channels):
                continue
            for delimiter in delimiters:
                cells = tuple(self._name(c) for c in split_line(lines[number], delimiter))
                matched = len(self.channels.intersection(cells))
                if matched == 0:
                    continue
                after = lines[number + 1 : number + 2 + _MAX_UNIT_LINES]
                followed = any(looks_like(c) for text in after for c in split_line(text, delimiter))
                rank = (matched, followed)
                if best is None or rank > best[0]:
                    best = (rank, _Header(number + 1, delimiter, cells, matched))
            if best is not None and best[0] == complete:
                break
        return None if best is None else best[1]

    def _name(self, cell: str) -> str:
        """Name a column; ``X1A [V]`` counts as ``X1A`` where the manifest knows only that."""
        if cell in self.channels:
            return cell
        short = _SUFFIX.sub("", cell)
        return short if short in self.channels else cell

    def _refuse_duplicates(self, header: _Header) -> None:
        for name in self.channels.intersection(header.names):
            columns = [i + 1 for i, n in enumerate(header.names) if n == name]
            if len(columns) > 1:
                what = f"column name {name!r} stands in columns {', '.join(map(str, columns))}"
                raise self._error(f"line {header.line}", what, "Give every column its own name; which one counts?")

    def _first_data(self, lines: list[str], header: _Header) -> int:
        """Index of the first data line: below the names and below lines of units."""
        index = max(header.line, self.spec.units_line or 0)
        if self.spec.units_line is not None and self.spec.units_line > header.line + _MAX_UNIT_LINES:
            cure = f"The names stand in line {header.line}; correct [csv] units_line"
            raise self._error(f"line {self.spec.units_line}", "units_line is far below the names", cure)
        skipped = 0
        while index < len(lines) and skipped <= _MAX_UNIT_LINES:
            cells = split_line(lines[index], header.delimiter)
            if cells and (any(looks_like(c) for c in cells) or all(is_missing(c) for c in cells)):
                return index
            skipped += bool(cells)
            index += 1
        if index >= len(lines):
            raise self._error(f"line {header.line}", "no samples follow the names", "Export the run again")
        raise self._error(f"line {index}", "is neither names, units nor numbers", "Check [csv] delimiter and decimal")

    def _decimal(self, sample: list[list[str]]) -> str | None:
        cells = [c for row in sample for c in row]
        comma = sum("," in c and is_number(c, ",") for c in cells)
        point = sum("." in c and is_number(c, ".") for c in cells)
        seen = "," if comma > point else "."
        if self.spec.decimal is not None and self.spec.decimal != seen and comma != point:
            example = next(c for c in cells if is_number(c, seen) and seen in c)
            what = f"decimal is {self.spec.decimal!r} in the manifest, but numbers look like {example!r}"
            raise self._error("", what, f"Set [csv] decimal = {seen!r}, or leave it out")
        return self.spec.decimal or (seen if comma or point else None)

    def _widen(self, header: _Header, sample: list[list[str]]) -> tuple[str, ...]:
        """Names for every cell of a data line: a trailing delimiter may stand in one line only."""
        widths = [len(row) for row in sample]
        width = max(set(widths), key=widths.count)
        names = header.names
        if len(names) < width:
            extra = [c for row in sample if len(row) == width for c in row[len(names) :]]
            if any(extra):
                what = f"has {len(names)} names, but the samples have {width} cells (the first extra is {extra[0]!r})"
                raise self._error(f"line {header.line}", what, "Check [csv] delimiter and decimal; name every column")
            return names + ("",) * (width - len(names))
        if any(names[width:]):
            what = f"has {len([n for n in names if n])} names, but the samples have {width} cells"
            raise self._error(f"line {header.line}", what, "Check [csv] delimiter and decimal")
        return names[:width]


def columns_of(kind: Callable[[str], bool], sample: list[list[str]]) -> frozenset[int]:
    """Columns whose cells are all of a kind, missing ones apart."""
    width = min((len(row) for row in sample), default=0)
    columns = [[row[i] for row in sample if row[i]] for i in range(width)]
    return frozenset(i for i, cells in enumerate(columns) if cells and all(kind(c) for c in cells))


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line, stripped of white space and quotes; empty for a blank line."""
    if not line.strip():
        return []
    if delimiter == " ":
        return line.split()
    if '"' in line:
        try:
            return [c.strip() for c in next(_csv.reader([line], delimiter=delimiter))]
        except _csv.Error:
            return [c.strip() for c in line.split(delimiter)]
    return [c.strip() for c in line.split(delimiter)]

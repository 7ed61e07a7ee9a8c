"""The head of a text file of which nothing is known: delimiter, decimal mark, names, units, first line of numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from rigdata.problem import Problem, RigDataError
from rigdata.readers.text.byte_stream import codec_of_bytes, head_lines, text_encoding
from rigdata.readers.text.cells import is_date, is_missing, is_number, is_stamp
from rigdata.readers.text.dialect import Dialect, columns_of, split_line

DELIMITERS = (";", "\t", ",", "|", " ")
_UNIT = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
#: So many lines in a row must be numbers for a table to begin.
_RUN = 3
_SAMPLE = 60


@dataclass(frozen=True)
class TextHead:
    """What the first lines of a file tell."""

    dialect: Dialect
    units: tuple[str, ...]
    dates: frozenset[int] = frozenset()

    @property
    def names(self) -> tuple[str, ...]:
        """One per column; "" where there is none."""
        return self.dialect.names


def find_head(path: Path) -> TextHead:
    """Look at the first lines of a text file."""
    encoding = text_encoding(path, None)
    raw = head_lines(path, encoding)
    lines = [line.decode(codec_of_bytes(encoding), "replace") for line, _ in raw]
    best: tuple[int, int, str, str] | None = None  # columns, first line, delimiter, decimal
    for delimiter in DELIMITERS:
        for decimal in ".,":
            if delimiter == decimal or (delimiter == " " and best is not None):
                continue  # a blank within a stamp parts no cells where another delimiter does
            found = _table_start(lines, delimiter, decimal)
            if found is not None and (best is None or found[1] > best[0]):
                best = (found[1], found[0], delimiter, decimal)
    if best is None:
        problem = Problem("error", path.name, "", "no table of numbers begins in its first lines", "Is it a record?")
        raise RigDataError(problem)
    width, first, delimiter, decimal = best
    sample = [c for c in (_cells(t, delimiter) for t in lines[first : first + _SAMPLE]) if c]
    header, names = _names(lines, first, width, delimiter)
    dialect = Dialect(
        encoding=encoding,
        delimiter=delimiter,
        decimal=decimal,
        header_line=header + 1,
        data_line=first + 1,
        data_offset=raw[first][1],
        names=names,
        stamps=columns_of(is_stamp, sample),
    )
    return TextHead(dialect, _units(lines, header, first, names, delimiter), columns_of(is_date, sample))


def _table_start(lines: list[str], delimiter: str, decimal: str) -> tuple[int, int] | None:
    """First line of the first run of lines of numbers, and how many columns they have."""
    run, width = 0, 0
    for i, line in enumerate(lines):
        cells = _cells(line, delimiter)
        good = len(cells) > 1 and all(
            is_number(c, decimal) or is_missing(c) or is_stamp(c) or is_date(c) for c in cells
        )
        good = good and any(is_number(c, decimal) for c in cells)
        run, width = (run + 1, width) if good and len(cells) == width else (int(good), len(cells) if good else 0)
        last = i == len(lines) - 1
        if run >= _RUN or (run and last):
            return i - run + 1, width
    return None


def _cells(line: str, delimiter: str) -> list[str]:
    return split_line(line.rstrip("\r\n"), delimiter)


def _names(lines: list[str], first: int, width: int, delimiter: str) -> tuple[int, tuple[str, ...]]:
    """Index of the highest line above the numbers that has as many cells and words in them; -1 without one."""
    found = -1
    for i in range(first - 1, max(first - 6, -1), -1):
        cells = _cells(lines[i], delimiter)
        if abs(len(cells) - width) <= 1 and len(cells) > 1:
            found = i
        elif cells:
            break
    if found < 0:
        return -1, tuple(f"column{i + 1}" for i in range(width))
    cells = _cells(lines[found], delimiter)[:width]
    return found, tuple(cells + [""] * (width - len(cells)))


def _units(lines: list[str], header: int, first: int, names: tuple[str, ...], delimiter: str) -> tuple[str, ...]:
    """Units from the line below the names, or from brackets in the names."""
    below = _cells(lines[header + 1], delimiter) if header >= 0 and header + 1 < first else []
    out = []
    for i, name in enumerate(names):
        bracket = _UNIT.search(name)
        text = bracket[1] if bracket else (below[i] if i < len(below) else "")
        out.append(text.strip().strip("[]()"))
    return tuple(out)

"""The one reader of tables that come back: results, or another program's, held to the schema cell by cell.

A table is refused, with file, line and column, where a line has another number of cells than there are names, a name is
missing or twice there, a number is text, infinite or below what its quantity can be, or a value is outside its own
interval. Columns that the schema does not know are passed on as text.
"""

import csv
import functools
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from rigdata.near_names import nearest_name
from rigdata.operating_point import ROTATIONS
from tpjb_ident.errors import BadInputError
from tpjb_ident.presentation import UNITS
from tpjb_ident.schema import TABLES, Column, with_endings

#: Larger tables are refused before they are read [bytes].
_LARGEST = 2**28
_DELIMITERS = (",", ";", "\t")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?", re.ASCII)
_NOTHING = ("", "nan", "NaN")
_INFINITE = {"inf": math.inf, "+inf": math.inf, "-inf": -math.inf}
#: Quantities that are one of a few words, with what each means.
_WORDS: dict[str, dict[str, object]] = {
    "truth value": {"True": True, "False": False, "": None},
    "rotation": {**{name: name for name in ROTATIONS}, "": ROTATIONS[0]},
}
#: Ends of columns in US units, ours and as people write them: the same in SI, and the size of the unit in it.
_US = {f"_{us}": (f"_{si}", size) for si, (us, size, zero) in UNITS.items() if not zero}
_US |= {"_lbf_s_per_in": _US["_lbfs_per_in"], "_rpm": ("_Hz", 1.0 / 60.0)}
#: Columns of our exported tables that have another name and unit in results.
_EXPORTED = {"frequency_rad_per_s": ("excitation_Hz", 0.5 / math.pi)}
_US_NAME = re.compile(rf"(\w+?)({'|'.join(_US)})(_lo|_hi|_se|)")


class _Header(NamedTuple):
    """Name of a column in results, the size of its unit there, and what it is by the schema."""

    name: str
    size: float
    definition: Column | None
    ending: str

    def value(self, cell: str) -> object:
        """Text, truth value or number of a cell, in SI."""
        definition = self.definition
        if definition is None or definition.quantity == "text":
            return cell
        words = _WORDS.get(definition.quantity, {})
        if words and cell not in words:
            names = " or ".join(filter(None, words))
            raise ValueError(f"{cell[:40]!r} is not known. Write {names}, or leave the cell empty.")
        if words:
            return words[cell]
        if cell in _NOTHING:
            return math.nan
        if cell in _INFINITE and definition.may_be_infinite(self.ending):
            return _INFINITE[cell]
        number = float(cell) if _NUMBER.fullmatch(cell) else math.nan
        if not math.isfinite(number):
            is_comma = _NUMBER.fullmatch(cell.replace(",", "."))
            remedy = "Write a decimal point" if is_comma else "Leave the cell empty where nothing is known"
            raise ValueError(f"{cell[:40]!r} is no number. {remedy}.")
        least = definition.least(self.ending)
        if number < least:
            raise ValueError(f"{cell[:40]} is below {least:g}, the least that it can be. Correct the cell.")
        return self.size * number


def read_table(path: Path, needed: Sequence[str] = (), misspelt: re.Pattern[str] | None = None) -> pd.DataFrame:
    """Table of a CSV file; `needed` are columns that must be there, `misspelt` what a wrong name looks like.

    Numbers are floats, NaN where a cell is empty; `lines` in the frame's attributes holds the line of each row.
    """
    records = _lines(path)
    line, names = next(records, (1, []))
    if not names:
        raise BadInputError(f"{path.name}: is empty. Give a table with a line of names.")
    header = _header(f"{path.name}, line {line}", path, names)
    columns: dict[str, list[object]] = {column.name: [] for column in header}
    for name in needed:
        if name not in columns:
            near = nearest_name(name, columns)
            hint = f"; {near!r} is not it" if near else ""
            raise BadInputError(f"{path.name}: column {name} is missing{hint}. Add it.")
    for column in header:
        if misspelt is not None and column.definition is None and misspelt.fullmatch(column.name):
            near = nearest_name(column.name, with_endings("", "_se", "_lo", "_hi"))
            raise BadInputError(f"{path.name}: column {column.name!r} is no coefficient. Did you mean {near}?")
    lines = []
    for line, cells in records:
        place = f"{path.name}, line {line}"
        if len(cells) != len(header):
            remedy = "A delimiter at a line's end counts as one; save the table again"
            raise BadInputError(f"{place}: has {len(cells)} cells, the names are {len(header)}. {remedy}.")
        row = {}
        for column, cell in zip(header, cells, strict=True):
            try:
                row[column.name] = column.value(cell.strip())
            except ValueError as error:
                raise BadInputError(f"{place}, {column.name}: {error}") from error
        _refuse_outside_intervals(row, place)
        for name, value in row.items():
            columns[name].append(value)
        lines.append(line)
    frame = pd.DataFrame(columns)
    frame.attrs["lines"] = lines
    return frame


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every line that is neither blank nor a remark; the names come first."""
    try:
        if path.stat().st_size > _LARGEST:
            raise BadInputError(f"{path.name}: is larger than {_LARGEST >> 20} MB. Is it the right file?")
        with path.open(encoding="utf-8-sig", newline="") as stream:
            head = next((line for line in stream if line.lstrip()[:1] not in ("", "#")), "")
            stream.seek(0)
            reader = csv.reader(stream, delimiter=max(_DELIMITERS, key=head.count), strict=True)
            for row in reader:
                if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#"):
                    yield reader.line_num, row
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        remedy = "Save it as CSV with a line of names, in UTF-8"
        raise BadInputError(f"{path.name}: cannot be read as a table ({reason}). {remedy}.") from error


def _header(place: str, path: Path, names: list[str]) -> list[_Header]:
    """What each column is, by its name in SI; US units are known by their ends."""
    header = {}
    for number, text in enumerate(names, start=1):
        name, size = _EXPORTED.get(text.strip(), (text.strip(), 1.0))
        if match := _US_NAME.fullmatch(name):
            unit, size = _US[match[2]]
            name = match[1] + unit + match[3]
        if not name:
            raise BadInputError(f"{place}: column {number} has no name. Delete the delimiter, or name the column.")
        if name in header:
            raise BadInputError(f"{place}: column {name!r} is there twice. Delete one of them.")
        header[name] = _Header(name, size, *column_of(name, path.stem))
    return list(header.values())


@functools.lru_cache(maxsize=4096)
def column_of(name: str, table: str = "") -> tuple[Column | None, str]:
    """Column of the schema that a name stands for, first of a table's own, and its ending; None where there is none."""
    for column in (*TABLES.get(table, ()), *itertools.chain.from_iterable(TABLES.values())):
        match = re.fullmatch(column.pattern(), name)
        if match is not None:
            return column, (match[match.re.groups] or "") if column.endings else ""
    return None, ""


def _refuse_outside_intervals(row: dict[str, object], place: str) -> None:
    """Refuse a value outside its own interval, of which one end may be missing."""
    for base in {name[:-3] for name in row if name.endswith(("_lo", "_hi"))}:
        low, value, high = (row.get(base + ending, math.nan) for ending in ("_lo", "", "_hi"))
        numbers = isinstance(low, float) and isinstance(value, float) and isinstance(high, float)
        if numbers and (low > high or value < low or value > high):  # type: ignore[operator]
            shown = f"{value:g} is not within {low:g} to {high:g}"
            raise BadInputError(f"{place}, {base}: {shown}, its interval. Correct the cells.")

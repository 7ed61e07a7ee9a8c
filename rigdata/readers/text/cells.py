"""What a cell of a text export says: a number, a missing value, date and time of day in place of seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray

_CLOCK = r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?"
_ZONE = r"(?:\s?(?:Z|UTC|[+-]\d{2}:?\d{2}))?"
#: Year first (ISO 8601), day first with points, day or month first with slashes, no date.
_ISO = r"(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ]\s?"
_STAMP = re.compile(rf"(?:{_ISO}|(\d{{1,2}})[./](\d{{1,2}})[./](\d{{4}})[T ]\s?)?{_CLOCK}{_ZONE}")
_DATE = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{4}")
_DAY = 86400.0
#: Ways in which loggers and spreadsheets write "no value".
MISSING = (
    "",
    "NaN",
    "nan",
    "NAN",
    "-NaN",
    "-nan",
    "-nan(ind)",
    "-",
    "--",
    "---",
    "----",
    "-----",
    "*",
    "***",
    "?",
    "NA",
    "N/A",
    "n/a",
    "#N/A",
    "#NA",
    "#NV",
    "#VALUE!",
    "#WERT!",
    "#DIV/0!",
    "null",
    "NULL",
    "None",
    "none",
    "1.#QNAN",
    "-1.#QNAN",
    "1.#IND",
    "-1.#IND",
    "1.#INF",
    "-1.#INF",
    "1,#QNAN",
    "-1,#QNAN",
    "1,#IND",
    "-1,#IND",
    "1,#INF",
    "-1,#INF",
    "1.#R",
    "OVL",
    "+OVL",
    "-OVL",
    "OL",
    "+OL",
    "-OL",
    "OVER",
    "OVERLOAD",
    "OVERFLOW",
    "Overflow",
    "INVALID",
    "Invalid",
    "ERR",
    "inf",
    "-inf",
    "+inf",
    "Inf",
    "-Inf",
    "INF",
    "-INF",
)
_MISSING = frozenset(MISSING)
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:[0-9]+(?:{re.escape(mark)}[0-9]*)?|{re.escape(mark)}[0-9]+)(?:[eE][+-]?[0-9]+)?")
    for mark in ".,"
}


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, with or without a date.

    >>> [is_stamp(c) for c in ("2019-07-22T11:31:22.125Z", "22.07.2019 11:31:22,125", "11:31:22.5", "12.5")]
    [True, True, True, False]
    """
    return _STAMP.fullmatch(cell) is not None


def is_date(cell: str) -> bool:
    """Whether a cell holds a date alone: such a column tells nothing within a run."""
    return _DATE.fullmatch(cell) is not None


def stamp_seconds(cells: Sequence[str | None]) -> tuple[FloatArray, int]:
    """Seconds from the first stamp of a column, and how many cells hold none where one should be.

    Stamps coarser than the samples are spread evenly: several samples then bear one stamp, and the straight line
    through them is nearer to the truth than the steps. Midnight between stamps without a date is a day.
    """
    found = [_STAMP.fullmatch(cell) if cell else None for cell in cells]
    bad = sum(match is None and bool(cell) for match, cell in zip(found, cells, strict=True))
    days: dict[tuple[str, ...], float] = {}
    seconds = np.array([np.nan if match is None else _seconds(match, days) for match in found])
    good = np.isfinite(seconds)
    if not good.any():
        return seconds, bad
    known = seconds[good]
    if not days:
        known = known + _DAY * np.concatenate([[0.0], np.cumsum(np.diff(known) < -0.5 * _DAY)])
    seconds[good] = _spread(known - known[0])
    return seconds, bad


def _seconds(match: re.Match[str], days: dict[tuple[str, ...], float]) -> float:
    year, month, day, d1, d2, y2, hour, minute, second, part = match.groups()
    start = 0.0
    if year or y2:
        key = (year, month, day) if year else (y2, d2, d1)
        if key not in days:
            date = "-".join(f"{int(p):02d}" for p in key)
            try:
                days[key] = float(np.datetime64(date).astype("datetime64[s]").astype(np.int64))
            except ValueError:  # month first
                swapped = f"{int(key[0]):04d}-{int(key[2]):02d}-{int(key[1]):02d}"
                try:
                    days[key] = float(np.datetime64(swapped).astype("datetime64[s]").astype(np.int64))
                except ValueError:
                    return float("nan")
        # counted from the first day: seconds since 1970 would cost the digits below a microsecond
        start = days[key] - next(iter(days.values()))
    return start + 3600.0 * int(hour) + 60.0 * int(minute) + int(second) + (float(f"0.{part}") if part else 0.0)


def _spread(time: FloatArray) -> FloatArray:
    """Even times where several samples in a row bear one stamp, and no stamp is farther off than its own step."""
    steps = np.diff(time)
    if len(time) < 8 or not (steps == 0).any() or not (steps > 0).any():
        return time
    resolution = float(steps[steps > 0].min())
    index = np.arange(len(time))
    slope, start = np.polyfit(index, time, 1)
    even = start + slope * index
    return even - even[0] if np.abs(even - time).max() <= 1.5 * resolution else time


def is_missing(cell: str) -> bool:
    """Whether `cell` (stripped) stands for no value."""
    return cell in _MISSING


def is_number(cell: str, decimal: str) -> bool:
    """Whether `cell` (stripped) is a number with that decimal mark."""
    return _NUMBER[decimal].fullmatch(cell) is not None


def looks_like(cell: str) -> bool:
    """Whether `cell` is a number with either decimal mark."""
    return is_number(cell, ".") or is_number(cell, ",")


def number_pattern(decimal: str) -> str:
    """Regular expression (RE2) of a number, for whole columns."""
    return f"^(?:{_NUMBER[decimal].pattern})$"

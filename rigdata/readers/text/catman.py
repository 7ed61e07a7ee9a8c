"""ASCII files of catman and its like with several time bases: each time column rules the columns to its right."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.problem import Problem, RigDataError
from rigdata.readers.series import Series, is_time, seconds
from rigdata.readers.text.csv_table import Source, read_table
from rigdata.readers.text.head import find_head

_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
_SPARE = re.compile(r"\s+(?:\d+\s*)?-.*$")  # "Time  1 - default sample rate"


def has_several_clocks(path: Path) -> bool:
    """Whether the names line of a text file holds more than one time column."""
    try:
        head = find_head(path)
    except (RigDataError, OSError):
        return False
    return sum(is_time(_short(n)) for n in head.names) > 1


def time_column(path: Path) -> str:
    """Name of the first time column of a text file; "" without one."""
    return next((n for n in map(_short, find_head(path).names) if is_time(n)), "")


def read_series(path: Path) -> list[Series]:
    """Read every column with the clock at its left."""
    head = find_head(path)
    labels = tuple(f"{i}:{_short(n)}" for i, n in enumerate(head.names))  # names need not be unique, labels must
    numbers = [label for i, label in enumerate(labels) if i not in head.dates]
    table = read_table(Source(path, path.name, None, replace(head.dialect, names=labels)), numbers)
    clock: np.ndarray | None = None
    found = []
    for i, (name, label) in enumerate(zip(head.names, labels, strict=True)):
        if label not in table.columns:
            continue
        values, unit = table.columns[label], head.units[i]
        if is_time(_short(name)):
            clock = seconds(values, unit)
        elif _short(name) and np.isfinite(values).any():
            found.append(_ended(_short(name), unit, values, clock, f"column {i + 1}"))
    if not found:
        raise RigDataError(Problem("error", path.name, "", "holds no column of numbers", "Export the run again"))
    return found


def _ended(name: str, unit: str, values: np.ndarray, clock: np.ndarray | None, group: str) -> Series:
    """Cut a slow column where its clock ends: below, the file is padded with blanks."""
    if clock is None:
        return Series(name, unit, values, None, group)
    last = int(np.flatnonzero(np.isfinite(clock))[-1]) + 1 if np.isfinite(clock).any() else 0
    return Series(name, unit, values[:last], clock[:last], group)


def _short(name: str) -> str:
    """Name without its unit and without what catman says of its rate."""
    bare = _UNIT.sub("", name).strip()
    return _SPARE.sub("", bare) if is_time(bare) else bare

"""ASCII files of catman and its like with several time bases: each time column rules the columns to its right."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import RigDataError, refuse
from rigdata.readers.series import Series, is_time, seconds
from rigdata.readers.text.csv import Source, read_table
from rigdata.readers.text.head import find_head, without_unit

_RATE_TEXT = re.compile(r"\s+(?:\d+\s*)?-.*$")  # "Time  1 - default sample rate"


def has_several_clocks(path: Path) -> bool:
    """Whether the names line of a text file holds more than one time column."""
    try:
        head = find_head(path)
    except (RigDataError, OSError):
        return False
    return sum(is_time(_short(name)) for name in head.names) > 1


def time_column(path: Path) -> str:
    """Name of the first time column of a text file; "" without one."""
    return next(filter(is_time, map(_short, find_head(path).names)), "")


def read_series(path: Path) -> list[Series]:
    """Read every column with the clock at its left."""
    head = find_head(path)
    names = [_short(name) for name in head.names]
    labels = tuple(f"{i}:{name}" for i, name in enumerate(names))  # names need not be unique, labels must
    wanted = [label for i, label in enumerate(labels) if i not in head.dates]
    columns = read_table(Source(path, path.name, None, replace(head, names=labels)), wanted).values
    clock: FloatArray | None = None
    series = []
    for i, (name, label) in enumerate(zip(names, labels, strict=True)):
        if label not in columns:
            continue
        values = columns[label]
        if is_time(name):
            clock = seconds(values, head.units[i])
        elif name and np.isfinite(values).any():
            length = len(values)
            if clock is not None:  # below the end of a slow clock the file is padded with blanks
                length = int(np.flatnonzero(np.isfinite(clock)).max(initial=-1)) + 1
            time = None if clock is None else clock[:length]
            series.append(Series(name, head.units[i], values[:length], time, f"column {i + 1}"))
    if not series:
        raise refuse(path.name, "", "holds no column of numbers", "Export the run again")
    return series


def _short(name: str) -> str:
    """Name without its unit and without what catman says of its rate."""
    bare = without_unit(name).strip()
    return _RATE_TEXT.sub("", bare) if is_time(bare) else bare

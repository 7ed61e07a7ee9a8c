"""Text files without a manifest: every column of numbers, at the times of its time column."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.problem import refuse
from rigdata.readers.series import Series, is_time
from rigdata.readers.text.csv import Source, read_table
from rigdata.readers.text.head import find_head, without_unit

_RATE_TEXT = re.compile(r"\s+(?:\d+\s*)?-.*$")  # "Time  1 - default sample rate"


def time_column(path: Path) -> str:
    """Name of the first time column of a text file; "" without one."""
    return next(filter(is_time, map(_short, find_head(path).names)), "")


def read_series(path: Path) -> list[Series]:
    """Read every column that is not empty."""
    head = find_head(path)
    labels = tuple(f"{i}:{_short(name)}" for i, name in enumerate(head.names))  # names need not be unique, labels must
    wanted = [label for i, label in enumerate(labels) if i not in head.dates]
    columns = read_table(Source(path, path.name, None, replace(head, names=labels)), wanted).values
    series = []
    for i, label in enumerate(labels):
        name = label.partition(":")[2]
        if name and label in columns and np.isfinite(columns[label]).any():
            series.append(Series(name, head.units[i], columns[label], None, f"column {i + 1}"))
    if all(is_time(column.name) for column in series):
        raise refuse(path.name, "", "holds no column of numbers", "Export the run again")
    return series


def _short(name: str) -> str:
    """Name without its unit and without what catman says of its rate."""
    bare = without_unit(name).strip()
    return _RATE_TEXT.sub("", bare) if is_time(bare) else bare

"""Parquet tables: one column per channel; a column named like a time, or the rate in the metadata, is the clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigdata.readers.series import Series, equidistant
from rigdata.readers.time_names import is_time, seconds


def read_series(path: Path) -> list[Series]:
    """Read every column of numbers.

    Field metadata ``unit`` gives a column's unit, table metadata ``sample_rate_hz`` the rate where no column is a time.

    Parameters
    ----------
    path : Path
        ``.parquet``.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    units = {f.name: (f.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") for f in table.schema}
    columns = {
        f.name: table.column(f.name).cast(pa.float64()).to_numpy()
        for f in table.schema
        if pa.types.is_integer(f.type) or pa.types.is_floating(f.type)
    }
    clock = next((n for n in columns if is_time(n)), None)
    time = None if clock is None else seconds(columns.pop(clock), units[clock])
    rate = (table.schema.metadata or {}).get(b"sample_rate_hz")
    if time is None and rate is not None and columns:
        time = equidistant(table.num_rows, 1.0 / float(rate))
    return [Series(n, units[n], np.asarray(v, dtype=float), time) for n, v in columns.items()]

"""Parquet tables: one column per channel; a column named like a time, or the rate in the metadata, is the clock."""

from __future__ import annotations

from pathlib import Path

from rigdata.readers.series import Series, equidistant, is_time, seconds, to_temporary_file


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

    with pq.ParquetFile(path) as table:
        schema, rows = table.schema_arrow, table.metadata.num_rows
        columns = {
            f.name: to_temporary_file(table.read([f.name]).column(0).cast(pa.float64()).to_numpy())
            for f in schema
            if pa.types.is_integer(f.type) or pa.types.is_floating(f.type)
        }
    units = {f.name: (f.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") for f in schema}
    clock = next((n for n in columns if is_time(n)), None)
    time = None if clock is None else seconds(columns.pop(clock), units[clock])
    rate = (schema.metadata or {}).get(b"sample_rate_hz")
    if time is None and rate is not None and columns:
        time = equidistant(rows, 1.0 / float(rate))
    return [Series(n, units[n], v, time) for n, v in columns.items()]

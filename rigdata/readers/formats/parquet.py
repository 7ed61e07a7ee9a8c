"""Parquet tables: one column per channel; a column named like a time, or the rate in the metadata, is the clock."""

from __future__ import annotations

from pathlib import Path

from rigdata.readers.base import SAMPLE, refuse_claim
from rigdata.readers.series import Series, equidistant, is_time, to_temporary_file


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

    columns, units = {}, {}
    with path.open("rb") as stream, pq.ParquetFile(stream) as table:
        schema, rows = table.schema_arrow, table.metadata.num_rows
        numeric = [c for c in schema if pa.types.is_integer(c.type) or pa.types.is_floating(c.type)]
        refuse_claim(SAMPLE * rows * (len(numeric) + 1), path.stat().st_size, path.name)
        for column in numeric:
            values = table.read([column.name]).column(0).cast(pa.float64()).to_numpy()
            columns[column.name] = to_temporary_file(values)
            units[column.name] = (column.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
    rate = (schema.metadata or {}).get(b"sample_rate_hz")
    is_timed = any(map(is_time, columns))
    time = equidistant(rows, 1.0 / float(rate)) if rate is not None and not is_timed else None
    return [Series(name, units[name], values, time) for name, values in columns.items()]

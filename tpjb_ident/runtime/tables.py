"""Tables on disk: CSV and Parquet under one name, whole or not at all, safe to open in a spreadsheet."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.runtime.provenance import TABLE_SCHEMA

if TYPE_CHECKING:
    import pandas as pd

#: A text cell that starts like this is a formula to a spreadsheet.
_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_SIGNS = {"um": "µm", "degC": "°C", "m/s^2": "m/s²"}
_UNIT = re.compile(r"(?:(?<=\d )|(?<=nan )|\A)(um|degC|m/s\^2)(?![\w/^'\"])")


def write_atomic(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then put it in place in one step."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)  # mkstemp gives 0600; results are for colleagues too
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text with Unix line ends, whole or not at all."""
    # UTF-8 has no sign for a file name's broken bytes; JSON reads the escape back as what it stands for
    form = {"encoding": "utf-8", "errors": "backslashreplace", "newline": "\n"}
    write_atomic(path, lambda part: part.write_text(text, **form))


def write_table(folder: Path, name: str, frame: pd.DataFrame) -> None:
    """Write ``name.csv`` and ``name.parquet``."""
    write_csv(folder / f"{name}.csv", frame)
    write_atomic(folder / f"{name}.parquet", lambda path: write_parquet(path, frame))


def write_csv(path: Path, frame: pd.DataFrame) -> None:
    """Write a CSV file that no spreadsheet takes for formulas, whole or not at all."""
    safe = safe_for_spreadsheets(frame)
    write_atomic(path, lambda part: safe.to_csv(part, index=False, lineterminator="\n"))


def write_parquet(path: Path, frame: pd.DataFrame, **metadata: str) -> None:
    """Write a Parquet file with the schema of all tables in its metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(frame, preserve_index=False)
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), "schema": TABLE_SCHEMA, **metadata})
    with path.open("wb") as stream:  # pyarrow takes no path that is not UTF-8
        pq.write_table(table, stream)


def safe_for_spreadsheets(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a copy whose text cells and column names no spreadsheet takes for formulas."""
    safe = frame.copy()
    for column in safe.columns:
        if safe[column].dtype.kind not in "biufcmM":
            safe[column] = safe[column].map(_disarm)
    safe.columns = [_disarm(str(column)) for column in safe.columns]
    return safe


def _disarm(cell: Any) -> Any:
    if not isinstance(cell, str):
        return cell
    safe = "'" + cell if cell.startswith(_FORMULA_STARTS) else cell
    # A carriage return within a cell is not quoted by the csv module: what follows it would begin a line of its own.
    return safe.replace("\r", " ")


def readable(text: object) -> str:
    """`printable`, its units with the signs that people write: µm, °C, m/s².

    >>> readable("30 um at 45 degC, '30 um'")
    "30 µm at 45 °C, '30 um'"
    """
    return _UNIT.sub(lambda match: _SIGNS[match[1]], printable(text))


def printable(text: object) -> str:
    """Text from outside without control characters: nothing that steers a terminal or turns writing round."""
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", str(text))

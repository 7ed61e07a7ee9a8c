"""A plain table of the coefficients: CSV, Parquet, or an Excel workbook."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.export.points import COLUMNS, ExportError, StaticPoint
from tpjb_ident.runtime.tables import printable, safe_for_spreadsheets, write_atomic

if TYPE_CHECKING:
    import pandas as pd


def coefficient_table(points: tuple[StaticPoint, ...]) -> pd.DataFrame:
    """One row per static point and frequency: speed in rpm, frequency in rad/s, K and C in SI."""
    import pandas as pd

    parts = [
        pd.DataFrame(
            {
                "static_load_N": p.load,
                "static_load_direction_deg": p.direction,
                "shaft_speed_rpm": 60 * p.speed,
                "frequency_rad_per_s": p.frequency,
                **{COLUMNS[name]: values for name, values in p.coefficients.items()},
            }
        )
        for p in points
    ]
    return pd.concat(parts, ignore_index=True)


def write_csv(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.csv."""
    frame = safe_for_spreadsheets(coefficient_table(points))
    path = folder / "bearing_coefficients.csv"
    write_atomic(path, lambda part: frame.to_csv(part, index=False, encoding="utf-8", lineterminator="\n"))


def write_parquet(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.parquet; the source stands in the table's metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(coefficient_table(points), preserve_index=False)
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), b"source": printable(source).encode()})
    write_atomic(folder / "bearing_coefficients.parquet", lambda part: pq.write_table(table, part))


def write_excel(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.xlsx: all coefficients on one sheet, what they are on another.

    Every text is written as text, so that no cell from outside can become a formula.

    Raises
    ------
    ExportError
        openpyxl is not installed.
    """
    try:
        from openpyxl import Workbook
    except ModuleNotFoundError as error:
        raise ExportError('an Excel file needs openpyxl. Install it: pip install "tpjb-ident[excel]"') from error
    book = Workbook()
    sheet = book.active
    sheet.title = "coefficients"
    frame = coefficient_table(points)
    for column, name in enumerate(frame.columns, start=1):
        _text(sheet.cell(1, column), str(name))
        sheet.column_dimensions[sheet.cell(1, column).column_letter].width = max(12, len(str(name)) + 2)
        for row, value in enumerate(frame[name].to_numpy(dtype=float), start=2):
            sheet.cell(row, column).value = float(value) if np.isfinite(value) else None
    sheet.freeze_panes = "A2"
    about = book.create_sheet("about")
    lines = (printable(source), "K = Re h, C = Im h / omega at the excitation frequency; SI units.",
             "frequency_rad_per_s is the excitation; the shaft speed is constant along it.")  # fmt: skip
    for row, line in enumerate(lines, start=1):
        _text(about.cell(row, 1), line)
    write_atomic(folder / "bearing_coefficients.xlsx", lambda part: book.save(part))


def _text(cell: Any, text: str) -> None:
    cell.value = text
    cell.data_type = "s"  # openpyxl would take a leading = for a formula

"""Tables of the coefficients: CSV, Parquet, an Excel workbook, a MATLAB file; and the intervals beside the rest."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.exports.formats import COLUMNS, ENDS, ExportError, flags
from tpjb_ident.presentation import us_table
from tpjb_ident.runtime import tables
from tpjb_ident.runtime.tables import printable, write_atomic
from tpjb_ident.schema import KINDS, STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

NAME = "bearing_coefficients"
#: Beside files of a form that holds no intervals.
INTERVALS = f"{NAME}_intervals"
_TIME, _NO_TIME = re.compile(rb"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:.]+Z"), b"1980-01-01T00:00:00Z"
#: Text at the start of a MATLAB file, in place of one with the time.
_MAT_HEAD = b"MATLAB 5.0 MAT-file, written by tpjb-ident".ljust(116)
#: Matrices of a MATLAB file: K, C and the ends of their intervals.
_MATRICES = ("K", "C", "K_lo", "K_hi", "C_lo", "C_hi")


def _coefficient_table(points: pd.DataFrame) -> pd.DataFrame:
    """The table as it leaves: speed in rpm, frequency in rad/s."""
    intervals = [name + end for name in COLUMNS.values() for end in ENDS]
    rates = {
        "shaft_speed_rpm": 60 * points["shaft_speed_Hz"],
        "frequency_rad_per_s": 2 * np.pi * points["excitation_Hz"],
    }
    place = ["static_load_N", "static_load_direction_deg", "shaft_speed_rpm", "rotation", "frequency_rad_per_s"]
    return points.assign(**rates)[[*place, *intervals, "quality", "trusted"]]


def write_csv(folder: Path, points: pd.DataFrame, source: str, name: str = NAME) -> None:
    """Write bearing_coefficients.csv into an existing folder, or the same table under another name."""
    tables.write_csv(folder / f"{name}.csv", _coefficient_table(points))


def write_us(folder: Path, points: pd.DataFrame, name: str) -> None:
    """Write the same table in US units, beside what stays SI."""
    tables.write_csv(folder / f"{name}_us.csv", us_table(_coefficient_table(points)))


def write_parquet(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.parquet; the source stands in the table's metadata."""
    frame = _coefficient_table(points)
    write_atomic(folder / f"{NAME}.parquet", lambda part: tables.write_parquet(part, frame, source=printable(source)))


def write_excel(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.xlsx: all coefficients on one sheet, what they are on another.

    Every text is written as text, so that no cell from outside can become a formula. Rows that are not to be trusted
    are red.
    """
    import pandas as pd

    try:
        import openpyxl.styles
    except ModuleNotFoundError as error:
        raise ExportError('an Excel file needs openpyxl. Install it: pip install "tpjb-ident[excel]"') from error
    frame = _coefficient_table(points)
    lines = [
        printable(source),
        "K = Re h, C = Im h / omega at the excitation frequency; SI units.",
        "frequency_rad_per_s is the excitation; the shaft speed is constant along it.",
        "_lo and _hi: 95 % interval, random and calibration errors together; empty for a prediction.",
        "quality: named conditions, explained in the report; trusted: FALSE was exported against advice.",
    ]
    for load, rows in points.groupby("static_load_N"):
        lines += [f"{load:g} N {flag}" for flag in flags(rows)]
    content = io.BytesIO()
    with pd.ExcelWriter(content, engine="openpyxl") as writer:
        frame.to_excel(writer, sheet_name="coefficients", index=False, freeze_panes=(1, 0))
        pd.DataFrame(lines).to_excel(writer, sheet_name="about", index=False, header=False)
        sheet = writer.sheets["coefficients"]
        for column in sheet.columns:
            sheet.column_dimensions[column[0].column_letter].width = max(12, len(str(column[0].value)) + 2)
        for row, trusted in zip(sheet.iter_rows(min_row=2), frame["trusted"], strict=True):
            for cell in row if not trusted else ():
                cell.font = openpyxl.styles.Font(color="C00000")
        for row in (*sheet.rows, *writer.sheets["about"].rows):
            for cell in row:
                if isinstance(cell.value, str):
                    cell.data_type = "s"  # openpyxl would take a leading = for a formula

    def write(part: Path) -> None:
        """Without the times of its making: the same results are the same bytes."""
        with zipfile.ZipFile(content) as archive, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as written:
            for name in archive.namelist():
                entry = archive.read(name)
                entry = _TIME.sub(_NO_TIME, entry) if name == "docProps/core.xml" else entry
                written.writestr(zipfile.ZipInfo(name), entry, zipfile.ZIP_DEFLATED)

    write_atomic(folder / f"{NAME}.xlsx", write)


def write_mat(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.mat (MATLAB 5): struct array ``bearing``.

    K and C are 2 x 2 x n, so are ``K_lo``, ``K_hi``, ``C_lo``, ``C_hi``, the ends of their 95 % intervals (NaN where
    there are none); ``quality`` is a cell array of n texts, ``trusted`` n truth values.
    """
    from scipy.io import savemat

    members = [_struct(rows) for _, rows in points.groupby(list(STATIC_KEY))]
    array = np.array([tuple(member.values()) for member in members], dtype=[(name, object) for name in members[0]])
    content = {"bearing": array, "source": printable(source)}
    file = io.BytesIO()
    savemat(file, content, oned_as="column", appendmat=False)
    timeless = _MAT_HEAD + file.getvalue()[len(_MAT_HEAD) :]
    write_atomic(folder / f"{NAME}.mat", lambda part: part.write_bytes(timeless))


def _struct(rows: pd.DataFrame) -> dict[str, Any]:
    """Fields of one static point, for MATLAB."""
    load, direction, speed, rotation = rows[list(STATIC_KEY)].iloc[0]
    matrices = {}
    for name in _MATRICES:
        columns = [column + name[1:] for column in KINDS[name[0].lower()].columns]
        matrices[name] = rows[columns].to_numpy().T.reshape(2, 2, -1)
    return {
        "load_N": load,
        "direction_deg": direction,
        "speed_Hz": speed,
        "frequency_rad_per_s": 2 * np.pi * rows["excitation_Hz"].to_numpy(),
        **matrices,
        "quality": np.array([printable(text) for text in rows["quality"]], dtype=object),
        "trusted": rows["trusted"].to_numpy(),
        "rotation": rotation,
    }

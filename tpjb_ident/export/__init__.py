"""Coefficients in the forms that other programs read, and records as dictionaries (SEP 005)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tpjb_ident.export.matlab import write_mat
from tpjb_ident.export.points import COLUMNS, ExportError, StaticPoint, static_points
from tpjb_ident.export.ross import ross_text, write_ross
from tpjb_ident.export.rotor_programs import write_ansys, write_dyrobes, write_xltrc
from tpjb_ident.export.structural import sep005
from tpjb_ident.export.table import write_csv, write_excel, write_parquet

#: How each format of ``tpjb export --to`` is written.
WRITERS: dict[str, Callable[[Path, tuple[StaticPoint, ...], str], None]] = {
    "ross": write_ross,
    "csv": write_csv,
    "parquet": write_parquet,
    "excel": write_excel,
    "mat": write_mat,
    "xltrc": write_xltrc,
    "dyrobes": write_dyrobes,
    "ansys": write_ansys,
}

__all__ = [
    "COLUMNS",
    "WRITERS",
    "ExportError",
    "StaticPoint",
    "ross_text",
    "sep005",
    "static_points",
    "write_ansys",
    "write_csv",
    "write_dyrobes",
    "write_excel",
    "write_mat",
    "write_parquet",
    "write_ross",
    "write_xltrc",
]

"""Coefficients in the forms that other programs read, and records as dictionaries (SEP 005)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tpjb_ident.callable_package import make_callable

if TYPE_CHECKING:
    from tpjb_ident.export.formats import FORMATS, ExportError, Format, export_format
    from tpjb_ident.export.points import COLUMNS, Chosen, StaticPoint, static_points
    from tpjb_ident.export.structural import sep005
    from tpjb_ident.export.write import Export, export

#: Imported on first use: the command line asks for the names of the formats alone.
_HOMES = {
    "COLUMNS": "points",
    "FORMATS": "formats",
    "Chosen": "points",
    "Export": "write",
    "ExportError": "formats",
    "Format": "formats",
    "StaticPoint": "points",
    "export": "write",
    "export_format": "formats",
    "sep005": "structural",
    "static_points": "points",
}

__all__ = [
    "COLUMNS",
    "FORMATS",
    "Chosen",
    "Export",
    "ExportError",
    "Format",
    "StaticPoint",
    "export",
    "export_format",
    "sep005",
    "static_points",
]


make_callable(__name__, "tpjb_ident.export.write:export")  # ti.export(...)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tpjb_ident.export' has no attribute {name!r}")
    return getattr(importlib.import_module(f"tpjb_ident.export.{_HOMES[name]}"), name)

"""Coefficients in the forms that other programs read, and records as dictionaries (SEP 005)."""

from __future__ import annotations

import importlib
from typing import Any

from tpjb_ident.callable_package import make_callable

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

__all__ = sorted(_HOMES)

make_callable(__name__, "tpjb_ident.export.write:export")  # ti.export(...)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tpjb_ident.export' has no attribute {name!r}")
    return getattr(importlib.import_module(f"tpjb_ident.export.{_HOMES[name]}"), name)

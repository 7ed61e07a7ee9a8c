"""Reports: one self-contained HTML page with its figures; the only place that knows matplotlib."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpjb_ident.report import plots
    from tpjb_ident.report.comparison_page import write_comparison_report as write_report

__all__ = ["plots", "write_report"]


def __getattr__(name: str) -> Any:
    if name == "plots":
        return importlib.import_module("tpjb_ident.report.plots")
    if name != "write_report":
        raise AttributeError(f"module 'tpjb_ident.report' has no attribute {name!r}")
    from tpjb_ident.report.comparison_page import write_comparison_report

    return write_comparison_report

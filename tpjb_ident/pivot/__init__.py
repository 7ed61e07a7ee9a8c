"""Dry pivot tests to load-deflection curves per pad (paper, Sec. 5)."""

from tpjb_ident.pivot.curve import PivotCurve, PivotSteps
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.pivot.hysteresis import Hysteresis
from tpjb_ident.pivot.pivots_toml import pivots_text, write_pivots
from tpjb_ident.pivot.records.settings import PivotSettings
from tpjb_ident.pivot.table import pads_table, pivot_table

__all__ = [
    "Hysteresis",
    "PivotCurve",
    "PivotSettings",
    "PivotSteps",
    "fit_pivots",
    "pads_table",
    "pivot_table",
    "pivots_text",
    "write_pivots",
]

"""Dry pivot tests to load-deflection curves per pad (paper, Sec. 5)."""

from tpjb_ident.pivot.curve import Hysteresis, PivotCurve, PivotSteps
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.pivot.tables import pads_table, pivot_table, pivots_text, write_pivots

__all__ = [
    "Hysteresis",
    "PivotCurve",
    "PivotSteps",
    "fit_pivots",
    "pads_table",
    "pivot_table",
    "pivots_text",
    "write_pivots",
]

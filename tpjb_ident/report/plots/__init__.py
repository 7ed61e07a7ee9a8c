"""Pictures of results: one function per figure, each takes result objects and returns a matplotlib figure.

No global style is set and pyplot is not needed: a figure saves itself (`savefig`) and shows itself in a notebook. Units
stand in the axis labels, bands and bars are 95 % intervals, and line and marker tell curves apart without colour. What
each function shows, and which figure of the paper it is, stands in docs/plots.md.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpjb_ident.report.plots.coherence_lines import coherence_spectrum
    from tpjb_ident.report.plots.coherence_points import coherence
    from tpjb_ident.report.plots.fig02_pad_deformation import pad_deformation
    from tpjb_ident.report.plots.fig10_pad_projection import pad_projection
    from tpjb_ident.report.plots.fig11_load_deflection import load_deflection
    from tpjb_ident.report.plots.fig12_pivot_stiffness import pivot_stiffness
    from tpjb_ident.report.plots.fig13_pivots_of_bearings import pivots_of_bearings
    from tpjb_ident.report.plots.fig14_clearance_and_locus import clearance_and_locus
    from tpjb_ident.report.plots.fig15_direct_coefficients import direct_coefficients
    from tpjb_ident.report.plots.fig17_coefficient import coefficient
    from tpjb_ident.report.plots.gap_bars import gap
    from tpjb_ident.report.plots.gap_beside_controls import gap_controls
    from tpjb_ident.report.plots.isolability_map import isolability
    from tpjb_ident.report.plots.residual_heat import residual_map
    from tpjb_ident.report.plots.residual_lines import residual_series
    from tpjb_ident.report.plots.weights_of_windows import window_weights

#: In which file each picture is drawn. Files and functions have different names: a submodule would hide its function.
_FILES = {
    "clearance_and_locus": "fig14_clearance_and_locus",
    "coefficient": "fig17_coefficient",
    "coherence": "coherence_points",
    "coherence_spectrum": "coherence_lines",
    "direct_coefficients": "fig15_direct_coefficients",
    "gap": "gap_bars",
    "gap_controls": "gap_beside_controls",
    "isolability": "isolability_map",
    "load_deflection": "fig11_load_deflection",
    "pad_deformation": "fig02_pad_deformation",
    "pad_projection": "fig10_pad_projection",
    "pivot_stiffness": "fig12_pivot_stiffness",
    "pivots_of_bearings": "fig13_pivots_of_bearings",
    "residual_map": "residual_heat",
    "residual_series": "residual_lines",
    "window_weights": "weights_of_windows",
}

__all__ = [
    "clearance_and_locus",
    "coefficient",
    "coherence",
    "coherence_spectrum",
    "direct_coefficients",
    "gap",
    "gap_controls",
    "isolability",
    "load_deflection",
    "pad_deformation",
    "pad_projection",
    "pivot_stiffness",
    "pivots_of_bearings",
    "residual_map",
    "residual_series",
    "window_weights",
]


def __getattr__(name: str) -> Any:
    if name not in _FILES:
        import difflib

        near = difflib.get_close_matches(name, _FILES, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'tpjb_ident.report.plots' has no attribute {name!r}{hint}")
    return getattr(importlib.import_module(f"tpjb_ident.report.plots.{_FILES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

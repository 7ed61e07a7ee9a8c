"""Pivots of the dry tests: stiffness over load beside the printed formula, load steps, projection on the pads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.plots.load_deflection import load_deflection
from tpjb_ident.report.plots.pad_projection import pad_projection
from tpjb_ident.report.plots.pivot_stiffness import Formula, pivot_stiffness

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve

GROUP = "Pivots, from the dry tests"


def pivot_panels(curves: Sequence[PivotCurve], formula: Formula | None = None) -> list[Panel]:
    """Draw the tangent stiffness of every pad, its load steps, and how they were projected.

    Parameters
    ----------
    curves : sequence of PivotCurve
    formula : callable, optional
        The printed formula, see `pivot_stiffness`.
    """
    if not curves:
        return []
    bands = "Pivot tangent stiffness over load, 95 % bands"
    steps = "Load steps and fitted laws, pivot and housing together"
    across = "Load and displacement vectors, and what of them lies on each pad's direction"
    return [
        panel("pivot-stiffness", bands, partial(pivot_stiffness, curves, formula), GROUP),
        panel("pivot-steps", steps, partial(load_deflection, curves), GROUP),
        panel("pivot-projection", across, partial(pad_projection, curves), GROUP),
    ]

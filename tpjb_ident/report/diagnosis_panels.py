"""Residuals before and after, and the gap by observable on held-out points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.plots.gap import gap
from tpjb_ident.report.plots.residual_map import residual_map
from tpjb_ident.report.plots.residual_series import residual_series
from tpjb_ident.report.plots.residual_table import residual_frame

if TYPE_CHECKING:
    from tpjb_ident.diagnose.diagnose import Diagnosis

GROUP = "Where model and measurement part"
OVER: tuple[tuple[Literal["load", "frequency"], str, str], ...] = (
    ("load", "residuals-load", "Residuals over static load, the coefficients that disagree most"),
    ("frequency", "residuals-excitation", "Residuals over excitation frequency, the same coefficients"),
)


def diagnosis_panels(diagnosis: Diagnosis) -> list[Panel]:
    """Draw the residuals over load, over frequency and as a map, and the gap by observable, before and after.

    Parameters
    ----------
    diagnosis : Diagnosis
        Diagnosis with its residuals.

    Returns
    -------
    list of Panel
        Those for which there are data.
    """
    panels = []
    frame = residual_frame(diagnosis)
    for over, name, title in OVER:
        try:
            panels.append(panel(name, title, residual_series(frame, over), GROUP))
        except ValueError:  # nothing varies over it
            continue
    if len(frame):
        panels.append(panel("residual-map", "Residuals of every coefficient and point", residual_map(frame), GROUP))
    title = "Gap by observable, held-out points where there are any (* fitted points)"
    return [*panels, panel("gap-by-observable", title, gap(diagnosis.verdict, logarithmic=False), GROUP)]

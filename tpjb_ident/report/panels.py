"""Panels that pages and commands share: coefficients, pivots, clearance and locus, what a plan can tell apart."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.report.drawing.series import CROSS, DIRECT, longest_series, where
from tpjb_ident.report.figure import Panel, panel, save_panels
from tpjb_ident.report.plots.coefficients import coefficient
from tpjb_ident.report.plots.diagnoses import isolability
from tpjb_ident.report.plots.pivot_tests import Formula, load_deflection, pad_projection, pivot_stiffness
from tpjb_ident.report.plots.positions import clearance_and_locus
from tpjb_ident.schema import KINDS

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.diagnosis.plan.plan import CampaignPlan
    from tpjb_ident.pivot import PivotCurve

OVER: tuple[Literal["load", "frequency"], ...] = ("load", "frequency")


def coefficient_panels(table: pd.DataFrame) -> list[Panel]:
    """Draw every series of at least two points."""
    panels = []
    for over in OVER:
        series = longest_series(table, over)
        if series is None:
            continue
        for names, kind in ((DIRECT, "Stiffness and damping"), (CROSS, "Cross-coupled stiffness and damping")):
            for name in names:
                title = f"{name} ({KINDS[name[0]].quantity}) over {over}, at {where(series, over)}"
                figure = functools.partial(coefficient, table, name, over=over)
                panels.append(panel(f"{name}-over-{over}", title, figure, f"{kind} over {over}"))
    return panels


def pivot_panels(curves: Sequence[PivotCurve], formula: Formula | None = None) -> list[Panel]:
    """Draw the tangent stiffness of every pad, its load steps, and how they were projected."""
    if not curves:
        return []
    bands = "Pivot tangent stiffness over load, 95 % bands"
    steps = "Load steps and fitted laws, pivot and housing together"
    across = "Load and displacement vectors, and what of them lies on each pad's direction"
    group = "Pivots, from the dry tests"
    return [
        panel("pivot-stiffness", bands, functools.partial(pivot_stiffness, curves, formula), group),
        panel("pivot-steps", steps, functools.partial(load_deflection, curves), group),
        panel("pivot-projection", across, functools.partial(pad_projection, curves), group),
    ]


def position_panels(
    polygon: ClearancePolygon | None,
    drawn: tuple[FloatArray, FloatArray],
    measured: Locus | FloatArray | None,
    predicted: Mapping[str, FloatArray],
    others: Sequence[ClearancePolygon] = (),
) -> list[Panel]:
    """Draw polygon and locus in one square panel."""
    nothing = measured is None or (isinstance(measured, np.ndarray) and not len(measured))
    if polygon is None and nothing:
        return []
    polygons = None if polygon is None else {"measured": polygon} | {f"run {p.run}": p for p in others}
    shown = None if nothing else measured
    figure = functools.partial(clearance_and_locus, polygons, shown, predicted, drawing=drawn)
    return [panel("locus-and-clearance", "Shaft centre locus inside the clearance polygon", figure,
                  "Clearance and shaft centre locus")]  # fmt: skip


def save_isolability(folder: Path, plans: Mapping[str, CampaignPlan]) -> None:
    """Draw the isolability matrix of every plan as ``figures/NAME.svg`` and ``.png``."""
    panels = [
        panel(name.replace("_", "-"), f"Isolability, {name}", isolability(p), "Isolability")
        for name, p in plans.items()
    ]
    save_panels(panels, folder / "figures")

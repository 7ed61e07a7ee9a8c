"""Panels that pages and commands share: coefficients, pivots, clearance and locus, what a plan can tell apart."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from rigdata.arrays import FloatArray
from tpjb_ident.report.drawing.picture import BLUE, INK, in_house_style, label, new_pictures
from tpjb_ident.report.drawing.series import CROSS, DIRECT, constant_along, longest_series, thinned
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.page import Section
from tpjb_ident.report.plots.coefficients import coefficient
from tpjb_ident.report.plots.residuals import isolability
from tpjb_ident.report.plots.static_tests import clearance_and_locus, load_deflection, pad_projection, pivot_stiffness
from tpjb_ident.runtime.tables import printable
from tpjb_ident.schema import KINDS

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.readers.series import Series
    from rigdata.survey.spectrum import Look
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.predictions import Formula
    from tpjb_ident.diagnosis.plan import CampaignPlan
    from tpjb_ident.pivot import PivotCurve


def coefficient_sections(table: pd.DataFrame) -> list[Section]:
    """Draw every series of at least two points."""
    sections = []
    for over in ("load", "frequency"):
        series = longest_series(table, over)
        if series is None:
            continue
        for names, kind in ((DIRECT, "Stiffness and damping"), (CROSS, "Cross-coupled stiffness and damping")):
            panels = []
            for name in names:
                title = f"{name} ({KINDS[name[0]].quantity}) over {over}, at {constant_along(series, over)}"
                figure = functools.partial(coefficient, table, name, over=over)
                panels.append(panel(f"{name}-over-{over}", title, figure))
            sections.append(Section(f"{kind} over {over}", panels=panels))
    return sections


def pivot_panels(curves: Sequence[PivotCurve], formula: Formula | None = None) -> list[Panel]:
    """Draw the tangent stiffness of every pad, its load steps, and how they were projected."""
    if not curves:
        return []
    bands = "Pivot tangent stiffness over load, 95 % bands"
    steps = "Load steps and fitted laws, pivot and housing together"
    across = "Load and displacement vectors, and what of them lies on each pad's direction"
    return [
        panel("pivot-stiffness", bands, pivot_stiffness, curves, formula),
        panel("pivot-steps", steps, load_deflection, curves),
        panel("pivot-projection", across, pad_projection, curves),
    ]


def position_panels(
    polygon: ClearancePolygon | None,
    drawn: tuple[FloatArray, FloatArray],
    measured: Locus | FloatArray | None,
    predicted: Mapping[str, FloatArray],
    others: Sequence[ClearancePolygon] = (),
) -> list[Panel]:
    """Draw polygon and locus in one square panel.

    `drawn` is the drawing's (n_pads,) pad angles [rad] and clearances [m]; positions are (n, 2) [m].
    """
    nothing = measured is None or (isinstance(measured, np.ndarray) and not len(measured))
    if polygon is None and nothing:
        return []
    polygons = None if polygon is None else {"measured": polygon} | {f"run {p.run}": p for p in others}
    shown = None if nothing else measured
    figure = functools.partial(clearance_and_locus, polygons, shown, predicted, drawing=drawn)
    return [panel("locus-and-clearance", "Shaft centre locus inside the clearance polygon", figure)]


def isolability_panels(plans: Mapping[str, CampaignPlan]) -> list[Panel]:
    """Draw the isolability matrix of every plan."""
    return [panel(name.replace("_", "-"), f"Isolability, {name}", isolability, plan) for name, plan in plans.items()]


#: A picture of more channels could not be read.
_MOST = 24
_ROW, _WIDTH = 1.35, 4.6
_POINTS = 4000


def quick_look(title: str, series: Sequence[Series], looks: Mapping[str, Look]) -> Panel:
    """Draw one row per channel: left over time (minima and maxima where samples are many), right its spectrum."""
    return panel("quick-look", title, _quick_look, title, list(series)[:_MOST], looks)


@in_house_style
def _quick_look(title: str, series: Sequence[Series], looks: Mapping[str, Look]) -> Figure:
    figure, grid = new_pictures(len(series), 2, title=printable(title), width=_WIDTH, height=_ROW)
    for (over_time, spectrum), channel in zip(grid, series, strict=True):
        label(over_time, "time, s", printable(", ".join(filter(None, (channel.name, channel.unit)))))
        label(spectrum, "frequency, Hz", "")
        time = np.arange(len(channel), dtype=float) if channel.time is None else channel.time
        over_time.plot(*thinned(time, channel.values, _POINTS), color=INK, linewidth=0.6)
        look = looks[channel.name]
        spectrum.plot(look.frequency[4:], np.maximum(look.amplitude[4:], 1e-300), color=BLUE, linewidth=0.7)
        spectrum.set_yscale("log")
        over_time.locator_params(axis="y", nbins=3)
        spectrum.yaxis.set_major_locator(LogLocator(numticks=4))
        spectrum.minorticks_off()
        for axes in (over_time, spectrum):
            axes.margins(x=0.0)
    return figure

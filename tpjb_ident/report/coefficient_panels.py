"""Stiffness and damping over load and over frequency: measured with intervals, predicted as lines (Fig. 15 to 20)."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Literal

from tpjb_ident.report.drawing.series import CROSS, DIRECT, longest_series, where
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.plots.coefficient import coefficient
from tpjb_ident.schema import KINDS

if TYPE_CHECKING:
    import pandas as pd

OVER: tuple[Literal["load", "frequency"], ...] = ("load", "frequency")


def coefficient_panels(table: pd.DataFrame) -> list[Panel]:
    """Draw every series of at least two points.

    Parameters
    ----------
    table : DataFrame
        As comparison.csv.

    Returns
    -------
    list of Panel
        Direct coefficients over load and over frequency, then cross-coupled ones.
    """
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

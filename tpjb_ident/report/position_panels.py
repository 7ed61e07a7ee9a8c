"""Clearance polygon and shaft centre locus (the paper's Fig. 14)."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.plots.clearance_and_locus import clearance_and_locus

if TYPE_CHECKING:
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon

GROUP = "Clearance and shaft centre locus"


def position_panels(
    polygon: ClearancePolygon | None,
    drawn: tuple[FloatArray, FloatArray],
    measured: Locus | FloatArray | None,
    predicted: Mapping[str, FloatArray],
    others: Sequence[ClearancePolygon] = (),
) -> list[Panel]:
    """Draw polygon and locus in one square panel.

    Parameters
    ----------
    polygon : ClearancePolygon or None
    drawn : (n_pads,), (n_pads,) ndarray
        Pad angles [rad] and assembled clearances [m] of the drawing.
    measured : Locus or (n, 2) ndarray or None
        Measured positions [m].
    predicted : mapping of str to (n, 2) ndarray
        Predicted ones by pivot model.
    others : sequence of ClearancePolygon
        Of further sweeps.
    """
    nothing = measured is None or (isinstance(measured, np.ndarray) and not len(measured))
    if polygon is None and nothing:
        return []
    polygons = None if polygon is None else {"measured": polygon} | {f"run {p.run}": p for p in others}
    shown = None if nothing else measured
    figure = functools.partial(clearance_and_locus, polygons, shown, predicted, drawing=drawn)
    return [panel("locus-and-clearance", "Shaft centre locus inside the clearance polygon", figure, GROUP)]

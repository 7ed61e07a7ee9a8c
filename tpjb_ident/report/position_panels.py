"""Clearance polygon and shaft centre locus (the paper's Fig. 14)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.report.figure import LIGHT, VARIANT_LABEL, VARIANT_STYLE, Panel, add_legend, new_panel

if TYPE_CHECKING:
    from tpjb_ident.clearance import ClearancePolygon

FloatArray = NDArray[np.float64]
GROUP = "Clearance and shaft centre locus"


def position_panels(
    polygon: ClearancePolygon | None,
    drawn: tuple[FloatArray, FloatArray],
    measured: FloatArray,
    predicted: Mapping[str, FloatArray],
) -> list[Panel]:
    """Draw polygon and locus in one square panel.

    Parameters
    ----------
    polygon : ClearancePolygon or None
    drawn : (n_pads,), (n_pads,) ndarray
        Pad angles [rad] and assembled clearances [m] of the drawing.
    measured : (n, 2) ndarray
        Measured positions [m]; may be empty.
    predicted : mapping of str to (n, 2) ndarray
        Predicted ones by pivot model.
    """
    if polygon is None and not len(measured):
        return []
    figure, axes = new_panel("x, µm", "y, µm", height=5.4)
    corners = 1e6 * _closed(polygon_corners(*drawn))
    axes.plot(*corners.T, color=LIGHT["grey"], linewidth=1.0, linestyle=(0, (5, 2)), label="clearance, drawing")
    if polygon is not None and np.isfinite(polygon.corners).all():
        axes.plot(*(1e6 * _closed(polygon.corners)).T, color=LIGHT["ink"], linewidth=1.4, label="clearance, measured")
    for name, places in predicted.items():
        colour, dashes, _ = VARIANT_STYLE[name]
        axes.plot(
            *(1e6 * _closed(places)).T, color=LIGHT[colour], linestyle=dashes, linewidth=1.5, label=VARIANT_LABEL[name]
        )
    if len(measured):
        axes.plot(*(1e6 * measured).T, linestyle="none", marker="o", markersize=4.5, color=LIGHT["ink"],
                  label="locus, measured")  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    add_legend(axes, columns=2)
    return [Panel("locus-and-clearance", "Shaft centre locus inside the clearance polygon", figure, GROUP)]


def polygon_corners(angles: FloatArray, clearances: FloatArray) -> FloatArray:
    """Corners (n, 2) [m] between neighbouring sides n_k . p = c_k, in the order of the angles."""
    order = np.argsort(angles % (2 * np.pi))
    normals = np.column_stack([np.cos(angles[order]), np.sin(angles[order])])
    sides = clearances[order]
    corners = [
        np.linalg.solve(np.array([normals[i], normals[(i + 1) % len(order)]]), [sides[i], sides[(i + 1) % len(order)]])
        for i in range(len(order))
    ]
    return np.array(corners)


def _closed(points: FloatArray) -> FloatArray:
    return np.vstack([points, points[:1]]) if len(points) else points

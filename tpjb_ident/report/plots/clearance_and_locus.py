"""Draw clearance polygons and shaft positions about the bearing centre (the paper's Fig. 14)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from rigdata.arrays import FloatArray
from tpjb_ident.clearance.polygon import corners
from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.picture import (
    DASHED,
    DOTTED,
    FONT_SIZE,
    GREY,
    INK,
    LIGHT,
    SHORT_DASHED,
    VARIANT_LABEL,
    VARIANT_STYLE,
    add_legend,
    new_picture,
)

if TYPE_CHECKING:
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon

_POLYGON_STYLE: tuple[tuple[str, Any], ...] = (
    ("ink", "-"),
    ("red", (0, (6, 2, 1, 2))),
    ("green", SHORT_DASHED),
    ("purple", DOTTED),
)

_TWO_SIGMA = 2.4477  # radius of the 95 % region of two normal variables, in standard deviations


def clearance_and_locus(
    polygons: ClearancePolygon | Mapping[str, ClearancePolygon] | None = None,
    locus: Locus | FloatArray | None = None,
    predicted: Mapping[str, FloatArray] | None = None,
    *,
    drawing: tuple[FloatArray, FloatArray] | None = None,
    title: str | None = None,
) -> Figure:
    """Draw clearance polygons and shaft positions about the bearing centre (the paper's Fig. 14).

    Parameters
    ----------
    polygons : ClearancePolygon or mapping of str to ClearancePolygon, optional
        Several by name: two bearings, cold and hot, two push loads. The polygon at zero push load is drawn, the one
        as pushed in a thin line.
    locus : Locus or (n, 2) ndarray, optional
        Measured positions; from a `Locus` with their 95 % regions [m].
    predicted : mapping of str to (n, 2) ndarray, optional
        Predicted positions [m] by name; names of pivot models keep their colours.
    drawing : (n_pads,), (n_pads,) ndarray, optional
        Pad angles [rad] and assembled clearances [m] of the drawing.
    title : str, optional

    Raises
    ------
    ValueError
        When there is nothing to draw.
    """
    named = {} if polygons is None else polygons if isinstance(polygons, Mapping) else {"measured": polygons}
    if not named and locus is None and not predicted and drawing is None:
        raise ValueError("nothing to draw: give polygons, a locus, predicted positions or a drawing")
    figure, axes = new_picture(f"x, {symbol('length')}", f"y, {symbol('length')}", title=title, width=4.6, height=4.8)
    if drawing is not None:
        angles, clearances = (np.asarray(values) for values in drawing)
        order = np.argsort(angles % (2 * np.pi))  # its pads stand in any order
        axes.plot(*(per("length") * _closed(corners(angles[order], clearances[order]))).T, color=GREY, linewidth=1.0,
                  linestyle=DASHED, label="clearance, drawing")  # fmt: skip
    for (name, polygon), (colour, dashes) in zip(named.items(), _POLYGON_STYLE * len(named), strict=False):
        _draw_polygon(axes, name, polygon, LIGHT[colour], dashes)
    if named:
        _draw_numbers(axes, next(iter(named.values())))
    for name, places in (predicted or {}).items():
        colour, dashes, _ = VARIANT_STYLE.get(name, ("green", (0, (4, 1, 1, 1)), ""))
        axes.plot(*(per("length") * _closed(np.asarray(places))).T, color=LIGHT[colour],
                  linestyle=dashes, linewidth=1.5, label=VARIANT_LABEL.get(name, name))  # fmt: skip
    if locus is not None:
        _draw_locus(axes, locus)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.07)
    add_legend(axes)
    return figure


def _draw_polygon(axes: Axes, name: str, polygon: ClearancePolygon, colour: str, dashes: Any) -> None:
    if not np.isfinite(polygon.corners).all():
        return
    text = "clearance, measured" if name == "measured" else f"clearance, {name}"
    axes.plot(*(per("length") * _closed(polygon.corners)).T, color=colour, linestyle=dashes, linewidth=1.5, label=text)
    pushed = _closed(corners(polygon.fitted_angle, polygon.clearance_pushed))
    axes.plot(*(per("length") * pushed).T, color=colour, linestyle=dashes, linewidth=0.6)


def _draw_numbers(axes: Axes, polygon: ClearancePolygon) -> None:
    """Number of each pad, just inside its side."""
    for k, (angle, clearance) in enumerate(zip(polygon.angles, polygon.clearance, strict=True), 1):
        if np.isfinite(clearance):
            toward = np.array([np.cos(angle), np.sin(angle)])
            axes.annotate(
                f"#{k}", tuple(per("length") * clearance * toward), xytext=tuple(-10.0 * toward),
                textcoords="offset points", ha="center", va="center", fontsize=FONT_SIZE - 1, color=INK,
            )  # fmt: skip


def _draw_locus(axes: Axes, locus: Locus | FloatArray) -> None:
    if isinstance(locus, np.ndarray):
        places = locus
    else:
        places = np.array([p.position for p in locus.points]).reshape(-1, 2)
        for point in locus.points:
            size, turn = np.linalg.eigh(point.covariance)
            axes.add_patch(Ellipse(
                tuple(per("length") * point.position),
                *(2.0 * per("length") * _TWO_SIGMA * np.sqrt(np.maximum(size, 0.0))),
                angle=float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))), color=INK, alpha=0.25,
                linewidth=0,
            ))  # fmt: skip
    if len(places):
        axes.plot(*(per("length") * places).T, linestyle="none", marker="o", markersize=4.0, color=INK,
                  label="locus, measured")  # fmt: skip


def _closed(points: FloatArray) -> FloatArray:
    return np.vstack([points, points[:1]]) if len(points) else points

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
    GREY,
    INK,
    MODEL_LABELS,
    SMALL,
    add_legend,
    in_house_style,
    model_styles,
    new_picture,
    style_of,
)

if TYPE_CHECKING:
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon

_TWO_SIGMA = 2.4477  # radius of the 95 % region of two normal variables, in standard deviations


@in_house_style
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
        _draw_closed(axes, corners(angles[order], clearances[order]), "--", color=GREY, label="clearance, drawing")
    for number, (name, polygon) in enumerate(named.items()):
        if not np.isfinite(polygon.corners).all():
            continue
        line = {"color": style_of(number)["color"] if number else INK, "linestyle": style_of(number)["linestyle"]}
        text = "clearance, measured" if name == "measured" else f"clearance, {name}"
        _draw_closed(axes, polygon.corners, **line, linewidth=1.5, label=text)
        _draw_closed(axes, corners(polygon.fitted_angle, polygon.clearance_pushed), **line, linewidth=0.6)
    if named:
        _draw_numbers(axes, next(iter(named.values())))
    styles = model_styles(list(predicted or {}))
    for name, places in (predicted or {}).items():
        _draw_closed(axes, places, **styles[name] | {"marker": ""}, label=MODEL_LABELS.get(name, name))
    if locus is not None:
        _draw_locus(axes, locus)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.07)
    add_legend(axes)
    return figure


def _draw_closed(axes: Axes, points: FloatArray, *form: str, **look: Any) -> None:
    """Draw points (n, 2) [m] with a line that ends where it began."""
    axes.plot(*(per("length") * np.vstack([points, points[:1]])).T, *form, **look)


def _draw_numbers(axes: Axes, polygon: ClearancePolygon) -> None:
    """Number of each pad, just inside its side."""
    for k, (angle, clearance) in enumerate(zip(polygon.angles, polygon.clearance, strict=True), 1):
        if np.isfinite(clearance):
            toward = np.array([np.cos(angle), np.sin(angle)])
            axes.annotate(f"#{k}", tuple(per("length") * clearance * toward), tuple(-10.0 * toward),
                          textcoords="offset points", ha="center", va="center", fontsize=SMALL)  # fmt: skip


def _draw_locus(axes: Axes, locus: Locus | FloatArray) -> None:
    places = locus
    if not isinstance(places, np.ndarray):
        points = places.points
        places = np.array([point.position for point in points]).reshape(-1, 2)
        for point in points:
            variances, directions = np.linalg.eigh(per("length") ** 2 * point.covariance)
            sides = 2.0 * _TWO_SIGMA * np.sqrt(np.maximum(variances, 0.0))
            turn = np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))
            place = tuple(per("length") * point.position)
            axes.add_patch(Ellipse(place, *sides, angle=float(turn), color=INK, alpha=0.25, linewidth=0))
    if len(places):
        axes.plot(*(per("length") * places).T, "o", markersize=4.0, color=INK, label="locus, measured")

"""Pictures of the static tests: dry pivot tests (the paper's Fig. 10 to 12), clearance and locus (Fig. 14)."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike

from rigdata.arrays import FloatArray
from rigdata.vector import directions
from tpjb_ident.clearance.locus import Locus
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.clearance.polygon import corners
from tpjb_ident.columns import size, symbol
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.dry_record import pad_axes
from tpjb_ident.pivot.tables import Formula
from tpjb_ident.report.drawing.picture import (
    GREY,
    INK,
    MODEL_LABELS,
    PAPER,
    RULE,
    SMALL,
    add_legend,
    from_zero,
    label,
    model_styles,
    new_picture,
    new_pictures,
    plot,
    style_of,
)
from tpjb_ident.rounding import signed

_LAW_POINTS = 200


def _listed(curves: PivotCurve | Sequence[PivotCurve]) -> list[PivotCurve]:
    chosen = list(curves) if isinstance(curves, Sequence) else [curves]
    if not chosen:
        raise ValueError("curves must hold at least one PivotCurve")
    return chosen


@plot
def load_deflection(curves: PivotCurve | Sequence[PivotCurve], *, up_to: float | None = None) -> Figure:
    """Draw the settled steps of dry tests and the laws fitted to them (the paper's Fig. 11).

    Steps that were left out are crossed; unloading steps are hollow. The law is drawn solid where it was measured with
    full contact and dotted elsewhere (extrapolated); where the shaft comes down on the pad first, a thin line shows
    what the readings do meanwhile.

    Parameters
    ----------
    curves : PivotCurve or sequence of PivotCurve
        One or several pads.
    up_to : float, optional
        Largest load [N]; default: the largest measured one.
    """
    figure, axes = new_picture(f"radial deflection, {symbol('length')}", f"load on the pad, {symbol('load')}")
    for curve in _listed(curves):
        _draw_law(axes, curve, up_to or curve.valid_to)
        _draw_steps(axes, curve)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    from_zero(axes)
    named = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    add_legend(axes, handles=[named[name] for name in sorted(named)])  # pad by pad, what was left out last
    return figure


def _draw_steps(axes: Axes, curve: PivotCurve) -> None:
    steps, style = curve.steps, style_of(curve.pad - 1) | {"linestyle": "none"}
    deflection, load = steps.deflection / size("length"), steps.load / size("load")
    errors = 1.96 * steps.deflection_se / size("length")
    used = steps.weight > 0
    for mask, face, name in (
        (used & (steps.branch > 0), style["color"], f"pad #{curve.pad}, {curve.law.name}"),
        (used & (steps.branch < 0), PAPER, f"pad #{curve.pad}, unloading"),
    ):
        if mask.any():
            axes.errorbar(deflection[mask], load[mask], xerr=errors[mask], **style, markerfacecolor=face, label=name,
                          capsize=0, zorder=4)  # fmt: skip
    if not used.all():
        axes.plot(deflection[~used], load[~used], "x", color=INK, label="step left out", zorder=5)


def _draw_law(axes: Axes, curve: PivotCurve, top: float) -> None:
    """The law, its band, and the way into contact."""
    colour = style_of(curve.pad - 1)["color"]
    load = np.linspace(0.0, top, _LAW_POINTS)[1:]
    shown = load / size("load")
    reading, low, high = (part / size("length") for part in curve.reading_band(load))
    deflection = curve.deflection(load) / size("length")
    axes.fill_betweenx(shown, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(deflection, shown, ":", color=colour)
    axes.plot(np.where(curve.is_extrapolated(load), np.nan, deflection), shown, color=colour)
    if curve.law.contact:
        coming = load <= max(curve.onset_load, load[0])
        axes.plot(reading[coming], shown[coming], color=colour, linewidth=0.7)


@plot
def pad_projection(curves: Sequence[PivotCurve]) -> Figure:
    """Draw measured load and displacement vectors of every pad's test beside their projection (the paper's Fig. 10).

    Hollow markers are what was measured, filled ones its projection on the pad's direction (dashed). Displacements
    count from where each pad's curve has its zero. The angles between load or displacement and the pad stand at the
    ends of the dashed lines, with their standard errors.

    Parameters
    ----------
    curves : sequence of PivotCurve
        As `fit_pivots` gives them.

    Returns
    -------
    Figure
        Left the loads [kN], right the displacements [µm].
    """
    figure, ((forces, places),) = new_pictures(1, 2, width=4.4, height=4.8)
    for curve in _listed(curves):
        steps = curve.steps
        used = steps.weight > 0
        loads = np.column_stack([steps.load, steps.across_load])[used] / size("load")
        moves = np.column_stack([steps.deflection, steps.across_deflection])[used] / size("length")
        _draw_vectors(forces, curve, loads, curve.load_direction.angle)
        _draw_vectors(places, curve, moves, curve.displacement_direction.angle)
    label(forces, f"horizontal load, {symbol('load')}", f"vertical load, {symbol('load')}", "static load")
    label(places, f"x, {symbol('length')}", f"y, {symbol('length')}", "displacement, shaft against housing")
    handles = []
    for face, name in (("none", "measured"), (INK, "on the pad's direction")):
        handles.append(Line2D([], [], marker="o", linestyle="none", color=INK, markerfacecolor=face, label=name))
    for axes in (forces, places):
        reach = 1.3 * max(np.max(np.abs(line.get_xydata())) for line in axes.get_lines())
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
        axes.set_aspect("equal", adjustable="box")
        add_legend(axes, handles)
    return figure


def _draw_vectors(axes: Axes, curve: PivotCurve, vectors: FloatArray, angle: float) -> None:
    """One pad's points (n, 2) along and across its direction, measured and projected, and the direction."""
    frame = pad_axes(curve.angle)
    axis, measured = frame[0], vectors @ frame
    projected = np.outer(vectors[:, 0], axis)
    end = 1.12 * np.max(vectors[:, 0]) * axis
    axes.plot([0.0, end[0]], [0.0, end[1]], "--", color=GREY, linewidth=0.9, zorder=1)
    style = style_of(curve.pad - 1) | {"linestyle": "none"}
    axes.plot(*measured.T, **style, markersize=5.5, markerfacecolor="none")
    axes.plot(*projected.T, **style, markersize=3.0)
    text = f"#{curve.pad}\n{signed(math.degrees(angle))}°"
    axes.annotate(text, tuple(end), tuple(12.0 * axis), textcoords="offset points", ha="center", va="center",
                  fontsize=SMALL)  # fmt: skip


_STIFFNESS_POINTS = 120
_LOWEST = 0.04  # of the largest load: Hertz's stiffness has no value at zero


@plot
def pivot_stiffness(
    curves: Sequence[PivotCurve], formula: Formula | None = None, *, loads: ArrayLike | None = None
) -> Figure:
    """Draw the stiffness of every pad's pivot over its load (the paper's Fig. 12).

    Thick where it was measured with the shaft fully in contact; thin and dotted where it is extrapolated, below the
    contact onset as well as beyond the largest load (shaded).

    Parameters
    ----------
    curves : sequence of PivotCurve
    formula : callable, optional
        ``formula(pad, load)`` gives the printed formula's (secant, tangent) stiffness [N/m], as
        `tpjb_ident.compare.predictions.printed_formula` makes it; drawn for the first curve's pad. What the
        paper prints is the secant.
    loads : (n,) array_like, optional
        Pad loads [N]; default: up to the largest measured one.
    """
    curves = _listed(curves)
    top = max(curve.valid_to for curve in curves)
    grid = np.linspace(_LOWEST * top, top, _STIFFNESS_POINTS) if loads is None else np.asarray(loads, dtype=float)
    figure, axes = new_picture(f"load on the pad, {symbol('load')}", f"tangent stiffness, {symbol('stiffness')}")
    shown = grid / size("load")
    for curve in curves:
        style = style_of(curve.pad - 1) | {"marker": ""}
        value, outside = curve.stiffness(grid) / size("stiffness"), curve.is_extrapolated(grid)
        measured = np.where(outside, np.nan, [value, *(end / size("stiffness") for end in curve.stiffness_band(grid))])
        axes.fill_between(shown, *measured[1:], color=style["color"], alpha=0.2, linewidth=0)
        axes.plot(shown, measured[0], **style, linewidth=1.7, label=f"pad #{curve.pad}")
        # one point of overlap, so that the two lines meet
        extrapolated = np.where(outside | np.roll(outside, 1) | np.roll(outside, -1), value, np.nan)
        axes.plot(shown, extrapolated, color=style["color"], linestyle=(0, (1, 2)), linewidth=0.9)
    if formula is not None:
        printed = np.array([formula(curves[0].pad, float(load)) for load in grid]) / size("stiffness")
        axes.plot(shown, printed[:, 1], color=INK, label="Kirk, tangent")
        axes.plot(shown, printed[:, 0], "--", color=INK, label="Kirk, printed")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, shown[-1])
    if grid[-1] > top:
        start = top / size("load")
        axes.axvspan(start, shown[-1], color=RULE, alpha=0.35, linewidth=0, zorder=0)
        axes.text(start, 0.02, " extrapolated", transform=axes.get_xaxis_transform(), fontsize=SMALL, color=GREY)
    add_legend(axes)
    return figure


_TWO_SIGMA = 2.4477  # radius of the 95 % region of two normal variables, in standard deviations


@plot
def clearance_and_locus(
    polygons: ClearancePolygon | Mapping[str, ClearancePolygon] | None = None,
    locus: Locus | None = None,
    predicted: Mapping[str, FloatArray] | None = None,
    *,
    drawing: tuple[FloatArray, FloatArray] | None = None,
) -> Figure:
    """Draw clearance polygons and shaft positions about the bearing centre (the paper's Fig. 14).

    Parameters
    ----------
    polygons : ClearancePolygon or mapping of str to ClearancePolygon, optional
        Several by name: two bearings, cold and hot, two push loads. The polygon at zero push load is drawn, the one
        as pushed in a thin line.
    locus : Locus, optional
        Measured positions with their 95 % regions.
    predicted : mapping of str to (n, 2) ndarray, optional
        Predicted positions [m] by name; names of pivot models keep their colours.
    drawing : (n_pads,), (n_pads,) ndarray, optional
        Pad angles [rad] and assembled clearances [m] of the drawing.

    Raises
    ------
    ValueError
        When there is nothing to draw.
    """
    named = polygons or {}
    if not isinstance(named, Mapping):
        named = {"measured": named}
    if not named and locus is None and not predicted and drawing is None:
        raise ValueError("nothing to draw: give polygons, a locus, predicted positions or a drawing")
    figure, axes = new_picture(f"x, {symbol('length')}", f"y, {symbol('length')}", width=4.6, height=4.8)
    if drawing is not None:
        angles, clearances = map(np.asarray, drawing)
        order = np.argsort(angles % (2 * np.pi))  # its pads stand in any order
        _draw_closed(axes, corners(angles[order], clearances[order]), "--", color=GREY, label="clearance, drawing")
    for number, (name, polygon) in enumerate(named.items()):
        if not np.isfinite(polygon.corners).all():
            continue
        line = style_of(number) | {"marker": ""} | ({} if number else {"color": INK})
        _draw_closed(axes, polygon.corners, **line, linewidth=1.5, label=f"clearance, {name}")
        _draw_closed(axes, corners(polygon.fitted_angle, polygon.clearance_pushed), **line, linewidth=0.6)
    for polygon in list(named.values())[:1]:  # number of each pad, just inside its side
        for k, (angle, clearance) in enumerate(zip(polygon.angles, polygon.clearance, strict=True), 1):
            if np.isfinite(clearance):
                toward = directions(angle)
                axes.annotate(f"#{k}", tuple(clearance / size("length") * toward), tuple(-10.0 * toward),
                              textcoords="offset points", ha="center", va="center", fontsize=SMALL)  # fmt: skip
    predicted = predicted or {}
    styles = model_styles(list(predicted))
    for name, places in predicted.items():
        _draw_closed(axes, places, **styles[name] | {"marker": ""}, label=MODEL_LABELS.get(name, name))
    if locus is not None:
        _draw_locus(axes, locus)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.07)
    add_legend(axes)
    return figure


def _draw_closed(axes: Axes, points: FloatArray, *form: str, **look: Any) -> None:
    """Draw points (n, 2) [m] with a line that ends where it began."""
    axes.plot(*(np.vstack([points, points[:1]]) / size("length")).T, *form, **look)


def _draw_locus(axes: Axes, locus: Locus) -> None:
    for point in locus.points:
        variances, axes_of_region = np.linalg.eigh(point.covariance / size("length") ** 2)
        sides = 2.0 * _TWO_SIGMA * np.sqrt(np.maximum(variances, 0.0))
        turn = np.degrees(np.arctan2(axes_of_region[1, 0], axes_of_region[0, 0]))
        place = tuple(point.position / size("length"))
        axes.add_patch(Ellipse(place, *sides, angle=turn, color=INK, alpha=0.25, linewidth=0))
    if locus.points:
        places = np.array([point.position for point in locus.points]) / size("length")
        axes.plot(*places.T, "o", markersize=4.0, color=INK, label="locus, measured")
